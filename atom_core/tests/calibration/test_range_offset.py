"""Range offsets of LiDARs: derivatives, parity of the solvers, planted offsets, what is refused."""

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.preparation import free_edges
from atom_core.calibration.start.boards import initial_boards
from atom_core.errors import CalibrationError
from atom_core.problem.builder import build_problem
from atom_core.problem.corrections import corrected
from atom_core.problem.measurements import read_measurements
from atom_core.problem.model_errors import RangeOffset
from atom_core.problem.residuals import BorderBlock, RangeBlock
from atom_core.solvers.base import SolverOptions
from atom_core.solvers.choice import SOLVERS
from atom_core.solvers.error_columns import error_columns
from atom_core.solvers.reweighting import covariance_of, solve
from atom_core.synthetic import paper_cell, scenes
from atom_core.synthetic.mistakes import with_long_ranges

PLANTED_M = 0.03
OFFSET = RangeOffset("lidar_1")


@pytest.fixture(scope="module")
def scene():
    return paper_cell(0, disturbance=(0.05, 0.05))


@pytest.fixture(scope="module")
def problem():
    dataset = scenes.random_scene(1, collections=5).dataset
    measurements, _ = read_measurements(dataset)
    free = free_edges(dataset, CalibrationOptions())
    boards = initial_boards(dataset, measurements, free)
    return build_problem(dataset, measurements, boards, free)


def by_range_offset(block, poses):
    return -np.einsum("ni,ni->n", block.linearise(poses)[1][:, 0, 3:], block.rays)


def lengths(points):
    return np.linalg.norm(points.astype(float), axis=1)  # clouds have single precision


def test_an_offset_is_taken_back_exactly(problem):
    zero = np.zeros(problem.parameters.size)
    there = corrected(problem, {OFFSET: 0.07}, zero)
    back = corrected(there, {}, zero)
    for one, moved, other in zip(
        problem.residual_blocks, there.residual_blocks, back.residual_blocks
    ):
        if isinstance(one, RangeBlock):
            shift = lengths(moved.points) - lengths(one.points)
            np.testing.assert_allclose(shift, 0.07 if one.sensor == "lidar_1" else 0.0, atol=1e-9)
            np.testing.assert_allclose(other.points, one.points, atol=1e-12)


