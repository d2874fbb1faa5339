"""The difference of an edge in two calibrations by different collections, and how sure it is."""

from __future__ import annotations

from typing import Tuple

import numpy as np

from atom_core.calibration.calibrate import Calibration
from atom_core.evaluation.edge_spread import edge_spread
from atom_core.evaluation.trust.relative import difference
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import BLOCK_SIZE
from atom_core.solvers.robust_covariance import wider_by_students_t


def edge_difference(
    one: Calibration, other: Calibration, edge: Edge
) -> Tuple[np.ndarray, np.ndarray]:
    """Return (6,) the turn [rad] and shift [m] from one estimate to the other, and its covariance.

    The standard deviation of an edge is wider by Student's t, since its few collections tell their
    scatter badly. The collections of two estimates together tell it better: the quantile of their
    difference is that of Welch and Satterthwaite's degrees of freedom (Welch 1947). The noise that
    is assumed is the least.

    Args:
        one: a calibration.
        other: one that has no collection in common with it.
        edge: estimated in both; one that is held has no covariance.

    Returns:
        In the parent's axes, and (6, 6).
    """
    numbers = difference(*(part.dataset.first_value(edge) for part in (one, other)))
    parts = [(_spread(part, edge), part.covariance.freedom) for part in (one, other)]
    stated = sum((spread for spread, _ in parts), np.zeros((BLOCK_SIZE, BLOCK_SIZE)))
    least = sum(_variance_of_model(part, edge) for part in (one, other))
    variances = np.array([np.diagonal(spread) for spread, _ in parts])
    variance = joint_variance(variances, np.array([freedom for _, freedom in parts]))
    wanted = np.minimum(np.maximum(variance, least), np.diagonal(stated))
    factors = np.sqrt(wanted / np.maximum(np.diagonal(stated), 1e-30))
    return numbers, stated * np.outer(factors, factors)


def _spread(part: Calibration, edge: Edge) -> np.ndarray:
    found = edge_spread(part, edge)
    return np.zeros((BLOCK_SIZE, BLOCK_SIZE)) if found is None else found


def _variance_of_model(part: Calibration, edge: Edge) -> np.ndarray:
    found = edge_spread(part, edge, part.covariance.of_model)
    return np.zeros(BLOCK_SIZE) if found is None else np.diagonal(found)


def joint_variance(variances: np.ndarray, freedoms: np.ndarray) -> np.ndarray:
    """Return (n,) those of differences, by the variances (2, n) that Student's t made wider."""
    wider = np.array([1.0 if np.isinf(f) else wider_by_students_t(f) for f in freedoms])
    scatter = variances / wider[:, None] ** 2
    total = np.sum(scatter, axis=0)
    unsure = np.sum(scatter**2 / freedoms[:, None], axis=0)
    joint = [
        wider_by_students_t(whole**2 / part) if part > 0.0 else 1.0
        for whole, part in zip(total, unsure)
    ]
    return total * np.array(joint) ** 2
