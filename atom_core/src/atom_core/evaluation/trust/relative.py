"""The pose of one sensor in another by a calibration, with its covariance."""

from __future__ import annotations

from typing import Callable, NamedTuple

import numpy as np

from atom_core.calibration.calibrate import Calibration
from atom_core.calibration.judge.weak_directions import edge_covariance
from atom_core.geometry import se3
from atom_core.model.dataset import Collection, pose
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import BLOCK_SIZE, ROTATION, TRANSLATION

_STEP = 1e-6  # of a rotation vector [rad] and of a translation [m]


class RelativePose(NamedTuple):
    """``target_T_source`` (4, 4), and the covariance (6, 6) of its turn [rad] and shift [m].

    Both about and along the target's axes, the turn about the source's origin.
    """

    target_T_source: np.ndarray
    covariance: np.ndarray


def relative_pose(calibration: Calibration, target: str, source: str) -> RelativePose:
    """Return where a calibration has one sensor in another.

    Edges that are estimated count as independent of one another; one of the two is best held.

    Args:
        calibration: of both sensors.
        target: in whose data frame.
        source: whose data frame.
    """
    dataset, graph = calibration.dataset, calibration.dataset.graph
    first = next(iter(dataset.collections.values()))
    frames = dataset.sensors[target].frame, dataset.sensors[source].frame
    now = pose(first, graph, *frames)
    covariance = np.zeros((BLOCK_SIZE, BLOCK_SIZE))
    parameters = calibration.problem.parameters
    for i, block in parameters.pose_blocks():
        if block.collection is not None or block.edge not in first.transforms:
            continue
        x = calibration.summary.x[parameters.slice_of(i)]
        own = edge_covariance(block, x, calibration.covariance.block(i))

        def at(numbers: np.ndarray, edge: Edge = block.edge) -> np.ndarray:
            return pose(_with_edge(first, edge, numbers), graph, *frames)

        slope = jacobian(at, now)
        covariance += slope @ own @ slope.T
    return RelativePose(now, covariance)


def jacobian(function: Callable[[np.ndarray], np.ndarray], now: np.ndarray) -> np.ndarray:
    """Return (6, n): the turn and shift of a pose by the numbers (6,) of its function at zero."""
    columns = []
    for i in range(BLOCK_SIZE):
        step = np.zeros(BLOCK_SIZE)
        step[i] = _STEP
        columns.append(difference(now, function(step)) / _STEP)
    return np.array(columns).T


def difference(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return (6,) the turn [rad] and the shift [m] from one pose to another, in outer axes."""
    turn = se3.rotation_vector_from_rotation(other[:3, :3] @ one[:3, :3].T)
    return np.concatenate([turn, other[:3, 3] - one[:3, 3]])


def stepped(pose_before: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Return a pose (4, 4) after a turn about its own origin and a shift (6,), in outer axes."""
    turn = se3.rotation_from_rotation_vector(numbers[ROTATION])
    return se3.transform(turn @ pose_before[:3, :3], pose_before[:3, 3] + numbers[TRANSLATION])


def _with_edge(collection: Collection, edge: Edge, numbers: np.ndarray) -> Collection:
    moved = {**collection.transforms, edge: stepped(collection.transforms[edge], numbers)}
    return Collection(collection.key, {}, moved)


def largest_in_sigmas(numbers: np.ndarray, covariance: np.ndarray) -> float:
    """Return the largest of some numbers (n,) in its standard deviation."""
    sigma = np.sqrt(np.maximum(np.diagonal(covariance), 1e-18))
    return float(np.max(np.abs(numbers) / sigma))
