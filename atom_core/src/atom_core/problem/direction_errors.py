"""Errors of a range sensor's directions: a LiDAR's angles, the intrinsics of a depth camera.

A scanner whose angular step is given wrong, a spinning LiDAR whose encoder is off its axis, one
whose elevations are not those of its table, a depth camera whose points were made with another
focal length: all points are turned, and none is nearer or farther.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar, Optional

import numpy as np

from atom_core.geometry.camera import Camera
from atom_core.problem.model_errors import AXES, RADIAN, RATIO, WITH_ALL, ModelError, Rows
from atom_core.problem.residuals import OrthogonalBlock, RangeBlock

_LEAST_M = 1e-3  # from the sensor to a board's plane: what is nearer is seen from the side


@dataclass(frozen=True)
class DirectionError(ModelError):
    """One number that turns the rays of a range sensor."""

    most = 0.1
    option: ClassVar[str] = WITH_ALL

    def derivatives(self, rows: Rows) -> Optional[np.ndarray]:
        """Return the rows' change as points move across their rays.

        Points count where the board is, not where noise has them: else rays would be turned to
        where noise along them makes the least heights.
        """
        if not isinstance(rows.block, RangeBlock) or rows.block.sensor != self.target:
            return None
        change = rows.by_sensor_point(self.moved(rows.block.points))
        return change * _to_board(rows) if isinstance(rows.block, OrthogonalBlock) else change

    @abstractmethod
    def moved(self, points: np.ndarray) -> np.ndarray:
        """Return (n, 3): the derivative of points (n, 3) in the sensor's frame by the value [m]."""

    @abstractmethod
    def directed(self, points: np.ndarray, value: float) -> np.ndarray:
        """Return points (n, 3) in the sensor's frame, in their right directions [m]."""


def _to_board(rows: Rows) -> np.ndarray:
    """Return (n, 1): distances of the board along the points' rays, in parts of the points'."""
    assert isinstance(rows.block, OrthogonalBlock)
    by_distance = rows.by_sensor_point(rows.block.points)
    seen = np.abs(by_distance) > _LEAST_M
    part = 1.0 - rows.residual / np.where(seen, by_distance, np.inf)
    return np.clip(part, 0.5, 2.0)


@dataclass(frozen=True)
class AzimuthError(DirectionError):
    """An error of the angle about the z axis of a LiDAR, from its x axis."""

    @abstractmethod
    def share(self, azimuth_rad: np.ndarray) -> np.ndarray:
        """Return (n,): what must be added to azimuths (n,) at a value of one [rad]."""

    def moved(self, points: np.ndarray) -> np.ndarray:
        """Return (n, 3): the derivative of points (n, 3) by the value [m]."""
        x, y, _ = points.T
        share = self.share(np.arctan2(y, x))
        return np.column_stack([-share * y, share * x, np.zeros(len(points))])

    def directed(self, points: np.ndarray, value: float) -> np.ndarray:
        """Return points (n, 3), turned about z."""
        x, y, z = points.T
        angle = value * self.share(np.arctan2(y, x))
        cosine, sine = np.cos(angle), np.sin(angle)
        return np.column_stack([cosine * x - sine * y, sine * x + cosine * y, z])


@dataclass(frozen=True)
class AzimuthScale(AzimuthError):
    """By which part all azimuths of a LiDAR must grow: its angular step is given wrong."""

    kind = "azimuth_scale"
    unit = RATIO
    usual = 0.0005

    def share(self, azimuth_rad: np.ndarray) -> np.ndarray:
        """Return (n,): what must be added at a value of one [rad]."""
        return azimuth_rad


@dataclass(frozen=True)
class AzimuthWave(AzimuthError):
    """What must be added to the azimuths of a spinning LiDAR, as a wave over one turn [rad].

    An encoder whose middle is off its axis makes it.

    Attributes:
        axis: 0 for the cosine of the azimuth, 1 for its sine.
    """

    axis: int

    kind = "azimuth_wave"
    unit = RADIAN
    usual = 0.0005

    @property
    def name(self) -> str:
        """What it is, without whose."""
        return f"{self.kind}_{AXES[self.axis]}"

    def share(self, azimuth_rad: np.ndarray) -> np.ndarray:
        """Return (n,): what must be added at a value of one [rad]."""
        return (np.cos, np.sin)[self.axis](azimuth_rad)


