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
from typing import Deque, Dict, Iterable, List, NamedTuple, Optional, Tuple

import numpy as np

from atom_calibration.errors import TransformError
from atom_calibration.labels.camera_links import CameraLinks
from atom_calibration.labels.common_motion import (
    FEWEST_PLACES,
    LEAST_PLACES,
    CommonMotion,
    Place,
    common_motion,
)
from atom_calibration.labels.guess import NORMAL_RAD, OFF_PLANE_M, Guess, misfit
from atom_calibration.sources.transform_tree import TransformTree
from atom_core.geometry import se3
from atom_core.labeling.stillness import SurfaceSighting
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import Sensor

FRESH_S = 1.0  # a camera's sight of the board is of use for so long
_PRIOR_RAD, _PRIOR_M = 0.12, 0.15  # one sigma of the first estimate of camera and sensor, each axis
_MOST_DRIFT_M = 0.02  # of a board in motion since a camera saw it, to learn from its label
_UNKNOWN_SPEED_M_S = 0.5
_APART_M, _APART_RAD = 0.2, 0.2  # places nearer to each other than this count once
_MOST_PLACES, _ITERATIONS = 30, 6
_SETTLED = 1e-7  # of a step [rad, m]
_USUAL_SQUARE, _TAIL_SQUARE = 5.0, 9.0  # of a label's misfit in sigmas: expected, and half weight


