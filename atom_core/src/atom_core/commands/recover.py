"""Assemble a dataset from the collections that an interrupted collector left.

With --previous they are removed, and the dataset that --overwrite was to replace is back.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from atom_core.commands import common
from atom_core.io.collections import CollectionStore, recover_dataset
from atom_core.io.dataset_json import read_dataset

EXAMPLE = "python3 -m atom_core recover my_dataset"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument(
        "folder", type=Path, metavar="DIR", help="what was --output of the interrupted collector"
    )
    common.add_option(
        parser, "overwrite", "-ow", action="store_true", help="replace a dataset.json in it"
    )
    parser.add_argument(
        "--previous",
        action="store_true",
        help="bring back the dataset that was there before; what was collected since is removed",
    )
    common.add_verbose_option(parser)


def run(args: argparse.Namespace) -> int:
    """Assemble, read back, and say what was found."""
    if args.previous:
        path = CollectionStore(args.folder).bring_back()
    else:
        path, warnings = recover_dataset(args.folder, args.overwrite)
        for warning in warnings:
            print(f"recover: {warning}", file=sys.stderr)
    dataset = read_dataset(path)
    print(
        f"{path.resolve()}: {len(dataset.sensors)} sensors, {len(dataset.collections)} collections"
    )
    return 0
