"""How fast a board moves before the sensors, to say it where a label fails meanwhile."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import Deque, Dict, List, Tuple

from atom_calibration.modalities.frames import Frame
from atom_core.labeling.stillness import Sighting, motion
from atom_core.labeling.view_quality import motion_words, speed_figure

_FRESH_S = 0.5  # what was seen longer ago tells nothing of now
_SHORTEST_S = 0.05  # between two sightings, for a speed
_LEAST_SIGMAS = 5.0  # between them; less may be noise

Key = Tuple[str, str]  # sensor, pattern


class MotionWatch:
    """Remembers what all sensors saw of the boards in the last moments."""

    def __init__(self) -> None:
        """Start with nothing seen."""
        self._seen: Dict[Key, Deque[Tuple[float, Sighting]]] = {}

    def note(self, frame: Frame) -> None:
        """Take note of a labeled frame; reasons of failed labels name a motion that is seen."""
        for pattern, sighting in frame.sightings.items():
            seen = self._seen.setdefault((frame.sensor.name, pattern), deque())
            while seen and not 0.0 <= frame.stamp_s - seen[0][0] <= _FRESH_S:
                seen.popleft()
            seen.append((frame.stamp_s, sighting))
        for pattern, labeled in list(frame.labels.items()):
            if labeled.detected:
                continue
            words = self.words(pattern, frame.stamp_s)
            if words and words not in labeled.reason:
                frame.set_label(pattern, replace(labeled, reason=f"{labeled.reason}; {words}"))

    def words(self, pattern: str, stamp_s: float) -> str:
        """Return how the board moves by the sensor that tells most clearly; empty if it rests."""
        moving: List[Tuple[float, str]] = []
        for (sensor, name), seen in self._seen.items():
            fresh = [(at, sighting) for at, sighting in seen if abs(stamp_s - at) <= _FRESH_S]
            if name != pattern or len(fresh) < 2:
                continue
            (first_s, first), (last_s, last) = fresh[0], fresh[-1]
            if last_s - first_s < _SHORTEST_S:
                continue
            sigmas = motion(first, last)
            words = motion_words(speed_figure(last, sigmas / (last_s - first_s)))
            if words and sigmas >= _LEAST_SIGMAS:
                moving.append((sigmas, f"{words} before sensor '{sensor}': hold it still"))
        return max(moving)[1] if moving else ""

    def forget(self) -> None:
        """Forget all: time may go back."""
        self._seen = {}
