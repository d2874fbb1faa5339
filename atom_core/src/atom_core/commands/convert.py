"""Bring a dataset into another format or version."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import List

from atom_core.commands import common
from atom_core.errors import SelectionError
from atom_core.io.atomic import prepare_output_folder
from atom_core.io.dataset_json import read_dataset
from atom_core.io.kalibr_export import (
    TARGET_FILE,
    KalibrExport,
    kalibr_export,
    write_kalibr_folder,
)
from atom_core.io.migrate import migrate_dataset

V2, V3, KALIBR = "atom_v2", "atom_v3", "kalibr"
BAG_FILE = "images.bag"
_FROM = {V3: V2, KALIBR: V3}  # what is brought into each format
EXAMPLE = """
python3 -m atom_core convert --from atom_v2 --to atom_v3 --dataset old.json --output new
python3 -m atom_core convert --to kalibr --dataset train/dataset.json --output kalibr
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    text = "the dataset's format (default: what can be brought into the other one)"
    parser.add_argument("--from", dest="source_format", choices=[V2, V3], help=text)
    text = "atom_v3: with its data files; kalibr: images of the cameras, and the board as a target"
    parser.add_argument(
        "--to", dest="target_format", choices=[V3, KALIBR], required=True, help=text
    )
    common.add_option(
        parser, "dataset", "-json", required=True, type=Path, metavar="FILE", help="what to convert"
    )
    common.add_output_options(parser)
    common.add_selection_options(parser)


def run(args: argparse.Namespace) -> int:
    """Convert and say where the result lies."""
    refuse_what_does_not_fit(args)
    common.refuse_occupied(args.output, args.overwrite)
    if args.target_format == KALIBR:
        export = chosen_export(args)
        folder = prepare_output_folder(args.output, args.overwrite)
        count = write_kalibr_folder(export, folder)
        print(f"{folder.resolve()}: {TARGET_FILE}, {count} images of {', '.join(export.cameras)}")
        bag = folder / BAG_FILE
        print(f"then: kalibr_bagcreater --folder {folder} --output-bag {bag}")
        topics = [f"/cam{i}/image_raw" for i in range(len(export.cameras))]
        print(kalibr_lines(export, folder, topics))
        return 0
    target = migrate_dataset(args.dataset, args.output, args.overwrite)
    dataset = read_dataset(target)
    counts = f"{len(dataset.sensors)} sensors, {len(dataset.collections)} collections"
    print(f"{target.resolve()}: {counts}")
    return 0


def refuse_what_does_not_fit(args: argparse.Namespace) -> None:
    """Refuse formats that are not brought into one another, and parts of a migrated dataset.

    Raises:
        SelectionError: naming what can be done.
    """
    wanted = _FROM[args.target_format]
    if args.source_format not in (None, wanted):
        raise SelectionError(
            f"--from {args.source_format} --to {args.target_format}: only {wanted} is brought into "
            f"{args.target_format}"
        )
    chosen = [
        name
        for name in ("sensor", "collection", "pattern")
        if getattr(args, f"{name}_selection_function") is not None
    ]
    if chosen and args.target_format == V3:
        raise SelectionError(f"--{chosen[0]}_selection_function: a dataset is migrated as a whole")


def chosen_export(args: argparse.Namespace) -> KalibrExport:
    """Return what of the dataset goes to Kalibr.

    Raises:
        AtomError: the dataset is unusable, a selection names nothing, or Kalibr cannot take it.
    """
    return kalibr_export(common.selected_dataset(args))


def kalibr_lines(export: KalibrExport, folder: Path, topics: List[str]) -> str:
    """Return what to type next, and what to know of it."""
    bag = folder / BAG_FILE
    files = f"--bag {bag} --target {folder / TARGET_FILE}"
    names = f"--topics {' '.join(topics)} --models {' '.join(export.models)}"
    chain = bag.with_name(f"{bag.stem}-camchain.yaml")
    return "\n".join(
        [
            f"then: kalibr_calibrate_cameras {files} {names}",
            f"then: evaluate --baseline kalibr --camchain {chain} "
            f"--cameras {' '.join(export.cameras)} ...",
            *(f"warning: {remark}" for remark in export.remarks),
        ]
    )
