"""Points of a range sensor on one board: its poses by plane and outline, and the residuals."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import List, Optional, Sequence, Tuple

import numpy as np
from scipy.spatial import cKDTree

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.geometry.expected_noise import LIDAR_SIGMA_M, depth_sigma_m
from atom_core.geometry.plane import fit_plane, plane_basis
from atom_core.geometry.rectangle import Rectangle
from atom_core.model.dataset import Dataset, range_points
from atom_core.model.labels import DetectionKey, RangePoints, place
from atom_core.model.sensor import Sensor
from atom_core.problem.measurements import Measurement, repeated
from atom_core.problem.residuals import BorderBlock, OrthogonalBlock, ResidualBlock

POINTS_LOOKED_AT = 200  # of a detection's points on the board
_GRAZING = 0.05  # cosine of the incidence below which a plane is hit nowhere in particular
_PLANE_LIMIT_M = 0.05
_FEW_POINTS = 6  # three are always on a plane, whatever they are
_SIZE_LIMIT = 1.15  # labeled extent over the board's diagonal


@dataclass(frozen=True)
class RangeMeasurement(Measurement):
    """Points of a range sensor on one board, in the sensor's frame.

    Attributes:
        border: the board's edges in its plane [m].
        inside: (n, 3) points on the board [m].
        limit: (m, 3) points on its border [m].
        inside_sigma_m: (n,) expected deviation from the plane [m].
        limit_sigma_m: (m,) expected deviation from the border [m].
        limit_steps: (m, 2, 3) in the board's plane, from a limit point to where the next sample
            in each direction of sampling would be [m]; zero where there is no second one.
        inside_indices, limit_indices: (n,), (m,) which points of the cloud or pixels they are.
        along_rays: heights over the board are measured along the rays (`OrthogonalBlock`).
    """

    border: Rectangle
    inside: np.ndarray
    limit: np.ndarray
    inside_sigma_m: np.ndarray
    limit_sigma_m: np.ndarray
    limit_steps: np.ndarray
    inside_indices: np.ndarray
    limit_indices: np.ndarray
    along_rays: bool

    identifies_board = False

    @property
    def information(self) -> int:
        """The number of limit points."""
        return len(self.limit)

    @property
    def rows(self) -> int:
        """One for each point, and one for each limit point."""
        return len(self.inside) + len(self.limit)

    def candidates(self) -> List[np.ndarray]:
        """Return the four poses of a rectangle that fit plane and outline equally well."""
        return list(self._fits)

    @cached_property
    def _fits(self) -> List[np.ndarray]:
        try:
            centroid, normal, _ = fit_plane(self.inside)
        except ValueError:
            return []
        sensor_T_plane = se3.transform(plane_basis(normal), centroid)
        flat = se3.apply(se3.inverse(sensor_T_plane), self.inside)[:, :2]
        limit = se3.apply(se3.inverse(sensor_T_plane), self.limit)[:, :2]
        outline = limit if len(limit) >= 4 else flat
        plane_T_board = _fit_rectangle(outline, flat, self.border)
        half_turns = [np.diag([1.0, 1, 1]), np.diag([-1.0, -1, 1])]
        flips = [np.diag([1.0, 1, 1]), np.diag([1.0, -1, -1])]
        board_T_pattern = np.eye(4)
        board_T_pattern[:2, 3] = -self.border.centre
        sensor_T_board = sensor_T_plane @ plane_T_board
        return [
            sensor_T_board @ se3.transform(turn @ flip, np.zeros(3)) @ board_T_pattern
            for turn in half_turns
            for flip in flips
        ]

    def errors_m(self, sensor_T_pattern: np.ndarray) -> np.ndarray:
        """Return (..., n) distances [m] of points to the plane, of limit points to the border."""
        pattern_T_sensor = se3.inverse(sensor_T_pattern)
        step = max(len(self.inside) // POINTS_LOOKED_AT, 1)
        height = se3.apply_each(pattern_T_sensor, self.inside[::step])[..., 2]
        limit = se3.apply_each(pattern_T_sensor, self.limit)[..., :2]
        distance, _ = self.border.signed_distance(limit.reshape(-1, 2))
        return np.concatenate([height, distance.reshape(limit.shape[:-1])], axis=-1)

    def with_atom_residuals(self) -> RangeMeasurement:
        """Return the measurement whose residuals are those of ATOM."""
        return replace(self, along_rays=False)

    def implausibilities(self) -> List[str]:
        """Return what is wrong with the points: no plane, too few, or larger than the board."""
        try:
            _, _, rms = fit_plane(self.inside)
        except ValueError as error:
            return [str(error)]
        found = []
        if len(self.inside) < _FEW_POINTS:
            few = f"only {len(self.inside)} points are labeled"
            found.append(f"{few}, which do not tell how the board stands")
        if rms > _PLANE_LIMIT_M:
            found.append(f"the labeled points are no plane (RMS {rms:.3f} m)")
        return found + self.too_large()

    def too_large(self) -> List[str]:
        """Return a phrase where the points reach farther than the board does."""
        if self.extent_m <= _SIZE_LIMIT * self.diagonal_m:
            return []
        return [
            f"the label is {self.extent_m:.2f} m across, the board only {self.diagonal_m:.2f} m"
        ]

    @property
    def extent_m(self) -> float:
        """How far apart the points are."""
        return _diameter(self.inside)

    @property
    def diagonal_m(self) -> float:
        """From corner to corner of the board."""
        return 2.0 * float(np.linalg.norm(self.border.half_size))


def measured_in_cloud(
    dataset: Dataset, key: DetectionKey
) -> Tuple[Optional[RangeMeasurement], List[str]]:
    """Return the measurement of a label in a cloud, if any of its points has a value."""
    points, remarks = usable_points(dataset, key)
    if points is None:
        return None, remarks
    sigmas = [np.full(len(p), LIDAR_SIGMA_M) for p in (points.inside, points.limit)]
    return range_measurement(
        dataset, key, points, sigmas[0], sigmas[1], _beam_steps(points)
    ), remarks


def measured_in_depth_image(
    dataset: Dataset, key: DetectionKey
) -> Tuple[Optional[RangeMeasurement], List[str]]:
    """Return the measurement of a label in a depth image, if any of its pixels has a depth."""
    points, remarks = usable_points(dataset, key)
    if points is None:
        return None, remarks
    camera = dataset.sensors[key.sensor].camera
    assert camera is not None
    inside_sigma = depth_sigma_m(points.inside[:, 2])
    limit_sigma = points.limit[:, 2] / np.min(camera.focal_px)  # a pixel's footprint
    steps = _pixel_steps(points, camera)
    return range_measurement(dataset, key, points, inside_sigma, limit_sigma, steps), remarks


def usable_points(dataset: Dataset, key: DetectionKey) -> Tuple[Optional[RangePoints], List[str]]:
    """Return a detection's labeled points, None where none has a value; and warnings."""
    points, remarks = range_points(dataset, key), []
    if points.dropped:
        remarks.append(f"{place(key)}: {points.dropped} labeled pixels have no depth")
    if len(points.inside) == 0:
        remarks.append(f"{place(key)}: left out, no labeled point has a value")
        return None, remarks
    return points, remarks


