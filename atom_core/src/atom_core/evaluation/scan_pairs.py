"""How 2D LiDARs are compared with one another: two cuts of a board lie in one plane."""

from __future__ import annotations

import numpy as np

from atom_core.evaluation.observed import Observed
from atom_core.evaluation.pairs import board_points
from atom_core.evaluation.statistics import Errors
from atom_core.geometry import se3
from atom_core.geometry.units import MM_PER_M
from atom_core.model.labels import DetectionKey


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
