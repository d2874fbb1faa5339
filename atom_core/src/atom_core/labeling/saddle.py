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
    iterations: int = 4,
) -> Corners:
    """Find the exact corners near expected ones.

    Args:
        grey: (height, width) uint8.
        expected: (n, 2) where they are about [px].
        axes_px: (n, 2, 2) columns: a square's side along the board's x and y [px].
        gap_squares: width of the white strip between a square's edge and its marker, in squares;
            0.5 for a board without markers.
        first_is_black: (n,) bool, whether the square towards -x, -y of the corner is black.
        iterations: the error left falls to about a third in each.
    """
    if len(expected) == 0:
        return Corners(np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros(0))
    to_squares = _inverse(axes_px)
    # distance [px] between lines one square apart, for each axis: rows of the inverse
    pitch_px = 1.0 / np.linalg.norm(to_squares, axis=2)
    arm = np.maximum(gap_squares * pitch_px - _MARGIN_PX, _NARROWEST_PX) / pitch_px
    radius = _radius_px(axes_px)
    reach = np.minimum(_REACH_SQUARES, radius / np.linalg.norm(axes_px, axis=1).max(axis=1))
    patches = _Patches(grey, radius)
    window = _Window(to_squares, pitch_px, arm, reach, radius)
    pixels, good = _iterate(patches, expected, window, iterations)
    quality, contrast = _likeness(patches, pixels, window, first_is_black)
    quality[~good] = 0.0
    moved = np.linalg.norm(pixels - expected, axis=1)
    return Corners(pixels, quality, contrast, moved)


def _inverse(matrices: np.ndarray) -> np.ndarray:
    """Return the inverses of (n, 2, 2); LAPACK, called for each, takes longer than all the rest."""
    a, b, c, d = (matrices[:, i, j] for i in (0, 1) for j in (0, 1))
    adjugate = np.stack([np.stack([d, -b], axis=-1), np.stack([-c, a], axis=-1)], axis=1)
    return adjugate / (a * d - b * c)[:, None, None]


def _radius_px(axes_px: np.ndarray) -> int:
    longest = float(np.median(np.linalg.norm(axes_px, axis=1).max(axis=1)))
    return int(np.clip(np.ceil(_REACH_SQUARES * longest), _LEAST_RADIUS_PX, _LARGEST_RADIUS_PX))


@dataclass(frozen=True)
class _Window:
    """The cross around each corner; ``arm`` and ``reach`` in squares. Offsets are (n, m) [px]."""

    to_squares: np.ndarray
    pitch_px: np.ndarray
    arm: np.ndarray
    reach: np.ndarray
    radius: int

    def lines(self, dx: np.ndarray, dy: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return signed distances (n, m) [px] from the two edges through the corner."""
        a = (self.to_squares * self.pitch_px[:, :, None]).astype(np.float32)[..., None]
        return a[:, 0, 0] * dx + a[:, 0, 1] * dy, a[:, 1, 0] * dx + a[:, 1, 1] * dy

    def weights(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Return (n, m): 1 inside, falling to 0 within a pixel about the window's edge."""
        first, second = np.abs(first), np.abs(second)
        arm = (self.arm * self.pitch_px + 0.5).astype(np.float32)[..., None]
        end = (self.reach[:, None] * self.pitch_px + 0.5).astype(np.float32)[..., None]
        arms = np.maximum(arm[:, 0] - first, arm[:, 1] - second)
        ends = np.minimum(end[:, 0] - first, end[:, 1] - second)
        return np.clip(arms, 0.0, 1.0) * np.clip(ends, 0.0, 1.0)


class _Patches:
    """Square pieces of a picture around corners."""

    def __init__(self, grey: np.ndarray, radius: int):
        self.grey, self.radius = grey, radius
        step = np.arange(-radius - 1, radius + 2)
        self._rows, self._columns = step[None, :, None], step[None, None, :]
        x, y = np.meshgrid(step[1:-1], step[1:-1])
        self._x, self._y = x.ravel().astype(np.float32), y.ravel().astype(np.float32)

    def cut(self, centres: np.ndarray) -> Tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return grey values (n, k + 2, k + 2), offsets dx, dy (n, k * k), and which are of use."""
        height, width = self.grey.shape
        whole = np.rint(centres).astype(int)
        rows, columns = (
            whole[:, 1, None, None] + self._rows,
            whole[:, 0, None, None] + self._columns,
        )
        values = self.grey[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]
        rest = (whole - centres).astype(np.float32)
        dx, dy = self._x + rest[:, :1], self._y + rest[:, 1:]
        # as far as the picture goes on both sides, or the window were not symmetric
        room = np.minimum(centres - 1.0, [width - 2.0, height - 2.0] - centres).astype(np.float32)
        use = (np.abs(dx) <= room[:, :1]) & (np.abs(dy) <= room[:, 1:])
        return values.astype(np.float32), dx, dy, use


def _iterate(
    patches: _Patches, expected: np.ndarray, window: _Window, iterations: int
) -> Tuple[np.ndarray, np.ndarray]:
    """Return the corners (n, 2) [px], and whether each one is determined."""
    estimate, good = expected.copy(), np.ones(len(expected), dtype=bool)
    for _ in range(iterations):
        values, dx, dy, use = patches.cut(estimate)
        gx = (values[:, 1:-1, 2:] - values[:, 1:-1, :-2]).reshape(len(expected), -1)
        gy = (values[:, 2:, 1:-1] - values[:, :-2, 1:-1]).reshape(len(expected), -1)
        w = window.weights(*window.lines(dx, dy)) * use
        wx, wy, along = w * gx, w * gy, gx * dx + gy * dy
        xx, xy, yy = _dot(wx, gx), _dot(wx, gy), _dot(wy, gy)
        bx, by = _dot(wx, along), _dot(wy, along)
        determinant, trace = xx * yy - xy * xy, xx + yy
        # ratio of the eigenvalues: an edge alone, without a corner, has one near zero
        good &= (determinant > 0.01 * trace**2) & (w.sum(axis=1) >= _LEAST_PIXELS)
        safe = np.where(determinant > 1e-6, determinant, 1.0)
        step = np.column_stack([yy * bx - xy * by, xx * by - xy * bx]) / safe[:, None]
        good &= np.hypot(step[:, 0], step[:, 1]) < window.radius + 1.0
        estimate = np.where(good[:, None], estimate + step, estimate)
    return estimate, good


def _likeness(
    patches: _Patches, corners: np.ndarray, window: _Window, first_is_black: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Return correlation with an ideal corner (n,), 0 to 1, and contrast (n,) [grey values]."""
    values, dx, dy, use = patches.cut(corners)
    seen = values[:, 1:-1, 1:-1].reshape(len(corners), -1)
    first, second = window.lines(dx, dy)
    w = window.weights(first, second) * use
    # blurred by a pixel
    ideal = np.clip(first, -1.0, 1.0) * np.clip(second, -1.0, 1.0)
    ideal = np.where(first_is_black[:, None], -ideal, ideal)
    total = np.maximum(w.sum(axis=1), 1e-9)[:, None]
    seen = seen - _dot(w, seen)[:, None] / total
    ideal = ideal - _dot(w, ideal)[:, None] / total
    both = _dot(w * seen, ideal)
    ideal_square = np.maximum(_dot(w * ideal, ideal), 1e-9)
    seen_square = np.maximum(_dot(w * seen, seen), 1e-9)
    return np.clip(both / np.sqrt(ideal_square * seen_square), 0, 1), both / ideal_square


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("ij,ij->i", a, b).astype(float)
