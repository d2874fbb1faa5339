"""Keep a dataset's transforms as the truth of its collections."""

from __future__ import annotations

import argparse
from pathlib import Path

from atom_core.commands import common
from atom_core.commands.dataset_output import add_overwrite_option, write_documents
from atom_core.errors import DatasetError
from atom_core.io.dataset_json import read_document

EXAMPLE = (
    "python3 -m atom_core add_ground_truth_to_dataset -ji data/dataset.json -jo data/true.json"
)
_KEY = "transforms_ground_truth"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    for name, short, what in (
        ("json_input", "-ji", "the dataset, whose transforms are true"),
        ("json_output", "-jo", "the same with its truth, for --truth"),
    ):
        common.add_option(parser, name, short, required=True, type=Path, metavar="FILE", help=what)
    add_overwrite_option(parser)


def run(args: argparse.Namespace) -> int:
    """Copy the transforms of each collection."""
    document = read_document(args.json_input)
    collections = {}
    for key, collection in document["collections"].items():
        if _KEY in collection:
            raise DatasetError(
                f"{args.json_input}: collection {key} has its {_KEY} already; nothing is written"
            )
        collections[key] = {**collection, _KEY: collection.get("transforms") or {}}
    new = {**document, "collections": collections}
    write_documents(args.json_input, {args.json_output: new}, args.overwrite)
    return 0
