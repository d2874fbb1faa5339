"""Messages of a bag, read directly: no master, no wall clock, one message in memory at a time."""

from __future__ import annotations

from contextlib import ExitStack
from heapq import merge
from itertools import islice
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence, Union

import numpy as np
import rosbag
import rospy

from atom_calibration.errors import BagError
from atom_calibration.sources.bag_index import IndexedBag
from atom_calibration.sources.bag_parts import bag_files, named_together
from atom_calibration.sources.driver_messages import undecoded
from atom_core.io.paths import unread

_LISTED = 12  # topics that a message lists at most
_TIMED = 20  # messages that tell how stamps lie against the times of receipt


class BagMessage(NamedTuple):
    """A message of a bag and when it was recorded [s]."""

    topic: str
    message: Any
    recorded_s: float


class BagReader:
    """A recording that is open for reading, in one file or in parts; a context manager.

    Attributes:
        files: of the recording.
        path: how messages name it: its file, or the first and the last one.
        types: type of messages by topic.
        counts: number of messages by topic.
        start_s, end_s: times of the first and the last message [s].
    """

    def __init__(self, paths: Union[Path, Sequence[Path]]):
        """Open a bag, or all files of a recording.

        Args:
            paths: the file, or files, or patterns of files (`bag_files`).

        Raises:
            BagError: a file is absent, no bag, cut off, not indexed, or empty; or they have
                messages of different types on a topic.
        """
        self.files = bag_files([paths] if isinstance(paths, (str, Path)) else paths)
        self.path = named_together(self.files)
        self.types: Dict[str, str] = {}
        self.counts: Dict[str, int] = {}
        self.start_s, self.end_s = np.inf, -np.inf
        with ExitStack() as opened:
            self._bags = [opened.enter_context(open_bag(file)) for file in self.files]
            for file, bag in zip(self.files, self._bags):
                self._add(file, bag)
            self._opened = opened.pop_all()

    def _add(self, file: Path, bag: rosbag.Bag) -> None:
        """Count what is in a file."""
        topics = bag.get_type_and_topic_info().topics
        if not topics:
            raise BagError(f"{file}: the bag is empty; record it again")
        for name, info in topics.items():
            if self.types.setdefault(name, info.msg_type) != info.msg_type:
                raise BagError(
                    f"{file}: {name} carries {info.msg_type}, in {self.files[0]} it carries "
                    f"{self.types[name]}; give the files of one recording"
                )
            self.counts[name] = self.counts.get(name, 0) + info.message_count
        self.start_s = min(self.start_s, bag.get_start_time())
        self.end_s = max(self.end_s, bag.get_end_time())

    def __enter__(self) -> BagReader:
        """Return the reader itself."""
        return self

    def __exit__(self, *_: Any) -> None:
        """Close the files."""
        self._opened.close()

    @property
    def size_bytes(self) -> int:
        """How large the files are together."""
        return sum(file.stat().st_size for file in self.files)

    def messages(
        self,
        topics: Sequence[str],
        start_s: Optional[float] = None,
        end_s: Optional[float] = None,
    ) -> Iterator[BagMessage]:
        """Yield the messages of topics in the order of recording.

        Args:
            topics: which.
            start_s: only what was recorded from then on [s].
            end_s: only what was recorded until then [s].

        Raises:
            BagError: the file is damaged; the message tells where.
        """
        limits = {
            "start_time": None if start_s is None else _time(start_s),
            "end_time": None if end_s is None else _time(end_s),
        }
        parts = [
            _messages_of(file, bag, list(topics), limits)
            for file, bag in zip(self.files, self._bags)
        ]
        yield from merge(*parts, key=lambda found: found.recorded_s)

    def first(self, topic: str) -> Any:
        """Return the first message of a topic."""
        for found in self.messages([topic]):
            return found.message
        raise self.absent(topic, (), "nothing")

    def receipt_lag_s(
        self, topics: Sequence[str], stamp_s: Callable[[Any], Optional[float]]
    ) -> Optional[float]:
        """Return how long after their stamps messages were received [s]: the median of the first.

        Args:
            topics: whose messages.
            stamp_s: returns the stamp of a message [s]; None: it has none.

        Returns:
            Negative where stamps are later than the receipt; None where no message has a stamp.
        """
        stamped = ((found.recorded_s, stamp_s(found.message)) for found in self.messages(topics))
        all_lags_s = (received_s - said_s for received_s, said_s in stamped if said_s is not None)
        lags_s = list(islice(all_lags_s, _TIMED))
        return float(np.median(lags_s)) if lags_s else None

    def topics_of(self, types: Sequence[str]) -> List[str]:
        """Return the topics that carry messages of these types."""
        return sorted(name for name, kind in self.types.items() if kind in types)

    def absent(self, topic: str, types: Sequence[str], whose: str) -> BagError:
        """Return the error that a topic is not in the bag, with those that might be meant."""
        similar = self.topics_of(types) if types else sorted(self.types)
        there = [kind for kind in types if kind in self.types.values()]
        kinds = " or ".join(there or types) or "any type"
        listed = ", ".join(similar[:_LISTED]) + (" ..." if len(similar) > _LISTED else "")
        return BagError(
            f"{self.path}: topic {topic} ({whose}) is not in the bag; topics of {kinds}: "
            f"{listed or 'none'}; correct topic_name in the configuration or record it"
            f"{undecoded(self.types, types)}"
        )


def _messages_of(
    file: Path, bag: rosbag.Bag, topics: List[str], limits: Dict[str, Optional[rospy.Time]]
) -> Iterator[BagMessage]:
    """Yield the messages of one file, as `BagReader.messages` does."""
    first_s = last_s = bag.get_start_time()
    recorded = bag.read_messages(topics=topics, **limits)
    while True:
        try:
            found = next(recorded, None)
        except Exception as error:  # noqa: BLE001 (rosbag and genpy pass on what damage does)
            raise BagError(
                f"{file}: the bag is damaged after {last_s - first_s:.2f} s (time "
                f"{last_s:.3f}; {str(error) or type(error).__name__}); repair it with `rosbag "
                f"reindex`, or record it again"
            ) from error
        if found is None:
            return
        last_s = found.timestamp.to_sec()
        yield BagMessage(found.topic, found.message, last_s)


def open_bag(path: Path) -> rosbag.Bag:
    """Open a bag to read it.

    Raises:
        BagError: it is absent, damaged or no bag.
    """
    if path.is_dir():
        raise BagError(
            f"{path}: a folder, as recordings of ROS 2 are; convert it to a .bag file, e.g. with "
            f"`rosbags-convert` of the Python package rosbags"
        )
    try:
        return IndexedBag(path)
    except rosbag.ROSBagUnindexedException:
        raise BagError(
            f"{path}: the bag has no index, because its recording was cut off; repair it with "
            f"`rosbag reindex {path}`"
        ) from None
    except OSError as error:
        reason = unread(path, error)
        raise BagError(f"{path}: the bag cannot be read ({reason}); check the path") from error
    except (rosbag.ROSBagException, ValueError, KeyError, EOFError) as error:
        what = str(error) or type(error).__name__
        raise BagError(
            f"{path}: this is no bag, or its beginning is damaged ({what}); record it again"
        ) from error


def _time(seconds: float) -> rospy.Time:
    return rospy.Time.from_sec(max(seconds, 0.0))
