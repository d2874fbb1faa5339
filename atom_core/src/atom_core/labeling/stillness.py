"""When the board stands still, judged on what the sensors' labels say and on nothing else.

Two labels of one sensor are compared in units of the label's own standard deviation: corners in
the image for a camera, the plane and its centre for a range sensor, the cut for a 2D LiDAR
(`line_sighting`). What the noise of the two labels explains is taken off.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Callable, ClassVar, Dict, NamedTuple, Optional, Protocol, runtime_checkable

import numpy as np

from atom_core.geometry.expected_noise import CORNER_SIGMA_PX, LIDAR_SIGMA_M, depth_sigma_m
from atom_core.geometry.plane import fit_plane, plane_basis

# A label's centre wanders in the plane as points at the border, or a LiDAR's whole layer, come and
# go: so many sigmas are nothing unusual.
_BESIDE_SIGMAS, _BESIDE_SIGMAS_OF_LAYERS = 4.0, 15.0
_AFFINE_PARAMETERS = 3  # of each axis
_MIN_CORNERS_FOR_AFFINE = 6
_EPSILON_S = 1e-6
_MOST_POINTS = 400  # of a label that its plane is fitted to


@dataclass(frozen=True)
class CornerSighting:
    """Corners of the board in an image: ids (n,) and pixels (n, 2)."""

    ids: np.ndarray
    pixels: np.ndarray

    def motion(self, other: CornerSighting) -> float:
        """Return by how many sigmas the board moved to another sighting; inf if none can tell."""
        common, mine, theirs = np.intersect1d(self.ids, other.ids, return_indices=True)
        if len(common) < 3:
            return np.inf
        before, shift = self.pixels[mine], other.pixels[theirs] - self.pixels[mine]
        columns = [np.ones(len(before))]
        if len(before) >= _MIN_CORNERS_FOR_AFFINE:
            columns += list((before - before.mean(axis=0)).T)
        design = np.column_stack(columns)
        fitted = design @ np.linalg.lstsq(design, shift, rcond=None)[0]
        noise = 2 * 2 * CORNER_SIGMA_PX**2 * len(columns) / len(before)  # two labels, two axes
        square = float(np.mean(np.sum(fitted**2, axis=1)))
        return float(np.sqrt(max(square - noise, 0.0)) / CORNER_SIGMA_PX)


@dataclass(frozen=True)
class PlaneSighting:
    """The board as a range sensor sees it.

    Attributes:
        centre: (3,) mean of the labeled points [m].
        normal: (3,) of their plane.
        extent_m: root of the mean squared distance from the centre.
        sigma_m: of one point.
        count: of points.
        beside_sigmas: by how many sigmas the centre wanders in the plane without any motion.
    """

    centre: np.ndarray
    normal: np.ndarray
    extent_m: float
    sigma_m: float
    count: int
    beside_sigmas: float
    known_axes: ClassVar[int] = 2

    def board_axes(self, _: np.ndarray) -> np.ndarray:
        """Return the plane's basis (3, 3), its normal last; no expectation is needed."""
        return plane_basis(self.normal)

    def motion(self, other: PlaneSighting) -> float:
        """Return by how many sigmas the board moved to another sighting."""
        shift = other.centre - self.centre
        out = float(self.normal @ shift)
        beside = float(np.linalg.norm(shift - out * self.normal)) / self.beside_sigmas
        turned = float(np.linalg.norm(np.cross(self.normal, other.normal))) * self.extent_m
        sigma = max(self.sigma_m, other.sigma_m)
        # The centre knows the plane to sigma / sqrt(n), its tilt about as well at the extent.
        noise = 2 * _AFFINE_PARAMETERS * sigma**2 / min(self.count, other.count)
        return float(np.sqrt(max(out**2 + beside**2 + turned**2 - noise, 0.0)) / sigma)


class Sighting(Protocol):
    """What a label says about where the board is; each modality has its own."""

    def motion(self, other: Any) -> float:
        """Return by how many sigmas the board moved to another sighting of the same kind."""


@runtime_checkable
class SurfaceSighting(Sighting, Protocol):
    """What labeled points say of the board's surface.

    Attributes:
        centre: (3,) mean of the points [m].
        known_axes: how many directions in the board they tell: two a plane, one a line.
    """

    centre: np.ndarray
    known_axes: ClassVar[int]

    def board_axes(self, normal: np.ndarray) -> np.ndarray:
        """Return axes of the board.

        Args:
            normal: (3,) the one expected.

        Returns:
            (3, 3), unit vectors as columns: two in the board, those that are known first; and the
            normal, as near to the expected one as the points allow, either way.
        """


