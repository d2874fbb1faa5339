"""Where a ChArUco's markers and corners stand on the board."""

from __future__ import annotations

from typing import List, NamedTuple, Tuple

import numpy as np

from atom_core.aruco import marker_squares

LEGACY, CURRENT = True, False


class Layout(NamedTuple):
    """How a ChArUco is printed: inner corners, and the layout of an even number of rows."""

    columns: int
    rows: int
    legacy: bool


def layouts_of(columns: int, rows: int) -> List[Layout]:
    """Return the layouts of a board: two where its rows of squares are even in number."""
    even = (rows + 1) % 2 == 0
    return [Layout(columns, rows, option) for option in (CURRENT, LEGACY) if even or not option]


def rows_needed(ids: np.ndarray, columns: int) -> int:
    """Return how many rows of corners a board has at least that has all these markers."""
    squares = 2 * (int(np.max(ids)) + 1)  # every other one has a marker
    return -(-squares // (columns + 1)) - 1


def corner_grid(layout: Layout) -> np.ndarray:
    """Return the inner corners (n, 2) in squares from the outer corner of the print."""
    row, column = np.mgrid[1 : layout.rows + 1, 1 : layout.columns + 1]
    return np.column_stack([column.ravel(), row.ravel()]).astype(float)


def on_squares(
    ids: np.ndarray, layout: Layout, marker_share: float
) -> Tuple[np.ndarray, np.ndarray]:
    """Return the corners (4 m, 2) of the markers that a layout has [squares], and which it has."""
    squares = marker_squares(layout.columns + 1, layout.rows + 1, layout.legacy)
    known = ids < len(squares)
    corner = 0.5 + 0.5 * marker_share * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return (squares[ids[known]][:, None, :] + corner).reshape(-1, 2), known
