"""Which frames make a collection: those of one moment, and only if the board held still in it."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Deque, Dict, Iterable, Iterator, List, Mapping, Optional, Protocol, Tuple

import numpy as np

from atom_calibration.errors import CollectionError, NoDataError
from atom_calibration.modalities.frames import Frame
from atom_core.labeling.stillness import (
    DEFAULT_OPTIONS,
    Sighting,
    Stop,
    StopDetector,
    motion,
)

_SAME_PLACE_SIGMAS = 3.0
_EPSILON_S = 1e-6
_AROUND_STOP_S = 1.0  # what a camera saw so shortly before or after a stop tells about it too
_DENSEST_DATA_S = 0.19  # of a sensor; more often than that, only the labels are remembered
_SILENT_S = 0.5  # a sensor whose newest data are so much older is not waited for


class HasSightings(Protocol):
    """Something that tells where a sensor saw the boards, as a `Frame` does."""

    @property
    def sightings(self) -> Mapping[str, Sighting]:
        """Where each board was seen, by pattern."""


@dataclass(frozen=True)
class Moment:
    """When a collection is to be taken.

    Attributes:
        start_s, end_s: only data of this time.
        centre_s: the time asked for; None: whichever suits.
        every_s: it is one of many that follow each other so fast; None: it stands for itself.
    """

    start_s: float
    end_s: float
    centre_s: Optional[float] = None
    every_s: Optional[float] = None

    @property
    def middle_s(self) -> float:
        """The middle of its time."""
        return 0.5 * (self.start_s + self.end_s)


class StopMoments:
    """A moment for each stop of the board; see ``stillness``.

    Cameras judge far more finely than range sensors, whose labels of a board that is half hidden
    or seen at a grazing angle wander. So a stop that range sensors report counts only where no
    camera saw the board long enough to tell.
    """

    def __init__(self, patterns: Iterable[str]):
        """Start with nothing seen."""
        self._cameras = {name: StopDetector() for name in patterns}
        self._range = {name: StopDetector() for name in patterns}
        self._seen_s: Dict[Tuple[str, str], Deque[float]] = {}  # by camera and pattern
        self.memory_s = DEFAULT_OPTIONS.take_after_s + DEFAULT_OPTIONS.longest_pause_s

    def add(self, frame: Frame) -> Iterator[Moment]:
        """Take note of a frame; yield the stops that have become certain."""
        name, stamp = frame.sensor.name, frame.stamp_s
        for ended in self._ended_unseen(stamp):
            yield Moment(ended.start_s, ended.end_s)
        for pattern, sighting in frame.sightings.items():
            if frame.ros.board_pose is not None:
                self._note(name, pattern, stamp)
                stop = self._cameras[pattern].add(name, stamp, sighting)
            else:
                stop = self._trusted(pattern, self._range[pattern].add(name, stamp, sighting))
            if stop is not None:
                yield Moment(stop.start_s, stop.end_s)

    def finish(self) -> Iterator[Moment]:
        """Yield the stop that lasted until the end."""
        for pattern, detector in self._cameras.items():
            by_range = self._trusted(pattern, self._range[pattern].finish())
            for stop in (detector.finish(), by_range):
                if stop is not None:
                    yield Moment(stop.start_s, stop.end_s)

    def _ended_unseen(self, stamp_s: float) -> List[Stop]:
        """Return stops after which the board went out of sight: its data would be forgotten."""
        stops = [detector.pass_time(stamp_s) for detector in self._cameras.values()]
        stops += [self._trusted(p, found.pass_time(stamp_s)) for p, found in self._range.items()]
        return [stop for stop in stops if stop is not None]

    def _note(self, camera: str, pattern: str, stamp_s: float) -> None:
        seen = self._seen_s.setdefault((camera, pattern), deque())
        seen.append(stamp_s)
        while seen[0] < stamp_s - 2 * self.memory_s:
            seen.popleft()

    def _trusted(self, pattern: str, stop: Optional[Stop]) -> Optional[Stop]:
        """Return a stop that range sensors report, unless cameras could tell."""
        if stop is None:
            return None
        early, late = stop.start_s - _AROUND_STOP_S, stop.end_s + _AROUND_STOP_S
        for (_, name), seen in self._seen_s.items():
            inside = any(stop.start_s <= s <= stop.end_s for s in seen)
            if name == pattern and inside and sum(early <= s <= late for s in seen) > 1:
                return None
        return stop


class SwitchedMoments:
    """Moments of another kind, which count only while they are switched on.

    Attributes:
        on: whether they do.
    """

    def __init__(self, moments: StopMoments, on: bool):
        """Wrap others."""
        self._moments, self.on = moments, on
        self.memory_s = moments.memory_s

    def add(self, frame: Frame) -> Iterator[Moment]:
        """Take note of a frame; yield moments that have become certain."""
        yield from (moment for moment in self._moments.add(frame) if self.on)

    def finish(self) -> Iterator[Moment]:
        """Yield those that only the end makes certain."""
        yield from (moment for moment in self._moments.finish() if self.on)


class TimedMoments:
    """Moments at times that are given."""

    def __init__(
        self, times_s: Iterable[float], max_skew_s: float, every_s: Optional[float] = None
    ):
        """Prepare.

        Args:
            times_s: when, ascending.
            max_skew_s: greatest difference of the stamps in a collection.
            every_s: the interval at which the times follow each other, if they do.
        """
        self._times, self._every_s = iter(times_s), every_s
        self._half_s = 0.5 * max_skew_s
        self.memory_s = 2.0 * max_skew_s
        self._next = next(self._times, None)

    def add(self, frame: Frame) -> Iterator[Moment]:
        """Take note of a frame; yield the times of which all data have come."""
        while self._next is not None and frame.stamp_s > self._next + 2 * self._half_s:
            yield self._take()

    def finish(self) -> Iterator[Moment]:
        """Yield the times for which later data were awaited: those of the last stretch."""
        while self._next is not None:
            yield self._take()

    def _take(self) -> Moment:
        assert self._next is not None
        centre, self._next = self._next, next(self._times, None)
        return Moment(centre - self._half_s, centre + self._half_s, centre, self._every_s)


class RecentFrames:
    """The frames of the last seconds: all sightings, and data no denser than needed.

    Of each fifth of a second a sensor keeps the frame whose stamp is nearest to frames of the other
    sensors, so that what was measured together stays together.
    """

    def __init__(self, memory_s: float, whole_s: float = 0.0):
        """Remember so many seconds; of the newest, ``whole_s``, all data."""
        self._memory_s, self._whole_s = memory_s, whole_s
        self._frames: Dict[str, Deque[Frame]] = {}
        self._sightings: Deque[Tuple[float, str, str, Sighting]] = deque()
        self._thinned: Optional[int] = None  # slots before this one

    def add(self, frame: Frame) -> None:
        """Remember a frame, and forget what is too old."""
        self.note(frame)
        self.forget_old(frame.stamp_s)

    def note(self, frame: Frame) -> None:
        """Remember a frame, and forget nothing for its age yet."""
        self._frames.setdefault(frame.sensor.name, deque()).append(frame)
        for pattern, sighting in frame.sightings.items():
            self._sightings.append((frame.stamp_s, frame.sensor.name, pattern, sighting))
        self._thin(_slot(frame))

    def forget_old(self, newest_s: float) -> None:
        """Forget what is too old when the newest frame is of this time [s]."""
        oldest = newest_s - self._memory_s
        for queue in self._frames.values():
            while queue and queue[0].stamp_s < oldest:
                queue.popleft()
        while self._sightings and self._sightings[0][0] < oldest:
            self._sightings.popleft()

    def _thin(self, added: int) -> None:
        """Leave one frame of each sensor in the slots of which all data have come.

        Args:
            added: the slot of the newest frame; may be one that was thinned before.
        """
        newest_s = [queue[-1].stamp_s for queue in self._frames.values() if queue]
        awaited_s = min(s for s in newest_s if s >= max(newest_s) - _SILENT_S) - self._whole_s
        due = int(awaited_s // _DENSEST_DATA_S)
        if self._thinned is None:
            self._thinned = min(added, due)
        if self._thinned >= due and self._thinned <= added:
            return
        slots = {_slot(f) for f in self._all() if self._thinned <= _slot(f) < due}
        if added < self._thinned:
            slots.add(added)
        for slot in sorted(slots):
            self._thin_slot(slot)
        self._thinned = max(self._thinned, due)

    def _thin_slot(self, slot: int) -> None:
        for name, queue in self._frames.items():
            inside = [frame for frame in queue if _slot(frame) == slot]
            if len(inside) > 1:
                best = min(inside, key=lambda f: (-f.detections, self._apart_s(f), f.stamp_s))
                kept = (frame for frame in queue if frame is best or _slot(frame) != slot)
                self._frames[name] = deque(kept)

    def _apart_s(self, frame: Frame) -> float:
        """Return how far the stamps of other sensors are from a frame's, added up [s]."""
        apart_s = 0.0
        for name, queue in self._frames.items():
            if name != frame.sensor.name:
                gaps_s = [(-f.detections, abs(f.stamp_s - frame.stamp_s)) for f in queue]
                near = [gap for gap in gaps_s if gap[1] < _DENSEST_DATA_S]
                apart_s += min(near)[1] if near else _DENSEST_DATA_S
        return apart_s

    def _all(self) -> Iterator[Frame]:
        return (frame for queue in self._frames.values() for frame in queue)

    def label_again(self, frame: Frame) -> None:
        """Take the newest frame of a sensor with other labels; those before count no more."""
        name = frame.sensor.name
        self._frames.pop(name, None)
        self._sightings = deque(seen for seen in self._sightings if seen[1] != name)
        self.add(frame)

    def clear(self) -> None:
        """Forget all."""
        self._frames.clear()
        self._sightings.clear()
        self._thinned = None

    def between(self, start_s: float, end_s: float) -> List[Frame]:
        """Return the frames of a time."""
        low, high = start_s - _EPSILON_S, end_s + _EPSILON_S
        return [frame for frame in self._all() if low <= frame.stamp_s <= high]

    def why_nothing(self, moment: Moment, max_skew_s: float) -> CollectionError:
        """Return why a moment gives no collection: nobody sees the board, or data are too far."""
        time_s = moment.middle_s
        gap_s, name = self._nearest_data(time_s)
        if gap_s <= 0.5 * max_skew_s + _EPSILON_S or gap_s == np.inf:
            return CollectionError(
                f"time {moment.start_s:.3f}: no sensor sees the board; choose another time"
            )
        return NoDataError(
            f"time {time_s:.3f}: no sensor has data within {500 * max_skew_s:.0f} ms of it; the "
            f"nearest are those of sensor '{name}', {1000 * gap_s:.0f} ms away: raise "
            f"max_duration_between_msgs, which is {1000 * max_skew_s:.0f} ms",
            moment.every_s is not None and gap_s > 0.5 * moment.every_s,
        )

    def _nearest_data(self, time_s: float) -> Tuple[float, str]:
        """Return how far from a time the nearest data are [s], and whose; inf: there are none."""
        gaps_s = ((abs(frame.stamp_s - time_s), frame.sensor.name) for frame in self._all())
        return min(gaps_s, default=(np.inf, ""))

    def speeds(self, start_s: float, end_s: float) -> Dict[Tuple[str, str], float]:
        """Return how fast the board moved [sigmas / s] by (sensor, pattern), where it shows.

        Its greatest distance from where it was first counts: a board that swings may end there.
        """
        ends: Dict[Tuple[str, str], List[Tuple[float, Sighting]]] = {}
        for stamp, sensor, pattern, sighting in self._sightings:
            if start_s - _EPSILON_S <= stamp <= end_s + _EPSILON_S:
                ends.setdefault((sensor, pattern), []).append((stamp, sighting))
        speeds = {}
        for key, seen in ends.items():
            (first_s, first), last_s = seen[0], seen[-1][0]
            if last_s > first_s:
                farthest = max(motion(first, other) for _, other in seen[1:])
                speeds[key] = farthest / (last_s - first_s)
        return speeds


