"""OpenCV, loaded when something of it is used first: `from atom_core import opencv as cv2`.

Its libraries take half a second to load, which is most of what a program takes that only reads
files, and every node of a launch file has it to itself. Whoever imports this waits for nothing.
"""

import importlib
from functools import lru_cache
from typing import Any

_wishes = {"one_thread": False}


def __getattr__(name: str) -> Any:
    """Return what OpenCV has under a name (PEP 562)."""
    return getattr(_loaded(), name)


def use_one_thread() -> None:
    """Let OpenCV use one thread of each caller, from its loading on."""
    _wishes["one_thread"] = True
    if _loaded.cache_info().currsize:
        _loaded().setNumThreads(1)


@lru_cache(maxsize=1)
def _loaded() -> Any:
    module = importlib.import_module("cv2")
    if _wishes["one_thread"]:
        module.setNumThreads(1)
    return module
