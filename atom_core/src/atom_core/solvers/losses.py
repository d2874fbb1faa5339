"""Robust losses of a squared norm s in units of sigma: cost rho(s) / 2, weight rho'(s).

Widths give 95 % efficiency for Gaussian residuals (Holland, Welsch 1977).
"""

from __future__ import annotations

from typing import Sequence, Tuple

import numpy as np

NONE, HUBER, CAUCHY = "none", "huber", "cauchy"
LOSSES = (NONE, HUBER, CAUCHY)
_HUBER_WIDTH, _CAUCHY_WIDTH = 1.345, 2.385
# Mean curvature over mean weight of Gaussian residuals: the weights alone make the cost look
# more curved than it is, so that every step would fall short.
_CURVATURE = {NONE: 1.0, HUBER: 1.0, CAUCHY: 0.8}
# What Gaussian residuals of one and of two dimensions tell, over what their weights say: of the
# information E[psi']^2 / E[psi^2] / E[weight], of the gradient E[psi'] / E[psi^2].
_TOLD = {
    NONE: ((1.0, 1.0), (1.0, 1.0)),
    HUBER: ((0.991, 1.158), (1.043, 1.253)),
    CAUCHY: ((1.084, 1.363), (1.211, 1.495)),
}


def step_length(loss: str) -> float:
    """Return the factor by which a step of the weighted normal equations falls short."""
    return 1.0 / _CURVATURE[loss]


def told(loss: str, dimension: int) -> Tuple[float, float]:
    """Return by how much information and gradient are larger than the weighted equations say.

    So they tell what least squares would, of residuals (n, dimension) that are Gaussian.
    """
    return _TOLD[loss][dimension - 1]


def width(loss: str) -> float:
    """Return beyond which norm, in sigmas, a residual counts less; of no loss it is not used."""
    return {HUBER: _HUBER_WIDTH, CAUCHY: _CAUCHY_WIDTH}.get(loss, np.inf)


def cost(loss: str, squares: np.ndarray) -> float:
    """Return half the sum of rho over squared norms (n,)."""
    if loss == HUBER:
        norm = np.sqrt(squares)
        far = 2 * _HUBER_WIDTH * norm - _HUBER_WIDTH**2
        return 0.5 * float(np.sum(np.where(norm <= _HUBER_WIDTH, squares, far)))
    if loss == CAUCHY:
        return 0.5 * _CAUCHY_WIDTH**2 * float(np.sum(np.log1p(squares / _CAUCHY_WIDTH**2)))
    return 0.5 * float(np.sum(squares))


def total_cost(loss: str, squares: Sequence[np.ndarray]) -> float:
    """Return half the sum of rho over the squared norms (n,) of all residual blocks."""
    return sum(cost(loss, square) for square in squares)


def weight(loss: str, squares: np.ndarray) -> np.ndarray:
    """Return rho' (n,) at squared norms (n,), between 0 and 1."""
    if loss == HUBER:
        return np.minimum(1.0, _HUBER_WIDTH / np.sqrt(np.maximum(squares, 1e-300)))
    if loss == CAUCHY:
        return 1.0 / (1.0 + squares / _CAUCHY_WIDTH**2)
    return np.ones_like(squares)
