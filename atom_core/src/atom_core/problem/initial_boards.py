"""Initial board poses from whatever sensor sees the board.

Cameras: PnP, with both solutions of the planar ambiguity. Range sensors: the plane of the
points and the outline of the limit points, with the symmetric poses of a rectangle. Every
candidate is judged by all sensors that see the same board, so that one sensor's ambiguity is
settled by the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Dict, List, Mapping, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.pattern import BoardKey
from atom_core.problem.blocks import PATTERN
from atom_core.problem.corner_measurement import M_PER_PX
from atom_core.problem.measurements import Measurement
from atom_core.problem.problem import Problem
from atom_core.problem.range_measurement import POINTS_LOOKED_AT
from atom_core.problem.residuals import ORTHOGONAL, REPROJECTION

GUESSED_M, SOLVED_M = 0.1, 0.05  # errors to expect while sensors are guesses, and after a solve
_CANDIDATE_SENSORS, _JUDGING_SENSORS = 8, 12
_GOOD_ENOUGH = 0.05  # mean misfit of a detection that needs no second look


View = Tuple[Measurement, np.ndarray]  # a detection and sensor_T_parent (4, 4) of its board


def misfit(measurement: Measurement, sensor_T_pattern: np.ndarray, expected_m: float) -> float:
    """Return how badly a pose explains a detection: 0 is perfect, 1 hopeless.

    Args:
        measurement: the detection.
        sensor_T_pattern: (4, 4).
        expected_m: the size of error that is nothing unusual.
    """
    return float(misfits(measurement, sensor_T_pattern, expected_m))


def misfits(
    measurement: Measurement, sensor_T_patterns: np.ndarray, expected_m: float
) -> np.ndarray:
    """Return how badly poses (..., 4, 4) explain a detection, (...), each as `misfit`."""
    squares = (measurement.errors_m(sensor_T_patterns) / expected_m) ** 2
    return np.asarray(np.mean(squares / (1.0 + squares), axis=-1))


@dataclass(frozen=True)
class Placement:
    """Where sensors and boards' parents are believed to be.

    Attributes:
        world_T_sensor: data frames (4, 4) by (collection, sensor).
        world_T_parent: parent frames of the patterns (4, 4) by (collection, pattern).
    """

    world_T_sensor: Mapping[Tuple[str, str], np.ndarray]
    world_T_parent: Mapping[Tuple[str, str], np.ndarray]

    def sensor_T_parent(self, m: Measurement) -> np.ndarray:
        """Return the pose (4, 4) of the pattern's parent in the sensor's data frame."""
        sensor_T_world = se3.inverse(self.world_T_sensor[(m.key.collection, m.key.sensor)])
        return sensor_T_world @ self.world_T_parent[(m.key.collection, m.key.pattern)]


def estimate_boards(
    measurements: Sequence[Measurement],
    fixed_patterns: Sequence[str],
    placement: Placement,
    known: Mapping[BoardKey, np.ndarray] = MappingProxyType({}),
) -> Dict[BoardKey, np.ndarray]:
    """Return ``parent_T_pattern`` (4, 4) of every board that some sensor can place.

    Args:
        measurements: all detections.
        fixed_patterns: names of patterns with one pose for all collections.
        placement: where the sensors are guessed to be.
        known: poses of boards as solved before; taken where they are good enough.
    """
    estimates = {}
    for key, seen in _by_board(measurements, fixed_patterns).items():
        if key in known:
            now = _total_misfit(_views(seen, placement), known[key], SOLVED_M)
            if now < _GOOD_ENOUGH * len(seen):
                estimates[key] = known[key]
                continue
        proposals = _proposals(seen, placement)
        if proposals:
            judges = sorted(seen, key=lambda m: m.information, reverse=True)[:_JUDGING_SENSORS]
            best, _ = _best_explaining(_views(judges, placement), proposals, GUESSED_M)
            estimates[key] = proposals[best]
    return estimates


def doubtful_boards(problem: Problem, squares: Sequence[np.ndarray]) -> List[int]:
    """Return the indices of the parameter blocks of boards that deserve a second look.

    All detections are judged at once, as ``misfit`` does it one by one.

    Args:
        problem: whose boards.
        squares: for each residual block, (n,) squared residuals in its unit, after a solve.
    """
    total, count = np.zeros(len(problem.detections)), np.zeros(len(problem.detections))
    for block, square in zip(problem.residual_blocks, squares):
        scale = M_PER_PX if block.kind == REPROJECTION else 1.0
        scaled = square * (scale / SOLVED_M) ** 2
        detection, value = block.detection, scaled / (1.0 + scaled)
        if block.kind == ORTHOGONAL:
            step = np.maximum(np.bincount(detection) // POINTS_LOOKED_AT, 1)
            looked_at = block.ids % step[detection] == 0
            detection, value = detection[looked_at], value[looked_at]
        total += np.bincount(detection, value, len(total))
        count += np.bincount(detection, minlength=len(total))
    blocks = problem.parameters.blocks
    is_board = np.array([block.kind == PATTERN for block in blocks] + [False])
    chains = np.where(is_board[problem.chains.block], problem.chains.block, -1)
    board, placed = np.max(chains, axis=1, initial=-1), np.max(chains, axis=1, initial=-1) >= 0
    misfits = np.bincount(board[placed], (total / count)[placed], len(blocks))
    seen = np.bincount(board[placed], minlength=len(blocks))
    return [int(i) for i in np.flatnonzero((seen > 0) & ~(misfits < _GOOD_ENOUGH * seen))]


def better_boards(
    measurements: Sequence[Measurement],
    fixed_patterns: Sequence[str],
    placement: Placement,
    boards: Mapping[BoardKey, np.ndarray],
) -> Dict[BoardKey, np.ndarray]:
    """Return other poses for boards that stand wrong, now that the sensors are better known.

    A board that began in the mirrored solution of its plane stays there in a local minimum. It
    is found by a candidate that explains its detections at least twice as well.
    """
    better = {}
    for key, seen in _by_board(measurements, fixed_patterns).items():
        views = _views(seen, placement)
        now = _total_misfit(views, boards[key], SOLVED_M)
        if now < _GOOD_ENOUGH * len(seen):
            continue
        proposals = _proposals(seen, placement)
        best, least = _best_explaining(views, proposals, SOLVED_M)
        if least < 0.5 * now:
            better[key] = proposals[best]
    return better


def _by_board(
    measurements: Sequence[Measurement], fixed_patterns: Sequence[str]
) -> Dict[BoardKey, List[Measurement]]:
    boards: Dict[BoardKey, List[Measurement]] = {}
    for m in measurements:
        collection = None if m.key.pattern in fixed_patterns else m.key.collection
        boards.setdefault((m.key.pattern, collection), []).append(m)
    return boards


def _views(seen: Sequence[Measurement], placement: Placement) -> List[View]:
    return [(m, placement.sensor_T_parent(m)) for m in seen]


def _total_misfit(views: Sequence[View], parent_T_pattern: np.ndarray, expected_m: float) -> float:
    """Return the sum of misfits."""
    return sum(
        misfit(m, sensor_T_parent @ parent_T_pattern, expected_m) for m, sensor_T_parent in views
    )


def _best_explaining(
    views: Sequence[View], proposals: Sequence[np.ndarray], expected_m: float
) -> Tuple[int, float]:
    """Return which pose has the least total misfit, and that; infinity if there is no pose."""
    if not proposals:
        return 0, np.inf
    poses, total = np.array(proposals), np.zeros(len(proposals))
    left = np.arange(len(proposals))
    for number, (m, sensor_T_parent) in enumerate(views, 1):
        found = misfits(m, sensor_T_parent @ poses[left], expected_m)
        total[left] += np.where(np.isnan(found), np.inf, found)
        # A view adds one at most: what is farther behind the best cannot catch up.
        reachable = np.min(total[left]) + (len(views) - number)
        left = left[total[left] <= reachable]
    best = int(left[np.argmin(total[left])])
    return best, float(total[best])


def _proposals(seen: Sequence[Measurement], placement: Placement) -> List[np.ndarray]:
    """Return candidate poses in the parent: of detections that identify it, else of all."""
    telling = [m for m in seen if m.identifies_board]
    return _propose(telling, placement) or _propose(seen, placement)


def _propose(measurements: Sequence[Measurement], placement: Placement) -> List[np.ndarray]:
    proposals: List[np.ndarray] = []
    proposing = 0
    for m in sorted(measurements, key=lambda m: m.information, reverse=True):
        candidates = m.candidates()
        parent_T_sensor = se3.inverse(placement.sensor_T_parent(m))
        proposals += [parent_T_sensor @ sensor_T_pattern for sensor_T_pattern in candidates]
        proposing += bool(candidates)
        if proposing == _CANDIDATE_SENSORS:
            break
    return proposals
