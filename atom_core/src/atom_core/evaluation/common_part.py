"""Two clouds of one board, compared over the part of it that both see."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, cKDTree

from atom_core.evaluation import metrics
from atom_core.evaluation.observed import NotMeasurableError, Observed
from atom_core.evaluation.pairs import board_points
from atom_core.evaluation.statistics import Errors
from atom_core.geometry import se3
from atom_core.geometry.plane import fit_plane, plane_basis
from atom_core.geometry.units import MM_PER_M
from atom_core.model.labels import DetectionKey


def nearest_points_in_common(
    observed: Observed, source: DetectionKey, target: DetectionKey, target_T_source: np.ndarray
) -> Errors:
    """Nearest neighbours of the points that lie where the other label has points, too [mm].

    In both directions. A point counts whose place on the board's plane lies in the outline of the
    other label, grown by one beam step. With a LiDAR that sees a strip of the board only, the rest
    of it has no counterpart whatever the calibration is.
    """
    there, here = board_points(observed, source), board_points(observed, target)
    carried = se3.apply(target_T_source, there)
    parts = [_to_the_common_part(a, b) for a, b in ((carried, here), (here, carried))]
    distances = np.concatenate(parts)
    if len(distances) == 0:
        raise NotMeasurableError(
            f"'{source.sensor}' and '{target.sensor}' see no part of the board in common"
        )
    return Errors(MM_PER_M * distances)


def _to_the_common_part(points: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return distances (n,) from the points in the others' outline to the nearest of these [m]."""
    chosen = points[in_outline(points, others)]
    return metrics.nearest_distances(chosen, others) if len(chosen) else np.zeros(0)


def in_outline(points: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Tell which points (n,) lie, seen along the others' plane's normal, in their grown outline.

    Args:
        points: (n, 3) [m].
        others: (m, 3) [m], of a flat label; the outline is their convex hull, grown by the usual
            distance of a point to its neighbour.

    Returns:
        None of them where the others are no area.
    """
    try:
        centroid, normal, _ = fit_plane(others)
        across = plane_basis(normal)[:, :2]
        flat, placed = (others - centroid) @ across, (points - centroid) @ across
        sides = ConvexHull(flat).equations
    except (ValueError, RuntimeError):  # Qhull's own error is a RuntimeError
        return np.zeros(len(points), dtype=bool)
    step = float(np.median(cKDTree(flat).query(flat, k=2)[0][:, 1]))
    return np.max(placed @ sides[:, :2].T + sides[:, 2], axis=1) <= step
