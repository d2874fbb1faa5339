"""How a person says where the board is: a pixel of an image, or a point in space."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Callable, Optional, Protocol

import numpy as np

from atom_core.geometry.plane import plane_basis
from atom_core.model.sensor import Sensor

if TYPE_CHECKING:
    from atom_calibration.modalities.frames import Frame

_OUTSIDE_M = 1.0  # a seed so far from every point is a mistake
_NOWHERE_PX = -1.0  # both numbers of a pixel that no image has
_AROUND_PX = 3  # half of the window that tells the depth at a pixel
_SAME_PX = 0.5
_DIRECTIONS = 32
_OF_REACH = (0.25, 0.4, 0.55, 0.7)  # about a board's middle: what is on the board, mostly
_LEAST_STEEPNESS = 0.2  # sine between a board and a scan's plane; what lies flatter is not cut


class SeedInput(Protocol):
    """What a seed of one kind means.

    Attributes:
        ahead: (3,) unit vector from the sensor to where the marker waits at first.
        from_clicks: a click on the annotated image is a seed.
        ends_outside: a seed outside the data is of no use, whatever the data.
        nowhere: the seed of a marker that covers no place of the data.
        same: two seeds that differ by no more are one.
    """

    ahead: np.ndarray
    from_clicks: bool
    ends_outside: bool
    nowhere: np.ndarray
    same: float

    def of_point(self, sensor: Sensor, point: np.ndarray) -> Optional[np.ndarray]:
        """Return the seed at a point (3,) [m] of the sensor's frame; None outside the data."""

    def of_board(
        self, sensor: Sensor, middle: np.ndarray, normal: np.ndarray, reach_m: float
    ) -> Optional[np.ndarray]:
        """Return the seed for a board that is expected somewhere; None outside the data.

        Args:
            sensor: which looks at it.
            middle: (3,) of the board in the sensor's frame [m].
            normal: (3,) of the board.
            reach_m: from the middle to where the board may end.
        """

    def point(self, frame: Frame, seed: np.ndarray, distance_m: float) -> Optional[np.ndarray]:
        """Return the point (3,) [m] of a seed; None where the data have no such place.

        Args:
            frame: the data.
            seed: of this kind.
            distance_m: taken where the data do not tell how far it is.
        """

    def problem(self, frame: Frame, seed: np.ndarray) -> str:
        """Return why a seed is outside the data; empty when it is inside."""


class PixelSeeds:
    """Seeds are pixels (2,) of a depth image."""

    ahead = np.array([0.0, 0.0, 1.0])
    from_clicks = ends_outside = True
    nowhere = np.full(2, _NOWHERE_PX)
    same = _SAME_PX

    def of_point(self, sensor: Sensor, point: np.ndarray) -> Optional[np.ndarray]:
        """Return the pixel of a point in front of the camera."""
        assert sensor.camera is not None
        inside = sensor.camera.in_image(point[None])[0]
        return sensor.camera.project(point[None])[0] if inside else None

    def of_board(
        self, sensor: Sensor, middle: np.ndarray, normal: np.ndarray, reach_m: float
    ) -> Optional[np.ndarray]:
        """Return the pixel of the board's middle, or of that part of it which is in the image."""
        pixel = self.of_point(sensor, middle)
        if pixel is not None:
            return pixel
        assert sensor.camera is not None
        angle = np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS, endpoint=False)
        circle = np.column_stack([np.cos(angle), np.sin(angle)]) @ plane_basis(normal)[:, :2].T
        for part in _OF_REACH:
            around = middle + part * reach_m * circle
            seen = around[sensor.camera.in_image(around)]
            if len(seen):
                return self.of_point(sensor, seen.mean(axis=0))
        return None

    def point(self, frame: Frame, seed: np.ndarray, distance_m: float) -> Optional[np.ndarray]:
        """Return the point at the median depth around the pixel."""
        camera, image = frame.sensor.camera, frame.data
        assert camera is not None
        column, row = (int(round(value)) for value in seed)
        if not (0 <= row < image.shape[0] and 0 <= column < image.shape[1]):
            return None
        low = max(row - _AROUND_PX, 0), max(column - _AROUND_PX, 0)
        window = image[low[0] : row + _AROUND_PX + 1, low[1] : column + _AROUND_PX + 1]
        seen = window[np.isfinite(window)]
        depth_m = float(np.median(seen)) if seen.size else distance_m
        return camera.ray_points(seed[None].astype(float), np.array([depth_m]))[0]

    def problem(self, frame: Frame, seed: np.ndarray) -> str:
        """Return why a pixel is outside the image."""
        height, width = frame.data.shape
        u, v = seed
        inside = -0.5 <= u <= width - 0.5 and -0.5 <= v <= height - 0.5
        return "" if inside else f"the image has {width} x {height} pixels"


class PointSeeds:
    """Seeds are points (3,) [m] in the sensor's frame."""

    ahead = np.array([1.0, 0.0, 0.0])
    from_clicks = ends_outside = False  # in a cloud there is always something, however far away
    nowhere = np.full(3, np.nan)
    same = 0.0

    def __init__(self, positions: Callable[[Any], np.ndarray]):
        """Take the function that makes positions (n, 3) [m] of the data."""
        self._positions = positions

    def of_point(self, sensor: Sensor, point: np.ndarray) -> Optional[np.ndarray]:
        """Return the point itself."""
        return point.copy()

    def of_board(
        self, sensor: Sensor, middle: np.ndarray, normal: np.ndarray, reach_m: float
    ) -> Optional[np.ndarray]:
        """Return the board's middle."""
        return self.of_point(sensor, middle)

    def point(self, frame: Frame, seed: np.ndarray, distance_m: float) -> Optional[np.ndarray]:
        """Return the point itself."""
        return seed

    def problem(self, frame: Frame, seed: np.ndarray) -> str:
        """Return why no measured point is near a seed."""
        away = np.linalg.norm(self._positions(frame.data) - seed, axis=1)
        nearest = float(np.nanmin(away)) if np.any(np.isfinite(away)) else np.inf
        return f"the nearest point is {nearest:.2f} m away" if nearest > _OUTSIDE_M else ""


class ScanSeeds(PointSeeds):
    """Seeds are points (3,) [m] in the sensor's frame; height only widens the search."""

    def of_board(
        self, sensor: Sensor, middle: np.ndarray, normal: np.ndarray, reach_m: float
    ) -> Optional[np.ndarray]:
        """Return the place of the board's cut by the scan's plane that is nearest to its middle."""
        level = normal[:2]
        steepness = float(np.linalg.norm(level))
        if abs(middle[2]) > reach_m * steepness or steepness < _LEAST_STEEPNESS:
            return None
        return np.append(middle[:2] + level * normal[2] * middle[2] / steepness**2, 0.0)

    def problem(self, frame: Frame, seed: np.ndarray) -> str:
        """Return why no measured point is near a seed in the scan's plane, z = 0."""
        return super().problem(frame, seed * np.array([1.0, 1.0, 0.0]))
