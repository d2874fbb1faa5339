"""Changes of a dataset before it is calibrated, as ATOM's options ask for them."""

from __future__ import annotations

from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.errors import CalibrationError, DatasetError
from atom_core.io.dataset_entries import pose_of_entry
from atom_core.model.dataset import Dataset, board_edge
from atom_core.model.joints import JOINT_PARAMETERS, POSITION_BIAS
from atom_core.model.transforms import Edge

_STRAIGHT_RAD = 1e-6  # of a joint's origin, whose own axes and the parent's are then the same


class JointBias(NamedTuple):
    """What is added to a parameter of a joint before anything is estimated [m or rad]."""

    joint: str
    parameter: str
    value: float


def with_known_boards(dataset: Dataset) -> Tuple[Dataset, List[str]]:
    """Return the dataset with what it knows of boards of which it places some, as calibrated.

    A board that is fixed has one pose. Of one that is moved, what was seen where the dataset has no
    pose of it is left out: the collector's first one would stand beside those of a calibration.

    Returns:
        The dataset, and a remark for each pattern of which something is left out.
    """
    remarks = []
    for name, pattern in dataset.patterns.items():
        edge = board_edge(pattern)
        lacking = _lacking(dataset, edge)
        if not 0 < len(lacking) < len(dataset.collections):
            continue
        if pattern.fixed:
            known = {edge: dataset.first_value(edge)}
            dataset = dataset.with_transforms(dict.fromkeys(lacking, known))
            continue
        of_pattern = {
            key: dict.fromkeys(
                place for place in dataset.collections[key].labels if place[1] == name
            )
            for key in lacking
        }
        left_out = [key for key, labels in of_pattern.items() if labels]
        for key in left_out:
            dataset = dataset.with_labels(key, of_pattern[key])
        if left_out:
            remarks.append(
                f"pattern '{name}' is held where the dataset has it (-ap); it is left out in "
                f"collections {', '.join(left_out)}, in which the dataset does not place it"
            )
    return dataset, remarks


def _lacking(dataset: Dataset, edge: Edge) -> List[str]:
    return [key for key, c in dataset.collections.items() if edge not in c.transforms]


def with_first_boards(dataset: Dataset) -> Tuple[Dataset, List[str]]:
    """Return the dataset with a pose of every board: its own, else the collector's first ones.

    A board that is fixed gets the first pose of the first collection that has one.

    Returns:
        The dataset, and a remark for each pattern whose first poses are taken, or of which
        something is left out (`with_known_boards`).

    Raises:
        DatasetError: a first pose is malformed.
    """
    dataset, remarks = with_known_boards(dataset)
    for name, pattern in dataset.patterns.items():
        edge = board_edge(pattern)
        lacking = _lacking(dataset, edge)
        first = _first_poses(dataset, name) if len(lacking) == len(dataset.collections) else {}
        if pattern.fixed and first:
            first = dict.fromkeys(lacking, next(iter(first.values())))
        taken = {key: {edge: first[key]} for key in lacking if key in first}
        if taken:
            dataset = dataset.with_transforms(taken)
            remarks.append(
                f"pattern '{name}' is held where one sensor saw it first (transforms_initial, "
                f"{len(taken)} collections): what is wrong there is wrong in the result"
            )
    return dataset, remarks


def _first_poses(dataset: Dataset, pattern: str) -> Dict[str, np.ndarray]:
    """Return ``parent_T_pattern`` (4, 4) by collection, where the collector noted it."""
    stored = ((dataset.document.get("patterns") or {}).get(pattern) or {}).get("transforms_initial")
    poses = {}
    for key in dataset.collections:
        entry = (stored or {}).get(key) or {}
        if entry.get("detected", "trans" in entry):
            try:
                poses[key] = pose_of_entry(entry)
            except (KeyError, ValueError, TypeError) as error:
                raise DatasetError(
                    f"{dataset.source}: transforms_initial of pattern '{pattern}' in collection "
                    f"{key} is malformed ({error}); restore the file or collect again"
                ) from None
    return poses


def check_boards_known(dataset: Dataset) -> None:
    """Refuse a detected board without a pose among its collection's transforms.

    Raises:
        CalibrationError: naming the first collection that lacks it.
    """
    for key, _ in dataset.detections():
        edge = board_edge(dataset.patterns[key.pattern])
        if edge not in dataset.collections[key.collection].transforms:
            raise CalibrationError(
                f"--ground_truth_pattern_poses: collection {key.collection} has no transform "
                f"'{edge}' of pattern '{key.pattern}'; leave the option out, or give a dataset "
                f"that knows where its boards are"
            )


def without_partial_detections(
    dataset: Dataset, needed: Optional[Sequence[str]] = None
) -> Tuple[Dataset, int]:
    """Return the dataset without cameras' labels that lack corners, and how many they are.

    Args:
        dataset: with all labels.
        needed: sensors that must keep some; all if None.

    Raises:
        CalibrationError: one of these cameras has no others.
    """
    partial = [
        key
        for key, label in dataset.detections()
        if not dataset.sensors[key.sensor].kind.measures_range
        and label.is_partial(dataset.patterns[key.pattern])
    ]
    removed = set(partial)
    of_collection: Dict[str, Dict[Tuple[str, str], None]] = {}
    whole = {key.sensor for key, _ in dataset.detections() if key not in removed}
    for key in partial:
        if key.sensor not in whole and (needed is None or key.sensor in needed):
            raise CalibrationError(
                f"--remove_partial_detections: all labels of sensor '{key.sensor}' lack corners, "
                f"it would see nothing; leave the option out"
            )
        of_collection.setdefault(key.collection, {})[key.sensor, key.pattern] = None
    for collection, labels in of_collection.items():
        dataset = dataset.with_labels(collection, labels)
    return dataset, len(partial)


def with_biased_joints(dataset: Dataset, biases: Sequence[JointBias]) -> Tuple[Dataset, List[str]]:
    """Return the dataset with values added to joints' parameters, and their transforms anew.

    Returns:
        The dataset, and remarks on parameters that mean another axis than in ATOM.

    Raises:
        CalibrationError: there is no such joint or parameter.
    """
    remarks = []
    for bias in biases:
        if bias.joint not in dataset.joints:
            raise CalibrationError(
                f"--joint_bias_names {bias.joint}: there is no such joint in the dataset; there "
                f"are: {', '.join(dataset.joints) or 'none'}"
            )
        if bias.parameter not in JOINT_PARAMETERS:
            raise CalibrationError(
                f"--joint_bias_params {bias.parameter}: unknown; use {', '.join(JOINT_PARAMETERS)}"
            )
        before = dataset.joint(bias.joint).parameters
        changed = {bias.parameter: before[bias.parameter] + bias.value}
        dataset = dataset.with_joint_parameters({bias.joint: changed})
        if bias.parameter == "origin_yaw" and is_inclined(dataset, bias.joint):
            remarks.append(
                f"joint '{bias.joint}': origin_yaw turns about the parent's z, as in URDF; ATOM "
                f"turns about the joint's own: that is {POSITION_BIAS} here"
            )
    return dataset, remarks


def is_inclined(dataset: Dataset, joint: str) -> bool:
    """Tell whether a joint's origin has a roll or pitch, so that its yaw is not about its own z."""
    parameters = dataset.joint(joint).parameters
    return max(abs(parameters["origin_roll"]), abs(parameters["origin_pitch"])) > _STRAIGHT_RAD
