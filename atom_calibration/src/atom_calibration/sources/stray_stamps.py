"""Single messages of a recording whose stamp is far off, as of a clock that is set for a moment.

One of them in the future makes all data after it lie before it, as if it were played twice.
"""

from __future__ import annotations

from itertools import islice
from types import MappingProxyType
from typing import Dict, Iterable, List, Mapping, NamedTuple

import numpy as np

from atom_calibration.messages.headers import stamp_s
from atom_calibration.sources.bag_reader import BagMessage, BagReader

_FAR_S = 2.0  # from when the messages before had their stamps, against the times of receipt
_MOST = 3  # in a row; more of them have another clock, or come from another recording


class Placed(NamedTuple):
    """A message, and how its stamp lies.

    Attributes:
        found: the message.
        off_s: how far its stamp lies after where those around it have it [s]; 0: as usual.
    """

    found: BagMessage
    off_s: float = 0.0


class StrayStamps:
    """Holds messages with a stamp far off until those after them tell whether they are alone."""

    def __init__(self, usual: Mapping[str, BagMessage] = MappingProxyType({})) -> None:
        """Know nothing, or the first ``usual`` messages of topics that begin with strays."""
        self._usual = dict(usual)  # the last of each topic
        self._held: Dict[str, List[BagMessage]] = {}

    def pass_on(self, found: BagMessage) -> List[Placed]:
        """Take the next message that has a stamp; return what can be said of messages by now."""
        before = self._usual.get(found.topic)
        held = self._held.pop(found.topic, [])
        if before is None:
            self._usual[found.topic] = found
            return [Placed(found)]
        if abs(_lag_s(found) - _lag_s(before)) <= _FAR_S:
            self._usual[found.topic] = found
            return [*(_placed(one, before) for one in held), Placed(found)]
        held.append(found)
        if len(held) <= _MOST:
            self._held[found.topic] = held
            return []
        self._usual[found.topic] = found
        return [Placed(one) for one in held]

    def rest(self) -> List[Placed]:
        """Return the messages that are held when the recording ends."""
        return [
            _placed(one, self._usual[topic]) for topic in self._held for one in self._held[topic]
        ]


def after_strays(bag: BagReader, topics: Iterable[str]) -> Dict[str, BagMessage]:
    """Return, by topic that begins with stamps in the future, the first message after these.

    Those after them have to be more, and agree. Stamps before those that follow do no harm.
    """
    found: Dict[str, BagMessage] = {}
    for topic in topics:
        first = list(islice(bag.messages([topic]), 2 * _MOST + 1))
        lags_s = np.array([_lag_s(one) for one in first])
        for count in range(1, min(_MOST, (len(first) - 1) // 2) + 1):
            begins, goes_on = lags_s[:count], lags_s[count : 2 * _MOST + 1]
            agree = np.all(np.abs(goes_on - goes_on[0]) <= _FAR_S)
            if agree and np.all(begins < goes_on[0] - _FAR_S):
                found[topic] = first[count]
    return found


def _placed(found: BagMessage, before: BagMessage) -> Placed:
    """Return a message between others; what was only received late is no stray."""
    off_s = _lag_s(before) - _lag_s(found)
    is_late = off_s < 0.0 and stamp_s(found.message) >= stamp_s(before.message)
    return Placed(found, 0.0 if is_late else off_s)


def _lag_s(found: BagMessage) -> float:
    return float(found.recorded_s - stamp_s(found.message))
