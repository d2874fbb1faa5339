"""The sphere in RViz that tells a range sensor where the board is, and shows where it looks.

Grey: nothing came yet; green: the board is detected, red: it is not; opaque: set by hand.
"""

from __future__ import annotations

import threading
import time
from typing import Callable, Optional

import numpy as np

from atom_calibration.labels.frames import Frame
from atom_calibration.show import markers
from atom_calibration.show.pose_marker import POSITION, MarkerServer, Moved, PoseMarker
from atom_core.geometry import se3
from atom_core.model.sensor import DEPTH, Sensor

BACK_TO_AUTOMATIC = "Automatic seed"
_SCALE_M, _SPHERE_M = 0.4, 0.12
_GREY, _GREEN, _RED = (0.6, 0.6, 0.6), (0.24, 0.86, 0.24), (1.0, 0.16, 0.16)
_FIRST_DISTANCE_M = 1.5  # where it waits for the first detection
_NOWHERE_PX = -1.0  # both numbers of a pixel that no image has
_HELD_S = 1.0  # a drag without an end, as when RViz is closed, lasts so long
_STILL_M = 1e-3
_AROUND_PX = 3  # half of the window that tells the depth at a pixel

OnSeed = Callable[[Optional[np.ndarray]], None]


class SeedMarker:
    """Marker on the server /SENSOR/data_labeler, in the frame of the sensor's data."""

    def __init__(self, sensor: Sensor, on_seed: OnSeed):
        """Show it where it waits for the first detection.

        Args:
            sensor: a range sensor.
            on_seed: is told the seed that the user sets, (3,) [m] or of a depth camera (2,) [px],
                or None: seeds shall be automatic again. Called in a thread of ROS.
        """
        self._sensor, self._on_seed = sensor, on_seed
        self._lock = threading.Lock()
        self._held_until_s = 0.0  # of the wall's clock
        self._dragged_to = np.zeros(3)
        self._look = (_GREY, False, sensor.name)  # colour, by hand, words
        ahead = [0.0, 0.0, 1.0] if sensor.modality == DEPTH else [1.0, 0.0, 0.0]
        self._marker = PoseMarker(
            MarkerServer(f"/{sensor.name}/data_labeler"),
            sensor.name,
            sensor.frame,
            se3.transform(np.eye(3), _FIRST_DISTANCE_M * np.array(ahead)),
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
        look = (_GREEN if found else _RED, by_hand is not None, words)
        if look != self._look:
            self._look = look
            self._marker.redraw([self._sphere()], words if found else f"{words}: not detected")

    @property
    def _position(self) -> np.ndarray:
        return self._marker.frame_T_marker[:3, 3]

    def _place(self, frame: Frame, by_hand: Optional[np.ndarray]) -> Optional[np.ndarray]:
        """Return where the marker belongs (3,) [m]; None: where it is."""
        if by_hand is not None:
            if self._sensor.modality == DEPTH and np.allclose(by_hand, self._pixel(), atol=0.5):
                return None  # it was dragged there, before or behind what is seen
            return self._point(frame, by_hand)
        found = [x.next_seed for x in frame.labels.values() if x.next_seed is not None]
        return self._point(frame, found[0]) if found else None

    def _point(self, frame: Frame, seed: np.ndarray) -> Optional[np.ndarray]:
        """Return the point (3,) [m] of a seed; None for a pixel outside the image."""
        camera = self._sensor.camera
        if self._sensor.modality != DEPTH or camera is None:
            return seed
        column, row = (int(round(value)) for value in seed)
        if not (0 <= row < frame.data.shape[0] and 0 <= column < frame.data.shape[1]):
            return None
        low = max(row - _AROUND_PX, 0), max(column - _AROUND_PX, 0)
        window = frame.data[low[0] : row + _AROUND_PX + 1, low[1] : column + _AROUND_PX + 1]
        seen = window[np.isfinite(window)]
        depth_m = float(np.median(seen)) if seen.size else float(self._position[2])
        return camera.ray_points(seed[None].astype(float), np.array([depth_m]))[0]

    def _pixel(self) -> np.ndarray:
        """Return the pixel (2,) that the marker covers."""
        camera, point = self._sensor.camera, self._position
        if camera is None or not camera.in_image(point[None])[0]:
            return np.full(2, _NOWHERE_PX)
        return camera.project(point[None])[0]

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
            self._on_seed(self._pixel() if self._sensor.modality == DEPTH else place)

    def _sphere(self) -> markers.Marker:
        colour, by_hand, _ = self._look
        return markers.sphere("", _SPHERE_M, colour, 0.95 if by_hand else 0.5)
