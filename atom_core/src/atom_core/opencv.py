"""OpenCV, loaded when something of it is used first: `from atom_core import opencv as cv2`.

Its libraries take half a second to load, which is most of what a program takes that only reads
files, and every node of a launch file has it to itself. Whoever imports this waits for nothing.
"""

import importlib
from typing import Any


def __getattr__(name: str) -> Any:
    """Return what OpenCV has under a name (PEP 562)."""
    return getattr(importlib.import_module("cv2"), name)
