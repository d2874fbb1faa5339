"""What other threads leave for the one that works."""

from __future__ import annotations

import threading
from collections import deque
from concurrent.futures import Future
from typing import Any, Callable, Deque, Optional

Work = Callable[[], Any]


class Inbox:
    """Data, of which the oldest are dropped when there are too many, and requests, which never are.

    Attributes:
        dropped: number of data that were.
    """

    def __init__(self, most_data: int):
        """Start empty.

        Args:
            most_data: that wait at a time.
        """
        self._data: Deque[Work] = deque()
        self._requests: Deque[Work] = deque()
        self._most_data = most_data
        self._there = threading.Condition()
        self.dropped = 0
        self._closed = False

    def close(self) -> None:
        """Take no more data: what is there can be worked off, however fast others come."""
        with self._there:
            self._closed = True

    def put(self, work: Work) -> None:
        """Leave data; once it is closed, they are passed over."""
        with self._there:
            if self._closed:
                return
            if len(self._data) >= self._most_data:
                self._data.popleft()
                self.dropped += 1
            self._data.append(work)
            self._there.notify()

    def ask(self, request: Callable[[Future], None]) -> Future:
        """Leave a request, which sets the result of the future that is returned."""
        future: Future = Future()
        with self._there:
            self._requests.append(lambda: request(future))
            self._there.notify()
        return future

    def get(self, timeout_s: float) -> Optional[Work]:
        """Return what is to be done next, requests first; None if nothing comes in time."""
        with self._there:
            if not (self._requests or self._data):
                self._there.wait(timeout_s)
            for waiting in (self._requests, self._data):
                if waiting:
                    return waiting.popleft()
        return None
