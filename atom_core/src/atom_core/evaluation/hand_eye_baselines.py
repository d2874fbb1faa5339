"""OpenCV's hand-eye methods on the labels of a calibrated dataset, to be evaluated like it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Dict, Iterable, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.evaluation.hand_eye_views import (
    HandEyeViews,
    board_of,
    hand_eye_views,
    with_hand_eye,
    with_transforms_of,
)
from atom_core.evaluation.observed import Observed
from atom_core.geometry.pose_solvers import (
    HAND_EYE_METHODS,
    ROBOT_WORLD_METHODS,
    hand_eye_pose,
    lacking,
    robot_world_poses,
)
from atom_core.model.dataset import Dataset
from atom_core.model.sensor import RGB

METHODS = (*HAND_EYE_METHODS, *ROBOT_WORLD_METHODS)


@dataclass(frozen=True)
class Baseline:
    """A method's answer.

    Attributes:
        method: one of ``METHODS``.
        dataset: the dataset with the answers in the cameras' edges, without the cameras that have
            none; None where no camera has one.
        boards: the board that was used, by camera that has an answer.
        skipped: why there is no answer, or none of some cameras.
    """

    method: str
    dataset: Optional[Dataset]
    boards: Mapping[str, str] = field(default_factory=dict)
    skipped: Optional[str] = None


def hand_eye_baselines(dataset: Dataset) -> Tuple[List[Baseline], List[str]]:
    """Solve every camera that can be by every method.

    Args:
        dataset: with the labels, and where the robot was.

    Returns:
        A baseline for each method; and remarks: which board was taken where there are several,
        and why cameras were left out.

    Raises:
        DatasetError: no camera can be solved; the message says why of the first.
    """
    observed, remarks = Observed(dataset), []
    refused: List[DatasetError] = []
    views: Dict[str, Tuple[str, HandEyeViews]] = {}
    for sensor in dataset.sensors.values():
        if sensor.modality != RGB:
            continue
        try:
            board = board_of(dataset, sensor.name)
            views[sensor.name] = (
                board,
                hand_eye_views(dataset, sensor.name, board, None, observed),
            )
        except DatasetError as error:
            refused.append(error)
            remarks.append(f"no hand-eye baseline of '{sensor.name}': {error}")
            continue
        if sum(pattern.fixed for pattern in dataset.patterns.values()) > 1:
            remarks.append(f"hand-eye baselines of '{sensor.name}' are by board '{board}' alone")
    if not views:
        why = refused[0] if refused else f"{dataset.source}: there is no rgb camera"
        raise DatasetError(f"--baseline hand_eye: {why}")
    return [_baseline(dataset, method, views) for method in METHODS], remarks


def _baseline(
    dataset: Dataset, method: str, views: Mapping[str, Tuple[str, HandEyeViews]]
) -> Baseline:
    if lacking(method):
        return Baseline(method, None, skipped=lacking(method))
    solved = dataset
    boards: Dict[str, str] = {}
    for camera in _carriers_first(dataset, list(views)):
        board, of_camera = views[camera]
        if _carriers(dataset, camera, boards):
            of_camera = with_transforms_of(solved, of_camera)
        X = solved_by(method, of_camera)
        if X is not None:
            solved = with_hand_eye(solved, camera, board, of_camera, X)
            boards[camera] = board
    failed = [camera for camera in views if camera not in boards]
    if not failed:
        return Baseline(method, solved, boards)
    why = f"{method} finds no pose of {', '.join(repr(camera) for camera in failed)}"
    if not boards:
        return Baseline(method, None, skipped=why)
    # Their edges have the calibration's own values, which would pass for the method's.
    left = solved.selected(sensors=[name for name in solved.sensors if name not in failed])
    return Baseline(method, left, boards, why)


def _carriers_first(dataset: Dataset, cameras: Sequence[str]) -> List[str]:
    """Return cameras in an order in which those that hang on others come after them."""
    return sorted(cameras, key=lambda camera: len(_carriers(dataset, camera, cameras)))


def _carriers(dataset: Dataset, camera: str, others: Iterable[str]) -> List[str]:
    """Return those of other cameras whose edges carry the edge of a camera."""
    graph, parent = dataset.graph, dataset.sensors[camera].edge.parent
    return [name for name in others if graph.hangs_below(parent, dataset.sensors[name].edge)]


def solved_by(method: str, views: HandEyeViews) -> Optional[np.ndarray]:
    """Return ``camera_side_T_frame`` (4, 4) by a method; None where it finds none.

    Raises:
        DatasetError: this OpenCV does not have the method.
    """
    if lacking(method):
        raise DatasetError(lacking(method))
    if method in HAND_EYE_METHODS:
        return hand_eye_pose(views.G, views.H, method)
    found = robot_world_poses(views.G, views.H, method)
    return None if found is None else found[0]
