"""Initial board poses from whatever sensor sees the board.

Cameras: PnP, with both solutions of the planar ambiguity. Range sensors: the plane of the
points and the outline of the limit points, with the symmetric poses of a rectangle. Every
candidate is judged by all sensors that see the same board, so that one sensor's ambiguity is
settled by the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, List, Mapping, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.plane import fit_plane, plane_basis
from atom_core.geometry.pose_solvers import planar_poses
from atom_core.geometry.rectangle import Rectangle
from atom_core.model.pattern import BoardKey
from atom_core.problem.blocks import PATTERN
from atom_core.problem.measurements import CornerMeasurement, Measurement, RangeMeasurement
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import ORTHOGONAL, REPROJECTION

_MIN_CORNERS = 6
_JUDGE_M_PER_PX = 0.1 / 30.0  # how metres and pixels are weighed against each other
GUESSED_M, SOLVED_M = 0.1, 0.05  # errors to expect while sensors are guesses, and after a solve
_CANDIDATE_SENSORS, _JUDGING_SENSORS = 8, 12
_POINTS_LOOKED_AT = 200  # of a detection's points on the board
_GOOD_ENOUGH = 0.05  # mean misfit of a detection that needs no second look


def board_candidates(measurement: Measurement) -> List[np.ndarray]:
    """Return the poses ``sensor_T_pattern`` (4, 4) that one detection alone allows."""
    if isinstance(measurement, CornerMeasurement):
        return camera_candidates(measurement)
    return range_candidates(measurement)


def camera_candidates(measurement: CornerMeasurement) -> List[np.ndarray]:
    """Return the solutions of planar PnP, the better one first; none if the corners are few."""
    corners = measurement.corners_in_pattern
    if len(corners) < _MIN_CORNERS or _on_a_line(corners[:, :2]):
        return []
    poses = planar_poses(corners, measurement.camera.normalise(measurement.pixels))
    return [
        pose
        for pose in poses
        if np.all(np.isfinite(pose)) and np.all(se3.apply(pose, corners)[:, 2] > 0)
    ]


def range_candidates(measurement: RangeMeasurement) -> List[np.ndarray]:
    """Return the four poses of a rectangle that fit plane and outline equally well."""
    try:
        centroid, normal, _ = fit_plane(measurement.inside)
    except ValueError:
        return []
    sensor_T_plane = se3.transform(plane_basis(normal), centroid)
    flat = se3.apply(se3.inverse(sensor_T_plane), measurement.inside)[:, :2]
    limit = se3.apply(se3.inverse(sensor_T_plane), measurement.limit)[:, :2]
    outline = limit if len(limit) >= 4 else flat
    plane_T_board = _fit_rectangle(outline, flat, measurement.border)
    half_turns = [np.diag([1.0, 1, 1]), np.diag([-1.0, -1, 1])]
    flips = [np.diag([1.0, 1, 1]), np.diag([1.0, -1, -1])]
    board_T_pattern = np.eye(4)
    board_T_pattern[:2, 3] = -measurement.border.centre
    return [
        sensor_T_plane @ plane_T_board @ se3.transform(turn @ flip, np.zeros(3)) @ board_T_pattern
        for turn in half_turns
        for flip in flips
    ]


def _fit_rectangle(outline: np.ndarray, inside: np.ndarray, border: Rectangle) -> np.ndarray:
    """Return ``plane_T_board`` (4, 4), origin in the board's centre, of the best orientation."""
    best_cost, best_pose = np.inf, np.eye(4)
    for angle in np.deg2rad(np.arange(0.0, 180.0, 4.0)):
        plane_R_board = se3.rotation_from_rotation_vector(np.array([0.0, 0.0, angle]))
        board_R_plane = plane_R_board[:2, :2].T
        turned, turned_inside = outline @ board_R_plane.T, inside @ board_R_plane.T
        low, high = turned_inside.min(axis=0), turned_inside.max(axis=0)
        centre = (low + high) / 2.0
        half = border.half_size
        around = Rectangle(*(centre - half), *(centre + half))
        distance, _ = around.signed_distance(turned)
        cost = np.mean(np.minimum(distance**2, (0.5 * half.min()) ** 2))
        cost += 4.0 * np.sum(np.maximum((high - low) / 2.0 - half, 0.0) ** 2)
        if cost < best_cost:
            best_cost = cost
            move = plane_R_board @ np.array([centre[0], centre[1], 0.0])
            best_pose = se3.transform(plane_R_board, move)
    return best_pose


