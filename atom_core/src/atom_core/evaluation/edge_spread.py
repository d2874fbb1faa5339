"""How exactly a calibration knows an edge: the covariance of its pose."""

from __future__ import annotations

from typing import Optional

import numpy as np

from atom_core.calibration.calibrate import Calibration
from atom_core.calibration.judge.weak_directions import edge_covariance
from atom_core.evaluation.spreads import NO_SPREAD, Spread, beyond
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


def known_spread(calibration: Calibration, edge: Edge) -> Spread:
    """Return how exactly a calibration knows an edge; one that is held exactly."""
    stated = edge_spread(calibration, edge)
    of_model = edge_spread(calibration, edge, calibration.covariance.of_model)
    if stated is None or of_model is None:
        return NO_SPREAD
    names = {name for name, sensor in calibration.dataset.sensors.items() if sensor.edge == edge}
    detections = sum(key.sensor in names for key in calibration.problem.detections)
    combined = edge_spread(calibration, edge, calibration.covariance.combined)
    usual = NO_SPREAD.usual
    if combined is not None:
        usual = beyond(np.diagonal(combined), np.diagonal(stated))
    freedom = calibration.covariance.freedom
    return Spread(stated, of_model, detections, freedom=freedom, usual=usual)
