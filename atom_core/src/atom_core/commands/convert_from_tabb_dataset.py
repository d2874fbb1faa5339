"""Make a dataset of images and robot poses in the layout of Tabb and Ahmad Yousef."""

from __future__ import annotations

import argparse
from pathlib import Path

from atom_core.commands import common
from atom_core.commands.hand_eye_import import add_import_options, import_folder
from atom_core.io.hand_eye_folders import read_tabb_folder

EXAMPLE = "python3 -m atom_core convert_from_tabb_dataset -ds DS1 -json config.yml -out data"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    common.add_option(
        parser,
        "dataset_folder",
        "-ds",
        required=True,
        type=Path,
        metavar="DIR",
        help="images/CAMERA/ for each camera of the configuration, and robot_cali.txt",
    )
    add_import_options(parser)


def run(args: argparse.Namespace) -> int:
    """Convert and say where the result lies."""
    return import_folder(args, read_tabb_folder(args.dataset_folder))
