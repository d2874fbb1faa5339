"""Range offsets: what must be added to all distances of a sensor, estimated with the poses.

Real LiDARs read boards some centimetres long or short. Like the insets, an offset is not one of
the solver's parameters: in each round of reweighting it takes the Newton step of the joint
problem. It is off unless asked for, since it weakens the poses: where all boards are equally far
and look the same way, an offset and a shift of the sensor can hardly be told apart.
"""

from __future__ import annotations

from typing import Dict, List, Mapping, NamedTuple, Sequence

import numpy as np

from atom_core.problem.camera_blocks import TWIST_SIZE
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import RangeBlock, squared_norms
from atom_core.solvers import losses
from atom_core.solvers.base import Solver

UNIT_M = 0.01  # in which an offset counts, beside insets in steps and logarithms of scales
_MOST_M = 0.5


class OffsetColumn(NamedTuple):
    """The derivative of a sensor's rows by its range offset in units of UNIT_M, reduced.

    Attributes:
        sensor: whose offset.
        curvature: sum of weight times derivative squared.
        slope: sum of weight times derivative times residual.
        detection: (d,) all detections.
        by_twist: (d, 6) what the offset and the detections' twists have in common.
        weighted: by index of the residual block, (n,) weight times derivative.
    """

    sensor: str
    curvature: float
    slope: float
    detection: np.ndarray
    by_twist: np.ndarray
    weighted: Mapping[int, np.ndarray]


def offset_columns(
    problem: Problem,
    x: np.ndarray,
    sigmas: Sequence[np.ndarray],
    loss: str,
    sensors: Sequence[str],
) -> List[OffsetColumn]:
    """Return the columns of some sensors' offsets at the vector x; of those that have rows."""
    if not sensors:
        return []
    poses = problem.poses(x)
    columns = []
    for sensor in sensors:
        curvature, slope = 0.0, 0.0
        by_twist, weighted = np.zeros((len(poses), TWIST_SIZE)), {}
        for i, (block, sigma) in enumerate(zip(problem.residual_blocks, sigmas)):
            if block.sensor != sensor or not isinstance(block, RangeBlock):
                continue
            residual, jacobian = block.linearise(poses)
            derivative = UNIT_M * block.by_range_offset(poses)
            weight = losses.weight(loss, squared_norms(residual, sigma)) / sigma**2
            weighted[i] = weight * derivative
            curvature += float(weighted[i] @ derivative)
            slope += float(weighted[i] @ residual[:, 0])
            np.add.at(by_twist, block.detection, weighted[i][:, None] * jacobian[:, 0])
        if curvature > 0:
            detection = np.arange(len(poses))
            columns.append(OffsetColumn(sensor, curvature, slope, detection, by_twist, weighted))
    return columns


def apply_range_offsets(solver: Solver, sensors: Sequence[str], offsets: np.ndarray) -> None:
    """Let a solver go on with other range offsets (s,), in units of UNIT_M."""
    if len(sensors):
        solver.take_range_offsets(solver.problem.with_range_offsets(in_metres(sensors, offsets)))


def in_metres(sensors: Sequence[str], offsets: np.ndarray) -> Dict[str, float]:
    """Return offsets (s,) in units of UNIT_M by sensor, in metres."""
    return {name: float(UNIT_M * value) for name, value in zip(sensors, offsets)}


def within_reason(offsets: np.ndarray) -> np.ndarray:
    """Return offsets (s,), in units of UNIT_M, cut off at half a metre."""
    return np.clip(offsets, -_MOST_M / UNIT_M, _MOST_M / UNIT_M)
