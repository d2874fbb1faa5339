"""The reduced equations of scalars: their step, their covariance, and what rows they share."""

from types import SimpleNamespace

import numpy as np
import pytest

from atom_core.problem.model_errors import RangeOffset
from atom_core.solvers.assessment import InsetColumn
from atom_core.solvers.error_columns import ErrorColumn
from atom_core.solvers.normal_equations import least_damped
from atom_core.solvers.scalars import JointScalars, _common

OFFSET = RangeOffset("a")
RNG = np.random.default_rng(0)
ROWS = RNG.standard_normal((20, 3)) * [1.0, 100.0, 0.01]
RESIDUAL = RNG.standard_normal(20)


def joint(rows=ROWS, residual=RESIDUAL):
    curvature, count = rows.T @ rows, rows.shape[1]
    scale = np.sqrt(np.maximum(np.diagonal(curvature), 1e-30))
    none = (None,) * count
    return JointScalars(none, curvature, rows.T @ residual, np.zeros((count, 6)), scale)


def test_the_step_is_that_of_least_squares():
    expected = -np.linalg.lstsq(ROWS, RESIDUAL, rcond=None)[0]
    np.testing.assert_allclose(joint().newton_step(), expected)


def test_the_covariance_is_the_inverse_of_the_curvature():
    expected = np.linalg.inv(ROWS.T @ ROWS)
    deviation = np.sqrt(np.diagonal(expected))
    relative = np.outer(deviation, deviation)
    np.testing.assert_allclose(joint().covariance() / relative, expected / relative, atol=1e-9)


def test_what_the_poses_imitate_entirely_stays_and_is_hardly_known():
    given = joint()
    alike = ROWS[:, [0, 0]]
    same = joint(alike)  # both only together
    step = same.newton_step()
    assert step[0] == pytest.approx(step[1])
    assert np.all(np.isfinite(step))
    variance = np.diagonal(same.covariance())
    assert np.all(np.isfinite(variance))
    assert np.all(variance > 1e9 * np.diagonal(given.covariance())[0])


def test_a_covariance_is_positive_even_where_rounding_is_not():
    curvature = np.diag([1.0, -1e-18])
    given = JointScalars((None, None), curvature, np.zeros(2), np.zeros((2, 6)), np.ones(2))
    values = np.linalg.eigvalsh(given.covariance())
    np.testing.assert_allclose(values, [1.0, 1e13], rtol=1e-9)


@pytest.mark.parametrize("unit", [1e-3, 1e3])
def test_units_do_not_matter(unit):
    units = np.array([unit, 1.0, 1.0])
    other = joint(ROWS * units)
    np.testing.assert_allclose(other.newton_step() * units, joint().newton_step())
    covariance = other.covariance() * np.outer(units, units)
    deviation = np.sqrt(np.diagonal(covariance))
    relative = np.outer(deviation, deviation)
    np.testing.assert_allclose(covariance / relative, joint().covariance() / relative, atol=1e-9)


def test_without_a_factor_the_poses_follow_the_scalars_alone():
    gains = RNG.standard_normal((2, 6))
    scalars = JointScalars((None, None), np.eye(2), np.zeros(2), gains, np.ones(2))
    hopeless = SimpleNamespace(layout=None)

    def refused(*_):
        raise np.linalg.LinAlgError

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("atom_core.solvers.normal_equations.Factor", refused)
        step = scalars.step_of_poses(hopeless, np.array([2.0, -1.0]))
    np.testing.assert_allclose(step, -2.0 * gains[0] + gains[1])


@pytest.mark.parametrize("least", [0.0, 1e-12, 1e-9, 1e-6, 1e-3])
def test_no_more_damping_is_taken_than_is_needed_and_none_above_a_millionth(least, monkeypatch):
    tried = []

    def factor(equations, damping):
        tried.append(damping)
        if damping < least:
            raise np.linalg.LinAlgError
        return f"damped by {damping:g}"

    monkeypatch.setattr("atom_core.solvers.normal_equations.Factor", factor)
    found = least_damped(None)
    assert found == (None if least > 1e-6 else f"damped by {least:g}")
    assert tried == [d for d in (0.0, 1e-12, 1e-9, 1e-6) if d <= least]


def error_column(derivative, weight):
    weighted = {i: weight[:, None] * d for i, d in derivative.items()}
    return ErrorColumn(OFFSET, 1.0, 0.0, np.arange(1), np.zeros((1, 6)), derivative, weighted)


def test_columns_have_in_common_the_rows_that_both_depend_on():
    weight = RNG.uniform(0.5, 2.0, 4)
    one = error_column({0: RNG.standard_normal((4, 1)), 2: RNG.standard_normal((4, 2))}, weight)
    other = error_column({2: RNG.standard_normal((4, 2)), 3: np.ones((4, 1))}, weight)
    expected = np.sum(weight[:, None] * one.derivative[2] * other.derivative[2])
    assert _common(one, other) == pytest.approx(expected)
    assert _common(other, one) == pytest.approx(expected)


def test_an_inset_and_an_error_share_the_rows_of_the_insets_block():
    weight, by_steps = RNG.uniform(0.5, 2.0, 4), RNG.standard_normal(4)
    error = error_column({1: RNG.standard_normal((4, 1))}, weight)
    for block, expected in ((1, np.sum(weight * by_steps * error.derivative[1][:, 0])), (0, 0.0)):
        none = np.zeros((4, 2)), by_steps, 1.0, 0.0, np.arange(1), np.zeros((1, 6))
        assert _common(InsetColumn(block, *none), error) == pytest.approx(expected)
