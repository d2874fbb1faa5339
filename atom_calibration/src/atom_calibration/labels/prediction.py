"""Where a range sensor should see the board, from a camera's sight of it and the first estimate.

The first estimate may be off by decimetres and degrees. Every label tells by how much: its plane
to a degree and centimetres (a 2D LiDAR's: a line in it), its middle roughly, since part of the
board may be hidden or out of view. So for each camera and range sensor one rigid motion is
estimated, with its covariance. It makes the next prediction better, and says how far from it
something may be and still be the board.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Deque, Dict, NamedTuple, Optional, Tuple

import numpy as np

from atom_calibration.errors import TransformError
from atom_calibration.sources.transform_tree import TransformTree
from atom_core.geometry import se3
from atom_core.labeling.stillness import SurfaceSighting
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import Sensor

FRESH_S = 1.0  # a camera's sight of the board is of use for so long
_PRIOR_RAD, _PRIOR_M = 0.12, 0.15  # one sigma of the first estimate of camera and sensor, each axis
_NORMAL_RAD, _OFF_PLANE_M = 0.03, 0.03  # one sigma of a label
_GATE_SIGMAS = 4.0
_MOST_DRIFT_M = 0.02  # of a board in motion since a camera saw it, to learn from its label
_UNKNOWN_SPEED_M_S = 0.5
_APART_M, _APART_RAD = 0.2, 0.2  # places nearer to each other than this count once
_MOST_PLACES, _ITERATIONS = 30, 6
_USUAL_SQUARE, _TAIL_SQUARE = 5.0, 9.0  # of a label's misfit in sigmas: expected, and half weight


class Guess(NamedTuple):
    """Where the board should be in a sensor's frame.

    Attributes:
        middle: (3,) of the board [m].
        normal: (3,) of the board, either way.
        half_diagonal_m: of the board.
        drift_m: how far the board may have moved since a camera saw it.
        covariance: (6, 6) of a small rotation about the sensor's axes [rad] and a shift [m].
    """

    middle: np.ndarray
    normal: np.ndarray
    half_diagonal_m: float
    drift_m: float
    covariance: np.ndarray

    @property
    def sigma_m(self) -> float:
        """Return how exact the middle is: root of the mean variance."""
        jacobian = np.hstack([-se3.skew(self.middle), np.eye(3)])
        variance = np.trace(jacobian @ self.covariance @ jacobian.T) / 3.0
        return float(np.sqrt(variance + self.drift_m**2))

    def agrees(self, found: SurfaceSighting) -> bool:
        """Tell whether what was found may be the board."""
        misfit = _misfit(self.middle, self.normal, found)
        variance = np.einsum("ij,jk,ik->i", misfit.jacobian, self.covariance, misfit.jacobian)
        turned = self.drift_m / self.half_diagonal_m
        variance += misfit.by_kind(turned, self.drift_m, self.drift_m) ** 2
        variance += misfit.by_kind(_NORMAL_RAD, _OFF_PLANE_M, _OFF_PLANE_M) ** 2
        limit = _GATE_SIGMAS * np.sqrt(variance)
        limit += misfit.by_kind(0.0, 0.0, self.half_diagonal_m)  # the labeled part may be any
        return bool(np.all(np.abs(misfit.numbers) <= limit))


class BoardPredictor:
    """Remembers where cameras saw the boards, and how far off predictions were."""

    def __init__(self, world: str):
        """Start with nothing seen.

        Args:
            world: frame in which boards are remembered.
        """
        self._world = world
        self._seen: Dict[Tuple[str, str], _Seen] = {}  # by a camera's frame and pattern
        self._corrections: Dict[Tuple[str, str], _Correction] = {}  # by frame, range sensor

    def see(
        self,
        camera_frame: str,
        pattern: Pattern,
        stamp_s: float,
        camera_T_pattern: np.ndarray,
        tree: TransformTree,
    ) -> None:
        """Take note of a board that a camera saw, unless the camera's place is not known."""
        try:
            world_T_camera = tree.lookup(self._world, camera_frame, stamp_s)
        except TransformError:
            return
        key = (camera_frame, pattern.name)
        pose = world_T_camera @ camera_T_pattern
        speed = _speed(self._seen.get(key), stamp_s, pose, pattern)
        self._seen[key] = _Seen(stamp_s, pose, speed)

    def predict(
        self, sensor: Sensor, pattern: Pattern, stamp_s: float, tree: TransformTree
    ) -> Optional[Guess]:
        """Return where a sensor should see the board, by the camera that tells it most exactly.

        None if no camera saw it lately, or transforms are not known.
        """
        guesses = [
            self._corrections.get((camera, sensor.name), _Correction()).apply(raw)
            for camera, raw in self._raw(sensor, pattern, stamp_s, tree).items()
        ]
        return min(guesses, key=lambda guess: guess.sigma_m) if guesses else None

    def learn(
        self,
        sensor: Sensor,
        pattern: Pattern,
        stamp_s: float,
        found: SurfaceSighting,
        tree: TransformTree,
    ) -> None:
        """Improve predictions by what a label says of the board's surface and middle.

        Also by labels that are not plausible by what was learnt so far: it may have been wrong.
        What would be out of the question even at the beginning is passed over.
        """
        for camera, raw in self._raw(sensor, pattern, stamp_s, tree).items():
            if raw.drift_m <= _MOST_DRIFT_M and raw.agrees(found):
                key = (camera, sensor.name)
                self._corrections.setdefault(key, _Correction()).add(raw, found)

    def _raw(
        self, sensor: Sensor, pattern: Pattern, stamp_s: float, tree: TransformTree
    ) -> Dict[str, Guess]:
        """Return what the first estimate says, by camera."""
        guesses: Dict[str, Guess] = {}
        for (camera, name), seen in self._seen.items():
            if name != pattern.name or abs(stamp_s - seen.stamp_s) > FRESH_S:
                continue
            try:
                world_T_sensor = tree.lookup(self._world, sensor.frame, stamp_s)
            except TransformError:
                return {}
            sensor_T_pattern = se3.inverse(world_T_sensor) @ seen.world_T_pattern
            guesses[camera] = Guess(
                _middle(sensor_T_pattern, pattern),
                sensor_T_pattern[:3, 2],
                float(np.linalg.norm(pattern.border.half_size)),
                seen.speed_m_s * abs(stamp_s - seen.stamp_s),
                _PRIOR,
            )
        return guesses


