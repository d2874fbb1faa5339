"""How far a board moved in a picture while it was exposed, told by the picture alone.

Edges tell the blur across them, along two normals. What blurs both together, a motion between the
two, shows at the corners: there four squares meet, and the grey value lies half way between black
and white, but for a blur in one direction, which mixes the two squares of one colour that lie
along it. Of a Gaussian blur with the correlation r of its parts across the two edges, the value
at the corner is off the middle by asin(r) / pi of the step from black to white (the orthant
probability of two normal numbers).
"""

from __future__ import annotations

from typing import NamedTuple, Tuple

import numpy as np

from atom_core import opencv as cv2

_LEAST_RATIO = 1.5  # of the two axes of a blur, for it to be a motion's
_LEAST_PAIRS = 8
_LEAST_STEP = 5.0  # grey values
_LEAST_SINE = 0.1  # of the angle between the edges
_LEAST_BLUR_PX = 0.3  # a pixel's own width
_INSIDE = np.linspace(0.1, 0.9, 5)  # of a square, where its grey value is looked at


class Smear(NamedTuple):
    """A motion during the exposure.

    Attributes:
        length_px: how far, for a steady motion; 0 where the blur is about the same all round.
        direction: (2,) x, y, of length 1, either way.
    """

    length_px: float
    direction: np.ndarray


def smear_of(
    grey: np.ndarray, grid: np.ndarray, blurs_px: Tuple[float, float], step: float
) -> Smear:
    """Return how far the board moved.

    Args:
        grey: (height, width) uint8.
        grid: (rows, columns, 2) corners [px], NaN where not known.
        blurs_px: standard deviation across the edges along the rows of the grid, and across those
            along its columns.
        step: from black to white [grey values].
    """
    rows, columns = (_mean_direction(grid, axis) for axis in (1, 0))
    across = np.column_stack([_across(rows, columns), _across(columns, rows)])
    if step < _LEAST_STEP or abs(np.linalg.det(across)) < _LEAST_SINE:
        return Smear(0.0, rows)
    correlation = np.sin(np.pi * np.clip(_excess(grey, grid) / step, -0.5, 0.5))
    both = correlation * blurs_px[0] * blurs_px[1]
    measured = np.array([[blurs_px[0] ** 2, both], [both, blurs_px[1] ** 2]])
    inverse = np.linalg.inv(across)  # measured = across.T @ covariance @ across
    values, vectors = np.linalg.eigh(inverse.T @ measured @ inverse)
    smaller, larger = np.maximum(values, _LEAST_BLUR_PX**2)
    if larger < _LEAST_RATIO**2 * smaller:
        return Smear(0.0, vectors[:, 1])
    return Smear(float(np.sqrt(12.0 * (larger - smaller))), vectors[:, 1])


def _mean_direction(grid: np.ndarray, axis: int) -> np.ndarray:
    steps = np.diff(grid, axis=axis).reshape(-1, 2)
    mean = np.nanmean(steps, axis=0)
    return mean / np.linalg.norm(mean)


def _across(direction: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """Return the normal (2,) of a direction on the side to which ``ahead`` points."""
    normal = np.array([-direction[1], direction[0]])
    return normal if normal @ ahead > 0.0 else -normal


def _excess(grey: np.ndarray, grid: np.ndarray) -> float:
    """Return by how much corners are brighter where white squares lie ahead and behind.

    Ahead is where both indices of the grid grow. Neighbours are compared, of which one has black
    squares there: a shade over the board adds nothing.
    """
    values = _values(grey, grid)
    number = np.add.outer(np.arange(grid.shape[0]), np.arange(grid.shape[1]))
    sign = np.where(number % 2 == 0, 1.0, -1.0)
    off = [
        sign[:, :-1] * (values[:, :-1] - values[:, 1:]) / 2.0,
        sign[:-1] * (values[:-1] - values[1:]) / 2.0,
    ]
    off = np.concatenate([part[np.isfinite(part)] for part in off])
    if len(off) < _LEAST_PAIRS:
        return 0.0
    return float(np.mean(off)) * _first_square(grey, grid)


def _first_square(grey: np.ndarray, grid: np.ndarray) -> float:
    """Return 1 where the square between corners (0, 0) and (1, 1) is white, -1 where it is black.

    A white square may hold a marker; on the whole it is brighter.
    """
    x, y = (share.ravel()[:, None, None, None] for share in np.meshgrid(_INSIDE, _INSIDE))
    places = (1 - y) * ((1 - x) * grid[:-1, :-1] + x * grid[:-1, 1:])
    places = places + y * ((1 - x) * grid[1:, :-1] + x * grid[1:, 1:])
    squares = np.mean([_values(grey, place) for place in places], axis=0)
    number = np.add.outer(np.arange(squares.shape[0]), np.arange(squares.shape[1]))
    even, odd = (squares[(number % 2 == k) & np.isfinite(squares)] for k in (0, 1))
    if not (len(even) and len(odd)):
        return 0.0
    return 1.0 if np.mean(even) > np.mean(odd) else -1.0


def _values(grey: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Return grey values (rows, columns) at a grid of pixels, NaN where one is not known."""
    values = cv2.remap(
        grey.astype(np.float32),
        np.nan_to_num(grid, nan=-10.0).astype(np.float32),
        None,
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.where(np.isfinite(grid).all(axis=2), values, np.nan)