def choose_frames(frames: List[Frame], moment: Moment, max_skew_s: float) -> Dict[str, Frame]:
    """Return one frame of each sensor, of stamps as close together as can be.

    Detections count more than nearness; among equal choices the one nearest to the middle of
    the moment is taken.

    Args:
        frames: of the moment, of all sensors.
        moment: when.
        max_skew_s: greatest difference of the stamps.
    """
    if moment.centre_s is not None:
        return _nearest(frames, moment.centre_s, moment.centre_s - 0.5 * max_skew_s, max_skew_s)
    best: Dict[str, Frame] = {}
    best_score = (-1, -1, 0.0, 0.0)
    # Cameras are the slowest, so that their stamps are the ones to meet; at most a few dozen.
    reference = [f for f in frames if f.ros.board_pose is not None and f.detections] or frames
    for time_s in sorted({f.stamp_s for f in reference}):
        for chosen in _choices(frames, time_s, max_skew_s):
            detections = sum(f.detections for f in chosen.values())
            beside_s = abs(time_s - moment.middle_s)
            score = (detections, len(chosen), -round(skew_s(chosen), 3), -beside_s)
            if score > best_score:
                best, best_score = chosen, score
    return best


def _choices(frames: List[Frame], time_s: float, max_skew_s: float) -> Iterator[Dict[str, Frame]]:
    """Yield frames near a time: of the span around it, and of others if those have more boards."""
    near = [f for f in frames if abs(f.stamp_s - time_s) <= max_skew_s + _EPSILON_S]
    around = _nearest(near, time_s, time_s - 0.5 * max_skew_s, max_skew_s)
    yield around
    seen = {frame.sensor.name for frame in near if frame.detections}
    if seen - {name for name, frame in around.items() if frame.detections}:
        for start_s in sorted({f.stamp_s for f in near if f.stamp_s <= time_s}):
            yield _nearest(near, time_s, start_s, max_skew_s)


