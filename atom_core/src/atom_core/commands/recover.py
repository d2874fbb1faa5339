"""Assemble a dataset from the collections that an interrupted collector left."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from atom_core.commands import common
from atom_core.io.collections import recover_dataset
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
    common.add_verbose_option(parser)


def run(args: argparse.Namespace) -> int:
    """Assemble, read back, and say what was found."""
    path, warnings = recover_dataset(args.folder, args.overwrite)
    for warning in warnings:
        print(f"recover: {warning}", file=sys.stderr)
    dataset = read_dataset(path)
    print(f"{path}: {len(dataset.sensors)} sensors, {len(dataset.collections)} collections")
    return 0
