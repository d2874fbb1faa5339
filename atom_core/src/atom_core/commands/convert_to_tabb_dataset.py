"""Write the images and robot poses of a dataset in the layout of Tabb and Ahmad Yousef."""

from __future__ import annotations

import argparse
from typing import Dict

from atom_core.commands import common
from atom_core.commands.hand_eye_export import (
    add_export_options,
    cameras_of,
    exported_dataset,
    folder_for,
    image_file,
    robot_poses,
)
from atom_core.errors import DatasetError
from atom_core.io.atomic import copy_atomically, write_text_atomically
from atom_core.io.hand_eye_folders import (
    TABB_BOARD,
    TABB_DETAILS,
    TABB_IMAGES,
    TABB_POSES,
    tabb_board_text,
)
from atom_core.io.robot_poses import tabb_text
from atom_core.model.dataset import Dataset

EXAMPLE = "python3 -m atom_core convert_to_tabb_dataset -json dataset.json -out tabb -hl flange"
_USUAL_HAND = "ee_link"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    text = f"the robot's hand (default: {_USUAL_HAND})"
    common.add_option(parser, "hand_link", "-hl", default=_USUAL_HAND, metavar="FRAME", help=text)
    text = "the robot's base (default: the configuration's world_link)"
    common.add_option(parser, "base_link", "-bl", metavar="FRAME", help=text)
    add_export_options(parser)


def run(args: argparse.Namespace) -> int:
    """Check everything, then write."""
    dataset = exported_dataset(args)
    cameras = cameras_of(dataset)
    if not cameras or len(dataset.patterns) != 1:
        raise DatasetError(
            f"{args.dataset}: {len(cameras)} cameras and {len(dataset.patterns)} patterns; this "
            f"layout has cameras and one board"
        )
    base = args.base_link or dataset.world
    for frame, option in ((args.hand_link, "--hand_link"), (base, "--base_link")):
        if frame not in dataset.graph:
            raise DatasetError(f"{args.dataset}: frame '{frame}' is in no transform; see {option}")
    poses = robot_poses(dataset, base, args.hand_link)
    files = {(c, key): image_file(dataset, key, c) for c in cameras for key in dataset.collections}
    numbers, images = _numbers(dataset), args.output / TABB_IMAGES
    copies = {
        images / camera / f"image{numbers[key]}{path.suffix}": path
        for (camera, key), path in files.items()
    }
    folder = folder_for(args, copies)
    for copy, path in copies.items():
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy_atomically(path, copy)
    (pattern,) = dataset.patterns.values()
    write_text_atomically(folder / TABB_BOARD, tabb_board_text(pattern))
    details = f"{args.dataset.name}: {len(poses)} poses of {args.hand_link} in {base}\n"
    write_text_atomically(folder / TABB_DETAILS, details)
    write_text_atomically(folder / TABB_POSES, tabb_text(poses))
    print(f"{folder.resolve()}: {len(poses)} poses, images of {', '.join(cameras)}")
    return 0


def _numbers(dataset: Dataset) -> Dict[str, str]:
    """Return what images are numbered by: names of collections, or places where not all count.

    Poses belong to images in the order of their numbers.
    """
    if all(key.isdigit() for key in dataset.collections):
        return {key: key for key in dataset.collections}
    return {key: str(place) for place, key in enumerate(dataset.collections, 1)}
