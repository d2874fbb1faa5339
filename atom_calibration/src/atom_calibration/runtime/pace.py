"""Whether somebody has to wait for labels that are late."""

from __future__ import annotations

import math
from typing import Callable, Dict, Iterable, List

from atom_calibration.runtime.graph_names import topic_of

LATE_S = 1.0
LOOK_EVERY_S = 0.05  # by the wall's clock
_LOOKS_IN_VAIN = 40  # in a row; not seconds, so that a machine that stands still gives nobody up
_OTHER_CLOCK_S = 30.0  # stamps this far away are of another clock, and say nothing


def labeled_until(sensor: str) -> str:
    """Return the topic on which a labeler says until when all that has come is labeled."""
    return topic_of(sensor, "labeled_until")


class Pace:
    """How far the labels of each sensor are behind the recording, and how far they may be.

    A labeler says also that all it has got is labeled, so that nobody waits for what a sensor does
    not send. It may fail all the same, or its data may come later than its stamps say: whoever was
    waited for in vain may be twice as late, until labels come again. All times are of the
    recording, in seconds.
    """

    def __init__(self, sensors: Iterable[str], late_s: float = LATE_S):
        """Expect labels of these sensors from the beginning on, none later than this [s]."""
        self._late_s = late_s
        self._allowed_s = dict.fromkeys(sensors, late_s)
        self._labeled_s: Dict[str, float] = {}
        self._begin_s, self._now_s = math.nan, math.inf
        self._noted = 0

    def note(self, sensor: str, stamp_s: float, now_s: float) -> None:
        """Take in that labels of a sensor came, with the stamp of their data."""
        of_this_clock = abs(now_s - stamp_s) < _OTHER_CLOCK_S
        self._labeled_s[sensor] = stamp_s if of_this_clock else now_s
        self._allowed_s[sensor] = self._late_s
        self._noted += 1

    def note_idle(self, sensor: str, until_s: float) -> None:
        """Take in that all data of a sensor that have come until a time are labeled."""
        self._labeled_s[sensor] = max(until_s, self._labeled_s.get(sensor, until_s))

    def late(self, now_s: float) -> List[str]:
        """Return the sensors whose labels are later than they may be."""
        if now_s < self._now_s:  # the first look, or the recording begins again
            self._labeled_s.clear()
            self._begin_s = now_s
        self._now_s = now_s
        return [name for name, most_s in self._allowed_s.items() if self._lag_s(name) > most_s]

    def wait(
        self,
        now: Callable[[], float],
        pause: Callable[[float], None],
        ended: Callable[[], bool],
    ) -> None:
        """Wait until nobody is late, for as long as any labels come at all.

        Args:
            now: returns the time of the recording.
            pause: waits for so many seconds of the wall's clock.
            ended: tells that there is no more reason to wait.
        """
        in_vain = 0
        while not ended() and self.late(now()):
            if in_vain == _LOOKS_IN_VAIN:
                self.wait_no_more(now())
                return
            before = self._noted
            pause(LOOK_EVERY_S)
            in_vain = in_vain + 1 if self._noted == before else 0

    def wait_no_more(self, now_s: float) -> None:
        """Let those that are late now be as late again, until their labels come."""
        for name in self.late(now_s):
            self._allowed_s[name] = 2.0 * self._lag_s(name)

    def _lag_s(self, name: str) -> float:
        return self._now_s - self._labeled_s.get(name, self._begin_s)
