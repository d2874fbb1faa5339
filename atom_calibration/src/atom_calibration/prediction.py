"""Where a range sensor should see the board, from a camera's sight of it and the first estimate.

The first estimate may be off by decimetres. Every label tells by how much, so that the next
prediction is better: a shift at first, a whole rigid motion once the board was seen in several
places.
"""

from __future__ import annotations

from collections import deque
from typing import Deque, Dict, List, Optional, Tuple

import numpy as np

from atom_calibration.errors import TransformError
from atom_calibration.tf_snapshot import TransformTree
from atom_core.geometry import se3
from atom_core.labeling.lidar3d import predict_seed
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import Sensor

FRESH_S = 1.0  # a camera's sight of the board is of use for so long
# A label farther from the prediction is another thing; by the number of places learnt from. A first
# estimate that is off by 0.1 m and 0.1 rad, of camera and sensor, makes 0.6 m at 2 m; part of the
# board may be hidden.
_NEAR_M = (1.2, 0.9, 0.65, 0.65, 0.65, 0.5)
_APART_M = 0.2  # places nearer to each other than this count once
_PLACES_FOR_SHIFT, _PLACES_FOR_MOTION, _MOST_PLACES = 1, 5, 60
_SPREAD_M = 0.3  # of the places, in the second direction: what a motion needs to be determined


class BoardPredictor:
    """Remembers where cameras saw the boards, and how far off predictions were."""

    def __init__(self, world: str):
        """Start with nothing seen.

        Args:
            world: frame in which boards are remembered.
        """
        self._world = world
        self._boards: Dict[str, Tuple[float, np.ndarray]] = {}  # stamp, world_T_pattern
        self._pairs: Dict[str, Deque[Tuple[np.ndarray, np.ndarray]]] = {}
        self._corrections: Dict[str, np.ndarray] = {}

    def see(
        self,
        camera_frame: str,
        pattern: str,
        stamp_s: float,
        camera_T_pattern: np.ndarray,
        tree: TransformTree,
    ) -> None:
        """Take note of a board that a camera saw, unless the camera's place is not known."""
        try:
            world_T_camera = tree.lookup(self._world, camera_frame, stamp_s)
        except TransformError:
            return
        self._boards[pattern] = (stamp_s, world_T_camera @ camera_T_pattern)

    def predict(
        self, sensor: Sensor, pattern: Pattern, stamp_s: float, tree: TransformTree
    ) -> Optional[np.ndarray]:
        """Return the board's middle (3,) [m] in a sensor's frame; None if nothing tells."""
        raw = self._raw(sensor, pattern, stamp_s, tree)
        if raw is None or sensor.name not in self._corrections:
            return raw
        return se3.apply(self._corrections[sensor.name], raw[None])[0]

    def is_plausible(self, sensor: Sensor, prediction: np.ndarray, found: np.ndarray) -> bool:
        """Tell whether what was found (3,) [m] may be the board that was predicted."""
        places = len(self._pairs.get(sensor.name, ()))
        near = _NEAR_M[min(places, len(_NEAR_M) - 1)]
        return bool(np.linalg.norm(found - prediction) <= near)

    def learn(
        self,
        sensor: Sensor,
        pattern: Pattern,
        stamp_s: float,
        found: np.ndarray,
        tree: TransformTree,
    ) -> None:
        """Improve predictions by where a label's points have their middle (3,) [m].

        Also of labels that are not plausible by what was learnt so far: it may have been wrong.
        A thing that stands still while the board moves counts once.
        """
        raw = self._raw(sensor, pattern, stamp_s, tree)
        if raw is None or np.linalg.norm(raw - found) > _NEAR_M[0]:
            return
        pairs = self._pairs.setdefault(sensor.name, deque(maxlen=_MOST_PLACES))
        for seen in pairs:
            if min(np.linalg.norm(raw - seen[0]), np.linalg.norm(found - seen[1])) < _APART_M:
                return
        pairs.append((raw, found))
        if len(pairs) >= _PLACES_FOR_SHIFT:
            self._corrections[sensor.name] = _correction(list(pairs))

    def _raw(
        self, sensor: Sensor, pattern: Pattern, stamp_s: float, tree: TransformTree
    ) -> Optional[np.ndarray]:
        seen_s, world_T_pattern = self._boards.get(pattern.name, (-np.inf, np.eye(4)))
        if abs(stamp_s - seen_s) > FRESH_S:
            return None
        try:
            world_T_sensor = tree.lookup(self._world, sensor.frame, stamp_s)
        except TransformError:
            return None
        return predict_seed(world_T_sensor, world_T_pattern, pattern.border)


def _correction(pairs: List[Tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Return found_T_predicted (4, 4): the median shift, or the best rigid motion."""
    predicted = np.array([p for p, _ in pairs])
    found = np.array([f for _, f in pairs])
    shift = se3.transform(np.eye(3), np.median(found - predicted, axis=0))
    if len(pairs) < _PLACES_FOR_MOTION:
        return shift
    off = np.linalg.norm(se3.apply(shift, predicted) - found, axis=1)
    good = off <= 3.0 * np.median(off) + 0.05
    a, b = predicted[good], found[good]
    centre_a, centre_b = a.mean(axis=0), b.mean(axis=0)
    u, _, vt = np.linalg.svd((b - centre_b).T @ (a - centre_a))
    spread = np.linalg.svd(a - centre_a, compute_uv=False) / np.sqrt(len(a))
    if spread[1] < _SPREAD_M:
        return shift
    rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return se3.transform(rotation, centre_b - rotation @ centre_a)
