"""Say what a dataset holds, whether it can be calibrated, and what looks wrong in it."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Dict, List, Mapping, Sequence, Tuple

import numpy as np

from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.preflight import preflight
from atom_core.calibration.prepare.description import description_caveats
from atom_core.calibration.prepare.preparation import free_edges
from atom_core.commands import common
from atom_core.commands.drift_check import calibration_of, drift_of
from atom_core.commands.verdict_output import print_next, print_verdict
from atom_core.errors import DescriptionError, OutputError
from atom_core.geometry import se3
from atom_core.io.atomic import write_json_atomically
from atom_core.io.dataset_json import read_dataset
from atom_core.io.truth_file import is_dataset
from atom_core.io.urdf import read_description
from atom_core.model.dataset import Dataset
from atom_core.model.transforms import Edge
from atom_core.report.calibration_tables import MovedEdge, moved_report, preflight_report
from atom_core.report.check_verdict import check_verdict
from atom_core.report.drift_report import drift_document, drift_table, drift_verdict
from atom_core.report.verdict import GOOD, WEAK, WRONG, length, names_in_words

EXAMPLE = """
python3 -m atom_core check --dataset data/dataset.json
python3 -m atom_core check --dataset results/atom_calibration.json --against robot.urdf
python3 -m atom_core check --dataset new/dataset.json --against results/optimized.urdf.xacro
python3 -m atom_core check --dataset new/dataset.json --against results/atom_calibration.json
"""
DRIFT_FILE = "drift.json"
_MOVED_M, _MOVED_DEG = 0.001, 0.05


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    common.add_dataset_options(parser)
    common.add_option(
        parser,
        "against",
        type=Path,
        metavar="FILE",
        help="compare the calibrated edges with this description, or with those of a calibrated "
        "dataset: has the rig moved? Where it lies "
        "beside the calibration.json of `calibrate`, the boards of the dataset are asked",
    )
    common.add_option(
        parser,
        "calibration",
        type=Path,
        metavar="DIR",
        help="the results that tell how exactly the description is known (default: beside it)",
    )
    common.add_option(
        parser,
        "output",
        "-o",
        type=Path,
        metavar="FILE",
        help=f"where to write what the boards say of the rig ({DRIFT_FILE})",
    )
    common.add_verbose_option(parser)


def run(args: argparse.Namespace) -> int:
    """Print the tables; 1 where the verdict is wrong, as where the rig has moved."""
    if args.output and args.output.exists():
        raise OutputError(f"{args.output}: exists already; choose another name for --output")
    dataset = common.selected_dataset(args)
    common.refuse_empty(dataset)
    dataset, remarks = _with_description(dataset)
    result = preflight(dataset)
    result = replace(result, warnings=(*result.warnings, *remarks))
    print(preflight_report(dataset, result))
    verdict = check_verdict(dataset, result)
    if args.against:
        calibration = calibration_of(args.against, args.calibration)
        described = _described(args.against)
        edges = _compare(dataset, described)
        print("\n" + moved_report(edges))
        if calibration is None:
            _refuse_other_rig(edges, args.against)
            moved, untold = _moved(edges), [e.sensor for e in edges if np.isnan(e.translation_m)]
            print("\nthe rig has moved" if moved else f"\n{_stands(untold)}")
            verdict = check_verdict(dataset, result, moved)
            if untold and verdict.grade == GOOD:
                verdict = replace(verdict, grade=WEAK, sentence=_stands(untold))
        else:
            found = drift_of(dataset, described, calibration, args.against)
            found = replace(found, caveats=result.caveats)
            verdict = verdict if result.problems and not found.moved else drift_verdict(found)
            print(f"\n{drift_table(found)}")
            if args.output:
                document = drift_document(found, str(dataset.source), str(args.against))
                write_json_atomically(args.output, document, sort_keys=False)
    print()
    print_verdict(verdict)
    if verdict.grade == WRONG:
        return 1
    if not args.against:
        words = ["--dataset", str(args.dataset.resolve()), *common.selection_words(args)]
        print_next("calibrate", *words, "--output", "results")
    return 0


def _with_description(dataset: Dataset) -> Tuple[Dataset, List[str]]:
    """Return the dataset with what the description that it names contradicts it in.

    Returns:
        The dataset, and why `calibrate` cannot use the description, if it cannot.
    """
    configured = dataset.config.description_file
    try:
        if configured:
            description = read_description(configured)
            free = free_edges(dataset, CalibrationOptions())
            caveats = description_caveats(dataset, free, description.robot, description.path)
            return dataset.with_caveats(caveats), []
    except DescriptionError as error:
        return dataset, [f"optimized.urdf.xacro will not be written: {error}"]
    return dataset, []


def _refuse_other_rig(edges: Sequence[MovedEdge], description: Path) -> None:
    if all(np.isnan(edge.translation_m) for edge in edges):
        missed = edges[0].edge
        raise DescriptionError(
            f"{description}: has none of the calibrated edges, such as '{missed.parent}' to "
            f"'{missed.child}'; give the description of this rig"
        )


def _stands(untold: Sequence[str]) -> str:
    if not untold:
        return "the rig stands as described"
    return (
        f"nothing is seen to have moved, but of {names_in_words(untold)} nothing is told: the "
        f"description has no joint there, or the dataset no transform"
    )


def _moved(edges: Sequence[MovedEdge]) -> Dict[str, str]:
    return {
        e.sensor: f"it stands {length(e.translation_m)} and {e.rotation_deg:.2f} deg elsewhere"
        for e in edges
        if e.translation_m > _MOVED_M or e.rotation_deg > _MOVED_DEG
    }


def _described(path: Path) -> Dict[Edge, np.ndarray]:
    """Return ``parent_T_child`` (4, 4) of joints at zero, or of edges that are so in a dataset."""
    if path.suffix.lower() == ".json" and path.is_file():
        return _standing_edges(path)
    joints = read_description(path).robot.joints.values()
    return {j.edge: j.parent_T_child() for j in joints if j.has_one_position}


def _standing_edges(path: Path) -> Dict[Edge, np.ndarray]:
    """Return ``parent_T_child`` (4, 4) of the edges that have one value in all of a dataset.

    Raises:
        AtomError: the file is no dataset, or cannot be used.
    """
    if not is_dataset(path):
        raise DescriptionError(
            f"{path}: is neither a robot description nor a dataset; give the optimized.urdf.xacro "
            f"or the atom_calibration.json that `calibrate` wrote"
        )
    dataset = read_dataset(path)
    common.refuse_empty(dataset)
    edges: Dict[Edge, List[np.ndarray]] = {}
    for collection in dataset.collections.values():
        for edge, parent_T_child in collection.transforms.items():
            edges.setdefault(edge, []).append(parent_T_child)
    return {edge: poses[0] for edge, poses in edges.items() if np.allclose(poses, poses[0])}


def _compare(dataset: Dataset, described: Mapping[Edge, np.ndarray]) -> List[MovedEdge]:
    collection = next(iter(dataset.collections.values()))
    rows = []
    for sensor in dataset.sensors.values():
        if sensor.edge not in described or sensor.edge not in collection.transforms:
            rows.append(MovedEdge(sensor.name, sensor.edge, np.nan, np.nan))
            continue
        now, then = collection.transforms[sensor.edge], described[sensor.edge]
        moved_m, turned_rad = se3.pose_difference(then, now)
        rows.append(MovedEdge(sensor.name, sensor.edge, moved_m, float(np.rad2deg(turned_rad))))
    return rows
