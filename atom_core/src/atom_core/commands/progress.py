"""How far a long step is: a bar on a terminal, and a line for every tenth of it in a log file."""

from __future__ import annotations

import sys
from types import TracebackType
from typing import Iterable, Iterator, Optional, Type, TypeVar, Union

from tqdm import tqdm

Item = TypeVar("Item")
_STEPS = 10


def progress(total: int, what: str, unit: str) -> Union[tqdm, Lines]:
    """Return what is told of every piece that is done (``update``), to be used by ``with``.

    Args:
        total: number of pieces.
        what: what is done, such as the name of a file.
        unit: what a piece is called, in the plural.
    """
    if sys.stderr.isatty():
        return tqdm(total=total, desc=what, unit=f" {unit}", mininterval=0.5)
    return Lines(total, what, unit)


def watched(items: Iterable[Item], total: int, what: str, unit: str) -> Iterator[Item]:
    """Yield items, and tell how many were taken."""
    with progress(total, what, unit) as bar:
        for item in items:
            yield item
            bar.update()


class Lines:
    """Writes a line to stderr whenever a further tenth is done."""

    def __init__(self, total: int, what: str, unit: str):
        self._total, self._what, self._unit = total, what, unit
        self._done = self._told = 0

    def __enter__(self) -> Lines:
        return self

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        error: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        """Nothing is left to be closed."""

    def update(self, count: int = 1) -> None:
        """Count pieces that are done."""
        self._done += count
        steps = _STEPS * self._done // max(self._total, 1)
        if steps > self._told:
            self._told = steps
            share = 100 * steps // _STEPS
            told = f"{self._what}: {share} % ({self._done} of {self._total} {self._unit})"
            print(told, file=sys.stderr, flush=True)