class _Seen(NamedTuple):
    """A camera's sight of a board."""

    stamp_s: float
    world_T_pattern: np.ndarray
    speed_m_s: float


_PRIOR = np.diag([_PRIOR_RAD**2] * 3 + [_PRIOR_M**2] * 3)


@dataclass
class _Correction:
    """The rigid motion from predicted to found, by all places seen so far."""

    places: Deque[Tuple[Guess, SurfaceSighting]] = field(
        default_factory=lambda: deque(maxlen=_MOST_PLACES)
    )
    found_T_predicted: np.ndarray = field(default_factory=lambda: np.eye(4))
    covariance: np.ndarray = field(default_factory=lambda: _PRIOR)

    def apply(self, raw: Guess) -> Guess:
        """Return the corrected guess."""
        middle = se3.apply(self.found_T_predicted, raw.middle[None])[0]
        normal = self.found_T_predicted[:3, :3] @ raw.normal
        return raw._replace(middle=middle, normal=normal, covariance=self.covariance)

    def add(self, raw: Guess, found: SurfaceSighting) -> None:
        """Learn from a place, unless board or thing found stand where they stood."""
        if self.places:
            before = np.array([[g.middle, g.normal, seen.centre] for g, seen in self.places])
            moved = np.linalg.norm(before[:, 0] - raw.middle, axis=1)
            turned = np.linalg.norm(np.cross(before[:, 1], raw.normal), axis=1)
            apart = np.linalg.norm(before[:, 2] - found.centre, axis=1)
            still = (moved < _APART_M) & (turned < _APART_RAD)
            if np.any(still | (apart < 0.25 * _APART_M)):
                return
        self.places.append((raw, found))
        self._estimate()

    def _estimate(self) -> None:
        """Robust weighted least squares, beside a prior of no correction."""
        pose = np.eye(4)
        for _ in range(_ITERATIONS):
            information = np.linalg.inv(_PRIOR)
            turn = se3.rotation_vector_from_rotation(pose[:3, :3])
            gradient = information @ np.concatenate([turn, pose[:3, 3]])
            for raw, found in self.places:
                middle, normal = se3.apply(pose, raw.middle[None])[0], pose[:3, :3] @ raw.normal
                misfit = _misfit(middle, normal, found)
                sigma = misfit.by_kind(_NORMAL_RAD, _OFF_PLANE_M, 0.5 * raw.half_diagonal_m)
                square = float(np.sum((misfit.numbers / sigma) ** 2))
                weight = 1.0 / (1.0 + max(square - _USUAL_SQUARE, 0.0) / _TAIL_SQUARE)
                rows = misfit.jacobian / sigma[:, None]
                information += weight * rows.T @ rows
                gradient += weight * rows.T @ (misfit.numbers / sigma)
            step = -np.linalg.solve(information, gradient)
            turned = se3.rotation_from_rotation_vector(step[:3])
            pose = se3.transform(turned, step[3:]) @ pose
        self.found_T_predicted, self.covariance = pose, np.linalg.inv(information)


