"""Calibrate a LiDAR against a camera by the corners of boards alone, as Dhall et al. (2017)."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from atom_core.commands import common
from atom_core.commands.atom_options import AtomOption, add_meaningless_options
from atom_core.commands.dataset_output import add_overwrite_option, refuse_existing
from atom_core.commands.pair_calibration import pose_table, with_source
from atom_core.errors import DatasetError
from atom_core.evaluation.corner_baseline import (
    as_named,
    by_nearest,
    corner_pairs,
    rms_m,
)
from atom_core.geometry.units import MM_PER_M
from atom_core.io.annotations import annotation_path
from atom_core.io.dataset_json import read_dataset, write_dataset
from atom_core.io.lidar_annotations import corners_of, read_picked_sides
from atom_core.io.paths import sibling
from atom_core.model.dataset import Dataset, pose
from atom_core.model.sensor import LIDAR3D, RGB

EXAMPLE = "python3 -m atom_core dahll2017 -d dataset.json -c rgb_1 -l lidar_1 -p pattern_1"
_METHODS = ("icp_based", "closed_form")
_TOO_FAR = 0.1  # of the board's shorter side: then corners are paired wrongly
_PAIRED = "the corners are paired by the dataset's transforms as they stand"
_NOT_HERE = (
    AtomOption("nig", "noisy_initial_guess", "0.1 0.1", remark=_PAIRED),
    AtomOption("ss", "sample_seed", "3", remark=_PAIRED),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add = common.add_option
    names = ("-d", "--dataset_file", "-json", "--json_file")
    add(parser, "dataset", *names, required=True, type=Path, metavar="FILE", help="the dataset")
    for name, short, what in (
        ("camera", "-c", "the camera, which stays where it is"),
        ("lidar", "-l", "the LiDAR, whose edge is calibrated"),
        ("pattern", "-p", "the board"),
    ):
        add(parser, name, short, required=True, metavar="NAME", help=what)
    text = "pair corners by how near they are, or as they are named (default: icp_based)"
    add(parser, "method_name", "-mn", choices=_METHODS, default=_METHODS[0], help=text)
    text = "the new dataset (default: dahll2017_LIDAR_CAMERA.json beside the input)"
    add(parser, "output", "-o", type=Path, metavar="FILE", help=text)
    add_overwrite_option(parser)
    add_meaningless_options(parser, _NOT_HERE)


def run(args: argparse.Namespace) -> int:
    """Solve, print and write; 1: the corners do not fit one another."""
    usual = sibling(args.dataset, f"dahll2017_{args.lidar}_{args.camera}.json")
    target = args.output or usual
    refuse_existing(args.dataset, [target], args.overwrite)
    dataset = _read(args)
    path = annotation_path(args.dataset.parent, args.lidar)
    picked = {key: corners_of(sides) for key, sides in read_picked_sides(path).items()}
    whole = {key: corners for key, corners in picked.items() if corners is not None}
    if not whole:
        raise DatasetError(
            f"{path}: no collection has all four sides of a board; pick them with "
            f"annotate_pattern_borders_in_lidar -d {args.dataset} -s {args.lidar} -p {args.pattern}"
        )
    pairs = corner_pairs(dataset, args.camera, args.pattern, whole)
    frames = [dataset.sensors[name].frame for name in (args.camera, args.lidar)]
    first = next(iter(dataset.collections.values()))
    start = pose(first, dataset.graph, *frames)
    named = args.method_name == _METHODS[1]
    camera_T_lidar = as_named(pairs) if named else by_nearest(pairs, start)
    write_dataset(with_source(dataset, args.lidar, args.camera, camera_T_lidar), target)
    off_m = rms_m(pairs, camera_T_lidar)
    row = (args.method_name, camera_T_lidar, len(pairs))
    print(pose_table(dataset, args.lidar, args.camera, [row]))
    print(f"\ncorners are {MM_PER_M * off_m:.1f} mm apart (RMS)\n\nresults: {target.resolve()}")
    limit_m = _TOO_FAR * 2.0 * float(np.min(dataset.patterns[args.pattern].border.half_size))
    if off_m > limit_m:
        print(
            f"dahll2017: the corners do not fit: they are paired wrongly, or picked on other sides "
            f"(limit {MM_PER_M * limit_m:.0f} mm); look at {path.name}, or use calibrate",
            file=sys.stderr,
        )
        return 1
    return 0


def _read(args: argparse.Namespace) -> Dataset:
    dataset = read_dataset(args.dataset)
    for name, modality, what in ((args.camera, RGB, "camera"), (args.lidar, LIDAR3D, "3D LiDAR")):
        there = [n for n, s in dataset.sensors.items() if s.modality == modality]
        if name not in there:
            raise DatasetError(
                f"{args.dataset}: there is no {what} '{name}'; there are: {', '.join(there) or '-'}"
            )
    if args.pattern not in dataset.patterns:
        raise DatasetError(
            f"{args.dataset}: there is no pattern '{args.pattern}'; there are: "
            f"{', '.join(dataset.patterns)}"
        )
    return dataset
