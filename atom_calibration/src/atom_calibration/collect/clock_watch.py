"""Does a sensor's clock jump amid a recording? PTP and NTP set clocks once they have a master."""

from __future__ import annotations

from typing import Collection, Dict, List, NamedTuple, Optional, Sequence

import numpy as np

from atom_core.model.caveats import Caveat

_EACH = 20  # messages of which the one that came fastest tells the clock; others may be delayed
_JUMP_S = 0.3  # busy machines take data from their queues so late
_COPIED_S = 2.0  # data that came so much later, or sooner, were recorded from a recording
_BACK_S = 0.25  # by which stamps go back where a clock is set; drivers disorder them by less


class _Group(NamedTuple):
    """Some messages of a sensor, one after the other.

    Attributes:
        first_s: when the first one was received [s].
        lag_s: the shortest time from stamp to receipt [s].
        went_back: a stamp lies well before that of a message before.
    """

    first_s: float
    lag_s: float
    went_back: bool


class ClockWatch:
    """Compares stamps with times of receipt, as long as data come."""

    def __init__(self, sensors: Collection[str]):
        """Know the sensors."""
        self._sensors = tuple(sensors)
        self.begin_anew()

    def begin_anew(self) -> None:
        """Forget all: the recording is read once more."""
        self._groups: Dict[str, List[_Group]] = {name: [] for name in self._sensors}
        self._open: Dict[str, List[_Group]] = {name: [] for name in self._sensors}
        self._newest_s: Dict[str, float] = {}
        self._first_s: Optional[float] = None

    def note(self, sensor: str, stamp_s: float, received_s: float) -> None:
        """Take note of the stamp of a message and of when it was received [s]."""
        self._first_s = received_s if self._first_s is None else self._first_s
        newest_s = self._newest_s.get(sensor, stamp_s)
        self._newest_s[sensor] = max(newest_s, stamp_s)
        one = _Group(received_s, received_s - stamp_s, stamp_s < newest_s - _BACK_S)
        self._open[sensor].append(one)
        if len(self._open[sensor]) >= _EACH:
            self._groups[sensor].append(_joined(self._open[sensor]))
            self._open[sensor] = []

    @property
    def caveats(self) -> Sequence[Caveat]:
        """The sensors whose clocks have jumped by now."""
        found = []
        for name, groups in self._groups.items():
            jump = self._first_jump(name, groups)
            if jump is not None:
                found.append(self._caveat(name, groups[0], jump))
        return found

    def _first_jump(self, name: str, groups: Sequence[_Group]) -> Optional[_Group]:
        """Return the first messages with another clock than those of the beginning."""
        for before, group in zip(groups, groups[1:]):
            jump_s = group.lag_s - groups[0].lag_s
            if jump_s > _JUMP_S and (before.went_back or group.went_back):
                return group
            if jump_s < -_JUMP_S and self._is_too_soon(name, group):
                return group
        return None

    def _is_too_soon(self, name: str, group: _Group) -> bool:
        """Tell whether data came so soon that no delay that has ended explains it."""
        usual_s = self._lag_of_others_s(name, group.first_s)
        if usual_s is None or group.lag_s > usual_s - _JUMP_S:
            return False
        return group.lag_s < 0.0 or abs(usual_s) > _COPIED_S

    def _lag_of_others_s(self, name: str, from_s: float) -> Optional[float]:
        """Return the lag of other sensors' data from a time on [s]; None: not known yet."""
        lags_s = [
            next((group.lag_s for group in groups if group.first_s >= from_s), None)
            for other, groups in self._groups.items()
            if other != name
        ]
        known_s = [lag_s for lag_s in lags_s if lag_s is not None]
        return float(np.median(known_s)) if known_s and len(known_s) == len(lags_s) else None

    def _caveat(self, name: str, first: _Group, jump: _Group) -> Caveat:
        assert self._first_s is not None
        size_s, after_s = first.lag_s - jump.lag_s, jump.first_s - self._first_s
        side = "ahead" if size_s > 0 else "back"
        return Caveat(
            (name,),
            f"about {after_s:.1f} s after the beginning its stamps jump {side} by "
            f"{abs(size_s):.2f} s, against the times of receipt: its clock was set meanwhile",
            f"collect_from_bag --use_receive_time {name} takes the times of receipt instead; or "
            f"use only what comes after, or record again once the clocks agree",
        )


def _joined(groups: Sequence[_Group]) -> _Group:
    return _Group(
        groups[0].first_s,
        min(group.lag_s for group in groups),
        any(group.went_back for group in groups),
    )