class _Misfit(NamedTuple):
    """How a predicted board differs from what was found.

    Attributes:
        numbers: (n,) the normal's direction [rad], off the surface [m], beside, two numbers [m].
        jacobian: (n, 6) by a rotation of the prediction about the sensor's axes and by a shift.
        directions: how many of the numbers are directions: two by a plane, one by a line.
    """

    numbers: np.ndarray
    jacobian: np.ndarray
    directions: int

    def by_kind(self, direction: float, off: float, beside: float) -> np.ndarray:
        """Return (n,) with a figure for each kind of number."""
        return np.array([direction] * self.directions + [off] + [beside] * 2)


def _misfit(middle: np.ndarray, normal: np.ndarray, found: SurfaceSighting) -> _Misfit:
    """Compare a predicted board, its middle (3,) [m] and its normal (3,), with what was found."""
    axes, known = found.board_axes(normal), found.known_axes
    beside, off = axes[:, :2].T, axes[:, 2]
    normal = normal if normal @ off >= 0 else -normal
    away = middle - found.centre
    numbers = np.concatenate([beside[:known] @ normal, [off @ away], beside @ away])
    jacobian = np.zeros((known + 3, 6))
    jacobian[:known, :3] = -beside[:known] @ se3.skew(normal)
    moved = np.vstack([off, beside])
    jacobian[known:, :3] = -moved @ se3.skew(middle)
    jacobian[known:, 3:] = moved
    # The nearest normal turns with the prediction about the axes that are known.
    free = beside[known:]
    jacobian[known, :3] -= (free @ away) @ free @ se3.skew(normal)
    return _Misfit(numbers, jacobian, known)


def _middle(frame_T_pattern: np.ndarray, pattern: Pattern) -> np.ndarray:
    return se3.apply(frame_T_pattern, np.append(pattern.border.centre, 0.0)[None])[0]


def _speed(before: Optional[_Seen], stamp_s: float, pose: np.ndarray, pattern: Pattern) -> float:
    """Return how fast [m/s] the board's points move, at most, by two sights in a row."""
    if before is None or not 0.0 < stamp_s - before.stamp_s <= 2.0 * FRESH_S:
        return _UNKNOWN_SPEED_M_S
    shift = np.linalg.norm(_middle(pose, pattern) - _middle(before.world_T_pattern, pattern))
    angle = se3.rotation_angle(before.world_T_pattern[:3, :3].T @ pose[:3, :3])
    way = shift + angle * np.linalg.norm(pattern.border.half_size)
    return float(way / (stamp_s - before.stamp_s))
