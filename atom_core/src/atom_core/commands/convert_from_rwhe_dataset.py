"""Make a dataset of images and robot poses in the layout of RWHE (Ali et al.)."""

from __future__ import annotations

import argparse
from pathlib import Path

from atom_core.commands import common
from atom_core.commands.hand_eye_import import add_import_options, import_folder
from atom_core.io.hand_eye_folders import read_rwhe_folder

EXAMPLE = "python3 -m atom_core convert_from_rwhe_dataset -rwhe DS1 -json c.yml -out data -s hand"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    common.add_option(
        parser,
        "rwhe_folder",
        "-rwhe",
        required=True,
        type=Path,
        metavar="DIR",
        help="images with numbers in their names, and RobotPosesVec.txt",
    )
    text = "the camera of the configuration that took the images"
    common.add_option(parser, "sensor", "-s", required=True, metavar="CAMERA", help=text)
    add_import_options(parser)


def run(args: argparse.Namespace) -> int:
    """Convert and say where the result lies."""
    return import_folder(args, read_rwhe_folder(args.rwhe_folder, args.sensor))