def skew_s(frames: Mapping[str, Frame]) -> float:
    """Return the greatest difference of the stamps [s]."""
    stamps = [frame.stamp_s for frame in frames.values()]
    return max(stamps) - min(stamps) if stamps else 0.0


def too_far(frames: List[Frame], chosen: Mapping[str, Frame]) -> Dict[str, float]:
    """Return by sensor that saw the board, and was not chosen, how long the stamps would last [s].

    Args:
        frames: of the moment, of all sensors.
        chosen: of them, those that were taken.
    """
    stamps = [frame.stamp_s for frame in chosen.values()]
    lasting_s: Dict[str, float] = {}
    for frame in frames:
        name = frame.sensor.name
        if frame.detections and name not in chosen:
            with_it = [*stamps, frame.stamp_s]
            span_s = max(with_it) - min(with_it)
            lasting_s[name] = min(span_s, lasting_s.get(name, span_s))
    return lasting_s


def check_still(frames: Mapping[str, Frame], recent: RecentFrames, moment: Moment) -> None:
    """Refuse frames between whose stamps the board moved by more than a label can tell.

    Raises:
        CollectionError: naming the sensor that saw it move, the time, and the remedy.
    """
    skew = skew_s(frames)
    if skew <= _EPSILON_S:
        return
    half = max(0.5 * (moment.end_s - moment.start_s), skew)
    stamps = [frame.stamp_s for frame in frames.values()]
    start_s, end_s = min(stamps) - half, max(stamps) + half
    if moment.centre_s is None:  # a stop: how the board came there, and goes, does not count
        start_s, end_s = max(start_s, moment.start_s), min(end_s, moment.end_s)
    speeds = recent.speeds(start_s, end_s)
    if moment.centre_s is not None and not speeds:  # slow sensors: what was shortly before tells
        speeds = recent.speeds(min(stamps) - _AROUND_STOP_S, max(stamps) + _AROUND_STOP_S)
    if not speeds:
        raise CollectionError(
            f"time {min(stamps):.3f}: no sensor saw the board twice, so that nothing tells whether "
            f"it stood still during the {1000 * skew:.0f} ms between the stamps; hold it longer"
        )
    (sensor, _), fastest = max(speeds.items(), key=lambda item: item[1])
    if fastest * skew > 1.0:
        raise CollectionError(
            f"time {min(stamps):.3f}: the board moved by {fastest * skew:.1f} sigmas of the labels "
            f"of sensor '{sensor}' during the {1000 * skew:.0f} ms between the stamps; hold it "
            f"still, or collect at stops (--stops)"
        )


