"""Bring a dataset into another format or version."""

from __future__ import annotations

import argparse
from pathlib import Path

from atom_core.commands import common
from atom_core.io.dataset_json import read_dataset
from atom_core.io.migrate import migrate_dataset

EXAMPLE = "python3 -m atom_core convert --from atom_v2 --to atom_v3 --dataset old.json --output new"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument("--from", dest="source_format", choices=["atom_v2"], required=True)
    parser.add_argument("--to", dest="target_format", choices=["atom_v3"], required=True)
    common.add_option(
        parser, "dataset", "-json", required=True, type=Path, metavar="FILE", help="what to convert"
    )
    common.add_output_options(parser)


def run(args: argparse.Namespace) -> int:
    """Convert and say where the result lies."""
    common.refuse_occupied(args.output, args.overwrite)
    target = migrate_dataset(args.dataset, args.output, args.overwrite)
    dataset = read_dataset(target)
    counts = f"{len(dataset.sensors)} sensors, {len(dataset.collections)} collections"
    print(f"{target.resolve()}: {counts}")
    return 0
