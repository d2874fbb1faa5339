"""What a 3D LiDAR sees and labels: beams on the boards, and the room behind them."""

from __future__ import annotations

from typing import Dict, List, Mapping, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.labels import RangeLabel
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import Sensor
from atom_core.synthetic.board import board_hits, centre_in_sensor, facing, is_dark
from atom_core.synthetic.lidar_models import AnyLidarModel
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.planted import RangeErrors
from atom_core.synthetic.realism import Realism
from atom_core.synthetic.rig import Rig
from atom_core.synthetic.sensing import Outlook, View

LARGEST_ANGLE_DEG = 80.0  # between the beam and the board's normal
LEAST_RINGS = 3
LEAST_POINTS = 30
MIXED_LABELED_M = 0.03  # a return farther from a board, for the sake of what is behind, is not it


def beams_on_board(
    model: AnyLidarModel, lidar_T_pattern: np.ndarray, pattern: Pattern
) -> Tuple[np.ndarray, np.ndarray]:
    """Return the ids (n,) of the beams that hit a board, in order, and their ranges (n,) [m]."""
    centre = centre_in_sensor(lidar_T_pattern, pattern.border)
    distance, radius = np.linalg.norm(centre), np.linalg.norm(pattern.border.half_size)
    candidates = np.arange(len(model.directions))
    if distance > radius:  # only beams in the cone around the board can hit it
        cosine = np.sqrt(1.0 - (radius / distance) ** 2)
        candidates = np.flatnonzero(model.directions @ (centre / distance) >= cosine)
    ranges, _ = board_hits(lidar_T_pattern, pattern, model.directions[candidates])
    good = (ranges >= model.range_m[0]) & (ranges <= model.range_m[1])
    return candidates[good], ranges[good]


