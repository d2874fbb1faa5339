"""The frames of a bag, labeled, in the order of recording."""

from __future__ import annotations

from collections import Counter, deque
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Callable, Collection, Deque, Iterator, NamedTuple

import rospy

from atom_calibration.collect.clock_watch import ClockWatch
from atom_calibration.errors import EmptyMessageError, MessageError
from atom_calibration.labels.frame_labeler import FrameLabeler
from atom_calibration.messages.headers import stamp_s
from atom_calibration.modalities.frames import Frame, decode
from atom_calibration.sources.bag_reader import BagMessage, BagReader
from atom_calibration.sources.bag_transforms import BagTransforms
from atom_calibration.sources.contradictions import MessageWatch
from atom_calibration.sources.readable import why_unreadable
from atom_calibration.sources.rig import Rig
from atom_calibration.sources.stray_stamps import Placed, StrayStamps, after_strays
from atom_core import opencv
from atom_core.commands.progress import progress
from atom_core.model.sensor import Sensor

_LOOK_AHEAD = 12  # messages that are decoded and, if images, labeled beforehand
_WORKERS = 2
_SIMULATION_BEGINS_S = 1.0
_MOST_BAD_MESSAGES = 3  # of a sensor that are told one by one
_NO_STAMP = "its driver has set no stamp (header.stamp)"
_FAR_OFF = (
    "its stamp lies {:+.1f} s off those around it, against the times of receipt; was the "
    "clock set for a moment?"
)


class _Waiting(NamedTuple):
    """A message that is being decoded."""

    sensor: str
    stamp_s: float
    future: Future


def labeled_frames(
    bag: BagReader,
    rig: Rig,
    labeler: FrameLabeler,
    transforms: BagTransforms,
    received: Collection[str],
    clocks: ClockWatch,
    warn: Callable[[str], None],
) -> Iterator[Frame]:
    """Yield every frame of the bag, labeled, in the order of recording.

    The stamps of sensors in ``received`` are replaced by the times of receipt. ``clocks``
    are told the stamps, ``warn`` what is left out.

    Messages are decoded, images labeled, clouds and depths prepared by threads a few messages
    ahead; what needs the result of the frame before it, the tracking of range sensors, is done
    here.
    """
    opencv.use_one_thread()
    good: Counter = Counter()
    bad: Counter = Counter()
    empty: Counter = Counter()  # sound, and nothing is in reach
    total = sum(bag.counts[topic] for topic in rig.topics)
    with ThreadPoolExecutor(_WORKERS) as pool, progress(total, bag.path.name, "messages") as bar:
        for future in _ahead(pool, bag, rig, labeler, received, clocks):
            bar.update()
            try:
                frame = future.result()
            except MessageError as error:
                name = error.sensor
                if not (good[name] or bad[name] or empty[name]):
                    _check_others(bag, rig, name)
                (empty if isinstance(error, EmptyMessageError) else bad)[name] += 1
                if bad[name] <= _MOST_BAD_MESSAGES and not isinstance(error, EmptyMessageError):
                    warn(f"a message is left out: {error}")
                continue
            good[frame.sensor.name] += 1
            yield labeler.label(frame, transforms.at(frame.stamp_s))
    for name, count in bad.items():
        if count > _MOST_BAD_MESSAGES:
            of_sensor = count + good[name] + empty[name]
            warn(f"sensor '{name}': in all, {count} of {of_sensor} messages are left out")


def _check_others(bag: BagReader, rig: Rig, sensor: str) -> None:
    """Refuse a sensor whose first message cannot be read, and none of those after it.

    Raises:
        MessageError: the one that the first message gave.
    """
    for topic, known in rig.topics.items():
        error = why_unreadable(bag, topic, known) if known.name == sensor else None
        if error is not None:
            raise error


def _ahead(
    pool: ThreadPoolExecutor,
    bag: BagReader,
    rig: Rig,
    labeler: FrameLabeler,
    received: Collection[str],
    clocks: ClockWatch,
) -> Iterator[Future]:
    waiting: Deque[_Waiting] = deque()
    watch = MessageWatch(bag.path, rig.infos, bag.start_s)
    try:
        for found, off_s in _in_turn(bag, rig, received):
            if found.topic in rig.infos:
                watch.see_info(*found)
                continue
            sensor = rig.topics[found.topic]
            why = _NO_STAMP if _is_unstamped(found) else _FAR_OFF.format(off_s) if off_s else ""
            if why:
                future = pool.submit(_refuse, sensor, found.recorded_s, why)
                waiting.append(_Waiting("", found.recorded_s, future))
            else:
                watch.see(sensor, found.message, found.recorded_s)
                clocks.note(sensor.name, stamp_s(found.message), found.recorded_s)
                future = pool.submit(_prepared, labeler, sensor, found.message)
                _put_in_order(waiting, _Waiting(sensor.name, stamp_s(found.message), future))
            if len(waiting) > _LOOK_AHEAD:
                yield waiting.popleft().future
        while waiting:
            yield waiting.popleft().future
    finally:
        for entry in waiting:
            entry.future.cancel()


def _in_turn(bag: BagReader, rig: Rig, received: Collection[str]) -> Iterator[Placed]:
    """Yield data and intrinsics in the order of recording, with the stamps that are to be used."""
    stamped = [topic for topic, sensor in rig.topics.items() if sensor.name not in received]
    strays = StrayStamps(after_strays(bag, stamped))
    for found in bag.messages([*rig.topics, *rig.infos]):
        if found.topic in rig.topics and rig.topics[found.topic].name in received:
            found.message.header.stamp = rospy.Time.from_sec(found.recorded_s)
        if found.topic in rig.infos or _is_unstamped(found):
            yield Placed(found)
        else:
            yield from strays.pass_on(found)
    yield from strays.rest()


def _is_unstamped(found: BagMessage) -> bool:
    """Tell whether data have no stamp; at the beginning of a simulation zero is one."""
    return bool(found.message.header.stamp.is_zero()) and found.recorded_s > _SIMULATION_BEGINS_S


def _refuse(sensor: Sensor, recorded_s: float, why: str) -> Frame:
    raise MessageError(
        f"sensor '{sensor.name}', topic {sensor.topic}, received at {recorded_s:.3f}: {why}",
        sensor.name,
    )


def _put_in_order(waiting: Deque[_Waiting], last: _Waiting) -> None:
    """Append an entry; where drivers send out of order, those of its sensor change places."""
    waiting.append(last)
    place = len(waiting) - 1
    for before in reversed(range(place)):
        if waiting[before].sensor == last.sensor:
            if waiting[before].stamp_s <= last.stamp_s:
                break
            waiting[place], waiting[before] = waiting[before], waiting[place]
            place = before


def _prepared(labeler: FrameLabeler, sensor: Any, message: Any) -> Frame:
    return labeler.prepare(decode(sensor, message))
