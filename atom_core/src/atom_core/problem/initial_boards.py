"""Initial board poses from whatever sensor sees the board.

Cameras: PnP, with both solutions of the planar ambiguity. Range sensors: the plane of the
points and the outline of the limit points, with the symmetric poses of a rectangle. Every
candidate is judged by all sensors that see the same board, so that one sensor's ambiguity is
settled by the others.
"""

from __future__ import annotations

from typing import Dict, List, Mapping, Optional, Sequence, Tuple

import cv2
import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.plane import fit_plane, plane_basis
from atom_core.geometry.rectangle import Rectangle
from atom_core.problem.measurements import CornerMeasurement, Measurement, RangeMeasurement

_MIN_CORNERS = 6
_JUDGE_PX, _JUDGE_M = 30.0, 0.1  # generous: the sensors' own poses are only guesses
_CANDIDATE_SENSORS = 8

BoardKey = Tuple[str, Optional[str]]  # pattern, collection (None for a fixed pattern)
World_T_Sensor = Mapping[Tuple[str, str], np.ndarray]  # by (collection, sensor)


def board_candidates(measurement: Measurement) -> List[np.ndarray]:
    """Return the poses ``sensor_T_pattern`` (4, 4) that one detection alone allows."""
    if isinstance(measurement, CornerMeasurement):
        return camera_candidates(measurement)
    return range_candidates(measurement)


def camera_candidates(measurement: CornerMeasurement) -> List[np.ndarray]:
    """Return the solutions of planar PnP, the better one first; none if the corners are few.

    Collins, Bartoli, "Infinitesimal plane-based pose estimation" (IJCV 2014), by OpenCV.
    """
    corners = measurement.corners_in_pattern
    if len(corners) < _MIN_CORNERS or _on_a_line(corners[:, :2]):
        return []
    rays = measurement.camera.normalise(measurement.pixels)
    centre = corners.mean(axis=0)  # IPPE wants points around the origin
    found, rotations, translations, _ = cv2.solvePnPGeneric(
        (corners - centre).reshape(-1, 1, 3),
        rays.reshape(-1, 1, 2),
        np.eye(3),
        np.zeros(5),
        flags=cv2.SOLVEPNP_IPPE,
    )
    candidates = []
    for rotation, translation in zip(rotations[:found], translations[:found]):
        pose = se3.transform(
            se3.rotation_from_rotation_vector(rotation.ravel()), translation.ravel()
        )
        pose[:3, 3] -= pose[:3, :3] @ centre
        if np.all(np.isfinite(pose)) and np.all(se3.apply(pose, corners)[:, 2] > 0):
            candidates.append(pose)
    return candidates


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


def misfit(measurement: Measurement, sensor_T_pattern: np.ndarray) -> float:
    """Return how badly a pose explains a detection: 0 is perfect, 1 hopeless."""
    if isinstance(measurement, CornerMeasurement):
        points = se3.apply(sensor_T_pattern, measurement.corners_in_pattern)
        error = np.linalg.norm(measurement.camera.project(points) - measurement.pixels, axis=1)
        squares = (error / _JUDGE_PX) ** 2
    else:
        pattern_T_sensor = se3.inverse(sensor_T_pattern)
        step = max(len(measurement.inside) // 200, 1)
        height = se3.apply(pattern_T_sensor, measurement.inside[::step])[:, 2]
        limit = se3.apply(pattern_T_sensor, measurement.limit)[:, :2]
        distance, _ = measurement.border.signed_distance(limit)
        squares = (np.concatenate([height, distance]) / _JUDGE_M) ** 2
    return float(np.mean(squares / (1.0 + squares)))


def estimate_boards(
    measurements: Sequence[Measurement],
    fixed_patterns: Sequence[str],
    world_T_sensor: World_T_Sensor,
    world_T_parent: Mapping[Tuple[str, str], np.ndarray],
) -> Dict[BoardKey, np.ndarray]:
    """Return ``parent_T_pattern`` (4, 4) of every board that some sensor allows to place.

    Args:
        measurements: all detections.
        fixed_patterns: names of patterns with one pose for all collections.
        world_T_sensor: data frames of the sensors as they are believed to be.
        world_T_parent: the patterns' parent frames, by (collection, pattern).
    """
    boards: Dict[BoardKey, List[Measurement]] = {}
    for m in measurements:
        collection = None if m.key.pattern in fixed_patterns else m.key.collection
        boards.setdefault((m.key.pattern, collection), []).append(m)
    estimates = {}
    for key, seen in boards.items():
        pose = _best_pose(seen, world_T_sensor, world_T_parent)
        if pose is not None:
            estimates[key] = pose
    return estimates


def _best_pose(
    seen: Sequence[Measurement], world_T_sensor: World_T_Sensor, world_T_parent
) -> Optional[np.ndarray]:
    cameras = [m for m in seen if isinstance(m, CornerMeasurement)]
    proposals = _propose(cameras, world_T_sensor, world_T_parent)
    if not proposals:
        proposals = _propose(seen, world_T_sensor, world_T_parent)
    if not proposals:
        return None

    def judge(parent_T_pattern: np.ndarray) -> float:
        total = 0.0
        for m in seen:
            sensor_T_parent = _sensor_T_parent(m, world_T_sensor, world_T_parent)
            total += misfit(m, sensor_T_parent @ parent_T_pattern)
        return total

    return min(proposals, key=judge)


def _propose(measurements, world_T_sensor, world_T_parent) -> List[np.ndarray]:
    proposals: List[np.ndarray] = []
    proposing = 0
    for m in sorted(measurements, key=_information, reverse=True):
        candidates = board_candidates(m)
        parent_T_sensor = se3.inverse(_sensor_T_parent(m, world_T_sensor, world_T_parent))
        proposals += [parent_T_sensor @ sensor_T_pattern for sensor_T_pattern in candidates]
        proposing += bool(candidates)
        if proposing == _CANDIDATE_SENSORS:
            break
    return proposals


def _information(measurement: Measurement) -> int:
    if isinstance(measurement, CornerMeasurement):
        return len(measurement.ids)
    return len(measurement.limit)


def _sensor_T_parent(m: Measurement, world_T_sensor, world_T_parent) -> np.ndarray:
    sensor_T_world = se3.inverse(world_T_sensor[(m.key.collection, m.key.sensor)])
    return sensor_T_world @ world_T_parent[(m.key.collection, m.key.pattern)]


def _on_a_line(points: np.ndarray) -> bool:
    singular = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(singular[1] < 1e-6 * max(singular[0], 1e-12))
