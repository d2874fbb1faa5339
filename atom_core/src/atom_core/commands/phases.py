"""``-phased``: a calibration that waits for a key before and after the solver."""

from __future__ import annotations

import sys
from typing import Optional, Protocol

from atom_core.calibration.calibrate import Calibration
from atom_core.calibration.options import CalibrationOptions
from atom_core.model.dataset import Dataset
from atom_core.solvers.base import Iteration

_GO_ON, _END = "c", "q"


class Watcher(Protocol):
    """Somebody who looks on while the command runs, such as a live view."""

    def begin(self, dataset: Dataset) -> None:
        """Called with the selected dataset, before anything is solved."""

    def progress(self, iteration: Iteration) -> Optional[bool]:
        """Called after every iteration, see ``SolverOptions.progress``."""

    def end(self, calibration: Calibration, options: CalibrationOptions) -> None:
        """Called when the results are written; `options` are those that were asked for."""


class Phases:
    """A watcher that waits for the user where the solver begins, and where it has ended."""

    def __init__(self, watcher: Optional[Watcher] = None):
        """Take the watcher that looks on, if there is one."""
        self._watcher = watcher
        self._begun = False
        self.ended = False  # by the user, before anything was solved

    def begin(self, dataset: Dataset) -> None:
        """Pass it on."""
        if self._watcher is not None:
            self._watcher.begin(dataset)

    def progress(self, iteration: Iteration) -> Optional[bool]:
        """Show the iteration; at the first one, wait until the solver may go on."""
        goes_on = None if self._watcher is None else self._watcher.progress(iteration)
        if not self._begun:
            self._begun = True
            self.ended = not asked_to_go_on("this is the start")
        return False if self.ended else goes_on

    def end(self, calibration: Calibration, options: CalibrationOptions) -> None:
        """Show the answer until the user has seen it."""
        if self._watcher is not None:
            self._watcher.end(calibration, options)
        asked_to_go_on("this is the result, and written")


def asked_to_go_on(what: str) -> bool:
    """Wait for the key c (True) or q (False) in the terminal; without one, go on."""
    print(f"{what}: press {_GO_ON} to go on, {_END} to end", file=sys.stderr, flush=True)
    while True:
        key = _key()
        if key in (_GO_ON, ""):
            return True
        if key == _END:
            return False


def _key() -> str:
    """Return the next key of the terminal, or the first sign of a line; empty at its end."""
    if not sys.stdin.isatty():
        line = sys.stdin.readline()
        return line.strip()[:1] or ("" if not line else " ")
    import termios
    import tty

    before = termios.tcgetattr(sys.stdin)
    try:
        tty.setcbreak(sys.stdin)
        return sys.stdin.read(1)
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
