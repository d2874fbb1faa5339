"""Keep only the selected collections of a dataset."""

from __future__ import annotations

import argparse

from atom_core.commands import common
from atom_core.commands.dataset_output import (
    add_output_option,
    add_overwrite_option,
    output_path,
    write_documents,
)
from atom_core.io.dataset_json import read_document, sorted_keys
from atom_core.io.dataset_tools import with_collections
from atom_core.model.selection import select_names

EXAMPLE = (
    "python3 -m atom_core remove_collections_from_atom_dataset -json data/dataset.json -csf '!013'"
)
_ADDITION = "_filtered"  # to the name of the input


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    common.add_dataset_option(parser)
    common.add_option(
        parser,
        "collection_selection_function",
        "-csf",
        required=True,
        nargs="+",
        metavar="SELECTION",
        help="collections to keep: keys, globs, '!key' to leave one out, or ATOM's lambda strings",
    )
    add_output_option(parser, _ADDITION, "--output_file")
    add_overwrite_option(parser)


def run(args: argparse.Namespace) -> int:
    """Write what is kept; damaged collections may go this way, they are not looked at."""
    document = read_document(args.dataset)
    keys = select_names(sorted_keys(document), args.collection_selection_function, "collection")
    target = output_path(args, _ADDITION)
    write_documents(args.dataset, {target: with_collections(document, keys)}, args.overwrite)
    return 0
