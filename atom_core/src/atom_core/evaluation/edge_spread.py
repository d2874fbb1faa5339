"""How exactly a calibration knows an edge: the covariance of its pose."""

from __future__ import annotations

from typing import Optional

import numpy as np

from atom_core.calibration.calibrate import Calibration
from atom_core.calibration.judge.weak_directions import edge_covariance
from atom_core.model.transforms import Edge
from atom_core.solvers.covariance import Covariance


def edge_spread(
    calibration: Calibration, edge: Edge, covariance: Optional[Covariance] = None
) -> Optional[np.ndarray]:
    """Return the covariance (6, 6) of turn [rad] and shift [m] in the parent's axes; None if held.

    Args:
        calibration: whose edge.
        edge: which.
        covariance: another one than the calibration's.
    """
    parameters = calibration.problem.parameters
    covariance = covariance or calibration.covariance
    for i, block in parameters.pose_blocks():
        if block.edge == edge:
            x = calibration.summary.x[parameters.slice_of(i)]
            return edge_covariance(block, x, covariance.block(i))
    return None
