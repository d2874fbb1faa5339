"""Residuals and their analytic Jacobians, vectorised; the specification of the native twin.

A residual block holds all rows of one sensor and one kind. Its rows depend on the pose
``sensor_T_pattern`` of their detection only. The Jacobian is taken by the *left twist*
(rotation w, move v) of that pose in the sensor's frame: a pattern point p, seen in the sensor,
moves by ``w x p + v``. The chain rule to the parameters is the problem's part.

Kinds, after Rato et al. 2022, section 4, but as signed components:

* ``reprojection`` eq. 3: projected minus detected pixel, x and y [px]
* ``orthogonal``   eq. 4: z of a range point in the pattern's frame [m]
* ``border``       eq. 5: signed XY distance of a limit point to the board's border [m]; where two
  sides are about equally near, a blend of both

A range sensor errs along its rays. Where these are slanted, the change of z with a turn of the
board has the noise of z itself, their product has a mean, and a plane turns away from the rays:
0.1 deg of a board 0.6 m wide at 45 deg, with 10 mm of noise. Distances along the rays, which are z
over the cosine of the incidence, have no such bias. So the heights of a detection are multiplied
by its own plane's cosine, a constant, over that of the board (`OrthogonalBlock.along_rays`); where
the two planes are far apart, by less than that.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Optional, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.geometry.intrinsics import project_with_derivatives
from atom_core.geometry.rectangle import blended_distance_to_rectangles

_GRAZING = 0.05  # cosine of the incidence below which a plane is hit nowhere in particular
_PLANAR = 4.0  # variances across a plane by which points must be spread in it, in both directions
_ROUNDING = 1e-12  # [m^2]
REPROJECTION, ORTHOGONAL, BORDER = "reprojection", "orthogonal", "border"
UNITS = {REPROJECTION: "px", ORTHOGONAL: "m", BORDER: "m"}


@dataclass(frozen=True)
class ResidualBlock(ABC):
    """Rows of one sensor and one kind.

    Attributes:
        sensor: whose measurements.
        modality: the sensor's.
        detection: (n,) index of the detection of each item, ascending.
        sigma: (n,) expected standard deviation of each item, in the kind's unit.
        ids: (n,) corner id, or index of the point in its cloud or of the pixel in its image.
    """

    sensor: str
    modality: str
    detection: np.ndarray
    sigma: np.ndarray
    ids: np.ndarray

    kind = ""
    dimension = 1

    @property
    def count(self) -> int:
        """Number of items; an item has ``dimension`` rows."""
        return len(self.detection)

    @cached_property
    def segments(self) -> Tuple[Tuple[int, slice], ...]:
        """Each detection that has items, and which."""
        starts = np.flatnonzero(np.diff(self.detection, prepend=-1))
        ends = np.append(starts[1:], self.count)
        items = map(slice, starts.tolist(), ends.tolist())
        return tuple(zip(self.detection[starts].tolist(), items))

    @cached_property
    def segment_of_items(self) -> np.ndarray:
        """(n,) in which of the segments each item is."""
        counts = [items.stop - items.start for _, items in self.segments]
        return np.repeat(np.arange(len(counts)), counts)

    def sums(self, values: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return the detections that have items (m,), and the sums (m, ...) of theirs (n, ...)."""
        detection = np.array([d for d, _ in self.segments], dtype=int)
        starts = [items.start for _, items in self.segments]
        return detection, np.add.reduceat(values, starts, axis=0) if starts else values

    def turned(self, vectors: np.ndarray, by: np.ndarray) -> np.ndarray:
        """Return (n, k): the items' vectors (n, j) times their detections' matrices (d, j, k)."""
        result = np.empty((self.count, by.shape[2]))
        for detection, items in self.segments:
            np.matmul(vectors[items], by[detection], out=result[items])
        return result

    def of_items(self, chosen: np.ndarray, detection: np.ndarray) -> ResidualBlock:
        """Return the rows of some items (m,), with other indices (m,) of their detections."""
        arrays = {f.name: getattr(self, f.name) for f in fields(self)}
        items = {k: v[chosen] for k, v in arrays.items() if isinstance(v, np.ndarray)}
        return replace(self, **{**items, "detection": detection})

    def residuals(self, sensor_T_pattern: np.ndarray) -> np.ndarray:
        """Return (n, dimension) at the poses (d, 4, 4) of the detections."""
        return self.linearise(sensor_T_pattern)[0]

    @abstractmethod
    def linearise(self, sensor_T_pattern: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return residuals (n, dimension) and Jacobians (n, dimension, 6) by the left twist."""


@dataclass(frozen=True)
class ReprojectionBlock(ResidualBlock):
    """Corners of one camera.

    Attributes:
        camera: its intrinsics.
        corners_in_pattern: (n, 3) [m].
        pixels: (n, 2) [px].
    """

    camera: Camera
    corners_in_pattern: np.ndarray
    pixels: np.ndarray

    kind = REPROJECTION
    dimension = 2

    def corners_in_sensor(self, sensor_T_pattern: np.ndarray) -> np.ndarray:
        """Return the corners (n, 3) in the camera's frame [m]."""
        rotation = np.swapaxes(sensor_T_pattern[:, :3, :3], 1, 2)
        origin = sensor_T_pattern[self.detection, :3, 3]
        return self.turned(self.corners_in_pattern, rotation) + origin

    def residuals(self, sensor_T_pattern: np.ndarray) -> np.ndarray:
        """Return projected minus detected pixels (n, 2)."""
        points = self.corners_in_sensor(sensor_T_pattern)
        return self.camera.project(points) - self.pixels

    def linearise(self, sensor_T_pattern: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return residuals (n, 2) [px] and Jacobians (n, 2, 6)."""
        points = self.corners_in_sensor(sensor_T_pattern)
        projected, by_point = self.camera.project_with_jacobian(points)
        turned = np.cross(points[:, None, :], by_point)
        return projected - self.pixels, np.concatenate([turned, by_point], axis=2)

    def linearise_with_intrinsics(
        self, sensor_T_pattern: np.ndarray, start: Camera
    ) -> Tuple[np.ndarray, np.ndarray]:
        """Return residuals (n, 2) [px] and Jacobians (n, 2, 18) by twist and camera's numbers.

        Args:
            sensor_T_pattern: (d, 4, 4).
            start: the camera to which the numbers are relative.
        """
        points = self.corners_in_sensor(sensor_T_pattern)
        projected, by_point, by_number = project_with_derivatives(start, self.camera, points)
        turned = np.cross(points[:, None, :], by_point)
        return projected - self.pixels, np.concatenate([turned, by_point, by_number], axis=2)


@dataclass(frozen=True)
class RangeBlock(ResidualBlock):
    """Points of one range sensor.

    Attributes:
        points: (n, 3) in its frame [m], already corrected: turned, by range scale, by range offset.
        range_offset_m: (n,) by how much they are moved away from the sensor, along their rays.
        range_scale: (n,) by which part of its distance each was moved before.
        unturned: (n, 3) as the sensor has them [m], where they are turned; None: they are not.
    """

    points: np.ndarray
    range_offset_m: np.ndarray
    range_scale: np.ndarray
    unturned: Optional[np.ndarray]

    @property
    def rays(self) -> np.ndarray:
        """(n, 3) unit vectors from the sensor to the points."""
        return _unit(self.points)

    @property
    def measured_points(self) -> np.ndarray:
        """(n, 3) as the sensor has them [m]."""
        if self.unturned is not None:
            return self.unturned
        if not (np.any(self.range_offset_m) or np.any(self.range_scale)):
            return self.points
        moved = self.points - self.range_offset_m[:, None] * self.rays
        return moved / (1.0 + self.range_scale[:, None])

    @property
    def on_own_rays(self) -> np.ndarray:
        """(n, 3) on the rays that the sensor has for them, at any distance [m]."""
        return self.points if self.unturned is None else self.unturned

    def in_plane(self, sensor_T_pattern: np.ndarray) -> np.ndarray:
        """Return the points (n, 2) in the boards' planes, along x and y of the patterns [m]."""
        axes = sensor_T_pattern[:, :3, :2]
        origin = np.einsum("di,dij->dj", sensor_T_pattern[:, :3, 3], axes)
        return self.turned(self.points, axes) - origin[self.detection]

    def with_range_errors(
        self, offset_m: np.ndarray, scale: np.ndarray, turned: Optional[np.ndarray] = None
    ) -> RangeBlock:
        """Return the block with its points corrected otherwise.

        Args:
            offset_m: (n,) how far they are moved along their rays.
            scale: (n,) by which part of its distance each is moved before.
            turned: (n, 3) what the sensor has, in the right directions [m]; None: as it has them.
        """
        same = np.array_equal(offset_m, self.range_offset_m)
        same = same and np.array_equal(scale, self.range_scale)
        if same and turned is None and self.unturned is None:
            return self
        measured = self.measured_points
        seen = measured if turned is None else turned
        points = (1.0 + scale[:, None]) * seen + offset_m[:, None] * _unit(seen)
        unturned = None if turned is None else measured
        return replace(
            self, points=points, range_offset_m=offset_m, range_scale=scale, unturned=unturned
        )


@dataclass(frozen=True)
class OrthogonalBlock(RangeBlock):
    """How far points lie before or behind the boards.

    Attributes:
        deviation_m: (n,) added to the heights [m]: the noise of points that were moved onto a line
            (`scan_measurement`); None: nothing.
        surface_m: (n,) how high the board's surface is estimated to be there [m]; None: flat.
        along_rays: heights are multiplied by the cosine at which the rays of their detection meet
            its own plane, over that at which they meet the board; else they are those of ATOM.
    """

    deviation_m: Optional[np.ndarray] = None
    surface_m: Optional[np.ndarray] = None
    along_rays: bool = False

    kind = ORTHOGONAL

    @cached_property
    def facing(self) -> np.ndarray:
        """(m, 3) of each segment: its mean ray, over the cosine at which it meets its own plane.

        The product with the normal of another plane is 1 or -1 where the rays meet that as steeply.
        """
        found, rays, points = [], _unit(self.on_own_rays), self.measured_points
        for _, items in self.segments:
            mean_ray, mine = rays[items].mean(axis=0), points[items].astype(float)
            beside = mine - mine.mean(axis=0)
            spread, axes = np.linalg.eigh(beside.T @ beside)
            is_plane = spread[1] > _PLANAR * max(spread[0], _ROUNDING)
            cosine = abs(float(axes[:, 0] @ mean_ray)) if is_plane else 1.0
            found.append(mean_ray / max(cosine, _GRAZING))
        return np.array(found).reshape(-1, 3)

    @property
    def added_m(self) -> Optional[np.ndarray]:
        """(n,) what is added to the heights of the points [m]; None: nothing."""
        if self.surface_m is None:
            return self.deviation_m
        return -self.surface_m if self.deviation_m is None else self.deviation_m - self.surface_m

    def residuals(self, sensor_T_pattern: np.ndarray) -> np.ndarray:
        """Return heights (n, 1) over the board [m], stretched where they are along the rays."""
        normal = sensor_T_pattern[:, :3, 2]
        height = self._over_plane(self.turned(self.points, normal[:, :, None]), sensor_T_pattern)
        if not self.along_rays:
            return height
        return height * self._stretch(sensor_T_pattern)[0][self.segment_of_items, None]

    def linearise(self, sensor_T_pattern: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return residuals (n, 1) [m] and Jacobians (n, 1, 6)."""
        normal = sensor_T_pattern[:, :3, 2]
        cross_and_along = np.concatenate([-se3.skew(normal), normal[:, :, None]], axis=2)
        by_point = self.turned(self.points, cross_and_along)
        jacobian = np.concatenate([by_point[:, :3], -normal[self.detection]], axis=1)
        height = self._over_plane(by_point[:, 3:], sensor_T_pattern)
        if self.along_rays:
            stretch, by_turn = self._stretch(sensor_T_pattern)
            of_item = self.segment_of_items
            jacobian *= stretch[of_item, None]
            jacobian[:, :3] += height * by_turn[of_item]
            height = height * stretch[of_item, None]
        return height, jacobian[:, None, :]

    def _stretch(self, sensor_T_pattern: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return (m,) factors by segment, and (m, 3) their change as the board turns."""
        detection = [d for d, _ in self.segments]
        normal = sensor_T_pattern[detection, :3, 2]
        steep = np.einsum("mi,mi->m", normal, self.facing)
        stretch = 2.0 / (1.0 + steep**2)  # as one over it near one, and never more than 2
        by_steep = -steep * stretch**2
        return stretch, by_steep[:, None] * np.cross(normal, self.facing)

    def _over_plane(self, along_normal: np.ndarray, sensor_T_pattern: np.ndarray) -> np.ndarray:
        """Return heights (n, 1) over the board of points that lie (n, 1) along its normal [m]."""
        normal = sensor_T_pattern[:, :3, 2]
        offset = np.einsum("di,di->d", normal, sensor_T_pattern[:, :3, 3])
        height = along_normal - offset[self.detection, None]
        return height if self.added_m is None else height + self.added_m[:, None]


@dataclass(frozen=True)
class BorderBlock(RangeBlock):
    """Limit points of one range sensor.

    The last sample on a board lies inside its border, on average by half a step to the next one.
    With an ``inset`` the distance is taken to where the last samples are to be expected. It has
    two numbers, since a step that crosses the left side may run along the top one: neither they
    nor the distance depend on which side a point is counted to.

    Attributes:
        centre, half_size: (n, 2) of the board's border in the pattern's plane [m].
        steps: (n, 2, 3) to the next samples, in the sensor's frame [m].
        inset: (n, 2) how far inside the sides of x and of y the points are expected [m].
    """

    centre: np.ndarray
    half_size: np.ndarray
    steps: np.ndarray
    inset: np.ndarray

    kind = BORDER

    @property
    def expected_half_size(self) -> np.ndarray:
        """(n, 2) of the rectangle on which the points are expected [m]."""
        return self.half_size - self.inset

    def linearise(self, sensor_T_pattern: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return signed distances (n, 1) [m], negative inside, and Jacobians (n, 1, 6)."""
        distance, gradient = self._distance(sensor_T_pattern)
        outward = self.turned(gradient, np.swapaxes(sensor_T_pattern[:, :3, :2], 1, 2))
        (u, v, w), (x, y, z) = outward.T, self.points.T
        across = np.column_stack([v * z - w * y, w * x - u * z, u * y - v * x])
        jacobian = np.concatenate([across, -outward], axis=1)
        return distance[:, None], jacobian[:, None, :]

    def steps_across(self, sensor_T_pattern: np.ndarray) -> np.ndarray:
        """Return the lengths (n, 2) of the steps across the sides of x and of y [m]."""
        axes = sensor_T_pattern[:, :3, :2]
        one, other = (self.turned(self.steps[:, k], axes) for k in range(2))
        return np.maximum(np.abs(one), np.abs(other))

    def by_inset_steps(self, sensor_T_pattern: np.ndarray) -> np.ndarray:
        """Return the derivatives (n,) of the distances by the inset in steps [m]."""
        _, gradient = self._distance(sensor_T_pattern)
        return np.einsum("nj,nj->n", np.abs(gradient), self.steps_across(sensor_T_pattern))

    def _distance(self, sensor_T_pattern: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return signed distances (n,) and their gradients (n, 2) in the board's plane."""
        in_plane = self.in_plane(sensor_T_pattern)
        return blended_distance_to_rectangles(in_plane, self.centre, self.expected_half_size)


def _unit(points: np.ndarray) -> np.ndarray:
    points = points.astype(float)  # clouds have single precision
    return points / np.sqrt(np.einsum("ni,ni->n", points, points))[:, None]


def squared_norms(residuals: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Return (n,) squared norms of residuals (n, dimension) in units of sigma (n,)."""
    return np.sum((residuals / sigma[:, None]) ** 2, axis=1)
