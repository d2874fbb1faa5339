"""Loss functions: their weights are their slopes, and what they make of Gaussian residuals."""

import numpy as np
import pytest

from atom_core.solvers import losses
from atom_core.solvers.losses import CAUCHY, HUBER, LOSSES, NONE

SQUARES = np.array([0.0, 0.3, 1.0, 1.8, 1.82, 4.0, 25.0, 400.0])


def gaussian_means(loss, dimension):
    """Return E[psi'], E[psi^2] and E[weight] of residuals (n, dimension), for one component.

    By sums over the norm, which has a Rayleigh distribution in two dimensions.
    """
    norm = np.linspace(0.0, 12.0, 240_001)
    density = np.exp(-0.5 * norm**2) * (norm if dimension == 2 else 1.0)
    density /= density.sum()
    weight = losses.weight(loss, norm**2)
    slope = np.gradient(weight, norm)
    return (
        np.sum(density * (weight + norm * slope / dimension)),  # the divergence, by dimension
        np.sum(density * weight**2 * norm**2) / dimension,
        np.sum(density * weight),
    )


@pytest.mark.parametrize("loss", LOSSES)
def test_the_weight_is_the_slope_of_the_cost(loss):
    step = 1e-6
    for square in SQUARES[1:]:
        higher, lower = (losses.cost(loss, np.array([square + d])) for d in (step, -step))
        slope = (higher - lower) / step  # of rho over the square: the cost is half of rho
        assert slope == pytest.approx(losses.weight(loss, np.array([square]))[0], rel=1e-4)


@pytest.mark.parametrize("loss", LOSSES)
def test_small_residuals_count_whole_and_weights_never_rise(loss):
    weights = losses.weight(loss, SQUARES)
    assert weights[0] == 1.0 and np.all(np.diff(weights) <= 0.0) and np.all(weights > 0.0)
    assert losses.cost(loss, np.array([0.01])) == pytest.approx(0.005, rel=1e-2)


@pytest.mark.parametrize("loss", [HUBER, CAUCHY])
def test_the_widths_lose_a_twentieth_of_what_gaussian_residuals_tell(loss):
    """Both are the customary ones, of 95 % efficiency (Holland and Welsch 1977)."""
    curvature, square, _ = gaussian_means(loss, 1)
    assert curvature**2 / square == pytest.approx(0.95, abs=0.002)
    assert losses.width(NONE) == np.inf and losses.width(loss) < 3.0


@pytest.mark.parametrize("loss", LOSSES)
@pytest.mark.parametrize("dimension", [1, 2])
def test_what_is_told_of_gaussian_residuals_follows_from_the_weights(loss, dimension):
    curvature, square, weight = gaussian_means(loss, dimension)
    information, gradient = losses.told(loss, dimension)
    assert information == pytest.approx(curvature**2 / square / weight, rel=4e-3)
    assert gradient == pytest.approx(curvature / square, rel=4e-3)


def test_a_step_of_the_weighted_equations_falls_short_with_cauchy():
    curvature, _, weight = gaussian_means(CAUCHY, 1)
    two, _, weight_of_two = gaussian_means(CAUCHY, 2)
    lengths = sorted([weight / curvature, weight_of_two / two])
    assert lengths[0] < losses.step_length(CAUCHY) < lengths[1] + 0.05
    assert losses.step_length(NONE) == losses.step_length(HUBER) == 1.0


def test_the_cost_of_blocks_is_the_sum_of_theirs():
    blocks = [SQUARES[:3], SQUARES[3:]]
    for loss in LOSSES:
        whole = losses.cost(loss, SQUARES)
        assert losses.total_cost(loss, blocks) == pytest.approx(whole, rel=1e-12)
