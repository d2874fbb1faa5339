"""Give a sensor of a dataset another name."""

from __future__ import annotations

import argparse
from pathlib import Path

from atom_core.commands import common
from atom_core.commands.dataset_output import add_overwrite_option, beside, write_documents
from atom_core.io.dataset_json import read_document
from atom_core.io.dataset_tools import with_sensor_renamed

EXAMPLE = "python3 -m atom_core rename_sensor -json data/dataset.json --sensor cam --name rgb_left"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    common.add_dataset_option(parser)
    for name, short, what in (("sensor", "-s", "its name now"), ("name", "-n", "its new name")):
        common.add_option(parser, name, short, required=True, metavar="NAME", help=what)
    common.add_option(
        parser,
        "output",
        "-o",
        type=Path,
        metavar="FILE",
        help="the new dataset (default: NAME_renamed.json beside it)",
    )
    add_overwrite_option(parser)


def run(args: argparse.Namespace) -> int:
    """Rename it everywhere in the JSON; its data files and frames keep their names."""
    document = with_sensor_renamed(read_document(args.dataset), args.sensor, args.name)
    target = args.output or beside(args.dataset, "_renamed")
    write_documents(args.dataset, {target: document}, args.overwrite)
    return 0
