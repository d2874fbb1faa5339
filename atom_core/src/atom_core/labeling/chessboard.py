"""Corners of a chessboard in an image: all of them or none.

Where they are about is found by OpenCV (`chessboard_detection`), in whatever order. Here they get
their numbers by the rule of docs/conventions.md, and their exact places.
"""

from __future__ import annotations

from typing import List, NamedTuple, Optional, Tuple

import numpy as np

from atom_core.labeling.chessboard_detection import detect, detect_another
from atom_core.labeling.saddle import Corners, refine

_LEAST_QUALITY = 0.8
_LEAST_LINE_QUALITY = 0.5  # median of a row or column of corners
_LEAST_OUTER_SHARE = 0.75  # of all corners' median: the print's edge is no line of corners
_ITERATIONS = 6
_LARGEST_MOVE_PX, _LARGEST_MOVE_SQUARES = 2.5, 0.12
_FARTHEST_SQUARES = 0.15  # of an unclear corner from where its neighbours say it is
_FREE = 0.5  # no marker stands beside the edges
_BEYOND_QUALITY, _BEYOND_MOVE_SQUARES = 0.9, 0.15  # a corner that the board should not have
_LEAST_CORNERS, _LARGEST_BOARD = 3, 40  # along a side


class FoundBoard(NamedTuple):
    """The corners of a chessboard in the order of their ids, or the reason why there are none.

    ``starts_black`` tells whether the square before corner 0 is black; ``exact`` (n,) bool which
    corners the picture confirms: the others stand about where the detector has them.
    """

    corners: Optional[Corners]
    reason: str = ""
    starts_black: bool = True
    exact: Optional[np.ndarray] = None


def mirror_shows(columns: int, rows: int) -> bool:
    """Tell whether a chessboard differs from its mirror image.

    With an even number of corners along a side there is an odd number of squares, and the colours
    are the same from both its ends: mirrored, it is the same board. A board of as many columns as
    rows is the same about its diagonal. Others, odd by odd, are mirrored with their colours
    exchanged.
    """
    return columns % 2 == 1 and rows % 2 == 1 and columns != rows


