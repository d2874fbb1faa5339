"""Bags that are written as a whole, or not at all."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Iterator

import rosbag

from atom_core.errors import OutputError


@contextlib.contextmanager
def new_bag(path: Path) -> Iterator[rosbag.Bag]:
    """Yield a bag that gets its name when all is written; an older one is intact until then.

    Raises:
        OutputError: it cannot be written; nothing is left of it.
    """
    half = path.with_name(f".{path.name}.part")
    try:
        with rosbag.Bag(str(half), "w") as bag:
            yield bag
        half.replace(path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from None
    finally:
        if half.exists():
            half.unlink()