def range_measurement(
    dataset: Dataset,
    key: DetectionKey,
    points: RangePoints,
    inside_sigma_m: np.ndarray,
    limit_sigma_m: np.ndarray,
    limit_steps: np.ndarray,
) -> RangeMeasurement:
    """Return the measurement of labeled points; the arguments are those of the class."""
    return RangeMeasurement(
        key,
        dataset.patterns[key.pattern].border,
        points.inside,
        points.limit,
        inside_sigma_m,
        limit_sigma_m,
        limit_steps,
        points.inside_indices,
        points.limit_indices,
        along_rays=True,
    )


def range_blocks(
    sensor: Sensor, items: Sequence[Tuple[int, RangeMeasurement]]
) -> List[ResidualBlock]:
    """Return the residuals of a range sensor, from its measurements and detections' indices."""
    blocks: List[ResidualBlock] = [_orthogonal(sensor, items)]
    if any(len(m.limit) for _, m in items):
        blocks.append(_border(sensor, items))
    return blocks


def _orthogonal(sensor: Sensor, items: Sequence[Tuple[int, RangeMeasurement]]) -> OrthogonalBlock:
    count = sum(len(m.inside) for _, m in items)
    return OrthogonalBlock(
        sensor=sensor.name,
        modality=sensor.modality,
        detection=repeated([(i, len(m.inside)) for i, m in items]),
        sigma=np.concatenate([m.inside_sigma_m for _, m in items]),
        ids=np.concatenate([m.inside_indices for _, m in items]),
        points=np.concatenate([m.inside for _, m in items]),
        range_offset_m=np.zeros(count),
        range_scale=np.zeros(count),
        unturned=None,
        along_rays=all(m.along_rays for _, m in items),
    )