class ChessboardFinder:
    """Finds the corners of one chessboard."""

    def __init__(self, columns: int, rows: int):
        """Set the numbers of inner corners."""
        self.columns, self.rows = columns, rows

    def find(self, grey: np.ndarray) -> FoundBoard:
        """Find all corners (columns * rows) in a grey image (height, width) uint8.

        The board may start with a black or with a white square and stand in any turn. Numbers
        follow docs/conventions.md: black before corner 0 where the board has such a turn; of the
        turns that are left the one whose x axis points most to the right in the image, or down
        where it points to neither side.
        """
        if min(self.columns, self.rows) < _LEAST_CORNERS:
            return FoundBoard(
                None,
                f"a chessboard of {self._size()} inner corners is too small to be told from "
                f"other things; use one with at least {_LEAST_CORNERS} x {_LEAST_CORNERS}",
            )
        found = detect(grey, (self.columns, self.rows))
        if found is None:
            return FoundBoard(None, f"no chessboard of {self._size()} inner corners is seen")
        shape = (self.rows, self.columns, 2)
        labeled = self._labeled(grey, found.reshape(shape))
        if labeled.corners is None:
            return labeled
        rest, other = detect_another(grey, labeled.corners.pixels.reshape(shape))
        if other is not None and self._labeled(rest, other.reshape(shape)).corners is not None:
            return FoundBoard(
                None,
                f"two chessboards of {self._size()} inner corners are seen, and nothing tells "
                f"which is the board; take the other one, or its mirror image, out of view",
            )
        return labeled

    def _labeled(self, grey: np.ndarray, grid: np.ndarray, is_sure: bool = False) -> FoundBoard:
        """Return the exact corners of a grid (rows, columns, 2) that a detector has found.

        Unless it is sure, it may lie beside the board.
        """
        grid = self._oriented(grey, grid)
        black = _starts_black(grey, grid)
        corners, poor, wrong = _refine(grey, grid, black)
        exact = corners.pixels.reshape(grid.shape)
        if not _clear(corners.quality.reshape(grid.shape[:2])):
            return self._of_another_size(grey, exact, is_sure)
        if wrong.any():
            return FoundBoard(
                None, f"corner {np.flatnonzero(wrong)[0]} of the chessboard is hidden or blurred"
            )
        whole = _whole_grid(grey, exact, black)
        if whole != (self.columns, self.rows):
            again = self._regridded(grey, exact)
            if again.shape == grid.shape and not is_sure:
                return self._labeled(grey, again, is_sure=True)
            return self._another(*whole)
        return FoundBoard(corners, starts_black=black, exact=~poor)

    def _of_another_size(self, grey: np.ndarray, grid: np.ndarray, is_sure: bool) -> FoundBoard:
        """Return the board of which a grid has lines that are none; mostly it is another one."""
        again = self._regridded(grey, grid)
        rows, columns = again.shape[:2]
        if again.shape == grid.shape:
            if not is_sure and not np.array_equal(again, grid):
                return self._labeled(grey, again, is_sure=True)
        elif min(rows, columns) >= _LEAST_CORNERS:
            corners, _, wrong = _refine(grey, again, _starts_black(grey, again))
            if _clear(corners.quality.reshape(rows, columns)) and not wrong.any():
                return self._another(columns, rows)
        return FoundBoard(None, f"no chessboard of {self._size()} inner corners is seen clearly")

    def _regridded(self, grey: np.ndarray, grid: np.ndarray) -> np.ndarray:
        """Return the lines of corners that there are, as rows and columns of this board if so."""
        again = _regridded(grey, grid)
        if again.shape[:2] == (self.columns, self.rows) != (self.rows, self.columns):
            return again.swapaxes(0, 1)
        return again

    def _another(self, columns: int, rows: int) -> FoundBoard:
        return FoundBoard(
            None,
            f"a chessboard of {columns} x {rows} inner corners is seen, not of {self._size()}; "
            f"correct dimension, or take the other board out of view",
        )

    def _size(self) -> str:
        return f"{self.columns} x {self.rows}"

    def _oriented(self, grey: np.ndarray, grid: np.ndarray) -> np.ndarray:
        """Return the grid (rows, columns, 2) turned so that it is as docs/conventions.md has it."""
        x, y = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
        if x[0] * y[1] - x[1] * y[0] < 0:  # counted from the other side
            grid = grid[:, ::-1]
        turns = [grid, grid[::-1, ::-1]]
        if self.columns == self.rows:
            turns += [np.rot90(grid), np.rot90(grid, 3)]
        black = [t for t in turns if _starts_black(grey, t)] or turns
        return max(black, key=lambda t: tuple(np.round(_direction(t), 2)))


def _direction(grid: np.ndarray) -> np.ndarray:
    along = grid[0, -1] - grid[0, 0]
    return along / max(float(np.linalg.norm(along)), 1e-9)


def _starts_black(grey: np.ndarray, grid: np.ndarray) -> bool:
    """Tell whether the square before corner 0 is black, like every other one from there."""
    centres = (grid[:-1, :-1] + grid[1:, :-1] + grid[:-1, 1:] + grid[1:, 1:]) / 4.0
    column, row = np.rint(centres).astype(int).transpose(2, 0, 1)
    height, width = grey.shape
    values = grey[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)].astype(float)
    number = np.add.outer(np.arange(values.shape[0]), np.arange(values.shape[1]))
    return bool(values[number % 2 == 0].mean() < values[number % 2 == 1].mean())