def is_detected(
    model: AnyLidarModel, beams: np.ndarray, lidar_T_pattern: np.ndarray, pattern: Pattern
) -> bool:
    """Tell whether the beams on a board suffice for a label."""
    if abs(facing(lidar_T_pattern, pattern.border)) < np.cos(np.radians(LARGEST_ANGLE_DEG)):
        return False
    rings = len(np.unique(beams // model.azimuth_steps))
    return len(beams) >= LEAST_POINTS and (rings >= LEAST_RINGS or not model.has_layers)


def first_and_last(model: AnyLidarModel, beams: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Return the first and the last beam (m,) of each ring, as seen from the board's middle.

    Args:
        model: the LiDAR.
        beams: (n,) ids of the beams on the board.
        centre: (3,) middle of the board in the LiDAR's frame; azimuths are counted from there,
            so that a board across the seam of the scan is one piece.
    """
    steps = model.azimuth_steps
    middle = int((np.arctan2(centre[1], centre[0]) + np.pi) * steps / (2.0 * np.pi))
    ring, azimuth = np.divmod(beams, steps)
    order = np.lexsort(((azimuth - middle + steps // 2) % steps, ring))
    sorted_ring = ring[order]
    first = np.flatnonzero(np.diff(sorted_ring, prepend=-1))
    last = np.append(first[1:], len(order)) - 1
    ends = np.concatenate([first, last])
    return np.unique(beams[order[ends]])


def outermost(
    model: AnyLidarModel, beams: np.ndarray, lidar_T_pattern: np.ndarray, pattern: Pattern
) -> np.ndarray:
    """Return the beams (m,) on a board that are about its border.

    Of a scan layer they are the first and the last; without layers all that are nearer to the
    border than beams are to each other.
    """
    if model.has_layers:
        return first_and_last(model, beams, centre_in_sensor(lidar_T_pattern, pattern.border))
    ranges, in_plane = board_hits(lidar_T_pattern, pattern, model.directions[beams])
    spacing_m = np.sqrt(4.0 * np.prod(pattern.border.half_size) / max(len(beams), 1))
    return beams[pattern.border.signed_distance(in_plane)[0] > -spacing_m]


def observe(view: View) -> Dict[str, RangeLabel]:
    """Return the labels of the boards in a cloud, and keep the cloud."""
    cloud, labels = _scan(view)
    view.data.add(view.collection, view.sensor.name, cloud)
    return labels


def _scan(view: View) -> Tuple[np.ndarray, Dict[str, RangeLabel]]:
    """Return the cloud (n, 3) [m] in the LiDAR's frame and the labels of the boards in it.

    The cloud is in the order of the beams; of the room it holds every ``background_step``-th
    return. With ``exact_border`` the limit points are moved onto the board's true border.
    ``errors_rng`` draws which returns from dark squares are lost.
    """
    model, patterns = view.rig.lidars[view.sensor.name], view.patterns
    lidar_T_patterns = view.sensor_T_patterns
    errors = view.errors if isinstance(view.errors, RangeErrors) else RangeErrors()
    nearest, step = np.full(len(model.directions), np.inf), view.sampling.background_step
    walls = _walls(view, model.directions[::step])
    in_range = (walls >= model.range_m[0]) & (walls <= model.range_m[1])
    nearest[::step] = np.where(in_range, walls, np.inf)
    seen: Dict[str, np.ndarray] = {}
    for name, lidar_T_pattern in lidar_T_patterns.items():
        beams, ranges = beams_on_board(model, lidar_T_pattern, patterns[name])
        kept = (view.rng.random(len(beams)) >= view.noise.dropout) & (ranges < nearest[beams])
        nearest[beams[kept]] = ranges[kept]
        seen = {other: np.setdiff1d(ids, beams[kept]) for other, ids in seen.items()}
        seen[name] = beams[kept]
    error_m = np.zeros(len(nearest))
    if errors != RangeErrors():
        seen, error_m = _spoil(view, errors, seen, nearest)
    returned = np.flatnonzero(np.isfinite(nearest))
    points = model.directions[returned] * nearest[returned, None]
    labels: Dict[str, RangeLabel] = {}
    for name, beams in seen.items():
        lidar_T_pattern, pattern = lidar_T_patterns[name], patterns[name]
        if is_detected(model, beams, lidar_T_pattern, pattern):
            limit = outermost(model, beams, lidar_T_pattern, pattern)
            limit = np.searchsorted(returned, limit)
            labels[name] = RangeLabel(np.searchsorted(returned, beams), limit)
            if view.sampling.exact_border:
                points[limit] = _moved_to_border(points[limit], lidar_T_pattern, pattern)
    errors_m = error_m[returned]
    spoiled = _with_noise(points, list(labels.values()), view.noise, view.rng, errors_m)
    return view.noise.round(spoiled), labels


def _walls(view: View, directions: np.ndarray) -> np.ndarray:
    """Return the ranges (n,) [m] of the room along directions (n, 3) in the LiDAR's frame."""
    world_T_lidar = view.world_T_sensor
    return view.rig.room.distance(world_T_lidar[:3, 3], directions @ world_T_lidar[:3, :3].T)


def _spoil(
    view: View, errors: RangeErrors, seen: Mapping[str, np.ndarray], nearest: np.ndarray
) -> Tuple[Dict[str, np.ndarray], np.ndarray]:
    """Return the beams that a labeler takes for those on each board, and how long beams read.

    Args:
        view: what the LiDAR has before it.
        errors: what is planted.
        seen: beams on each board.
        nearest: (beams,) true ranges [m]; those of lost returns become infinite.

    Returns:
        Beams by board, and (beams,) by how much each reads long [m].
    """
    model, rng = view.rig.lidars[view.sensor.name], view.errors_rng
    labeled, error_m = {}, np.zeros(len(nearest))
    returned = np.flatnonzero(np.isfinite(nearest))
    rings = returned // model.azimuth_steps
    error_m[returned] = errors.error_m(nearest[returned], rings)
    for name, beams in seen.items():
        lidar_T_pattern, pattern = view.sensor_T_patterns[name], view.patterns[name]
        points = model.directions[beams] * nearest[beams, None]
        in_pattern = se3.apply(se3.inverse(lidar_T_pattern), points)
        dark = is_dark(lidar_T_pattern, pattern, in_pattern[:, :2])
        error_m[beams] += errors.dark_offset_m * dark
        lost = np.zeros(len(beams), dtype=bool)
        if errors.dark_lost > 0:
            lost = dark & (rng.random(len(beams)) < errors.dark_lost)
        missing = _share_beside(lidar_T_pattern, pattern, points, errors.divergence_rad)
        mixed_m = missing * (_walls(view, model.directions[beams]) - nearest[beams])
        error_m[beams] += mixed_m
        nearest[beams[lost]] = np.inf
        labeled[name] = beams[~lost & (np.abs(mixed_m) < MIXED_LABELED_M)]
    return labeled, error_m


def _share_beside(
    lidar_T_pattern: np.ndarray, pattern: Pattern, points: np.ndarray, divergence_rad: float
) -> np.ndarray:
    """Return which share (n,) of beams that hit a board at ``points`` (n, 3) falls beside it."""
    if divergence_rad == 0.0:
        return np.zeros(len(points))
    on_border = _moved_to_border(points, lidar_T_pattern, pattern)
    ranges = np.linalg.norm(points, axis=1)
    beside = np.linalg.norm(np.cross(points / ranges[:, None], on_border), axis=1)
    return np.clip(0.5 - beside / (divergence_rad * ranges), 0.0, 1.0)


def _moved_to_border(
    points: np.ndarray, lidar_T_pattern: np.ndarray, pattern: Pattern
) -> np.ndarray:
    in_pattern = se3.apply(se3.inverse(lidar_T_pattern), points)
    distance, outward = pattern.border.signed_distance(in_pattern[:, :2])
    in_pattern[:, :2] -= distance[:, None] * outward
    return se3.apply(lidar_T_pattern, in_pattern)


def _with_noise(
    points: np.ndarray,
    labels: List[RangeLabel],
    noise: Noise,
    rng: np.random.Generator,
    error_m: np.ndarray,
) -> np.ndarray:
    """Return the points with noise along their beams, gross errors only on labeled ones.

    ``error_m`` (n,) is by how much they read long beside that.
    """
    error = error_m + noise.lidar_m * rng.standard_normal(len(points))
    for label in labels:
        error[label.indices] += noise.gross_range_errors(len(label.indices), rng)
    ranges = np.linalg.norm(points, axis=1)
    return points * (1.0 + error / ranges)[:, None]


def outlook(rig: Rig, sensor: Sensor, lidar_T_pattern: np.ndarray, pattern: Pattern) -> Outlook:
    """Tell what a LiDAR would make of a board."""
    model = rig.lidars[sensor.name]
    beams, _ = beams_on_board(model, lidar_T_pattern, pattern)
    seen = is_detected(model, beams, lidar_T_pattern, pattern)
    return Outlook(seen, False, len(beams) if seen else 0)


def errors(
    realism: Realism, _: Sensor, model: AnyLidarModel, rng: np.random.Generator
) -> RangeErrors:
    """Draw the systematic errors of a LiDAR."""
    return RangeErrors.drawn(realism, model.rings if model.has_layers else 0, rng)