def _border(sensor: Sensor, items: Sequence[Tuple[int, RangeMeasurement]]) -> BorderBlock:
    counts = [len(m.limit) for _, m in items]
    return BorderBlock(
        sensor=sensor.name,
        modality=sensor.modality,
        detection=repeated([(i, len(m.limit)) for i, m in items]),
        sigma=np.concatenate([m.limit_sigma_m for _, m in items]),
        ids=np.concatenate([m.limit_indices for _, m in items]),
        points=np.concatenate([m.limit for _, m in items]),
        range_offset_m=np.zeros(sum(counts)),
        range_scale=np.zeros(sum(counts)),
        unturned=None,
        centre=np.repeat([m.border.centre for _, m in items], counts, axis=0),
        half_size=np.repeat([m.border.half_size for _, m in items], counts, axis=0),
        steps=np.concatenate([m.limit_steps for _, m in items]),
        inset=np.zeros((sum(counts), 2)),
    )


def _fit_rectangle(outline: np.ndarray, inside: np.ndarray, border: Rectangle) -> np.ndarray:
    """Return ``plane_T_board`` (4, 4), origin in the board's centre, of the best orientation.

    Args:
        outline: (m, 2) points on the border, in the plane [m].
        inside: (n, 2) points on the board [m].
        border: the board's.
    """
    angles, half = np.deg2rad(np.arange(0.0, 180.0, 4.0)), border.half_size
    cosine, sine = np.cos(angles), np.sin(angles)
    plane_R_boards = np.array([[cosine, -sine], [sine, cosine]]).transpose(2, 0, 1)
    turned, turned_inside = outline @ plane_R_boards, inside @ plane_R_boards  # (angles, n, 2)
    low, high = turned_inside.min(axis=1), turned_inside.max(axis=1)
    centre = (low + high) / 2.0
    beyond = np.abs(turned - centre[:, None]) - half
    deepest = beyond.max(axis=2)
    outside = np.sum(np.maximum(beyond, 0.0) ** 2, axis=2)
    squares = np.where(deepest > 0.0, outside, deepest**2)  # of the distances to the border
    costs = np.mean(np.minimum(squares, (0.5 * half.min()) ** 2), axis=1)
    costs += 4.0 * np.sum(np.maximum((high - low) / 2.0 - half, 0.0) ** 2, axis=1)
    best = int(np.argmin(costs))
    plane_R_board = se3.rotation_from_rotation_vector(np.array([0.0, 0.0, angles[best]]))
    return se3.transform(plane_R_board, plane_R_board @ np.array([*centre[best], 0.0]))


def _diameter(points: np.ndarray) -> float:
    """Return the distance of two far points: the farthest from the middle, and from that."""
    first = points[np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1))]
    return float(np.max(np.linalg.norm(points - first, axis=1)))


def _pixel_steps(points: RangePoints, camera: Camera) -> np.ndarray:
    """Return (m, 2, 3): from each limit pixel to its neighbours in x and y, on the board [m]."""
    rays = points.limit / points.limit[:, 2:]
    moved = [rays + np.eye(3)[axis] / camera.focal_px[axis] for axis in (0, 1)]
    return _steps_on_plane(points, rays, moved)


def _beam_steps(points: RangePoints) -> np.ndarray:
    """Return (m, 2, 3): from each limit point to the next beam of its layer, on the board [m].

    Layers are farther apart than the beams of one, so the next beam is the nearest direction.
    Where beams were lost the step is that of the whole detection.
    """
    steps = np.zeros((len(points.limit), 2, 3))
    if len(points.inside) < 3 or len(points.limit) == 0:
        return steps
    rays, others = _unit(points.limit), _unit(points.inside)
    gap, nearest = cKDTree(others).query(rays, k=2)
    own = gap[:, 0] < 1e-7  # the limit points are among the points inside
    neighbour = others[np.where(own, nearest[:, 1], nearest[:, 0])]
    across = neighbour - rays
    length = np.linalg.norm(across, axis=1, keepdims=True)
    direction = across / np.maximum(length, 1e-12)
    moved = rays + np.median(length) * direction
    return _steps_on_plane(points, rays, [moved, rays])


def _steps_on_plane(
    points: RangePoints, rays: np.ndarray, moved: Sequence[np.ndarray]
) -> np.ndarray:
    """Return (m, 2, 3): between where rays (m, 3) and moved rays meet the board's plane [m]."""
    try:
        centroid, normal, _ = fit_plane(points.inside)
    except ValueError:
        return np.zeros((len(rays), 2, 3))

    def hit(directions: np.ndarray) -> np.ndarray:
        slope = directions @ normal
        safe = np.where(np.abs(slope) < _GRAZING, _GRAZING, slope)
        return directions * (normal @ centroid / safe)[:, None]

    return np.stack([hit(m) - hit(rays) for m in moved], axis=1)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