def _refine(
    grey: np.ndarray, grid: np.ndarray, starts_black: bool
) -> Tuple[Corners, np.ndarray, np.ndarray]:
    """Return the exact corners, which are not confirmed (n,), and of these which are implausible.

    A detector may put a corner beside its place, mostly at the board's end: where the refit fails,
    it is made again where the neighbours say that the corner is.
    """
    corners = _refit(grey, grid, starts_black)
    side_px = np.mean([np.linalg.norm(_along(grid, i), axis=-1) for i in (0, 1)], axis=0).ravel()
    failed = _failed(corners, side_px)
    if not failed.any() or failed.all():
        return corners, failed, failed
    known = np.where(failed[:, None], np.nan, corners.pixels).reshape(grid.shape)
    likely = _from_neighbours(known)
    start = np.where(np.isfinite(known), known, np.where(np.isfinite(likely), likely, grid))
    again = _refit(grey, start, starts_black)
    mended = failed & ~_failed(again, side_px)
    pixels = np.where(mended[:, None], again.pixels, corners.pixels)
    # where that fails too the detector's own corner stands, if it can be right: it is no label,
    # but the others keep their numbers
    poor = failed & ~mended
    pixels = np.where(poor[:, None], grid.reshape(-1, 2), pixels)
    off_px = np.linalg.norm(grid - likely, axis=-1).ravel()
    wrong = poor & ~(off_px <= np.maximum(_FARTHEST_SQUARES * side_px, 1.0))
    chosen = Corners(
        pixels,
        np.where(mended, again.quality, corners.quality),
        np.where(mended, again.contrast, corners.contrast),
        np.where(mended, again.moved_px, np.where(poor, 0.0, corners.moved_px)),
    )
    return chosen, poor, wrong


def _failed(corners: Corners, side_px: np.ndarray) -> np.ndarray:
    """Return (n,) bool: what is no corner, or another one; squares' sides (n,) [px]."""
    farthest_px = np.maximum(_LARGEST_MOVE_PX, _LARGEST_MOVE_SQUARES * side_px)
    return (corners.quality < _LEAST_QUALITY) | (corners.moved_px > farthest_px)


def _from_neighbours(known: np.ndarray) -> np.ndarray:
    """Return where corners (rows, columns, 2) stand by those around them; NaN is not known.

    Between two neighbours, else in line with two; what neither tells stays NaN.
    """
    rows, columns = known.shape[:2]
    padded = np.pad(known, ((2, 2), (2, 2), (0, 0)), constant_values=np.nan)

    def at(row: int, column: int) -> np.ndarray:
        return padded[2 + row : 2 + row + rows, 2 + column : 2 + column + columns]

    between = [(at(-i, -j) + at(i, j)) / 2.0 for i, j in ((0, 1), (1, 0))]
    steps = ((0, 1), (1, 0), (0, -1), (-1, 0))
    in_line = [2.0 * at(i, j) - at(2 * i, 2 * j) for i, j in steps]
    return _mean_of_known(between, _mean_of_known(in_line, np.full(known.shape, np.nan)))


def _mean_of_known(values: List[np.ndarray], otherwise: np.ndarray) -> np.ndarray:
    stacked = np.stack(values)
    finite = np.isfinite(stacked)
    count = finite.sum(axis=0)
    mean = np.where(finite, stacked, 0.0).sum(axis=0) / np.maximum(count, 1)
    return np.where(count > 0, mean, otherwise)


def _clear(quality: np.ndarray) -> bool:
    """Tell whether corners (rows, columns) look like corners, in each line of them.

    A detector may leave out a line: from there on white and black change places.
    """
    lines = [np.median(quality, axis=axis) for axis in (0, 1)]
    outer = min(float(of_axis[[0, -1]].min()) for of_axis in lines)
    middle = float(np.median(quality))
    every = min(float(of_axis.min()) for of_axis in lines) >= _LEAST_LINE_QUALITY
    return middle >= _LEAST_QUALITY and every and outer >= _LEAST_OUTER_SHARE * middle


