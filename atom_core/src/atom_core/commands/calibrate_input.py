"""The dataset that ``calibrate`` begins with, and the truth, as its arguments say."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import Dict, List, Mapping, Optional, Sequence, Tuple

from atom_core.calibration.prepare.input_changes import (
    JointBias,
    check_boards_known,
    is_inclined,
    with_biased_joints,
    with_first_boards,
    with_known_boards,
    without_partial_detections,
)
from atom_core.calibration.prepare.preparation import INCOMPLETE
from atom_core.commands import common
from atom_core.errors import CalibrationError
from atom_core.io.truth_file import read_any_truth
from atom_core.model.dataset import Dataset, is_complete
from atom_core.model.truth import Truth, truth_of

_YAW = "origin_yaw"


@dataclass(frozen=True)
class CalibrationInput:
    """What is calibrated.

    Attributes:
        original: the selected dataset as it was read.
        dataset: with the changes that were asked for.
        truth: to compare with, if there is one.
        remarks: what the user should know.
        joint_biases: what was added to joints, by joint and parameter [m or rad].
        unused: collections of which nothing is used, and why, by key.
    """

    original: Dataset
    dataset: Dataset
    truth: Optional[Truth]
    remarks: Tuple[str, ...]
    joint_biases: Mapping[str, Mapping[str, float]]
    unused: Mapping[str, str]


def read_input(args: argparse.Namespace) -> CalibrationInput:
    """Read the dataset and the truth, and change the dataset as ATOM's options ask.

    Raises:
        AtomError: the files are unusable, or what was asked for cannot be done.
    """
    biases = joint_biases(args)
    if args.truth and args.comparison_to_ground_truth:
        raise CalibrationError("--truth and -ctgt are two truths; leave one of them out")
    if args.use_incomplete_collections and args.complete_only:
        raise CalibrationError(
            "-uic uses the incomplete collections that --complete_only leaves out; leave one of "
            "the two out"
        )
    chosen = common.selected_dataset(args)
    common.refuse_empty(chosen)
    original = _only_anchored(chosen, args)
    dataset, remarks = original, _remarks_on_yaw(original)
    unused = _incomplete(original) if args.complete_only else {}
    if args.comparison_to_ground_truth:
        truth: Optional[Truth] = truth_of(original)
    else:
        truth = read_any_truth(args.truth) if args.truth else None
    if args.only_anchored_sensor:
        remarks.append("-oas: the anchored sensor is held and the boards are placed, no more")
    if args.remove_partial_detections:
        dataset, count = without_partial_detections(dataset)
        remarks.append(f"{count} labels of cameras lack corners and are not used (-rpd)")
        unused.update(_emptied(original, dataset, "all its labels lack corners (-rpd)"))
    if args.anchor_patterns:
        before = dataset
        dataset, of_boards = with_known_boards(dataset)
        remarks += of_boards
        unused.update(
            _emptied(before, dataset, "the dataset does not place what is seen in it (-ap)")
        )
    if args.ground_truth_pattern_poses:
        check_boards_known(dataset)
    if args.anchor_patterns:
        dataset, of_boards = with_first_boards(dataset)
        remarks += of_boards
    dataset, of_joints = with_biased_joints(dataset, biases)
    if (args.save_file_results or args.save_file_results_name) and truth is None:
        remarks.append("-sfr writes errors against the truth: add -ctgt or --truth")
    remarks += of_joints
    return CalibrationInput(original, dataset, truth, tuple(remarks), _added(biases), unused)


def _incomplete(dataset: Dataset) -> Dict[str, str]:
    """Return the incomplete collections, and that they are; labels that lack corners are some."""
    return {key: INCOMPLETE for key in dataset.collections if not is_complete(dataset, key)}


def _emptied(before: Dataset, after: Dataset, why: str) -> Dict[str, str]:
    """Return the collections that have lost their last detection, and why."""
    seen, left = ({key.collection for key, _ in d.detections()} for d in (before, after))
    return dict.fromkeys((key for key in before.collections if key in seen - left), why)


def _added(biases: Sequence[JointBias]) -> Dict[str, Dict[str, float]]:
    added: Dict[str, Dict[str, float]] = {}
    for bias in biases:
        of_joint = added.setdefault(bias.joint, {})
        of_joint[bias.parameter] = of_joint.get(bias.parameter, 0.0) + bias.value
    return added


def _only_anchored(dataset: Dataset, args: argparse.Namespace) -> Dataset:
    if not args.only_anchored_sensor:
        return dataset
    anchored = dataset.config.anchored_sensor
    if args.ignore_anchored_sensor:
        raise CalibrationError("-oas keeps the anchored sensor that -ias ignores; leave one out")
    if anchored is None or anchored not in dataset.sensors:
        raise CalibrationError(
            f"-oas: the configuration anchors none of the sensors used "
            f"({', '.join(dataset.sensors)}); select one with -ssf"
        )
    return dataset.selected(sensors=[anchored])


def joint_biases(args: argparse.Namespace) -> List[JointBias]:
    """Return by what `-jbn -jbp -jbv` disturb the robot.

    Raises:
        CalibrationError: they are not of one length.
    """
    names, parameters, values = (
        common.strings(args.joint_bias_names),
        common.strings(args.joint_bias_params),
        list(args.joint_bias_values or []),
    )
    if not len(names) == len(parameters) == len(values):
        raise CalibrationError(
            f"-jbn, -jbp and -jbv go together, a joint, a parameter and a value each; there are "
            f"{len(names)}, {len(parameters)} and {len(values)}"
        )
    return [JointBias(*triple) for triple in zip(names, parameters, values)]


def _remarks_on_yaw(dataset: Dataset) -> List[str]:
    """Return remarks on joints of the configuration whose yaw has another axis than in ATOM."""
    inclined = [
        name
        for name, joint in dataset.config.joints.items()
        if _YAW in joint.params_to_calibrate
        and name in dataset.joints
        and is_inclined(dataset, name)
    ]
    if not inclined:
        return []
    return [
        f"origin_yaw of {', '.join(inclined)} turns about the parent's z, as in URDF; ATOM's turns "
        f"about the joint's own axis, which position_bias does here"
    ]
