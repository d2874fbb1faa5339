"""Planes through points: fit, and the rectangle that bounds points in a plane."""

from __future__ import annotations

from typing import Tuple

import numpy as np


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
    helper = np.eye(3)[np.argmin(np.abs(normal))]
    first = np.cross(helper, normal)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(normal, first), normal])
