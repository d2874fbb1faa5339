"""Planes through points: fit, and the rectangle that bounds points in a plane."""

from __future__ import annotations

from math import sqrt
from typing import Tuple

import numpy as np

_UPRIGHT = 0.95  # of a normal along the sensor's z axis: then x tells what is up


def fit_plane(points: np.ndarray) -> Tuple[np.ndarray, np.ndarray, float]:
    """Fit a plane by total least squares.

    Args:
        points: (n, 3) [m], n >= 3.

    Returns:
        The centroid (3,) [m], the unit normal (3,), and the RMS distance to the plane [m].

    Raises:
        ValueError: fewer than three points, or all on a line.
    """
    points = np.asarray(points, dtype=float)
    if len(points) < 3:
        raise ValueError(f"a plane needs three points, found {len(points)}")
    centroid = points.mean(axis=0)
    _, singular, rows = np.linalg.svd(points - centroid, full_matrices=False)
    if singular[1] < 1e-9 * max(singular[0], 1e-12):
        raise ValueError("the points lie on a line, which leaves the plane open")
    return centroid, rows[2], float(singular[2] / np.sqrt(len(points)))


def plane_basis(normal: np.ndarray) -> np.ndarray:
    """Return a rotation (3, 3) whose third column is the unit normal."""
    # By numbers: numpy's cross product of two single vectors takes ten times as long.
    x, y, z = (float(value) for value in normal)
    smallest = min(abs(x), abs(y), abs(z))
    if abs(x) == smallest:  # the axis that is farthest from the normal, times the normal
        a, b, c = 0.0, -z, y
    elif abs(y) == smallest:
        a, b, c = z, 0.0, -x
    else:
        a, b, c = -y, x, 0.0
    length = sqrt(a * a + b * b + c * c)
    a, b, c = a / length, b / length, c / length
    return np.array([[a, y * c - z * b, x], [b, z * a - x * c, y], [c, x * b - y * a, z]])


def plane_as_seen(points: np.ndarray) -> np.ndarray:
    """Return ``sensor_T_plane`` (4, 4) of the plane through points, as its sensor sees it.

    Its origin is the centroid, z points away from the sensor, and y against the sensor's z axis:
    down, as in a picture of a sensor that stands upright.

    Args:
        points: (n, 3) [m] in the sensor's frame, n >= 3.

    Raises:
        ValueError: as `fit_plane`.
    """
    centroid, normal, _ = fit_plane(points)
    away = normal if normal @ centroid >= 0.0 else -normal
    up = np.eye(3)[2] if abs(away[2]) < _UPRIGHT else np.eye(3)[0]
    down = -(up - (up @ away) * away)
    down /= np.linalg.norm(down)
    frame = np.eye(4)
    frame[:3, :3] = np.column_stack([np.cross(down, away), down, away])
    frame[:3, 3] = centroid
    return frame