def same_place(frames: Mapping[str, HasSightings], before: Mapping[str, HasSightings]) -> bool:
    """Tell whether the board stands where it stood, as far as any sensor saw it both times."""
    moved = [
        motion(before[name].sightings[pattern], sighting)
        for name, frame in frames.items()
        for pattern, sighting in frame.sightings.items()
        if name in before and pattern in before[name].sightings
    ]
    return bool(moved) and sorted(moved)[len(moved) // 2] < _SAME_PLACE_SIGMAS


def _nearest(frames: List[Frame], time_s: float, start_s: float, span_s: float) -> Dict[str, Frame]:
    """Return the frame of each sensor nearest to a time; one with a detection if there is any.

    Args:
        frames: of all sensors.
        time_s: which.
        start_s: from when on stamps may be.
        span_s: for how long.
    """
    first_s, last_s = start_s - _EPSILON_S, start_s + span_s + _EPSILON_S
    chosen: Dict[str, Frame] = {}
    for frame in sorted(frames, key=lambda f: (-f.detections, abs(f.stamp_s - time_s))):
        if first_s <= frame.stamp_s <= last_s:
            chosen.setdefault(frame.sensor.name, frame)
    return chosen


def _slot(frame: Frame) -> int:
    """Return the number of the slot of time of which a sensor keeps one frame."""
    return int(frame.stamp_s // _DENSEST_DATA_S)
