"""The difference of an edge in two calibrations by different collections, and how sure it is."""

from __future__ import annotations

from typing import Tuple

import numpy as np

from atom_core.calibration.calibrate import Calibration
from atom_core.evaluation.edge_spread import edge_spread
from atom_core.evaluation.spreads import NO_SPREAD, Spread, beyond, joint_covariance
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
