"""Write the images and robot poses of a dataset in the layout of RWHE (Ali et al.)."""

from __future__ import annotations

import argparse

from scipy.io import savemat

from atom_core.commands import common
from atom_core.commands.hand_eye_export import (
    add_export_options,
    check_camera,
    exported_dataset,
    image_file,
    robot_poses,
)
from atom_core.errors import DatasetError
from atom_core.io.atomic import copy_atomically, prepare_output_folder, write_text_atomically
from atom_core.io.hand_eye_folders import RWHE_MATLAB, RWHE_POSES, RWHE_SQUARE, matlab_poses
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
    files = {key: image_file(dataset, key, args.eye) for key in dataset.collections}
    folder = prepare_output_folder(args.output, args.overwrite)
    for number, path in enumerate(files.values(), 1):  # image n belongs to line n
        copy_atomically(path, folder / f"{number}{path.suffix}")
    (pattern,) = dataset.patterns.values()
    write_text_atomically(folder / RWHE_SQUARE, f"{pattern.square_m:g}m\n")
    write_text_atomically(folder / RWHE_POSES, rwhe_text(poses))
    savemat(str(folder / RWHE_MATLAB), matlab_poses(poses))
    if args.save_detections:
        _write_corners(dataset, args)
    print(f"{folder.resolve()}: {len(poses)} images with their poses, image n with line n")
    return 0


def _write_corners(dataset: Dataset, args: argparse.Namespace) -> None:
    (pattern,) = dataset.patterns
    below = args.output / "detections"
    below.mkdir(exist_ok=True)
    for key, collection in dataset.collections.items():
        label = collection.labels.get((args.eye, pattern))
        pixels = label.pixels.tolist() if isinstance(label, RgbLabel) else []
        text = "".join(f"{x!r} {y!r}\n" for x, y in pixels)
        write_text_atomically(below / f"{key}.txt", text)