def _refit(grey: np.ndarray, grid: np.ndarray, starts_black: bool) -> Corners:
    axes = np.stack([_along(grid, 1), _along(grid, 0)], axis=-1).reshape(-1, 2, 2)
    row, column = np.mgrid[0 : grid.shape[0], 0 : grid.shape[1]]
    black = ((row + column) % 2 == 0).ravel() == starts_black
    return refine(grey, grid.reshape(-1, 2), axes, _FREE, black, _ITERATIONS)


def _along(grid: np.ndarray, axis: int) -> np.ndarray:
    """Return the side of a square at every corner along an axis of the grid [px]."""
    return np.gradient(grid, axis=axis)


def _whole_grid(grey: np.ndarray, grid: np.ndarray, starts_black: bool) -> Tuple[int, int]:
    """Return columns and rows of the board that the corners (rows, columns, 2) are a part of.

    A detector may take some rows of a larger board for the whole; its corners would get wrong
    numbers. So the lines of corners are continued on each side as long as there are corners.
    """
    sizes: List[int] = []
    for axis in (1, 0):
        count = grid.shape[axis]
        for outwards in (grid, np.flip(grid, axis=axis)):
            black = starts_black == ((outwards is grid) or grid.shape[axis] % 2 == 0)
            count += _lines_beyond(grey, np.moveaxis(outwards, axis, 0), black)
        sizes.append(count)
    return sizes[0], sizes[1]


def _regridded(grey: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Return corners (rows, columns, 2) without outer lines that have none, with those beyond.

    A detector may take the print's border for a line of corners, and leave out one elsewhere.
    """
    for ends in (_without_blank_line, _with_line_beyond):
        for axis in (1, 0):
            for _ in range(2):  # each end, and back again
                grid = np.flip(ends(grey, grid, axis), axis=axis)
    return grid


def _without_blank_line(grey: np.ndarray, grid: np.ndarray, axis: int) -> np.ndarray:
    corners = _refit(grey, grid, _starts_black(grey, grid))
    first = np.take(corners.quality.reshape(grid.shape[:2]), 0, axis=axis)
    is_blank = np.median(first) < _BEYOND_QUALITY and grid.shape[axis] > _LEAST_CORNERS
    return np.delete(grid, 0, axis=axis) if is_blank else grid


def _with_line_beyond(grey: np.ndarray, grid: np.ndarray, axis: int) -> np.ndarray:
    lines = np.moveaxis(grid, axis, 0)
    if _lines_beyond(grey, lines, _starts_black(grey, grid)) == 0:
        return grid
    return np.moveaxis(np.concatenate([_next_line(lines[:3])[None], lines]), 0, axis)


def _lines_beyond(grey: np.ndarray, lines: np.ndarray, starts_black: bool) -> int:
    """Return how many lines of corners there are before the first of lines (n, m, 2)."""
    height, width = grey.shape
    nearest, count = lines[:3], 0
    while count < _LARGEST_BOARD:
        starts_black = not starts_black
        further = _next_line(nearest)
        grid = np.concatenate([further[None], nearest])
        axes_px = np.linalg.norm(_along(grid, 0)[0], axis=1)
        corners = _refit(grey, grid, starts_black)
        first = slice(0, len(further))
        inside = np.all((further >= 2) & (further <= [width - 3, height - 3]), axis=1)
        good = (corners.quality[first] >= _BEYOND_QUALITY) & inside
        good &= corners.moved_px[first] <= np.maximum(_BEYOND_MOVE_SQUARES * axes_px, 1.0)
        if np.sum(good) < 2 or np.sum(good) <= np.sum(inside) / 2.0:
            return count
        count += 1
        found = np.where(good[:, None], corners.pixels[first], further)
        nearest = np.concatenate([found[None], nearest[:-1]])
    return count


def _next_line(lines: np.ndarray) -> np.ndarray:
    """Return where the line before (n, m, 2) lines is expected; n is 2 or 3."""
    if len(lines) == 2:
        return 2.0 * lines[0] - lines[1]
    return 3.0 * lines[0] - 3.0 * lines[1] + lines[2]
