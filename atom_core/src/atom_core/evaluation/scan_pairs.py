"""How a 2D LiDAR is compared with other sensors: its cut of the board lies in the board's plane."""

from __future__ import annotations

import numpy as np

from atom_core.evaluation.observed import NotMeasurableError, Observed
from atom_core.evaluation.pairs import MM_PER_M, board_points
from atom_core.evaluation.statistics import Errors
from atom_core.geometry import se3
from atom_core.geometry.plane import fit_plane
from atom_core.model.labels import DetectionKey


def cut_to_plane_of_points(
    observed: Observed, source: DetectionKey, target: DetectionKey, target_T_source: np.ndarray
) -> Errors:
    """Distances of the source's cut to the plane through the target's board points [mm]."""
    carried = se3.apply(target_T_source, board_points(observed, source))
    try:
        centroid, normal, _ = fit_plane(board_points(observed, target))
    except ValueError as error:
        raise NotMeasurableError(
            f"the points of '{target.sensor}' have no plane: {error}"
        ) from None
    return Errors(MM_PER_M * np.abs((carried - centroid) @ normal))


def cut_to_plane_of_corners(
    observed: Observed, source: DetectionKey, target: DetectionKey, target_T_source: np.ndarray
) -> Errors:
    """Distances of the source's cut to the board's plane by the target's corners alone [mm]."""
    carried = se3.apply(target_T_source, board_points(observed, source))
    pattern_T_target = se3.inverse(observed.camera_T_pattern(target))
    return Errors(MM_PER_M * np.abs(se3.apply(pattern_T_target, carried)[:, 2]))


def cuts_in_one_plane(
    observed: Observed, source: DetectionKey, target: DetectionKey, target_T_source: np.ndarray
) -> Errors:
    """Distances of both cuts to the plane that is nearest to them [mm].

    Two lines always are in one plane when they meet or are parallel; so this sees what makes them
    skew, and where the cuts coincide only that they do.
    """
    carried = se3.apply(target_T_source, board_points(observed, source))
    both = np.concatenate([carried, board_points(observed, target)]).astype(float)
    offsets = both - both.mean(axis=0)
    normal = np.linalg.svd(offsets, full_matrices=False)[2][-1]
    return Errors(MM_PER_M * np.abs(offsets @ normal))
