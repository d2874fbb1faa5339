"""Corners between black and white squares, to a fraction of a pixel, and how good each one is.

The estimator is the classical one: every gradient near a corner stands at right angles to the
edge it lies on, and both edges pass through the corner (Foerstner, Guelch, "A fast operator for
detection and precise location of distinct points, corners and centres of circular features",
ISPRS 1987; OpenCV's ``cornerSubPix`` too). What is different is the window: a cross along the two
edges, laid out in the board's own, slanted axes. It leaves out the markers, takes in as much of
the edges as there is, and is symmetric about the corner, so that what a blurred marker adds
on one side it adds on the other: the estimate stays unbiased.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Tuple

import numpy as np

_REACH_SQUARES = 0.40  # along the edges
_LARGEST_RADIUS_PX = 11
_LEAST_RADIUS_PX = 2
_MARGIN_PX = 1.5  # kept from a marker's edge: pixels mix what is beside them
_NARROWEST_PX = 0.9  # half a cross's arm, at least
_ITERATIONS = 4
_LEAST_PIXELS = 8


@dataclass(frozen=True)
class Corners:
    """Refined corners.

    Attributes:
        pixels: (n, 2) [px].
        quality: (n,) correlation of the picture with an ideal corner, 0 to 1; 0 where the
            estimate failed.
        contrast: (n,) half the difference between white and black [grey values].
        moved_px: (n,) from where it was expected.
    """

    pixels: np.ndarray
    quality: np.ndarray
    contrast: np.ndarray
    moved_px: np.ndarray


def refine(
    grey: np.ndarray,
    expected: np.ndarray,
    axes_px: np.ndarray,
    gap_squares: float,
    first_is_black: np.ndarray,
) -> Corners:
    """Find the exact corners near expected ones.

    Args:
        grey: (height, width) uint8.
        expected: (n, 2) where they are about [px].
        axes_px: (n, 2, 2) columns: a square's side along the board's x and y [px].
        gap_squares: width of the white strip between a square's edge and its marker, in squares;
            0.5 for a board without markers.
        first_is_black: (n,) bool, whether the square towards -x, -y of the corner is black.
    """
    if len(expected) == 0:
        return Corners(np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros(0))
    to_squares = np.linalg.inv(axes_px)
    # distance [px] between lines one square apart, for each axis: rows of the inverse
    pitch_px = 1.0 / np.linalg.norm(to_squares, axis=2)
    arm = np.maximum(gap_squares * pitch_px - _MARGIN_PX, _NARROWEST_PX) / pitch_px
    radius = _radius_px(axes_px)
    reach = np.minimum(_REACH_SQUARES, radius / np.linalg.norm(axes_px, axis=1).max(axis=1))
    window = _Window(to_squares, pitch_px, arm, reach, radius)
    pixels, good = _iterate(_Patches(grey, radius), expected, window)
    quality, contrast = _likeness(_Patches(grey, radius), pixels, window, first_is_black)
    quality[~good] = 0.0
    moved = np.linalg.norm(pixels - expected, axis=1)
    return Corners(pixels, quality, contrast, moved)


def _radius_px(axes_px: np.ndarray) -> int:
    longest = float(np.median(np.linalg.norm(axes_px, axis=1).max(axis=1)))
    return int(np.clip(np.ceil(_REACH_SQUARES * longest), _LEAST_RADIUS_PX, _LARGEST_RADIUS_PX))


@dataclass(frozen=True)
class _Window:
    """The cross around each corner; ``arm`` and ``reach`` in squares."""

    to_squares: np.ndarray
    pitch_px: np.ndarray
    arm: np.ndarray
    reach: np.ndarray
    radius: int

    def coordinates(self, offsets: np.ndarray) -> np.ndarray:
        """Return offsets (n, m, 2) [px] from the corner in squares."""
        return offsets @ self.to_squares.transpose(0, 2, 1)

    def weights(self, coordinates: np.ndarray) -> np.ndarray:
        """Return (n, m): 1 inside, falling to 0 within half a pixel of the window's edge."""
        distance = np.abs(coordinates)
        pitch = self.pitch_px[:, None, :]
        arms = np.clip((self.arm[:, None, :] - distance) * pitch + 0.5, 0.0, 1.0).max(axis=2)
        ends = np.clip((self.reach[:, None, None] - distance) * pitch + 0.5, 0.0, 1.0).min(axis=2)
        return arms * ends


