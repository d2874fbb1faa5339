"""An OpenCV window in which something is drawn on pictures by clicks and keys."""

from __future__ import annotations

import os
import sys
from typing import Any, Callable, Protocol, Sequence, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.editing.border_annotation import Outcome
from atom_core.errors import DatasetError

_WINDOW = "border of the board"
_WAIT_MS = 50


class Drawn(Protocol):
    """What the window shows and changes."""

    @property
    def title(self) -> str:
        """What the window is called."""

    def picture(self) -> np.ndarray:
        """Return what is shown, (height, width, 3)."""

    def click(self, at: Tuple[int, int]) -> None:
        """Do what a left click at a pixel of the picture does."""

    def right_click(self) -> None:
        """Do what a right click does."""

    def press(self, key: str) -> Outcome:
        """Do what a key does."""

    def save(self) -> str:
        """Write the file; return its name."""


def need_screen() -> None:
    """Refuse to go on where no window can open.

    Raises:
        DatasetError: there is no screen.
    """
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise DatasetError(
            "there is no screen to draw on (DISPLAY is not set); run this where windows can open"
        )


def run(drawn: Drawn, help_lines: Sequence[str]) -> int:
    """Open the window; return when the user ends it or closes it.

    Raises:
        DatasetError: this OpenCV has no windows.
    """
    try:
        cv2.namedWindow(_WINDOW, cv2.WINDOW_AUTOSIZE | cv2.WINDOW_GUI_NORMAL)
    except cv2.error:
        raise DatasetError(
            "this OpenCV was built without windows; use the system's (python3-opencv)"
        ) from None
    cv2.setMouseCallback(_WINDOW, _mouse(drawn))
    print("\n".join(help_lines))
    _show(drawn)
    while cv2.getWindowProperty(_WINDOW, cv2.WND_PROP_VISIBLE) >= 1:
        code = cv2.waitKey(_WAIT_MS)
        if code < 0:
            continue
        outcome = drawn.press(chr(code & 0xFF))
        said = drawn.save() if outcome.save else "ended without saving"
        if outcome.help:
            print("\n".join(help_lines))
        if outcome.end:
            print(said, file=sys.stdout)
            break
        _show(drawn)
    cv2.destroyAllWindows()
    return 0


def _show(drawn: Drawn) -> None:
    cv2.imshow(_WINDOW, drawn.picture())
    cv2.setWindowTitle(_WINDOW, drawn.title)


def _mouse(drawn: Drawn) -> Callable[..., None]:
    def handle(event: int, x: int, y: int, *_: Any) -> None:
        if event == cv2.EVENT_LBUTTONDOWN:
            drawn.click((x, y))
        elif event == cv2.EVENT_RBUTTONDOWN:
            drawn.right_click()
        else:
            return
        _show(drawn)

    return handle
