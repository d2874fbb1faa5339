"""What one collection says of the numbers that all collections share, kept as a triangle."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple, Tuple

import numpy as np


class CollectionPart(NamedTuple):
    """What a collection says of those k shared numbers that it depends on.

    Attributes:
        numbers: (k,) which.
        upper: (k (k + 1) / 2,) upper triangle of its information, row by row.
    """

    numbers: np.ndarray
    upper: np.ndarray

    @classmethod
    def of(cls, numbers: np.ndarray, information: np.ndarray) -> CollectionPart:
        """Return the part that information (k, k) makes."""
        return cls(numbers, information[_triangle(len(numbers))])

    @property
    def information(self) -> np.ndarray:
        """(k, k)."""
        k = len(self.numbers)
        full = np.empty((k, k))
        row, column = _triangle(k)
        full[row, column] = self.upper
        full[column, row] = self.upper
        return full

    def column(self, number: int, numbers: np.ndarray) -> np.ndarray:
        """Return the information (n,) of one number with others, zero with those that are none."""
        k, own = len(self.numbers), int(np.searchsorted(self.numbers, number))
        found = np.zeros(len(numbers))
        if own < k and self.numbers[own] == number:
            row, column = np.minimum(np.arange(k), own), np.maximum(np.arange(k), own)
            at = np.searchsorted(numbers, self.numbers)
            known = numbers[np.minimum(at, len(numbers) - 1)] == self.numbers
            found[at[known]] = self.upper[row * k - row * (row - 1) // 2 + column - row][known]
        return found


@lru_cache(maxsize=4)
def _triangle(size: int) -> Tuple[np.ndarray, np.ndarray]:
    row, column = np.triu_indices(size)
    return row, column
