"""Messages of a bag, read directly: no master, no wall clock, one message in memory at a time."""

from __future__ import annotations

from itertools import islice
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence

import numpy as np
import rosbag
import rospy

from atom_calibration.errors import BagError
from atom_core.io.paths import unread

_LISTED = 12  # topics that a message lists at most
_TIMED = 20  # messages that tell how stamps lie against the times of receipt


class BagMessage(NamedTuple):
    """A message of a bag and when it was recorded [s]."""

    topic: str
    message: Any
    recorded_s: float


class BagReader:
    """A bag that is open for reading; a context manager.

    Attributes:
        path: the file.
        types: type of messages by topic.
        counts: number of messages by topic.
        start_s, end_s: times of the first and the last message [s].
    """

    def __init__(self, path: Path):
        """Open a bag.

        Raises:
            BagError: the file is absent, no bag, cut off, not indexed, or empty.
        """
        self.path = Path(path)
        self._bag = open_bag(self.path)
        try:
            topics = self._bag.get_type_and_topic_info().topics
            self.types: Dict[str, str] = {name: t.msg_type for name, t in topics.items()}
            self.counts: Dict[str, int] = {name: t.message_count for name, t in topics.items()}
            if not topics:
                raise BagError(f"{path}: the bag is empty; record it again")
            self.start_s, self.end_s = self._bag.get_start_time(), self._bag.get_end_time()
        except BaseException:
            self._bag.close()
            raise

    def __enter__(self) -> BagReader:
        """Return the reader itself."""
        return self

    def __exit__(self, *_: Any) -> None:
        """Close the file."""
        self._bag.close()

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
        last_s = self.start_s
        recorded = self._bag.read_messages(topics=list(topics), **limits)
        while True:
            try:
                found = next(recorded, None)
            except Exception as error:  # noqa: BLE001 (rosbag and genpy pass on what damage does)
                raise BagError(
                    f"{self.path}: the bag is damaged after {last_s - self.start_s:.2f} s (time "
                    f"{last_s:.3f}; {str(error) or type(error).__name__}); repair it with `rosbag "
                    f"reindex`, or record it again"
                ) from error
            if found is None:
                return
            last_s = found.timestamp.to_sec()
            yield BagMessage(found.topic, found.message, last_s)

    def first(self, topic: str) -> Any:
        """Return the first message of a topic."""
        for found in self.messages([topic]):
            return found.message
        raise self.absent(topic, (), "nothing")

    def receipt_lag_s(
        self, topics: Sequence[str], stamp_s: Callable[[Any], float]
    ) -> Optional[float]:
        """Return how long after their stamps messages were received [s]: the median of the first.

        Args:
            topics: whose messages.
            stamp_s: returns the stamp of a message [s].

        Returns:
            Negative where stamps are later than the receipt; None where there is no message.
        """
        first = islice(self.messages(topics), _TIMED)
        lags_s = [found.recorded_s - stamp_s(found.message) for found in first]
        return float(np.median(lags_s)) if lags_s else None

    def topics_of(self, types: Sequence[str]) -> List[str]:
        """Return the topics that carry messages of these types."""
        return sorted(name for name, kind in self.types.items() if kind in types)

    def absent(self, topic: str, types: Sequence[str], whose: str) -> BagError:
        """Return the error that a topic is not in the bag, with those that might be meant."""
        similar = self.topics_of(types) if types else sorted(self.types)
        kinds = " or ".join(types) or "any type"
        listed = ", ".join(similar[:_LISTED]) + (" ..." if len(similar) > _LISTED else "")
        return BagError(
            f"{self.path}: topic {topic} ({whose}) is not in the bag; topics of {kinds}: "
            f"{listed or 'none'}; correct topic_name in the configuration or record it"
        )


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
        return rosbag.Bag(str(path), "r")
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