def test_both_solvers_see_the_same_rows_after_an_offset(problem):
    sigmas = problem.initial_sigmas
    x = 0.01 * np.random.default_rng(1).standard_normal(problem.parameters.size)
    squares, gradients = [], []
    for make in SOLVERS.values():
        solver = make(problem)
        solver.take_rows(corrected(problem, {OFFSET: 0.04}, x))
        squares.append(np.concatenate(solver.squares(x, sigmas)))
        gradients.append(solver.equations(x, sigmas, "cauchy").gradient_shared)
    np.testing.assert_allclose(squares[0], squares[1], rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(gradients[0], gradients[1], rtol=1e-6, atol=1e-3)


def test_the_column_is_the_derivative_of_the_cost(problem):
    sigmas = problem.initial_sigmas
    x, h = np.zeros(problem.parameters.size), 1e-6
    (column,) = error_columns(problem, x, sigmas, "none", [OFFSET])

    def cost(offset_m):
        residuals = corrected(problem, {OFFSET: offset_m}, x).residuals(x)
        return sum(0.5 * np.sum((r / s[:, None]) ** 2) for r, s in zip(residuals, sigmas))

    slope = (cost(h) - cost(-h)) / (2 * h)
    assert column.slope / OFFSET.step == pytest.approx(slope, rel=1e-5)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("solver_name", list(SOLVERS))
def test_a_planted_offset_is_found(scene, solver_name):
    dataset = with_long_ranges(scene.dataset, "lidar_2", PLANTED_M)
    options = CalibrationOptions(range_offset=("lidar_2",), solver_name=solver_name)
    result = calibrate(dataset, options)
    assert result.status == "converged" and not result.rejected
    found = result.summary.model_errors[RangeOffset("lidar_2")]
    sigma = result.covariance.error_sigmas[RangeOffset("lidar_2")]
    assert 0.0 < sigma < 0.002
    assert found == pytest.approx(-PLANTED_M, abs=min(4.0 * sigma, 0.002))


def test_without_an_offset_it_is_nothing(scene):
    names = ("lidar_1", "lidar_2", "lidar_3")
    result = calibrate(scene.dataset, CalibrationOptions(range_offset=names))
    for name in names:
        sigma = result.covariance.error_sigmas[RangeOffset(name)]
        assert abs(result.summary.model_errors[RangeOffset(name)]) < 4.0 * sigma
    assert calibrate(scene.dataset).summary.model_errors == {}


def test_the_joint_covariance_is_the_inverse_of_the_bordered_equations(problem):
    options = SolverOptions(loss="none", model_errors=(OFFSET,))
    solver = SOLVERS["scipy"](problem)
    summary = solve(solver, options)
    x, sigmas, now = summary.x, summary.sigmas, solver.problem
    poses, columns = now.poses(x), []
    offset, insets = [], []
    for i, (block, sigma) in enumerate(zip(now.residual_blocks, sigmas)):
        rows = block.count * block.dimension
        mine = block.sensor == "lidar_1" and isinstance(block, RangeBlock)
        offset.append(by_range_offset(block, poses) / sigma if mine else np.zeros(rows))
        if isinstance(block, BorderBlock):
            insets.append((i, block.by_inset_steps(poses) / sigma))
    starts = np.cumsum([0] + [b.count * b.dimension for b in now.residual_blocks])
    for i, across in insets:
        column = np.zeros(starts[-1])
        column[starts[i] : starts[i + 1]] = across
        columns.append(column)
    jacobian = now.jacobian(x, sigmas).toarray()
    full = np.column_stack([jacobian, *columns, np.concatenate(offset)])
    scale = np.linalg.norm(full, axis=0)
    inverse = np.linalg.inv((full / scale).T @ (full / scale)) / scale[:, None] / scale
    covariance = covariance_of(solver, summary, options)
    sigma = covariance.error_sigmas[OFFSET]
    assert sigma == pytest.approx(np.sqrt(inverse[-1, -1]), rel=1e-4)
    for i in range(len(now.parameters.blocks)):
        at = now.parameters.slice_of(i)
        np.testing.assert_allclose(
            covariance.block(i), inverse[at, at], rtol=1e-3, atol=1e-4 * np.max(inverse[at, at])
        )


def test_an_offset_that_nothing_tells_is_named():
    scene = scenes.random_scene(0, collections=6)
    options = CalibrationOptions(range_offset=("lidar_1",), undetermined_limit=(1e-4, 0.05))
    result = calibrate(scene.dataset, options)
    assert result.status == "rank_deficient"
    weak = [w for w in result.weak_directions if w.parameters == ("range offset of lidar_1",)]
    assert len(weak) == 1 and weak[0].unit == "m" and weak[0].sigma > 1e-4


@pytest.mark.parametrize("name", ["rgb_1", "lidar_9"])
def test_only_lidars_have_one(scene, name):
    with pytest.raises(CalibrationError, match=f"--range_offset {name}: .* lidar_1, lidar_2"):
        calibrate(scene.dataset, CalibrationOptions(range_offset=(name,)))


# The mean square of so many values is 1 within these limits, but for four in a thousand.
@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize(
    "rigs, least, most", [(4, 0.04, 4.2), pytest.param(12, 0.3, 2.5, marks=pytest.mark.long)]
)
def test_the_sigma_of_the_offset_is_that_of_its_errors(rigs, least, most):
    normalised, errors = [], []
    for seed in range(rigs):
        scene = paper_cell(seed, disturbance=(0.02, 0.02))
        dataset = with_long_ranges(scene.dataset, "lidar_1", PLANTED_M)
        result = calibrate(dataset, CalibrationOptions(range_offset=("lidar_1",)))
        error = result.summary.model_errors[OFFSET] + PLANTED_M
        errors.append(error)
        normalised.append(error / result.covariance.error_sigmas[OFFSET])
    assert np.sqrt(np.mean(np.square(errors))) < 0.001
    assert least < np.mean(np.square(normalised)) < most
