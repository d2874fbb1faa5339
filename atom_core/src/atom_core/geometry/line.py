"""Straight lines in space."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class LineFit(NamedTuple):
    """A line through points.

    Attributes:
        centroid: (3,) of the points [m].
        direction: (3,) unit vector along it.
        distances: (n,) of the points from it [m].
    """

    centroid: np.ndarray
    direction: np.ndarray
    distances: np.ndarray

    @property
    def rms_m(self) -> float:
        """Root mean square of the distances."""
        return float(np.sqrt(np.mean(self.distances**2)))


def fit_line(points: np.ndarray) -> LineFit:
    """Return the line that is nearest to points (n, 3), by least squares.

    Raises:
        ValueError: there are fewer than two, or they lie in one place.
    """
    points = np.asarray(points, dtype=float)
    if len(points) < 2:
        raise ValueError(f"{len(points)} point(s) have no line")
    centroid = points.mean(axis=0)
    offsets = points - centroid
    _, lengths, axes = np.linalg.svd(offsets, full_matrices=False)
    if lengths[0] <= 1e-9 * max(1.0, float(np.linalg.norm(centroid))):
        raise ValueError("the points lie in one place and have no line")
    across = offsets - np.outer(offsets @ axes[0], axes[0])
    return LineFit(centroid, axes[0], np.linalg.norm(across, axis=1))
