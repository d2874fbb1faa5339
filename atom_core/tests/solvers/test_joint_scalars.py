"""Insets and model errors beside the poses, against the same in one dense least-squares problem."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from problems import problem_of, rows  # noqa: E402

from atom_core.problem.board_errors import BoardSize
from atom_core.problem.corrections import corrected  # noqa: E402
from atom_core.problem.model_errors import ErrorPrior, RangeOffset  # noqa: E402
from atom_core.problem.residuals import BorderBlock  # noqa: E402
from atom_core.solvers import losses  # noqa: E402
from atom_core.solvers.assessment import assess  # noqa: E402
from atom_core.solvers.covariance import Covariance  # noqa: E402
from atom_core.solvers.error_columns import error_columns, in_steps, in_units, within_reason  # noqa: E402
from atom_core.solvers.levenberg_marquardt import LevenbergMarquardt  # noqa: E402
from atom_core.solvers.normal_equations import Layout  # noqa: E402
from atom_core.solvers.scalar_columns import scalars_of  # noqa: E402
from atom_core.solvers.scalars import better_scalars, joint_of, joint_scalars  # noqa: E402
from atom_core.solvers.variance_components import (  # noqa: E402
    MEDIAN_OF_NORM,
    SMALLEST_SIGMA,
    scale_factors,
)
from atom_core.synthetic import scenes  # noqa: E402

ERRORS = (RangeOffset("lidar_1"), RangeOffset("depth_1"), BoardSize("pattern_1"))
PRIORS = {ERRORS[0]: ErrorPrior(0.02, -0.01)}
NO_SENSOR = RangeOffset("nobody")


class Dense:
    """A problem a little away from its start, with dense derivatives by poses and errors."""

    def __init__(self):
        rng = np.random.default_rng(8)
        problem = problem_of(scenes.random_scene)
        self.sigmas, free = problem.initial_sigmas, problem.parameters.free.ravel()
        self.x = np.where(free, 1e-3 * rng.standard_normal(problem.parameters.size), 0.0)
        self.values = {ERRORS[0]: 0.004, ERRORS[1]: -0.003}
        self.problem = problem = corrected(problem, self.values, self.x)
        self.solver = LevenbergMarquardt(problem)
        self.free = np.flatnonzero(free)
        self.jacobian = problem.jacobian(self.x, self.sigmas).toarray()[:, self.free]
        self.residual = rows(problem, self.x, self.sigmas)
        self.columns = np.stack([self.by_error(error) for error in ERRORS], axis=1)
        layout = Layout(problem.parameters)
        self.assessed = assess(problem, layout, self.x, self.sigmas, losses.NONE)
        self.found = error_columns(problem, self.x, self.sigmas, losses.NONE, ERRORS)

    def by_error(self, error):
        """Return (rows,) the derivative by an error in units of its step, by differences."""
        ends = []
        for sign in (-1, 1):
            value = self.values.get(error, 0.0) + sign * 0.01 * error.step
            there = corrected(self.problem, {**self.values, error: value}, self.x)
            ends.append(rows(there, self.x, self.sigmas))
        return (ends[1] - ends[0]) / 0.02

    def inset_columns(self):
        """Return (rows, b) the derivatives by the insets, block by block."""
        columns, start = [], 0
        for i, block in enumerate(self.problem.residual_blocks):
            end = start + block.count * block.dimension
            for column in self.assessed.columns:
                if column.block == i:
                    columns.append(np.zeros(len(self.residual)))
                    columns[-1][start:end] = column.by_steps / self.sigmas[i]
            start = end
        return np.stack(columns, axis=1)

    def reduced(self, columns):
        """Return curvature (k, k), slope (k,) and gains (k, p) with the poses following."""
        gains = np.linalg.lstsq(self.jacobian, columns, rcond=None)[0]
        left = columns - self.jacobian @ gains
        return columns.T @ left, left.T @ self.residual, gains.T


@pytest.fixture(scope="module")
def dense():
    return Dense()


def close(found, expected, scale=1.0, limit=1e-4):
    np.testing.assert_allclose(found / scale, expected / scale, atol=limit)


def test_a_column_is_the_derivative_of_the_rows(dense):
    assert [column.error for column in dense.found] == list(ERRORS)
    for column, expected in zip(dense.found, dense.columns.T):
        assert column.curvature == pytest.approx(expected @ expected, rel=1e-5)
        assert column.slope == pytest.approx(expected @ dense.residual, rel=1e-4, abs=1e-3)
    none = error_columns(dense.problem, dense.x, dense.sigmas, losses.NONE, [NO_SENSOR])
    assert none == []
    known = {NO_SENSOR: ErrorPrior(0.02)}
    (only,) = error_columns(dense.problem, dense.x, dense.sigmas, losses.NONE, [NO_SENSOR], known)
    assert only.curvature == 0.0  # its prior alone tells it


@pytest.mark.parametrize("priors", [{}, PRIORS], ids=["without priors", "with a prior"])
def test_scalars_are_reduced_as_the_dense_problem_is(dense, priors):
    equations = dense.assessed.equations
    joint = joint_scalars(dense.problem, equations, [], dense.found, priors)
    curvature, slope, gains = dense.reduced(dense.columns)
    if priors:
        information = (ERRORS[0].step / PRIORS[ERRORS[0]].sigma) ** 2
        curvature[0, 0] += information
        slope[0] += information * (dense.values[ERRORS[0]] + 0.01) / ERRORS[0].step
    size = np.sqrt(np.diagonal(curvature))
    close(joint.curvature, curvature, np.outer(size, size))
    close(joint.slope, slope, size, limit=2e-3)
    poses = np.sqrt(np.sum(dense.jacobian**2, axis=0))
    close(joint.gains[:, dense.free] * poses / size[:, None], gains * poses / size[:, None])
    assert not np.delete(joint.gains, dense.free, axis=1).any()
    step = joint.newton_step()
    close(step * size, -np.linalg.solve(curvature, slope) * size, limit=3e-3)
    deviation = np.sqrt(np.diagonal(np.linalg.inv(curvature)))
    expected = np.linalg.inv(curvature) / np.outer(deviation, deviation)
    close(joint.covariance() / np.outer(deviation, deviation), expected)
    moved = joint.step_of_poses(equations, step)
    alone = -np.linalg.lstsq(dense.jacobian, dense.residual, rcond=None)[0]
    close(moved[dense.free] * poses, (alone - step @ gains) * poses, limit=0.02)


def test_poses_are_less_sure_beside_scalars_as_the_dense_inverse_says(dense):
    equations = dense.assessed.equations
    joint = joint_scalars(dense.problem, equations, [], dense.found, {})
    bordered = Covariance(equations, 4.0).bordered(joint)
    both = np.hstack([dense.jacobian, dense.columns])
    scale = 1.0 / np.linalg.norm(both, axis=0)
    inverse = np.linalg.inv((both * scale).T @ (both * scale)) * np.outer(scale, scale)
    whole = np.zeros((dense.problem.parameters.size,) * 2)
    count = len(dense.free)
    whole[np.ix_(dense.free, dense.free)] = 4.0 * inverse[:count, :count]
    size = 6 * equations.layout.shared
    deviation = np.sqrt(np.maximum(np.diagonal(whole), 1e-30))
    relative = np.outer(deviation, deviation)
    close(bordered.shared, whole[:size, :size], relative[:size, :size], limit=1e-3)
    for i, group in enumerate(equations.layout.group):
        own = slice(6 * i, 6 * i + 6)
        close(bordered.block(i), whole[own, own], relative[own, own], limit=1e-3)
        if group >= 0:
            pair = bordered.pairs(np.array([i]), np.array([0]))[0]
            close(pair, whole[own, :6], np.maximum(relative[own, :6], 1e-12), limit=1e-3)
    sigmas = 2.0 * np.sqrt(np.diagonal(inverse)[count:])
    for error, sigma in zip(ERRORS, sigmas):
        assert bordered.error_sigmas[error] == pytest.approx(sigma * error.step, rel=1e-3)


def test_insets_and_errors_together_by_either_way(dense):
    equations, insets = dense.assessed.equations, dense.assessed.columns
    joint = joint_scalars(dense.problem, equations, insets, dense.found, PRIORS)
    columns = np.hstack([dense.inset_columns(), dense.columns])
    curvature, slope, _ = dense.reduced(columns)
    place = len(insets)
    information = (ERRORS[0].step / PRIORS[ERRORS[0]].sigma) ** 2
    curvature[place, place] += information
    slope[place] += information * (dense.values[ERRORS[0]] + 0.01) / ERRORS[0].step
    size = np.sqrt(np.diagonal(curvature))
    close(joint.curvature, curvature, np.outer(size, size))
    close(joint.slope, slope, size, limit=2e-3)
    assert joint.errors == (*(None for _ in insets), *ERRORS)
    scalars = scalars_of(dense.solver, dense.x, dense.sigmas, losses.NONE, [*ERRORS, NO_SENSOR])
    borders = [b for b in dense.problem.residual_blocks if isinstance(b, BorderBlock)]
    assert scalars.insets == len(borders) == len(insets) and scalars.errors == ERRORS
    assert scalars.count == len(insets) + 3 and scalars.error(0) is None
    assert [scalars.error(place + i) for i in range(3)] == list(ERRORS)
    shares = [np.ones(len(block.segments)) for block in dense.problem.residual_blocks]
    other = joint_of(dense.problem, equations, scalars, shares, PRIORS)
    assert other.errors == joint.errors
    close(other.curvature, joint.curvature, np.outer(size, size), limit=1e-9)
    close(other.slope, joint.slope, size, limit=1e-7)
    np.testing.assert_allclose(other.gains, joint.gains, rtol=1e-6, atol=1e-12)


def test_a_round_takes_the_joint_step_within_reason(dense):
    equations, insets = dense.assessed.equations, dense.assessed.columns
    joint = joint_scalars(dense.problem, equations, insets, dense.found, {})
    before, values = np.full(len(dense.problem.residual_blocks), 0.5), np.zeros(3)
    args = (dense.problem, dense.assessed, dense.found, losses.NONE, before, values)
    new, errors = better_scalars(*args, {})
    step = joint.newton_step()
    chosen = [column.block for column in insets]
    np.testing.assert_allclose(new[chosen], np.clip(0.5 + step[: len(chosen)], 0.0, 1.0))
    others = np.setdiff1d(np.arange(len(before)), chosen)
    np.testing.assert_array_equal(new[others], before[others])
    np.testing.assert_allclose(errors, within_reason(ERRORS, step[len(chosen) :]))
    nothing = replace(dense.assessed, columns=())
    same = better_scalars(dense.problem, nothing, [], losses.NONE, before, values, {})
    assert same[0] is before and same[1] is values


def test_values_in_steps_and_in_units_are_one_another(dense):
    steps = np.array([0.5, -2.0, 1.0])
    units = in_units(ERRORS, steps)
    assert [units[error] for error in ERRORS] == [e.step * s for e, s in zip(ERRORS, steps)]
    np.testing.assert_allclose(in_steps(ERRORS, units), steps)
    assert in_steps([NO_SENSOR], units) == [0.0]
    most = np.array([error.most / error.step for error in ERRORS])
    np.testing.assert_allclose(within_reason(ERRORS, 3.0 * most), most)
    np.testing.assert_allclose(within_reason(ERRORS, -3.0 * most), -most)
    np.testing.assert_allclose(within_reason(ERRORS, 0.3 * most), 0.3 * most)


@pytest.mark.parametrize("loss", [losses.NONE, "cauchy"])
def test_sigmas_that_are_too_small_by_a_factor_are_told_so(dense, loss):
    rng, problem = np.random.default_rng(3), dense.problem
    true = [2.0 + i for i in range(len(problem.residual_blocks))]
    squares = [
        np.sum((factor * rng.standard_normal((block.count, block.dimension))) ** 2, axis=1)
        for factor, block in zip(true, problem.residual_blocks)
    ]
    equations = dense.assessed.equations
    found = scale_factors(problem, equations, squares, dense.sigmas, loss)
    explained = Covariance(equations).explained(problem, equations)
    for factor, result, block, square, used in zip(
        true, found, problem.residual_blocks, squares, explained
    ):
        count = block.count * block.dimension
        redundancy = count - used
        assert redundancy > 0.05 * count
        if loss == losses.NONE:
            assert result == pytest.approx(np.sqrt(np.sum(square) / redundancy))
        else:
            middle = np.sqrt(np.median(square)) / MEDIAN_OF_NORM[block.dimension]
            assert result == pytest.approx(middle * np.sqrt(count / redundancy), rel=0.02)
        assert result == pytest.approx(factor * np.sqrt(count / redundancy), rel=0.25)
    none = scale_factors(problem, equations, [0.0 * s for s in squares], dense.sigmas, loss)
    for result, block, sigma in zip(none, problem.residual_blocks, dense.sigmas):
        assert result * np.median(sigma) == pytest.approx(SMALLEST_SIGMA[block.kind])
