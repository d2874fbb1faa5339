"""The difference of an edge in two calibrations by different collections, and how sure it is."""

from __future__ import annotations

from typing import Tuple

import numpy as np

from atom_core.calibration.calibrate import Calibration
from atom_core.evaluation.edge_spread import known_spread
from atom_core.evaluation.spreads import joint_covariance
from atom_core.evaluation.trust.relative import difference
from atom_core.model.transforms import Edge


def edge_difference(
    one: Calibration, other: Calibration, edge: Edge
) -> Tuple[np.ndarray, np.ndarray]:
    """Return (6,) the turn [rad] and shift [m] from one estimate to the other, and its covariance.

    Args:
        one: a calibration.
        other: one that has no collection in common with it.
        edge: estimated in both; one that is held has no covariance.

    Returns:
        In the parent's axes, and (6, 6).
    """
    numbers = difference(*(part.dataset.first_value(edge) for part in (one, other)))
    return numbers, joint_covariance(known_spread(one, edge), known_spread(other, edge))
