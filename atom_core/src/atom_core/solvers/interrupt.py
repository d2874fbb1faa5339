"""Ctrl-C while a solver works: it ends with the best state so far instead of a traceback."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any, Optional, Type

from atom_core.solvers.base import Iteration, Progress


class Interrupt:
    """Notes the first Ctrl-C within the context; a second one acts as it does elsewhere.

    Python knows signals in the main thread only, and where they are ignored (as in a shell's
    background jobs) they stay so. A handler that somebody else has set is called, too.
    """

    def __init__(self) -> None:
        """Prepare; nothing changes before the context is entered."""
        self.requested = False
        self._before: Any = None

    def __enter__(self) -> Interrupt:
        handler = signal.getsignal(signal.SIGINT)
        in_main_thread = threading.current_thread() is threading.main_thread()
        if in_main_thread and callable(handler):
            self._before = signal.signal(signal.SIGINT, self._note)
        return self

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        error: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        self._restore()

    def watching(self, progress: Optional[Progress]) -> Progress:
        """Return a progress callable that stops a solver after Ctrl-C.

        Args:
            progress: asked as well, if there is one.
        """

        def watched(iteration: Iteration) -> Optional[bool]:
            if progress is not None and progress(iteration) is False:
                return False
            return not self.requested

        return watched

    def _note(self, number: int, frame: Optional[FrameType]) -> None:
        self.requested = True
        before = self._before
        self._restore()
        if before is not signal.default_int_handler:
            before(number, frame)

    def _restore(self) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)
            self._before = None
