"""Labels: what of a board was found in the data of one sensor."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Mapping, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from atom_core.model.pattern import Pattern

CORNER, POINT, LIMIT_POINT = "corner", "point", "limit_point"


@dataclass(frozen=True)
class Label(ABC):
    """A board in the data of one sensor; an empty one where it was not detected."""

    @property
    @abstractmethod
    def counts(self) -> Mapping[str, int]:
        """How many items of each kind it has: ``corner``, or ``point`` and ``limit_point``."""

    @property
    @abstractmethod
    def rows(self) -> int:
        """How many residuals it makes."""

    @abstractmethod
    def summary(self, pattern: Pattern) -> str:
        """Return its size in a few characters, for tables."""

    @abstractmethod
    def is_partial(self, pattern: Pattern) -> bool:
        """Tell whether a part of the board is known to be missing."""

    @property
    def size(self) -> int:
        """How many items lie on the board: corners, points or pixels."""
        counts = self.counts
        return counts.get(CORNER, 0) + counts.get(POINT, 0)

    @property
    def limit_size(self) -> int:
        """How many items lie on the board's border."""
        return self.counts.get(LIMIT_POINT, 0)

    @property
    def detected(self) -> bool:
        """Tell whether anything was found."""
        return self.size > 0


@dataclass(frozen=True)
class RgbLabel(Label):
    """Corners of a pattern found in an image.

    Attributes:
        ids: (n,) corner ids.
        pixels: (n, 2) x right, y down [px], in the raw (distorted) image.
    """

    ids: np.ndarray
    pixels: np.ndarray

    @property
    def counts(self) -> Mapping[str, int]:
        """How many corners."""
        return {CORNER: len(self.ids)}

    @property
    def rows(self) -> int:
        """Two for each corner, x and y."""
        return 2 * len(self.ids)

    def summary(self, pattern: Pattern) -> str:
        """Return the number of corners, and of how many where some are missing."""
        found = str(len(self.ids))
        return f"{found}/{pattern.corner_count}" if self.is_partial(pattern) else found

    def is_partial(self, pattern: Pattern) -> bool:
        """Tell whether corners are missing."""
        return len(self.ids) < pattern.corner_count


@dataclass(frozen=True)
class RangeLabel(Label):
    """Returns of a range sensor on the board.

    Attributes:
        indices: (n,) points of the flattened cloud, beams of a scan, or pixels
            ``column + row * width``.
        limit_indices: (m,) those on the board's physical border.
    """

    indices: np.ndarray
    limit_indices: np.ndarray

    @property
    def counts(self) -> Mapping[str, int]:
        """How many points, and how many of its border."""
        return {POINT: len(self.indices), LIMIT_POINT: len(self.limit_indices)}

    @property
    def rows(self) -> int:
        """One for each point, and one for each limit point."""
        return len(self.indices) + len(self.limit_indices)

    def summary(self, pattern: Pattern) -> str:
        """Return the numbers of points and of limit points."""
        return f"{len(self.indices)}+{len(self.limit_indices)}"

    def is_partial(self, pattern: Pattern) -> bool:
        """Return False: points do not tell."""
        return False


class DetectionKey(NamedTuple):
    """Which sensor saw which pattern in which collection."""

    collection: str
    sensor: str
    pattern: str


class RangePoints(NamedTuple):
    """Labeled points of a range sensor.

    Attributes:
        inside: (n, 3) on the board, in the sensor's frame [m].
        limit: (m, 3) on its border [m].
        inside_indices: (n,) which points of the cloud or pixels of the image they are.
        limit_indices: (m,) likewise.
        dropped: so many labeled pixels had no valid depth.
    """

    inside: np.ndarray
    limit: np.ndarray
    inside_indices: np.ndarray
    limit_indices: np.ndarray
    dropped: int


def place(key: DetectionKey) -> str:
    """Return the words that name a detection in a message."""
    return f"sensor '{key.sensor}', collection {key.collection}, pattern '{key.pattern}'"
