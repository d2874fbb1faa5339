"""Divide a dataset into files of collections whose positions of a joint hang together."""

from __future__ import annotations

import argparse

from atom_core.commands import common
from atom_core.commands.dataset_output import add_overwrite_option, beside, write_documents
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_tools import joint_clusters, with_collections

EXAMPLE = (
    "python3 -m atom_core filter_dataset_based_on_joint_states -json data/dataset.json -j elbow"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    common.add_dataset_option(parser)
    common.add_option(
        parser, "joint", "-j", required=True, metavar="JOINT", help="the joint that is looked at"
    )
    common.add_option(
        parser,
        "threshold",
        "-t",
        type=float,
        default=0.1,
        metavar="X",
        help="largest step within a file [rad or m] (default: 0.1)",
    )
    add_overwrite_option(parser)


def run(args: argparse.Namespace) -> int:
    """Write a file for each group, NAME_JOINT_N.json; -1 holds those that are near no other."""
    dataset = read_dataset(args.dataset)
    documents = {
        beside(args.dataset, f"_{args.joint}_{number}"): with_collections(dataset.document, keys)
        for number, keys in joint_clusters(dataset, args.joint, args.threshold).items()
    }
    write_documents(args.dataset, documents, args.overwrite)
    return 0
