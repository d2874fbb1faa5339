"""Model errors as columns: their weights, their sums by detection, and what priors add."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from problems import problem_of  # noqa: E402

from atom_core.problem.board_errors import BoardSize  # noqa: E402
from atom_core.problem.corrections import corrected  # noqa: E402
from atom_core.problem.model_errors import ErrorPrior, RangeOffset  # noqa: E402
from atom_core.solvers import losses  # noqa: E402
from atom_core.solvers.error_columns import (  # noqa: E402
    apply_errors,
    error_columns,
    prior_row,
    row_weight,
)
from atom_core.synthetic import scenes  # noqa: E402

OFFSET, SIZE = RangeOffset("lidar_1"), BoardSize("pattern_1")


@pytest.fixture(scope="module")
def problem():
    return problem_of(scenes.random_scene, rgb=1, depth=0, lidar3d=1)


def at(problem):
    return np.full(problem.parameters.size, 2e-3)


@pytest.mark.parametrize("loss", losses.LOSSES)
def test_a_row_counts_by_its_robust_weight_over_its_variance(loss):
    residual, sigma = np.array([[3.0, 4.0], [0.0, 0.1], [6.0, 8.0]]), np.array([1.0, 0.1, 5.0])
    square = np.array([25.0, 1.0, 4.0])
    expected = losses.weight(loss, square) / np.array([1.0, 0.01, 25.0])
    np.testing.assert_allclose(row_weight(residual, sigma, loss), expected)


@pytest.mark.parametrize("loss", [losses.NONE, losses.CAUCHY])
@pytest.mark.parametrize("error", [OFFSET, SIZE])
def test_a_column_against_differences_row_by_row(problem, error, loss):
    x, h, sigmas = at(problem), 1e-4, problem.initial_sigmas
    (column,) = error_columns(problem, x, sigmas, loss, [error])
    ahead, behind = (corrected(problem, {error: s * h * error.step}, x) for s in (1.0, -1.0))
    rows = zip(problem.residuals(x), ahead.residuals(x), behind.residuals(x), sigmas)
    by_state, curvature, slope = np.zeros((len(problem.detections), 6)), 0.0, 0.0
    linearised, moved = problem.linearise(x), set()
    for i, (now, more, less, sigma) in enumerate(rows):
        change, weight = (more - less) / (2.0 * h), row_weight(now, sigma, loss)
        curvature += np.sum(weight[:, None] * change**2)
        slope += np.sum(weight[:, None] * change * now)
        for row, detection in enumerate(problem.residual_blocks[i].detection):
            by_state[detection] += weight[row] * change[row] @ linearised.by_state[i][row]
        if np.any(change):
            moved.add(i)
            np.testing.assert_allclose(column.derivative[i], change, atol=1e-5)
            weighted = weight[:, None] * change
            np.testing.assert_allclose(column.weighted[i], weighted, rtol=1e-3, atol=0.1)
    assert column.error is error and moved <= set(column.derivative)
    assert column.curvature == pytest.approx(curvature, rel=1e-4)
    assert column.slope == pytest.approx(slope, rel=1e-3, abs=1e-2)
    scale = np.max(np.abs(by_state))
    np.testing.assert_allclose(column.by_state / scale, by_state / scale, atol=1e-4)
    np.testing.assert_array_equal(column.detection, np.arange(len(problem.detections)))


def test_columns_keep_the_order_of_the_errors_and_leave_out_what_tells_nothing(problem):
    nobody = RangeOffset("nobody")
    args = problem, at(problem), problem.initial_sigmas, losses.NONE
    assert [c.error for c in error_columns(*args, [SIZE, nobody, OFFSET])] == [SIZE, OFFSET]
    known = {nobody: ErrorPrior(0.02)}
    (_, only, _) = error_columns(*args, [SIZE, nobody, OFFSET], known)
    assert only.error == nobody and only.curvature == only.slope == 0.0
    assert not only.by_state.any() and only.derivative == {}
    assert error_columns(*args, []) == []


def test_a_solver_goes_on_with_rows_that_are_corrected_by_the_values(problem):
    taken = []
    solver = SimpleNamespace(problem=problem, take_rows=taken.append)
    apply_errors(solver, at(problem), [OFFSET, SIZE], np.array([0.5, -0.2]))
    (there,) = taken
    expected = {OFFSET: 0.5 * OFFSET.step, SIZE: -0.2 * SIZE.step}
    assert there.model_errors == expected
    for mine, other in zip(
        there.residuals(at(problem)),
        corrected(problem, expected, at(problem)).residuals(at(problem)),
    ):
        np.testing.assert_array_equal(mine, other)
    apply_errors(solver, at(problem), [], np.zeros(0))
    assert len(taken) == 1


@pytest.mark.parametrize("value", [0.03, -0.01, 0.0])
def test_a_prior_adds_the_derivatives_of_its_cost(value):
    """Half the square of (value - mean) / sigma, by the value in steps."""
    prior, h = ErrorPrior(0.02, 0.005), 1e-3

    def cost(steps):
        return 0.5 * ((value + steps * OFFSET.step - prior.mean) / prior.sigma) ** 2

    curvature, slope = prior_row(OFFSET, {OFFSET: prior}, value)
    assert slope == pytest.approx((cost(h) - cost(-h)) / (2.0 * h), abs=1e-9)
    assert curvature == pytest.approx((cost(h) - 2.0 * cost(0.0) + cost(-h)) / h**2, rel=1e-4)


def test_without_a_prior_nothing_is_added():
    assert prior_row(OFFSET, {}, 0.3) == (0.0, 0.0)
    assert prior_row(OFFSET, {SIZE: ErrorPrior(0.02)}, 0.3) == (0.0, 0.0)