@dataclass(frozen=True)
class ElevationError(DirectionError):
    """An error of the angle above the plane across the z axis of a LiDAR."""

    @abstractmethod
    def share(self, elevation_rad: np.ndarray) -> np.ndarray:
        """Return (n,): what must be added to elevations (n,) at a value of one [rad]."""

    def moved(self, points: np.ndarray) -> np.ndarray:
        """Return (n, 3): the derivative of points (n, 3) by the value [m]."""
        flat = np.maximum(np.hypot(points[:, 0], points[:, 1]), 1e-9)
        x, y, z = points.T
        share = self.share(np.arctan2(z, flat))
        return np.column_stack([-share * z * x / flat, -share * z * y / flat, share * flat])

    def directed(self, points: np.ndarray, value: float) -> np.ndarray:
        """Return points (n, 3), turned up from the plane across z."""
        x, y, z = points.T
        flat = np.maximum(np.hypot(x, y), 1e-9)
        angle = value * self.share(np.arctan2(z, flat))
        cosine, sine = np.cos(angle), np.sin(angle)
        grown = cosine - sine * z / flat
        return np.column_stack([grown * x, grown * y, sine * flat + cosine * z])


@dataclass(frozen=True)
class ElevationOffset(ElevationError):
    """What must be added to all elevations of a LiDAR [rad]."""

    kind = "elevation_offset"
    unit = RADIAN
    usual = 0.0005

    def share(self, elevation_rad: np.ndarray) -> np.ndarray:
        """Return (n,): what must be added at a value of one [rad]."""
        return np.ones(len(elevation_rad))


@dataclass(frozen=True)
class ElevationScale(ElevationError):
    """By which part all elevations of a LiDAR must grow."""

    kind = "elevation_scale"
    unit = RATIO
    usual = 0.002

    def share(self, elevation_rad: np.ndarray) -> np.ndarray:
        """Return (n,): what must be added at a value of one [rad]."""
        return elevation_rad


@dataclass(frozen=True)
class DepthIntrinsics(DirectionError):
    """An error of the intrinsics with which depths became points.

    Attributes:
        camera: with the given intrinsics.
    """

    camera: Camera = field(compare=False)

    unit = RATIO
    usual = 0.001  # half a pixel of the centre


@dataclass(frozen=True)
class DepthFocalLength(DepthIntrinsics):
    """By which part the focal lengths of a depth camera must grow."""

    kind = "depth_focal_length"

    def moved(self, points: np.ndarray) -> np.ndarray:
        """Return (n, 3): the derivative of points (n, 3) by the value [m]."""
        return points * [-1.0, -1.0, 0.0]

    def directed(self, points: np.ndarray, value: float) -> np.ndarray:
        """Return points (n, 3) at the same depths."""
        return points / [1.0 + value, 1.0 + value, 1.0]


@dataclass(frozen=True)
class DepthCentre(DepthIntrinsics):
    """What must be added to the image centre of a depth camera, in parts of its focal length.

    Attributes:
        axis: 0 for x, 1 for y.
    """

    axis: int

    kind = "depth_centre"

    @property
    def name(self) -> str:
        """What it is, without whose."""
        return f"{self.kind}_{AXES[self.axis]}"

    def moved(self, points: np.ndarray) -> np.ndarray:
        """Return (n, 3): the derivative of points (n, 3) by the value [m]."""
        across = np.zeros((len(points), 3))
        across[:, self.axis] = -points[:, 2]
        return across

    def directed(self, points: np.ndarray, value: float) -> np.ndarray:
        """Return points (n, 3) at the same depths."""
        return points + value * self.moved(points)
