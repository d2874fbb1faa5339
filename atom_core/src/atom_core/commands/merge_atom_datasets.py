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
from atom_core.io.dataset_tools import absent_files, edges_elsewhere, joints_apart, merged
from atom_core.io.dataset_writer import write_with_copies
from atom_core.model.dataset import Dataset

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
    _warn_of_absent_files(first, second)
    _warn_of_moved_tfs(first, second)
    _warn_of_joints(first, second)
    twice = shared_collections(first, second)
    if twice:
        print(
            f"warning: {len(twice)} of {len(second.collections)} collections of {args.dataset2} "
            f"have the labels of one of {args.dataset1} ({', '.join(twice[:5])}"
            f"{' ...' if len(twice) > 5 else ''}): what counts twice looks surer than it is; merge "
            f"other recordings, or remove them (remove_collections_from_atom_dataset)"
        )
    return 0


def _warn_of_absent_files(*datasets: Dataset) -> None:
    for dataset in datasets:
        absent = absent_files(dataset)
        if absent:
            print(
                f"warning: {len(absent)} data files of {dataset.source} are absent "
                f"({', '.join(absent[:3])}{' ...' if len(absent) > 3 else ''}), and so they are in "
                f"the new dataset; its labels suffice to calibrate"
            )


def _warn_of_moved_tfs(first: Dataset, second: Dataset) -> None:
    apart = edges_elsewhere(first, second)
    for name, entry in first.config.additional_tfs.items():
        if entry.edge in apart:
            print(
                f"warning: additional tf '{name}' stands elsewhere in {second.source} than in "
                f"{first.source}: each collection keeps a pose of its own; if it was not moved, "
                f"give '{entry.edge}' the type 'fixed' under 'transforms'"
            )


def _warn_of_joints(first: Dataset, second: Dataset) -> None:
    apart = joints_apart(first, second)
    if apart:
        print(
            f"warning: {', '.join(apart)} of {second.source} have another origin, bias or axis "
            f"than in {first.source}, as where one of the two was calibrated: together they "
            f"contradict each other; merge both as they were collected"
        )
