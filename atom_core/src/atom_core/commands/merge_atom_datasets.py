"""Put the collections of two datasets of one rig into a new one."""

from __future__ import annotations

import argparse
from pathlib import Path

from atom_core.commands import common
from atom_core.commands.dataset_output import add_overwrite_option, described
from atom_core.errors import OutputError
from atom_core.evaluation.same_data import shared_collections
from atom_core.io.atomic import prepare_output_folder
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_tools import merged
from atom_core.io.dataset_writer import write_with_copies

EXAMPLE = "python3 -m atom_core merge_atom_datasets -ds1 a/dataset.json -ds2 b/dataset.json -dof ab"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    for number, which in ((1, "one"), (2, "the other, whose collections are renumbered")):
        common.add_option(
            parser,
            f"dataset{number}",
            f"-ds{number}",
            required=True,
            type=Path,
            metavar="FILE",
            help=f"the dataset's JSON: {which}",
        )
    common.add_option(
        parser,
        "output",
        *("-dof", "--dataset_output_folder", "-o"),
        required=True,
        type=Path,
        metavar="DIR",
        help="folder for both, data files included",
    )
    add_overwrite_option(parser)


def run(args: argparse.Namespace) -> int:
    """Check, copy, write; a dataset that was there is replaced as a whole."""
    common.refuse_occupied(args.output, args.overwrite)
    first, second = read_dataset(args.dataset1), read_dataset(args.dataset2)
    document, files = merged(first, second)
    for source in (args.dataset1, args.dataset2):
        if source.resolve().parent == args.output.resolve():
            raise OutputError(
                f"{args.output}: holds {source.name}, which would change; choose another"
            )
    folder = prepare_output_folder(args.output, args.overwrite)
    copies = {file.name: file.source for file in files}
    print(described(write_with_copies(folder, document, copies), document))
    twice = shared_collections(first, second)
    if twice:
        print(
            f"warning: {len(twice)} of {len(second.collections)} collections of {args.dataset2} "
            f"have the labels of one of {args.dataset1} ({', '.join(twice[:5])}"
            f"{' ...' if len(twice) > 5 else ''}): what counts twice looks surer than it is; merge "
            f"other recordings, or remove them (remove_collections_from_atom_dataset)"
        )
    return 0
