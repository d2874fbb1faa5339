"""Corners of a chessboard in an image: all of them or none.

OpenCV's sector based detector first (Duda, Frese, "Accurate detection and localization of
checkerboard corners for calibration", BMVC 2018), then the same in an enlarged image, since small
squares escape it.
"""

from __future__ import annotations

from typing import Optional

import cv2
import numpy as np

from atom_core.labeling.saddle import Corners, refine

_UPSCALE = 2.0
_LEAST_QUALITY = 0.8
_ITERATIONS = 6
_STEEP, _LEAST_SADDLES, _AROUND_PX = 60.0, 0.8, 40
_LARGEST_MOVE_PX = 2.5
_FREE = 0.5  # no marker stands beside the edges


class ChessboardFinder:
    """Finds the corners of one chessboard."""

    def __init__(self, columns: int, rows: int):
        """Set the numbers of inner corners."""
        self.columns, self.rows = columns, rows

    def find(self, grey: np.ndarray) -> Optional[Corners]:
        """Return all corners (columns * rows) in the order of their ids, or None.

        A board that looks the same after half a turn (an even sum of columns and rows) is taken
        as standing upright: its x axis points to the right, or down where it points to neither.
        """
        found = _detect(grey, (self.columns, self.rows), 1.0)
        if found is None:
            found = self._enlarged(grey)
        if found is None:
            return None
        grid = self._oriented(grey, found.reshape(self.rows, self.columns, 2))
        corners = _refine(grey, grid)
        return corners if np.median(corners.quality) >= _LEAST_QUALITY else None

    def _enlarged(self, grey: np.ndarray) -> Optional[np.ndarray]:
        """Look again in the enlarged part of the image with saddles in it, if they are enough."""
        saddles = _saddles(grey)
        if len(saddles) < _LEAST_SADDLES * self.columns * self.rows:
            return None
        low = np.maximum(saddles.min(axis=0) - _AROUND_PX, 0)
        high = saddles.max(axis=0) + _AROUND_PX + 1
        part = np.ascontiguousarray(grey[low[1] : high[1], low[0] : high[0]])
        found = _detect(part, (self.columns, self.rows), _UPSCALE)
        return None if found is None else found + low

    def _oriented(self, grey: np.ndarray, grid: np.ndarray) -> np.ndarray:
        """Return the grid (rows, columns, 2) turned so that it is as docs/conventions.md has it."""
        x, y = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
        if x[0] * y[1] - x[1] * y[0] < 0:  # mirrored
            grid = grid[:, ::-1]
        turns = [grid, grid[::-1, ::-1]]
        if self.columns == self.rows:
            turns += [np.rot90(grid), np.rot90(grid, 3)]
        black = [t for t in turns if _starts_black(grey, t)] or turns
        return max(black, key=lambda t: tuple(np.round(_direction(t), 2)))


def _saddles(grey: np.ndarray) -> np.ndarray:
    """Return pixels (n, 2) where the grey values form a steep saddle, as squares' corners do."""
    smooth = cv2.GaussianBlur(grey, (0, 0), 1.5).astype(np.float32)
    xx, yy = (cv2.Sobel(smooth, cv2.CV_32F, *order, ksize=3) for order in ((2, 0), (0, 2)))
    xy = cv2.Sobel(smooth, cv2.CV_32F, 1, 1, ksize=3)
    steepness = xy * xy - xx * yy  # minus the determinant of the Hessian
    highest = cv2.dilate(steepness, np.ones((7, 7), np.uint8))
    rows, columns = np.nonzero((steepness == highest) & (steepness > _STEEP))
    return np.column_stack([columns, rows])


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


def _detect(grey: np.ndarray, size: tuple, scale: float) -> Optional[np.ndarray]:
    """Return corners (n, 2) [px] of the image as it is."""
    picture = grey
    if scale != 1.0:
        picture = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    # its own refinement (CALIB_CB_ACCURACY) takes five times as long, and ours follows
    found, corners = cv2.findChessboardCornersSB(picture, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
    if not found:
        return None
    return (corners.reshape(-1, 2).astype(float) + 0.5) / scale - 0.5


def _refine(grey: np.ndarray, grid: np.ndarray) -> Corners:
    axes = np.stack([_along(grid, 1), _along(grid, 0)], axis=-1).reshape(-1, 2, 2)
    row, column = np.mgrid[0 : grid.shape[0], 0 : grid.shape[1]]
    black = ((row + column) % 2 == 0).ravel()
    pixels = grid.reshape(-1, 2)
    corners = refine(grey, pixels, axes, _FREE, black, _ITERATIONS)
    # where the refit fails the detector's own corner stands, as a poor one
    failed = (corners.quality < _LEAST_QUALITY) | (corners.moved_px > _LARGEST_MOVE_PX)
    kept = np.where(failed[:, None], pixels, corners.pixels)
    return Corners(kept, corners.quality, corners.contrast, np.where(failed, 0, corners.moved_px))


def _along(grid: np.ndarray, axis: int) -> np.ndarray:
    """Return the side of a square at every corner along an axis of the grid [px]."""
    return np.gradient(grid, axis=axis)