class PointNoise(NamedTuple):
    """What the noise of a sensor does to a label of points.

    Attributes:
        sigma_m: of one point, given the centre (3,) of the label [m].
        beside_sigmas: by how many of them the centre wanders in the plane without any motion.
    """

    sigma_m: Callable[[np.ndarray], float]
    beside_sigmas: float


DEPTH_NOISE = PointNoise(lambda centre: float(depth_sigma_m(centre[2])), _BESIDE_SIGMAS)
LIDAR_NOISE = PointNoise(lambda _: LIDAR_SIGMA_M, _BESIDE_SIGMAS_OF_LAYERS)


def plane_sighting(points: np.ndarray, noise: PointNoise) -> Optional[PlaneSighting]:
    """Return the sighting of labeled points (n, 3) [m]; None if they make no plane.

    Args:
        points: in the sensor's frame.
        noise: of the sensor.
    """
    points = points[:: max(len(points) // _MOST_POINTS, 1)].astype(float)
    try:
        centre, normal, _ = fit_plane(points)
    except ValueError:
        return None
    squares = np.sum((points - centre) ** 2, axis=1)
    extent = float(np.sqrt(np.mean(squares)))
    sigma = noise.sigma_m(centre)
    return PlaneSighting(centre, normal, extent, sigma, len(points), noise.beside_sigmas)


class Stop(NamedTuple):
    """A time during which nothing that was seen of the board moved [s]."""

    start_s: float
    end_s: float


@dataclass(frozen=True)
class StillnessOptions:
    """When the board counts as standing still.

    Attributes:
        sigmas: how far a label may be from the stop's first one of its sensor.
        min_still_s: shortest stop.
        longest_pause_s: a sensor that saw nothing for longer does not know what went on.
        take_after_s: a stop that lasts longer is reported without waiting for its end, so that
            no more than this has to be remembered.
    """

    sigmas: float = 1.0
    min_still_s: float = 0.5
    longest_pause_s: float = 1.5
    take_after_s: float = 3.0


DEFAULT_OPTIONS = StillnessOptions()


class StopDetector:
    """Finds the stops in a stream of sightings; give it those of one pattern, in time order."""

    def __init__(self, options: StillnessOptions = DEFAULT_OPTIONS):
        """Start without a sighting."""
        self._options = options
        self._anchors: Dict[str, Sighting] = {}  # the first of each sensor since the start
        self._first_s: Dict[str, float] = {}
        self._last_s: Dict[str, float] = {}
        self._reported = False

    def add(self, sensor: str, stamp_s: float, sighting: Sighting) -> Optional[Stop]:
        """Add what a sensor saw; return a stop that has just become certain."""
        anchor = self._anchors.get(sensor)
        if not self._anchors or (anchor is not None and self._moved(sensor, stamp_s, sighting)):
            stop = self._end(self._last_s[sensor]) if self._anchors else None
            self._anchors, self._reported = {sensor: sighting}, False
            self._first_s, self._last_s = {sensor: stamp_s}, {sensor: stamp_s}
            return stop
        if anchor is None:
            self._anchors[sensor], self._first_s[sensor] = sighting, stamp_s
        self._last_s[sensor] = stamp_s
        if stamp_s - self._first_s[sensor] >= self._options.take_after_s:
            return self._end(stamp_s)
        return None

    def pass_time(self, stamp_s: float) -> Optional[Stop]:
        """Say what time it is; return the stop that ended because the board went out of sight."""
        last_s = max(self._last_s.values(), default=np.inf)
        if stamp_s - last_s <= self._options.longest_pause_s:
            return None
        stop = self.finish()
        self._anchors, self._first_s, self._last_s = {}, {}, {}
        self._reported = False
        return stop

    def finish(self) -> Optional[Stop]:
        """Return the stop that lasted until the end of the stream, if any."""
        return self._end(max(self._last_s.values())) if self._last_s else None

    def _moved(self, sensor: str, stamp_s: float, sighting: Sighting) -> bool:
        if stamp_s - self._last_s[sensor] > self._options.longest_pause_s:
            return True
        return motion(self._anchors[sensor], sighting) > self._options.sigmas

    def _end(self, end_s: float) -> Optional[Stop]:
        """Return the time for which some sensor vouches, by a first and a last sighting."""
        if self._reported:
            return None
        spans = [(first, min(self._last_s[s], end_s)) for s, first in self._first_s.items()]
        spans = [(a, b) for a, b in spans if b - a >= self._options.min_still_s - _EPSILON_S]
        if not spans:
            return None
        self._reported = True
        return Stop(min(first for first, _ in spans), max(last for _, last in spans))


def motion(first: Sighting, second: Sighting) -> float:
    """Return by how many sigmas the board moved between two sightings of one sensor."""
    return first.motion(second)
