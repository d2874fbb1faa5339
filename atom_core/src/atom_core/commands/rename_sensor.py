"""Give a sensor of a dataset another name."""

from __future__ import annotations

import argparse

from atom_core.commands import common
from atom_core.commands.dataset_output import (
    add_output_option,
    add_overwrite_option,
    output_path,
    write_documents,
)
from atom_core.io.dataset_json import read_document
from atom_core.io.dataset_tools import with_sensor_renamed

EXAMPLE = "python3 -m atom_core rename_sensor -json data/dataset.json --sensor cam --name rgb_left"
_ADDITION = "_renamed"  # to the name of the input


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    common.add_dataset_option(parser)
    for name, short, what in (("sensor", "-s", "its name now"), ("name", "-n", "its new name")):
        common.add_option(parser, name, short, required=True, metavar="NAME", help=what)
    add_output_option(parser, _ADDITION)
    add_overwrite_option(parser)


def run(args: argparse.Namespace) -> int:
    """Rename it everywhere in the JSON; its data files and frames keep their names."""
    document = with_sensor_renamed(read_document(args.dataset), args.sensor, args.name)
    target = output_path(args, _ADDITION)
    write_documents(args.dataset, {target: document}, args.overwrite)
    return 0