class _Patches:
    """Square pieces of a picture around corners."""

    def __init__(self, grey: np.ndarray, radius: int):
        self.grey, self.radius = grey, radius
        step = np.arange(-radius - 1, radius + 2)
        self._rows, self._columns = step[None, :, None], step[None, None, :]
        x, y = np.meshgrid(step[1:-1], step[1:-1])
        self._inner = np.column_stack([x.ravel(), y.ravel()]).astype(float)

    def cut(self, centres: np.ndarray) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return grey values (n, k + 2, k + 2), pixels (n, k * k, 2), and which are of use."""
        height, width = self.grey.shape
        whole = np.rint(centres).astype(int)
        rows, columns = (
            whole[:, 1, None, None] + self._rows,
            whole[:, 0, None, None] + self._columns,
        )
        values = self.grey[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]
        pixels = whole[:, None, :] + self._inner
        # as far as the picture goes on both sides, or the window were not symmetric
        room = np.minimum(centres - 1.0, [width - 2.0, height - 2.0] - centres)[:, None, :]
        inside = np.all(np.abs(pixels - centres[:, None, :]) <= room, axis=2)
        return values.astype(np.float32), pixels, inside


def _iterate(
    patches: _Patches, expected: np.ndarray, window: _Window
) -> Tuple[np.ndarray, np.ndarray]:
    """Return the corners (n, 2) [px], and whether each one is determined."""
    estimate, good = expected.copy(), np.ones(len(expected), dtype=bool)
    for _ in range(_ITERATIONS):
        values, pixels, inside = patches.cut(estimate)
        gx = (values[:, 1:-1, 2:] - values[:, 1:-1, :-2]).reshape(len(expected), -1)
        gy = (values[:, 2:, 1:-1] - values[:, :-2, 1:-1]).reshape(len(expected), -1)
        offsets = pixels - estimate[:, None, :]
        w = window.weights(window.coordinates(offsets)) * inside
        xx, xy, yy = (np.sum(w * a * b, axis=1) for a, b in ((gx, gx), (gx, gy), (gy, gy)))
        along = gx * offsets[..., 0] + gy * offsets[..., 1]
        bx, by = np.sum(w * gx * along, axis=1), np.sum(w * gy * along, axis=1)
        determinant, trace = xx * yy - xy * xy, xx + yy
        # ratio of the eigenvalues: an edge alone, without a corner, has one near zero
        good &= (determinant > 0.01 * trace**2) & (np.sum(w, axis=1) >= _LEAST_PIXELS)
        safe = np.where(determinant > 1e-6, determinant, 1.0)
        step = np.column_stack([yy * bx - xy * by, xx * by - xy * bx]) / safe[:, None]
        good &= np.linalg.norm(step, axis=1) < window.radius + 1.0
        estimate = np.where(good[:, None], estimate + step, estimate)
    return estimate, good


def _likeness(
    patches: _Patches, corners: np.ndarray, window: _Window, first_is_black: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Return correlation with an ideal corner (n,), 0 to 1, and contrast (n,) [grey values]."""
    values, pixels, inside = patches.cut(corners)
    seen = values[:, 1:-1, 1:-1].reshape(len(corners), -1)
    coordinates = window.coordinates(pixels - corners[:, None, :])
    w = window.weights(coordinates) * inside
    edges = np.clip(coordinates * window.pitch_px[:, None, :], -1.0, 1.0)  # blurred by a pixel
    ideal = np.where(first_is_black, -1.0, 1.0)[:, None] * edges[..., 0] * edges[..., 1]
    total = np.maximum(np.sum(w, axis=1), 1e-9)[:, None]
    seen = seen - np.sum(w * seen, axis=1)[:, None] / total
    ideal = ideal - np.sum(w * ideal, axis=1)[:, None] / total
    both = np.sum(w * seen * ideal, axis=1)
    ideal_square = np.maximum(np.sum(w * ideal**2, axis=1), 1e-9)
    seen_square = np.maximum(np.sum(w * seen**2, axis=1), 1e-9)
    return np.clip(both / np.sqrt(ideal_square * seen_square), 0, 1), both / ideal_square