def misfit(measurement: Measurement, sensor_T_pattern: np.ndarray, expected_m: float) -> float:
    """Return how badly a pose explains a detection: 0 is perfect, 1 hopeless.

    Args:
        measurement: the detection.
        sensor_T_pattern: (4, 4).
        expected_m: the size of error that is nothing unusual.
    """
    if isinstance(measurement, CornerMeasurement):
        points = se3.apply(sensor_T_pattern, measurement.corners_in_pattern)
        error = np.linalg.norm(measurement.camera.project(points) - measurement.pixels, axis=1)
        errors = error * _JUDGE_M_PER_PX
    else:
        pattern_T_sensor = se3.inverse(sensor_T_pattern)
        step = max(len(measurement.inside) // _POINTS_LOOKED_AT, 1)
        height = se3.apply(pattern_T_sensor, measurement.inside[::step])[:, 2]
        limit = se3.apply(pattern_T_sensor, measurement.limit)[:, :2]
        errors = np.concatenate([height, measurement.border.signed_distance(limit)[0]])
    squares = (errors / expected_m) ** 2
    return float(np.mean(squares / (1.0 + squares)))


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
    measurements: Sequence[Measurement], fixed_patterns: Sequence[str], placement: Placement
) -> Dict[BoardKey, np.ndarray]:
    """Return ``parent_T_pattern`` (4, 4) of every board that some sensor allows to place.

    Args:
        measurements: all detections.
        fixed_patterns: names of patterns with one pose for all collections.
        placement: where the sensors are guessed to be.
    """
    estimates = {}
    for key, seen in _by_board(measurements, fixed_patterns).items():
        proposals = _proposals(seen, placement)
        if proposals:
            judges = sorted(seen, key=_information, reverse=True)[:_JUDGING_SENSORS]
            estimates[key] = min(
                proposals, key=lambda pose: _total_misfit(judges, pose, placement, GUESSED_M)
            )
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
        scale = _JUDGE_M_PER_PX if block.kind == REPROJECTION else 1.0
        scaled = square * (scale / SOLVED_M) ** 2
        detection, value = block.detection, scaled / (1.0 + scaled)
        if block.kind == ORTHOGONAL:
            step = np.maximum(np.bincount(detection) // _POINTS_LOOKED_AT, 1)
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
        now = _total_misfit(seen, boards[key], placement, SOLVED_M)
        if now < _GOOD_ENOUGH * len(seen):
            continue
        proposals = _proposals(seen, placement)
        costs = [_total_misfit(seen, pose, placement, SOLVED_M) for pose in proposals]
        if costs and min(costs) < 0.5 * now:
            better[key] = proposals[int(np.argmin(costs))]
    return better


def _by_board(
    measurements: Sequence[Measurement], fixed_patterns: Sequence[str]
) -> Dict[BoardKey, List[Measurement]]:
    boards: Dict[BoardKey, List[Measurement]] = {}
    for m in measurements:
        collection = None if m.key.pattern in fixed_patterns else m.key.collection
        boards.setdefault((m.key.pattern, collection), []).append(m)
    return boards


def _total_misfit(
    seen: Sequence[Measurement],
    parent_T_pattern: np.ndarray,
    placement: Placement,
    expected_m: float,
) -> float:
    return sum(misfit(m, placement.sensor_T_parent(m) @ parent_T_pattern, expected_m) for m in seen)


def _proposals(seen: Sequence[Measurement], placement: Placement) -> List[np.ndarray]:
    """Return candidate poses in the parent: the cameras', or else the range sensors'."""
    cameras = [m for m in seen if isinstance(m, CornerMeasurement)]
    return _propose(cameras, placement) or _propose(seen, placement)


def _propose(measurements: Sequence[Measurement], placement: Placement) -> List[np.ndarray]:
    proposals: List[np.ndarray] = []
    proposing = 0
    for m in sorted(measurements, key=_information, reverse=True):
        candidates = board_candidates(m)
        parent_T_sensor = se3.inverse(placement.sensor_T_parent(m))
        proposals += [parent_T_sensor @ sensor_T_pattern for sensor_T_pattern in candidates]
        proposing += bool(candidates)
        if proposing == _CANDIDATE_SENSORS:
            break
    return proposals


def _information(measurement: Measurement) -> int:
    if isinstance(measurement, CornerMeasurement):
        return len(measurement.ids)
    return len(measurement.limit)


def _on_a_line(points: np.ndarray) -> bool:
    singular = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(singular[1] < 1e-6 * max(singular[0], 1e-12))
