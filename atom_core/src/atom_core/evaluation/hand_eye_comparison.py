"""A calibration and OpenCV's hand-eye methods on one test set, camera by camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.evaluation.evaluate import Evaluation, evaluate
from atom_core.evaluation.hand_eye_baselines import Baseline, hand_eye_baselines
from atom_core.evaluation.statistics import mean_of
from atom_core.geometry.se3 import pose_difference
from atom_core.model.dataset import Dataset, pose
from atom_core.model.truth import Truth

CALIBRATION = "this calibration"


class HandEyeScore(NamedTuple):
    """How well a camera's edge does on a test set.

    Attributes:
        reprojection_px: mean distance of the corners, boards with one pose each.
        spread_px, spread_mm, spread_deg: how far apart the collections put the boards.
        error_m, error_deg: of its data frame in the parent of its edge; None without a truth.
    """

    reprojection_px: Optional[float]
    spread_px: Optional[float]
    spread_mm: Optional[float]
    spread_deg: Optional[float]
    error_m: Optional[float] = None
    error_deg: Optional[float] = None


@dataclass(frozen=True)
class HandEyeComparison:
    """The methods beside a calibration, on the same test set.

    Attributes:
        baselines: of all methods.
        evaluations: by method; those that were skipped have none.
        scores: by method and camera; those of the calibration under ``CALIBRATION``.
        remarks: what the user should know.
    """

    baselines: Tuple[Baseline, ...]
    evaluations: Mapping[str, Evaluation]
    scores: Mapping[Tuple[str, str], HandEyeScore]
    remarks: Tuple[str, ...]


def compare_hand_eye(
    train: Dataset,
    test: Dataset,
    evaluation: Evaluation,
    *,
    truth: Optional[Truth] = None,
    sensors: Optional[Sequence[str]] = None,
) -> HandEyeComparison:
    """Solve by OpenCV's methods and evaluate each result on the test set.

    Args:
        train: the calibrated dataset, whose labels the methods get.
        test: to evaluate on.
        evaluation: of the calibration itself.
        truth: true edges of a simulation.
        sensors: only these; None: all.

    Raises:
        DatasetError: no camera can be solved; the message says why.
    """
    baselines, remarks = hand_eye_baselines(train.selected(sensors, None, list(test.patterns)))
    cameras = list(dict.fromkeys(camera for b in baselines for camera in b.boards))
    evaluations: Dict[str, Evaluation] = {}
    scores: Dict[Tuple[str, str], HandEyeScore] = {}
    for camera in cameras:
        scores[CALIBRATION, camera] = hand_eye_score(camera, train, evaluation, truth)
    for baseline in baselines:
        if baseline.dataset is None:
            continue
        solved = list(baseline.boards)
        found = evaluate(baseline.dataset, test, truth=truth, sensors=solved)
        evaluations[baseline.method] = found
        for camera in solved:
            score = hand_eye_score(camera, baseline.dataset, found, truth)
            scores[baseline.method, camera] = score
    return HandEyeComparison(tuple(baselines), evaluations, scores, tuple(remarks))


def hand_eye_score(
    camera: str, dataset: Dataset, evaluation: Evaluation, truth: Optional[Truth] = None
) -> HandEyeScore:
    """Return the score of a camera.

    Args:
        camera: its name.
        dataset: the calibrated one.
        evaluation: of this dataset.
        truth: with the true edge.
    """
    of_camera = [s for s in evaluation.single if s.sensor == camera and s.tells_of_calibration]
    reprojection = mean_of([s.measured.pooled.mean for s in of_camera if s.measured is not None])
    spread = next((s.measured for s in evaluation.spread if s.pair.source == camera), None)
    apart: Tuple[Optional[float], Optional[float], Optional[float]] = (None, None, None)
    if spread is not None:
        apart = (spread.rms, spread.translation_mm, spread.rotation_deg)
    sensor = dataset.sensors[camera]
    true = None if truth is None else truth.edges.get(sensor.edge)
    if true is None:
        return HandEyeScore(reprojection, *apart)
    first = next(iter(dataset.collections.values()))
    child_T_camera = pose(first, dataset.graph, sensor.edge.child, sensor.frame)
    found = dataset.first_value(sensor.edge)
    error_m, error_rad = pose_difference(true @ child_T_camera, found @ child_T_camera)
    return HandEyeScore(reprojection, *apart, error_m, float(np.degrees(error_rad)))
