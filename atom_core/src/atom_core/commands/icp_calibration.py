"""Calibrate one range sensor against another by ICP of their whole clouds."""

from __future__ import annotations

import argparse
import sys
from typing import Dict

import numpy as np

from atom_core.commands import common
from atom_core.commands.atom_options import AtomOption, add_meaningless_options
from atom_core.commands.dataset_output import add_overwrite_option, refuse_existing
from atom_core.commands.pair_calibration import pose_table, read_pair, refuted, with_source
from atom_core.errors import DatasetError
from atom_core.evaluation.baselines.icp import ALIGNED, AVERAGE, BEST, INITIAL, icp_baselines
from atom_core.evaluation.baselines.links import Link
from atom_core.geometry import se3
from atom_core.io.dataset_json import write_dataset
from atom_core.io.paths import sibling
from atom_core.model.dataset import Dataset
from atom_core.model.sensor import DEPTH, LIDAR3D

EXAMPLE = "python3 -m atom_core icp_calibration -json dataset.json -ss lidar_1 -st lidar_2"
_NOT_HERE = (
    AtomOption("si", "show_images", remark="nothing is drawn"),
    AtomOption("ssd", "sub_sample_depth", "4", remark="large clouds are thinned as it is"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    common.add_dataset_option(parser)
    add = common.add_option
    for name, short, what in (
        ("sensor_source", "-ss", "the range sensor whose edge is calibrated"),
        ("sensor_target", "-st", "the one that stays where it is"),
    ):
        add(parser, name, short, required=True, metavar="SENSOR", help=what)
    text = "begin with the middles of the boards on one another, not where the dataset has them"
    add(parser, "manual_alignment", "-ma", action="store_true", help=text)
    text = "disturb where the dataset has the source by so much, m and rad"
    common.add_option(
        *(parser, "noisy_initial_guess", "-nig"),
        nargs=2,
        type=float,
        default=(0.0, 0.0),
        metavar=("M", "RAD"),
        help=text,
    )
    add(
        parser,
        "sample_seed",
        "-seed",
        type=common.seed_of_chance,
        default=0,
        metavar="N",
        help="of -nig",
    )
    add_overwrite_option(parser)
    add_meaningless_options(parser, _NOT_HERE)


def run(args: argparse.Namespace) -> int:
    """Solve collection by collection; write the average, and the one with the smallest error.

    1: the labels contradict both.
    """
    source, target = args.sensor_source, args.sensor_target
    name = f"ICPCalibration_{source}_to_{target}"
    files = {kind: sibling(args.dataset, f"{name}_{kind}.json") for kind in (AVERAGE, BEST)}
    refuse_existing(args.dataset, list(files.values()), args.overwrite)
    dataset = read_pair(args, [source, target], [LIDAR3D, DEPTH])
    if [dataset.sensors[s].modality for s in (source, target)] == [DEPTH, DEPTH]:
        raise DatasetError(f"{args.dataset}: two depth cameras have no such baseline; calibrate")
    links = _links(dataset, args)
    poses, doubts = {}, {}
    for kind, link in links.items():
        found = link.target_T_source
        poses[kind] = found if link.source == source else se3.inverse(found)
        solved = with_source(dataset, source, target, poses[kind])
        write_dataset(solved, files[kind])
        doubts[kind] = refuted(solved, [source, target])
    rows = [(kind, pose, links[kind].collections) for kind, pose in poses.items()]
    print(pose_table(dataset, source, target, rows))
    for path in files.values():
        print(f"results: {path.resolve()}")
    for kind in (kind for kind, doubt in doubts.items() if doubt):
        print(
            f"icp_calibration: the answer of '{kind}' is wrong: {doubts[kind]}; begin with the "
            f"boards on one another (-ma), or calibrate",
            file=sys.stderr,
        )
    return 1 if all(doubts.values()) else 0


def _links(dataset: Dataset, args: argparse.Namespace) -> Dict[str, Link]:
    """Return what ICP finds, by kind.

    Raises:
        DatasetError: it finds nothing.
    """
    pair = dataset.selected(sensors=[args.sensor_source, args.sensor_target])
    start = ALIGNED if args.manual_alignment else INITIAL
    rigs = icp_baselines(pair, None if args.manual_alignment else _disturbed(pair, args))
    by_method = {rig.method: rig for rig in rigs}
    links = {}
    for kind in (AVERAGE, BEST):
        rig = by_method[f"icp_{start}_{kind}"]
        if not rig.links:
            why = "; ".join(rig.unsolved.values())
            hint = "" if args.manual_alignment else "; -ma begins with the boards on one another"
            raise DatasetError(f"{args.dataset}: ICP finds nothing: {why}{hint}")
        links[kind] = rig.links[0]
    return links


def _disturbed(dataset: Dataset, args: argparse.Namespace) -> Dataset:
    edge = dataset.sensors[args.sensor_source].edge
    rng = np.random.default_rng(args.sample_seed)
    metres, radians = args.noisy_initial_guess
    moved = dataset.first_value(edge) @ se3.random_move(metres, radians, rng)
    return dataset.with_transforms(dict.fromkeys(dataset.collections, {edge: moved}))
