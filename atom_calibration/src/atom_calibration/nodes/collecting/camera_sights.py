"""What cameras saw of the boards, as their labels come, until data of that time are labeled."""

from __future__ import annotations

import threading
from collections import deque
from typing import Any, Callable, Deque, Iterable, List, NamedTuple

from atom_calibration.runtime.pace import Pace

_MOST = 1000


class Sight(NamedTuple):
    """Labels of a camera.

    Attributes:
        stamp_s: of the image [s].
        camera: its name.
        labels: the message.
    """

    stamp_s: float
    camera: str
    labels: Any


class CameraSights:
    """Hands out what cameras saw; callbacks may add while another thread takes."""

    def __init__(self, cameras: Iterable[str]):
        """Start empty, with these cameras to wait for."""
        self._lock = threading.Lock()
        self._waiting: Deque[Sight] = deque(maxlen=_MOST)
        self._pace = Pace(cameras, late_s=0.0)

    def add(self, sight: Sight) -> None:
        """Take in the labels of an image."""
        with self._lock:
            self._waiting.append(sight)
            self._pace.note(sight.camera, sight.stamp_s, sight.stamp_s)

    def note_idle(self, camera: str, until_s: float) -> None:
        """Take in that a camera's labeler has labeled all that had come until a time [s]."""
        with self._lock:
            self._pace.note_idle(camera, until_s)

    def wait_for(
        self, stamp_s: float, pause: Callable[[float], None], ended: Callable[[], bool]
    ) -> None:
        """Wait until cameras have labeled what they saw until a time, but for nobody for ever.

        Args:
            stamp_s: of the data that are to be labeled [s].
            pause: waits for so many seconds of the wall's clock.
            ended: tells that there is no more reason to wait.
        """
        self._pace.wait(lambda: stamp_s, pause, ended)

    def take(self, until_s: float) -> List[Sight]:
        """Return what was seen until a time [s], in the order of time; later sights stay."""
        with self._lock:
            sights = list(self._waiting)
            self._waiting.clear()
            self._waiting.extend(sight for sight in sights if sight.stamp_s > until_s)
        past = [sight for sight in sights if sight.stamp_s <= until_s]
        return sorted(past, key=lambda sight: sight.stamp_s)

    def clear(self) -> None:
        """Forget all: time went back."""
        with self._lock:
            self._waiting.clear()
