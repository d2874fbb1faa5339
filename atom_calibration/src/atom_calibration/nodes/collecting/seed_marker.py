"""The sphere in RViz that tells a range sensor where the board is, and shows where it looks.

Grey: nothing came yet; green: the board is detected, red: it is not; opaque: set by hand.
"""

from __future__ import annotations

import threading
import time
from typing import Callable, Optional

import numpy as np

from atom_calibration.modalities.frames import Frame
from atom_calibration.modalities.seeds import SeedInput
from atom_calibration.runtime.graph_names import topic_of
from atom_calibration.show import markers
from atom_calibration.show.pose_marker import POSITION, MarkerServer, Moved, PoseMarker
from atom_core.geometry import se3
from atom_core.model.sensor import Sensor

BACK_TO_AUTOMATIC = "Automatic seed"
_SCALE_M, _SPHERE_M = 0.4, 0.12
_GREY, _GREEN, _RED = (0.6, 0.6, 0.6), (0.24, 0.86, 0.24), (1.0, 0.16, 0.16)
_FIRST_DISTANCE_M = 1.5  # where it waits for the first detection
_HELD_S = 1.0  # a drag without an end, as when RViz is closed, lasts so long
_STILL_M = 1e-3

OnSeed = Callable[[Optional[np.ndarray]], None]


class SeedMarker:
    """Marker on the server /SENSOR/data_labeler, in the frame of the sensor's data."""

    def __init__(self, sensor: Sensor, seeds: SeedInput, on_seed: OnSeed):
        """Show it where it waits for the first detection.

        Args:
            sensor: one that needs seeds.
            seeds: what a seed of its modality means.
            on_seed: is told the seed that the user sets, (3,) [m] or of a depth camera (2,) [px],
                or None: seeds shall be automatic again. Called in a thread of ROS.
        """
        self._sensor, self._seeds, self._on_seed = sensor, seeds, on_seed
        self._lock = threading.Lock()
        self._held_until_s = 0.0  # of the wall's clock
        self._dragged_to = np.zeros(3)
        self._look = (_GREY, False, sensor.name)  # colour, by hand, words
        self._marker = PoseMarker(
            MarkerServer(topic_of(sensor.name, "data_labeler")),
            sensor.name,
            sensor.frame,
            se3.transform(np.eye(3), _FIRST_DISTANCE_M * seeds.ahead),
            self._moved,
            moves=POSITION,
            scale=_SCALE_M,
            shapes=[self._sphere()],
            description=sensor.name,
            menu=[(BACK_TO_AUTOMATIC, lambda: on_seed(None))],
        )

    def show(self, frame: Frame, by_hand: Optional[np.ndarray]) -> None:
        """Show what a labeled frame says; the board is followed unless the seed is set by hand.

        Args:
            frame: labeled.
            by_hand: the user's seed; None: seeds are automatic.
        """
        with self._lock:
            if time.monotonic() < self._held_until_s:
                return
        place = self._place(frame, by_hand)
        if place is not None and np.linalg.norm(place - self._position) > _STILL_M:
            self._marker.move(se3.transform(np.eye(3), place))
        found = frame.detections > 0
        words = f"{self._sensor.name}{'' if by_hand is None else ', by hand'}"
        words = words if found else f"{words}: not detected"
        look = (_GREEN if found else _RED, by_hand is not None, words)
        if look != self._look:
            self._look = look
            self._marker.redraw([self._sphere()], words)

    @property
    def _position(self) -> np.ndarray:
        return self._marker.frame_T_marker[:3, 3]

    def _place(self, frame: Frame, by_hand: Optional[np.ndarray]) -> Optional[np.ndarray]:
        """Return where the marker belongs (3,) [m]; None: where it is."""
        if by_hand is not None:
            if np.allclose(by_hand, self._seed(), atol=self._seeds.same):
                return None  # it was dragged there, before or behind what is seen
            return self._seeds.point(frame, by_hand, float(self._position[2]))
        found = [x.next_seed for x in frame.labels.values() if x.next_seed is not None]
        return self._seeds.point(frame, found[0], float(self._position[2])) if found else None

    def _seed(self) -> np.ndarray:
        """Return the seed that the marker covers."""
        seed = self._seeds.of_point(self._sensor, self._position)
        return self._seeds.nowhere if seed is None else seed

    def _moved(self, move: Moved) -> None:
        """Take a step of a drag; a mere click, which only ends, is none."""
        now = time.monotonic()
        with self._lock:
            held = now < self._held_until_s
            self._held_until_s = 0.0 if move.dropped else now + _HELD_S
        if move.dropped and not held:
            return
        place = self._position.copy()
        rests, self._dragged_to = held and np.array_equal(place, self._dragged_to), place
        if move.dropped or not rests:  # RViz repeats itself while nobody moves
            self._on_seed(self._seed())

    def _sphere(self) -> markers.Marker:
        colour, by_hand, _ = self._look
        return markers.sphere("", _SPHERE_M, colour, 0.95 if by_hand else 0.5)
