"""Write the images and robot poses of a dataset in the layout of RWHE (Ali et al.)."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Dict, Mapping

from scipy.io import savemat

from atom_core.commands import common
from atom_core.commands.hand_eye_export import (
    add_export_options,
    check_camera,
    exported_dataset,
    folder_for,
    image_file,
    robot_poses,
)
from atom_core.errors import DatasetError
from atom_core.io.atomic import copy_atomically, write_text_atomically
from atom_core.io.hand_eye_folders import (
    RWHE_CORNERS,
    RWHE_MATLAB,
    RWHE_POSES,
    RWHE_SQUARE,
    matlab_poses,
)
from atom_core.io.robot_poses import rwhe_text
from atom_core.model.dataset import Dataset
from atom_core.model.labels import RgbLabel

EXAMPLE = (
    "python3 -m atom_core convert_to_rwhe_dataset -json dataset.json -out rwhe -e rgb_hand "
    "-sf base_link -tf flange"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add = common.add_option
    for name, short, what in (
        ("eye", "-e", "the camera"),
        ("source_frame", "-sf", "the frame in which poses are written: the robot's base"),
        ("target_frame", "-tf", "the frame whose poses they are: the robot's hand"),
    ):
        add(parser, name, short, required=True, metavar="NAME", help=what)
    text = "also the corners of each image, detections/KEY.txt"
    add(parser, "save_detections", "-sd", action="store_true", help=text)
    add_export_options(parser)


def run(args: argparse.Namespace) -> int:
    """Check everything, then write."""
    dataset = exported_dataset(args)
    check_camera(dataset, args.eye)
    if len(dataset.patterns) != 1:
        raise DatasetError(
            f"{args.dataset}: {len(dataset.patterns)} patterns, and this layout knows one board"
        )
    poses = robot_poses(dataset, args.source_frame, args.target_frame)
    images = [image_file(dataset, key, args.eye) for key in dataset.collections]
    # image n belongs to line n
    copies = {args.output / f"{n}{path.suffix}": path for n, path in enumerate(images, 1)}
    corners = _corner_files(dataset, args) if args.save_detections else {}
    folder = folder_for(args, {*copies, *corners.values()})
    for copy, path in copies.items():
        copy_atomically(path, copy)
    (pattern,) = dataset.patterns.values()
    write_text_atomically(folder / RWHE_SQUARE, f"{pattern.square_m:g}m\n")
    write_text_atomically(folder / RWHE_POSES, rwhe_text(poses))
    savemat(str(folder / RWHE_MATLAB), matlab_poses(poses))
    if args.save_detections:
        _write_corners(dataset, args.eye, corners)
    print(f"{folder.resolve()}: {len(poses)} images with their poses, image n with line n")
    return 0


def _corner_files(dataset: Dataset, args: argparse.Namespace) -> Dict[str, Path]:
    return {key: args.output / RWHE_CORNERS / f"{key}.txt" for key in dataset.collections}


def _write_corners(dataset: Dataset, camera: str, files: Mapping[str, Path]) -> None:
    (pattern,) = dataset.patterns
    for key, collection in dataset.collections.items():
        label = collection.labels.get((camera, pattern))
        pixels = label.pixels.tolist() if isinstance(label, RgbLabel) else []
        text = "".join(f"{x!r} {y!r}\n" for x, y in pixels)
        files[key].parent.mkdir(exist_ok=True)
        write_text_atomically(files[key], text)
