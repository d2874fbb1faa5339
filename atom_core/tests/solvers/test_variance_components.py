"""Sigmas of each sensor and kind: by mean square or median, from redundancy, never too small."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from atom_core.problem.residuals import BORDER, ORTHOGONAL, REPROJECTION
from atom_core.solvers import losses
from atom_core.solvers.variance_components import MEDIAN_OF_NORM, SMALLEST_SIGMA, scale_factors

SQUARES = np.array([0.1, 0.5, 1.0, 2.0, 30.0])


@pytest.fixture
def factor(monkeypatch):
    """Return a function: the factor of one block whose rows the parameters explain in part."""

    def of(square, sigma, explained, loss, kind=ORTHOGONAL):
        fake = SimpleNamespace(explained=lambda problem, equations: [explained])
        module = "atom_core.solvers.variance_components.Covariance"
        monkeypatch.setattr(module, lambda equations: fake)
        dimension = 2 if kind == REPROJECTION else 1
        block = SimpleNamespace(count=len(square), dimension=dimension, kind=kind)
        problem = SimpleNamespace(residual_blocks=[block])
        (found,) = scale_factors(problem, None, [square], [sigma], loss)
        return found

    return of


def test_medians_of_norms_are_those_of_a_gaussian():
    for dimension, expected in MEDIAN_OF_NORM.items():
        assert expected == pytest.approx(np.sqrt(stats.chi2(dimension).median()), abs=1e-5)


@pytest.mark.parametrize("kind, rows", [(ORTHOGONAL, 5), (REPROJECTION, 10)])
def test_without_a_loss_the_mean_square_over_the_redundancy_decides(factor, kind, rows):
    found = factor(SQUARES, np.ones(5), 2.0, losses.NONE, kind)
    assert found == pytest.approx(np.sqrt(SQUARES.sum() / (rows - 2.0)))


@pytest.mark.parametrize("kind, rows", [(BORDER, 5), (REPROJECTION, 10)])
def test_with_a_loss_the_median_decides_and_one_far_row_does_not(factor, kind, rows):
    found = factor(SQUARES, np.ones(5), 2.0, losses.CAUCHY, kind)
    dimension = rows // 5
    middle = 1.0 / np.sqrt(stats.chi2(dimension).median())
    assert found == pytest.approx(middle * np.sqrt(rows / (rows - 2.0)), rel=1e-4)
    farther = np.append(SQUARES[:-1], 1e6)
    assert factor(farther, np.ones(5), 2.0, losses.CAUCHY, kind) == found


@pytest.mark.parametrize("explained, redundancy", [(4.7, 0.3), (4.8, 0.25), (5.0, 0.25)])
def test_a_twentieth_of_the_rows_is_redundant_at_least(factor, explained, redundancy):
    found = factor(SQUARES, np.ones(5), explained, losses.NONE)
    assert found == pytest.approx(np.sqrt(SQUARES.sum() / redundancy))


@pytest.mark.parametrize(
    "kind, smallest", [(REPROJECTION, 0.01), (ORTHOGONAL, 1e-5), (BORDER, 1e-4)]
)
@pytest.mark.parametrize("loss", [losses.NONE, losses.HUBER])
def test_sigmas_do_not_vanish_where_residuals_do(factor, kind, smallest, loss):
    sigma = 3.0 * smallest * np.array([1.0, 2.0, 3.0, 4.0, 50.0])
    found = factor(np.zeros(5), sigma, 0.0, loss, kind)
    assert SMALLEST_SIGMA[kind] == smallest
    assert found * np.median(sigma) == pytest.approx(smallest)


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_the_smallest_sigma_counts_as_it_will_be(factor, share):
    """All sigmas alike: what is above the smallest stays, what is below becomes the smallest."""
    sigma = np.full(5, 1e-5)
    found = factor(np.full(5, share**2), sigma, 0.0, losses.NONE)
    assert found == pytest.approx(max(share, 1.0))


def test_a_median_sigma_above_the_smallest_is_not_raised(factor):
    sigma = np.array([0.5e-5, 1e-3, 1e-3, 1e-3, 1e-3])  # the least is below, the median is not
    found = factor(np.ones(5), sigma, 0.0, losses.NONE)
    assert found == pytest.approx(1.0)
