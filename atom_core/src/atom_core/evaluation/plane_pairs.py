"""How far a range sensor's points are off the plane in which another sensor sees the board.

What is projected into an image hardly shows that a sensor is too far away, or too near, along the
image's rays. Its points off the board's plane do.
"""

from __future__ import annotations

import numpy as np

from atom_core.evaluation.observed import NotMeasurableError, Observed
from atom_core.evaluation.pairs import board_points
from atom_core.evaluation.statistics import Errors
from atom_core.geometry import se3
from atom_core.geometry.plane import fit_plane
from atom_core.geometry.units import MM_PER_M
from atom_core.model.labels import DetectionKey


def to_plane_of_points(
    observed: Observed, source: DetectionKey, target: DetectionKey, target_T_source: np.ndarray
) -> Errors:
    """Distances of the source's points to the plane through the target's board points [mm]."""
    carried = se3.apply(target_T_source, board_points(observed, source))
    try:
        centroid, normal, _ = fit_plane(board_points(observed, target))
    except ValueError as error:
        raise NotMeasurableError(
            f"the points of '{target.sensor}' have no plane: {error}"
        ) from None
    return Errors(MM_PER_M * np.abs((carried - centroid) @ normal))


def to_plane_of_corners(
    observed: Observed, source: DetectionKey, target: DetectionKey, target_T_source: np.ndarray
) -> Errors:
    """Distances of the source's points to the board's plane by the target's corners alone [mm]."""
    carried = se3.apply(target_T_source, board_points(observed, source))
    pattern_T_target = se3.inverse(observed.camera_T_pattern(target))
    return Errors(MM_PER_M * np.abs(se3.apply(pattern_T_target, carried)[:, 2]))
