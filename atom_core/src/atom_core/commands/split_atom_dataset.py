"""Divide a dataset by chance into one to calibrate with and one to measure on."""

from __future__ import annotations

import argparse

from atom_core.commands import common
from atom_core.commands.dataset_output import add_overwrite_option, beside, write_documents
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_tools import named, split_keys, with_collections

EXAMPLE = "python3 -m atom_core split_atom_dataset -json data/dataset.json -tp 70"
_PARTS = ("_train", "_test")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    common.add_dataset_option(parser)
    common.add_option(
        parser,
        "training_percentage",
        "-tp",
        required=True,
        type=float,
        metavar="PERCENT",
        help="how many collections go to NAME_train.json; the others go to NAME_test.json",
    )
    common.add_option(
        parser,
        "sample_seed",
        *("-ss", "--shuffle_seed"),
        type=common.seed_of_chance,
        default=0,
        metavar="N",
        help="seed of chance (default: 0)",
    )
    add_overwrite_option(parser)


def run(args: argparse.Namespace) -> int:
    """Divide, alike in which sensors see the boards, and write both parts beside the dataset."""
    dataset = read_dataset(args.dataset)
    parts = split_keys(dataset, args.training_percentage, args.sample_seed)
    documents = {
        beside(args.dataset, part): named(with_collections(dataset.document, keys), part)
        for part, keys in zip(_PARTS, parts)
    }
    write_documents(args.dataset, documents, args.overwrite)
    return 0