class BoardPredictor:
    """Remembers where cameras saw the boards, and how far off predictions were.

    Attributes:
        relocated: what is to be said of sensors that are not at all where the transforms have
            them, a sentence by sensor.
    """

    def __init__(self, world: str):
        """Start with nothing seen.

        Args:
            world: frame in which boards are remembered.
        """
        self._world = world
        self._contradictions: Dict[Tuple[str, str], List[Place]] = {}
        self.relocated: Dict[str, str] = {}
        self._links = CameraLinks()
        self._sensors: Dict[str, Tuple[Sensor, np.ndarray]] = {}  # that contradict, world_T_sensor
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
        self._seen[key] = seen = _Seen(stamp_s, pose, speed)
        for (other, name), before in self._seen.items():
            apart_s = abs(stamp_s - before.stamp_s)
            drift_m = max(seen.speed_m_s, before.speed_m_s) * apart_s
            if name != pattern.name or other == camera_frame or apart_s > FRESH_S:
                continue
            if drift_m <= _MOST_DRIFT_M:
                self._links.see(camera_frame, other, pose, before.world_T_pattern)

    def predict(
        self, sensor: Sensor, pattern: Pattern, stamp_s: float, tree: TransformTree
    ) -> Optional[Guess]:
        """Return where a sensor should see the board, by the camera that tells it most exactly.

        None if no camera saw it lately, or transforms are not known.
        """
        guesses = [
            self._correction(camera, sensor).apply(raw)
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
        What would be out of the question even at the beginning is passed over, unless it goes on
        like that: where all labels contradict the transforms in the same way, these are wrong.
        """
        for camera, raw in self._raw(sensor, pattern, stamp_s, tree).items():
            if raw.drift_m > _MOST_DRIFT_M:
                continue
            correction = self._correction(camera, sensor)
            if raw.moved(correction.first).agrees(found):
                correction.add(raw, found)
            elif found.known_axes == 2:
                world_T_sensor = tree.lookup(self._world, sensor.frame, stamp_s)
                self._contradict(camera, sensor, (raw, found), world_T_sensor)

    def forget_sights(self) -> None:
        """Forget where boards were seen: time goes back. What was learned of the sensors stays."""
        self._seen = {}

    def _correction(self, camera: str, sensor: Sensor) -> _Correction:
        return self._corrections.setdefault((camera, sensor.name), _Correction())

    def _contradict(
        self, camera: str, sensor: Sensor, place: Place, world_T_sensor: np.ndarray
    ) -> None:
        """Take note of a label out of the question; believe the labels where all say the same."""
        places = self._contradictions.setdefault((camera, sensor.name), [])
        if _is_known(places, *place):
            return
        places.append(place)
        del places[:-_MOST_PLACES]
        self._sensors[sensor.name] = sensor, world_T_sensor
        self._believe(camera, sensor, world_T_sensor)

    def settle(self) -> None:
        """Believe few labels that all say the same: nothing more will be seen."""
        for camera, name in list(self._contradictions):
            sensor, world_T_sensor = self._sensors[name]
            if name not in self.relocated and not self._correction(camera, sensor).places:
                self._believe(camera, sensor, world_T_sensor, few=True)

    def _believe(
        self, camera: str, sensor: Sensor, world_T_sensor: np.ndarray, few: bool = False
    ) -> None:
        """Take the motion on which labels that contradict a camera's boards agree, if any."""
        places = self._contradictions[camera, sensor.name]
        others = self._as_others_have_it(camera, world_T_sensor)
        together = list(places)
        for other, camera_T_other in others.items():
            for raw, found in self._contradictions.get((other, sensor.name), []):
                moved = raw.moved(camera_T_other)
                if not _is_known(together, moved, found):
                    together.append((moved, found))
        agreeing = len(self._correction(camera, sensor).places)
        if len(together) < max(FEWEST_PLACES if few else LEAST_PLACES, 2 * agreeing):
            return
        motion = common_motion(together, few)
        if motion is None:
            return
        for other, camera_T_other in {camera: np.eye(4), **others}.items():
            self._relocate(other, sensor, motion, camera_T_other)
        shift_m = np.linalg.norm(motion.found_T_predicted[:3, 3])
        turn_deg = np.degrees(se3.rotation_angle(motion.found_T_predicted[:3, :3]))
        self.relocated.setdefault(
            sensor.name,
            f"sensor '{sensor.name}' is not where the transforms have it: {len(motion.places)} "
            f"boards that camera frame '{camera}' saw too show it {shift_m:.1f} m and "
            f"{turn_deg:.0f} deg from there; its labels go by what they show; give it a first "
            f"guess (set_initial_estimate), or calibrate with --initial_guess none",
        )

    def _as_others_have_it(self, camera: str, world_T_sensor: np.ndarray) -> Dict[str, np.ndarray]:
        """Return what brings other cameras' predictions (4, 4), in a sensor's frame, to one's."""
        moves: Dict[str, np.ndarray] = {}
        for other in self._links.linked_with(camera):
            between = self._links.between(camera, other)
            if between is not None:
                moves[other] = se3.inverse(world_T_sensor) @ between @ world_T_sensor
        return moves

    def _relocate(
        self, camera: str, sensor: Sensor, motion: CommonMotion, first_T_camera: np.ndarray
    ) -> None:
        """Let predictions by a camera start from a motion that another one's boards showed."""
        agreeing = len(self._correction(camera, sensor).places)
        if agreeing and 2 * agreeing > len(motion.places):
            return
        correction = _Correction(first=motion.found_T_predicted @ first_T_camera)
        for raw, found in motion.places:
            correction.add(raw.moved(se3.inverse(first_T_camera)), found)
        self._corrections[camera, sensor.name] = correction
        self._contradictions[camera, sensor.name] = []

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
_PRIOR_INFORMATION = np.linalg.inv(_PRIOR)


@dataclass
class _Correction:
    """The rigid motion from predicted to found, by all places seen so far."""

    first: np.ndarray = field(default_factory=lambda: np.eye(4))  # around it is the prior
    places: Deque[Place] = field(default_factory=lambda: deque(maxlen=_MOST_PLACES))
    found_T_predicted: np.ndarray = field(init=False)
    covariance: np.ndarray = field(default_factory=lambda: _PRIOR)

    def __post_init__(self) -> None:
        self.found_T_predicted = self.first

    def apply(self, raw: Guess) -> Guess:
        """Return the corrected guess."""
        return raw.moved(self.found_T_predicted)._replace(covariance=self.covariance)

    def add(self, raw: Guess, found: SurfaceSighting) -> None:
        """Learn from a place, unless board or thing found stand where they stood."""
        if _is_known(self.places, raw, found):
            return
        self.places.append((raw, found))
        self._estimate()

    def _estimate(self) -> None:
        """Robust weighted least squares, beside a prior of no further correction."""
        pose = self.first
        for _ in range(_ITERATIONS):
            information = _PRIOR_INFORMATION.copy()
            further = pose @ se3.inverse(self.first)
            turn = se3.rotation_vector_from_rotation(further[:3, :3])
            gradient = information @ np.concatenate([turn, further[:3, 3]])
            for raw, found in self.places:
                moved = raw.moved(pose)
                off = misfit(moved.middle, moved.normal, found)
                sigma = off.by_kind(NORMAL_RAD, OFF_PLANE_M, 0.5 * raw.half_diagonal_m)
                square = float(np.sum((off.numbers / sigma) ** 2))
                weight = 1.0 / (1.0 + max(square - _USUAL_SQUARE, 0.0) / _TAIL_SQUARE)
                rows = off.jacobian / sigma[:, None]
                information += weight * rows.T @ rows
                gradient += weight * rows.T @ (off.numbers / sigma)
            step = -np.linalg.solve(information, gradient)
            turned = se3.rotation_from_rotation_vector(step[:3])
            pose = se3.transform(turned, step[3:]) @ pose
            if np.abs(step).max() < _SETTLED:
                break
        self.found_T_predicted, self.covariance = pose, np.linalg.inv(information)


def _is_known(places: Iterable[Place], raw: Guess, found: SurfaceSighting) -> bool:
    """Tell whether the board, or the thing found, stands where one of the places is."""
    before = np.array([[guess.middle, guess.normal, seen.centre] for guess, seen in places])
    if not len(before):
        return False
    moved = np.linalg.norm(before[:, 0] - raw.middle, axis=1)
    turned = np.linalg.norm(np.cross(before[:, 1], raw.normal), axis=1)
    apart = np.linalg.norm(before[:, 2] - found.centre, axis=1)
    still = (moved < _APART_M) & (turned < _APART_RAD)
    return bool(np.any(still | (apart < 0.25 * _APART_M)))


def _middle(frame_T_pattern: np.ndarray, pattern: Pattern) -> np.ndarray:
    return se3.apply(frame_T_pattern, pattern.border.centre_in_pattern[None])[0]


def _speed(before: Optional[_Seen], stamp_s: float, pose: np.ndarray, pattern: Pattern) -> float:
    """Return how fast [m/s] the board's points move, at most, by two sights in a row."""
    if before is None or not 0.0 < stamp_s - before.stamp_s <= 2.0 * FRESH_S:
        return _UNKNOWN_SPEED_M_S
    return pattern.border.way_m(before.world_T_pattern, pose) / (stamp_s - before.stamp_s)
