"""Where the messages of a time are in a bag, found by halving."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from heapq import merge
from pathlib import Path
from typing import Any, Iterable, List, Optional, Set

import rosbag
from rospy import Time


class IndexedBag(rosbag.Bag):
    """A bag that is read; messages from a time on are found without a look at all before it.

    rosbag passes over the entries before a time one by one. Where a recording is read in windows,
    as its /tf is, that grows with the square of its length. Nor does it put in order what a program
    wrote out of order (times of headers in place of those of receipt, a bag of several): it ends at
    the first entry that is too late, whatever comes after it.
    """

    def __init__(self, path: Path):
        """Open a file; raises what `rosbag.Bag` does."""
        self._in_order: Set[int] = set()
        super().__init__(str(path), "r")

    def _get_indexes(self, connections: Optional[Iterable[Any]]) -> List[List[Any]]:
        """Return the entries of each connection, in the order of their times."""
        indexes = list(super()._get_indexes(connections))
        for index in indexes:
            if id(index) not in self._in_order:
                index.sort(key=_time_ns)
                self._in_order.add(id(index))
        return indexes

    def _get_entries(
        self,
        connections: Optional[Iterable[Any]] = None,
        start_time: Optional[Time] = None,
        end_time: Optional[Time] = None,
    ) -> Iterable[Any]:
        """Return the entries of connections in the order of their times, within limits."""
        parts = []
        for index in self._get_indexes(connections):
            times = _Times(index)
            first = 0 if start_time is None else bisect_left(times, start_time.to_nsec())
            last = len(index) if end_time is None else bisect_right(times, end_time.to_nsec())
            parts.append(index[first:last])
        return merge(*parts, key=_time_ns)


class _Times:
    """The times of entries [ns]."""

    def __init__(self, index: List[Any]):
        self._index = index

    def __len__(self) -> int:
        return len(self._index)

    def __getitem__(self, place: int) -> int:
        return _time_ns(self._index[place])


def _time_ns(entry: Any) -> int:
    return int(entry.time.to_nsec())
