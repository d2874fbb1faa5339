"""A rectangle of known size laid on points of its border in a plane, some sides out of view."""

from __future__ import annotations

from typing import NamedTuple, Tuple

import numpy as np

from atom_core.geometry.rectangle import Rectangle

_ANGLE_STEP_DEG = 2.0
_BIN_M = 0.015
_ROUNDS = 6
_NEAR_SIDE, _CORNER = 0.25, 0.1  # of half a side: points that tell where the side is
_BEST_SHARE = 0.995  # of the points between the extremes of a side


class BoardFit(NamedTuple):
    """Where the board lies in the plane.

    Attributes:
        centre: (2,) [m].
        plane_R_board: (2, 2) rotation.
        half_size: (2,) half of the sides [m], in the board's axes.
        distance: (n,) signed distance of each border point to the border [m], outside positive.
        sides: number of sides that border points lie on.
        corner: whether two adjacent sides have border points.
        opposite: whether two opposite sides have: only they tell the board's size.
        measured: (2,) distances of opposite sides by their points [m]; NaN where one is not seen.
    """

    centre: np.ndarray
    plane_R_board: np.ndarray
    half_size: np.ndarray
    distance: np.ndarray
    sides: int
    corner: bool
    opposite: bool
    measured: np.ndarray

    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        """Return distances (n,) of points (n, 2) in the plane to the nearest side's line [m]."""
        return _beyond((points - self.centre) @ self.plane_R_board, self.half_size).max(axis=0)

    def outline(self, larger_m: float) -> np.ndarray:
        """Return points (n, 2) in the plane around the board, made larger on each side [m]."""
        half = self.half_size + larger_m
        around = Rectangle(*(-half), *half).sample(0.05)
        return self.centre + around @ self.plane_R_board.T


def fit_board(
    border: np.ndarray, region: np.ndarray, half_size: np.ndarray, tolerance_m: float
) -> BoardFit:
    """Lay a board on its border points.

    Args:
        border: (n, 2) points where the region ends within the image [m], n >= 3.
        region: (m, 2) points of the region [m], its cut-off ends too.
        half_size: (2,) half of the board's sides [m].
        tolerance_m: distance from the border that is no misfit.

    Returns:
        The best of all directions, both ways round, and all sides that the points may belong to.
    """
    angle = _direction(border)
    plane_R_board = _rotation(angle)
    turned_border, turned_region = border @ plane_R_board, region @ plane_R_board
    best, lowest = None, np.inf
    for half in (half_size, half_size[::-1]):
        for centre in _centres(turned_region, half):
            cost = _cost(turned_border, turned_region, centre, half, tolerance_m)
            if cost < lowest:
                best, lowest = (centre, half), cost
    assert best is not None
    centre, half = best
    return _refined(border, plane_R_board @ centre, angle, half, tolerance_m)


def _direction(border: np.ndarray) -> float:
    """Return the angle [rad] in which the border's points stand in the sharpest lines."""
    angles = np.radians(np.arange(0.0, 90.0, _ANGLE_STEP_DEG))
    score = []
    for angle in angles:
        turned = border @ _rotation(angle)
        bins = np.floor((turned - turned.min(axis=0)) / _BIN_M).astype(int)
        score.append(sum(float(np.sum(np.bincount(b).astype(float) ** 2)) for b in bins.T))
    return float(angles[int(np.argmax(score))])


def _rotation(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def _centres(region: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Return centres (k, 2) that put a side on an extreme of the points, in the board's axes."""
    low, high = np.quantile(region, [1 - _BEST_SHARE, _BEST_SHARE], axis=0)
    options = np.stack([low + half, high - half, (low + high) / 2.0])
    return np.stack(np.meshgrid(options[:, 0], options[:, 1]), axis=-1).reshape(-1, 2)


def _cost(
    border: np.ndarray, region: np.ndarray, centre: np.ndarray, half: np.ndarray, tolerance: float
) -> float:
    off = _beyond(border - centre, half).max(axis=0)
    outside = _beyond(region - centre, half).max(axis=0)
    misfit = np.minimum(np.abs(off) / tolerance, 5.0)
    beyond = np.clip(outside / tolerance - 1.0, 0.0, 5.0)
    return float(np.mean(misfit) + 3.0 * np.mean(beyond))


def _beyond(points: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Return (2, n): how far points (n, 2) lie beyond the sides across x, and those across y."""
    return np.abs(points.T) - half[:, None]


def _distance_and_gradient(points: np.ndarray, half: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return distances (n,) to the nearest side's line, outside positive, and gradients (n, 2)."""
    across_x, across_y = _beyond(points, half)
    x_is_nearer = across_x >= across_y
    gradient = np.where(np.stack([x_is_nearer, ~x_is_nearer], axis=1), np.sign(points), 0.0)
    return np.where(x_is_nearer, across_x, across_y), gradient


def _refined(
    border: np.ndarray, centre: np.ndarray, angle: float, half: np.ndarray, tolerance: float
) -> BoardFit:
    """Improve centre and angle by robust least squares (Gauss-Newton, Cauchy weights)."""
    for _ in range(_ROUNDS):
        plane_R_board = _rotation(angle)
        turned = (border - centre) @ plane_R_board
        off, gradient = _distance_and_gradient(turned, half)
        weight = 1.0 / (1.0 + (off / tolerance) ** 2) ** 2
        turning = gradient[:, 0] * turned[:, 1] - gradient[:, 1] * turned[:, 0]
        rows = np.column_stack([-gradient, turning]) * weight[:, None]
        normal = rows.T @ np.column_stack([-gradient, turning]) + np.diag([1e-3, 1e-3, 1e-3])
        step = -np.linalg.solve(normal, rows.T @ off)
        centre, angle = centre + plane_R_board @ step[:2], angle + float(step[2])
    plane_R_board = _rotation(angle)
    turned = (border - centre) @ plane_R_board
    off, gradient = _distance_and_gradient(turned, half)
    on = np.abs(off) <= 2.0 * tolerance
    least = max(4, int(0.04 * len(border)))
    touched = [
        int(np.sum(on & (gradient @ np.array(direction) > 0.9))) >= least
        for direction in ((1, 0), (-1, 0), (0, 1), (0, -1))
    ]
    corner = (touched[0] or touched[1]) and (touched[2] or touched[3])
    opposite = (touched[0] and touched[1]) or (touched[2] and touched[3])
    measured = _measured(turned, half, least)
    return BoardFit(centre, plane_R_board, half, off, sum(touched), corner, opposite, measured)


def _measured(border: np.ndarray, half: np.ndarray, least: int) -> np.ndarray:
    """Return (2,) distances of opposite sides [m]; NaN where one has fewer points than the least.

    Args:
        border: (n, 2) points in the board's axes [m]; those near a corner tell of two sides, and
            are left out.
        half: (2,) half of the board's sides [m].
        least: number of points.
    """
    measured = np.full(2, np.nan)
    beyond = _beyond(border, half)
    for axis in (0, 1):
        mine = (np.abs(beyond[axis]) < _NEAR_SIDE * half.min()) & (
            beyond[1 - axis] < -_CORNER * half[1 - axis]
        )
        ends = [beyond[axis][mine & (sign * border[:, axis] > 0)] for sign in (1, -1)]
        if min(len(end) for end in ends) >= least:
            measured[axis] = 2.0 * half[axis] + sum(float(np.median(end)) for end in ends)
    return measured
