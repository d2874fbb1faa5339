"""Frames of several sensors, which come as their labelers get ready, put into the order of time."""

from __future__ import annotations

import heapq
from itertools import count
from typing import Dict, Iterable, List, Tuple

import numpy as np

from atom_calibration.modalities.frames import Frame

_BACK_S = 1.0  # a sensor whose stamps go back by more has begun anew, as when a bag is repeated


class TimeOrder:
    """Holds frames until every sensor is past them, but never for longer than is allowed.

    Attributes:
        newest_s: stamp of the newest frame [s].
        released_s: everything up to this stamp was given out [s].
        late: number of frames by sensor that came too late and were dropped.
    """

    def __init__(self, sensors: Iterable[str] = (), hold_s: float = 1.5):
        """Start empty.

        Args:
            sensors: names of those that are expected; at the beginning they are waited for as if
                they had sent a frame together with the first one.
            hold_s: a sensor whose newest frame is older than the newest of all by more than
                this is not waited for.
        """
        self._expected, self._hold_s = frozenset(sensors), hold_s
        self._number = count()  # of the frame: breaks ties of the heap
        self.late: Dict[str, int] = {}
        self.clear()

    def clear(self) -> None:
        """Forget everything but what came late."""
        self._last_s: Dict[str, float] = {}
        self._held: List[Tuple[float, int, Frame]] = []
        self._begin_s = np.inf
        self.newest_s = self.released_s = -np.inf

    def goes_back(self, frame: Frame) -> bool:
        """Tell whether a frame's sensor began anew; then `clear` before it is added."""
        return frame.stamp_s < self._last_s.get(frame.sensor.name, -np.inf) - _BACK_S

    def is_late(self, frame: Frame) -> bool:
        """Tell whether later data were given out already; then `add` drops the frame."""
        return frame.stamp_s < self.released_s

    def add(self, frame: Frame) -> List[Frame]:
        """Take a frame; return those whose turn it is, in the order of their stamps."""
        name, stamp = frame.sensor.name, frame.stamp_s
        self._last_s[name] = max(stamp, self._last_s.get(name, -np.inf))
        self.newest_s, self._begin_s = max(self.newest_s, stamp), min(self._begin_s, stamp)
        if self.is_late(frame):
            self.late[name] = self.late.get(name, 0) + 1
            return []
        heapq.heappush(self._held, (stamp, next(self._number), frame))
        oldest_s = self.newest_s - self._hold_s
        lasts = list(self._last_s.values())
        if not self._expected <= self._last_s.keys():
            lasts.append(self._begin_s)
        return self._until(min(last for last in lasts if last >= oldest_s))

    def flush(self) -> List[Frame]:
        """Return all that is held, in the order of the stamps."""
        return self._until(self.newest_s)

    def _until(self, time_s: float) -> List[Frame]:
        frames = []
        while self._held and self._held[0][0] <= time_s:
            frames.append(heapq.heappop(self._held)[2])
        self.released_s = max(self.released_s, time_s)
        return frames
