"""Detections that are off as a whole: what their rows have in common, and where rounds end."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from problems import problem_of  # noqa: E402

from atom_core.problem.model_errors import RangeOffset  # noqa: E402
from atom_core.problem.residuals import BorderBlock  # noqa: E402
from atom_core.solvers import losses  # noqa: E402
from atom_core.solvers.base import CONVERGED, NOT_CONVERGED, SolverOptions  # noqa: E402
from atom_core.solvers.covariance import Covariance  # noqa: E402
from atom_core.solvers.detection_noise import (  # noqa: E402
    _common_parts,
    _first_state,
    _moving_still,
    _own_gain,
    covariance_by_detections,
    weighted_by_detections,
)
from atom_core.solvers.levenberg_marquardt import LevenbergMarquardt  # noqa: E402
from atom_core.solvers.normal_equations import DetectionParts  # noqa: E402
from atom_core.solvers.reweighting import solve  # noqa: E402
from atom_core.solvers.shared_equations import shares_of  # noqa: E402
from atom_core.solvers.variance_components import scale_factors  # noqa: E402
from atom_core.synthetic import scenes  # noqa: E402

# --- what a detection's own pose would gain ------------------------------------------------------


def information(rank, seed=0, count=4):
    """Return (m, 6, 6) of detections that see some directions of their twist only."""
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((count, 30, rank)) @ rng.standard_normal((count, rank, 6))
    return np.swapaxes(rows, 1, 2) @ rows, rows


@pytest.mark.parametrize("rank", [1, 3, 6])
def test_the_gain_is_what_least_squares_saves_and_the_rank_what_is_seen(rank):
    matrices, rows = information(rank)
    residual = np.random.default_rng(1).standard_normal((4, 30))
    gradient = np.einsum("dri,dr->di", rows, residual)
    gain, seen = _own_gain(matrices, gradient)
    np.testing.assert_array_equal(seen, rank)
    for d in range(4):
        step = np.linalg.lstsq(rows[d], residual[d], rcond=None)[0]
        saved = residual[d] @ residual[d] - np.sum((residual[d] - rows[d] @ step) ** 2)
        assert gain[d] == pytest.approx(saved, rel=1e-6)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_units_of_the_twist_do_not_matter(scale):
    matrices, rows = information(6)
    gradient = np.random.default_rng(2).standard_normal((4, 6))
    units = np.array([scale] * 3 + [1.0] * 3)
    other = _own_gain(matrices * np.outer(units, units), gradient * units)
    for one, two in zip(_own_gain(matrices, gradient), other):
        np.testing.assert_allclose(one, two, rtol=1e-6)


def test_a_detection_without_information_gains_and_sees_nothing():
    gain, seen = _own_gain(np.zeros((1, 6, 6)), np.zeros((1, 6)))
    assert gain == [0.0] and seen == [0.0]


def common_of(gradient, matrices, fitted=0.0, rows=30, sigma=0.01):
    """Return the common part of one block, a part of whose information the solution has fitted."""
    count = len(matrices)
    states = np.array([fitted * np.linalg.pinv(m) for m in matrices])
    covariance = SimpleNamespace(states=lambda index, jacobians: states)
    part = DetectionParts(np.arange(count), matrices, gradient)
    equations = SimpleNamespace(parts=[part], state_jacobians=None)
    block = SimpleNamespace(detection=np.repeat(np.arange(count), rows))
    problem = SimpleNamespace(residual_blocks=[block], dependencies=None)
    (found,) = _common_parts(problem, equations, covariance, [np.full(count * rows, sigma)])
    return found


@pytest.mark.parametrize("common_m", [0.002, 0.01])
def test_the_common_part_of_many_detections_is_found(common_m):
    """Rows of a detection are moved alike along what its twist can do: by each direction."""
    rng, count, sigma_m = np.random.default_rng(3), 400, 0.01
    matrices, rows = information(6, count=count)
    noise = rng.standard_normal((count, 30))
    for d in range(count):  # of the variance n c^2 in each direction that is seen
        basis = np.linalg.qr(rows[d])[0]
        noise[d] += basis @ rng.standard_normal(6) * np.sqrt(30.0) * common_m / sigma_m
    gradient = np.einsum("dri,dr->di", rows, noise)
    assert common_of(gradient, matrices) == pytest.approx(common_m, rel=0.1)


def test_noise_of_single_rows_has_hardly_a_common_part():
    rng, count = np.random.default_rng(4), 400
    matrices, rows = information(6, count=count)
    gradient = np.einsum("dri,dr->di", rows, rng.standard_normal((count, 30)))
    assert common_of(gradient, matrices) < 0.05 * 0.01


def test_what_the_solution_has_fitted_is_made_up_for():
    """The mean chi-square of six directions of which a half is fitted is three."""
    matrices, rows = information(6, count=2)
    along = np.linalg.qr(rows[0])[0][:, 0], np.linalg.qr(rows[1])[0][:, 0]
    gradient = np.stack([r.T @ v * 10.0 for r, v in zip(rows, along)])  # chi-square 100 each
    for fitted, made_up in ((0.0, 0.0), (0.5, 3.0), (1.0, 6.0), (5.0, 6.0)):
        expected = np.sqrt((100.0 + made_up - 6.0) / (6.0 * 30.0)) * 0.01
        assert common_of(gradient, matrices, fitted) == pytest.approx(expected, rel=1e-6)


def test_less_than_noise_has_no_common_part_nor_has_what_sees_nothing():
    matrices, _ = information(6)
    assert common_of(np.zeros((4, 6)), matrices) == 0.0
    assert common_of(np.zeros((4, 6)), np.zeros((4, 6, 6))) == 0.0


# --- whole solutions -----------------------------------------------------------------------------

ERROR = RangeOffset("lidar_1")


class Solution:
    """A rig's solution with single rows' noise, and the same weighted by detections."""

    def __init__(self):
        self.options = SolverOptions(loss=losses.CAUCHY, model_errors=(ERROR,))
        problem = problem_of(scenes.random_scene, rgb=2, depth=0, lidar3d=1)
        self.solver = LevenbergMarquardt(problem)
        self.before = solve(self.solver, self.options)
        self.after = weighted_by_detections(self.solver, self.before, self.options)


@pytest.fixture(scope="module")
def solution():
    return Solution()


def test_the_first_state_is_the_solution_without_common_parts(solution):
    state = _first_state(solution.before, solution.options)
    np.testing.assert_array_equal(state.x, solution.before.x)
    assert state.x is not solution.before.x
    assert not state.common.any() and len(state.common) == len(solution.before.sigmas)
    assert state.errors * ERROR.step == pytest.approx(solution.before.model_errors[ERROR])


def test_a_settled_solution_fits_its_own_sigmas(solution):
    after, solver = solution.after, solution.solver
    assert after.status == CONVERGED == solution.before.status
    squares = solver.squares(after.x, after.sigmas)
    equations = solver.equations(after.x, after.sigmas, losses.CAUCHY)
    factors = scale_factors(solver.problem, equations, squares, after.sigmas, losses.CAUCHY)
    np.testing.assert_allclose(factors, 1.0, atol=0.02)
    assert after.cost_final == pytest.approx(losses.total_cost(losses.CAUCHY, squares))


def test_both_costs_have_the_final_weights_and_what_priors_cost(monkeypatch):
    solution = Solution()
    solver = solution.solver
    parameters = type(solver.problem.parameters)
    monkeypatch.setattr(parameters, "prior_cost", lambda self, x: 7.0 + float(x @ x))
    after = weighted_by_detections(solver, solution.before, solution.options)
    for x, cost in ((np.zeros_like(after.x), after.cost_initial), (after.x, after.cost_final)):
        of_rows = losses.total_cost(losses.CAUCHY, solver.squares(x, after.sigmas))
        assert cost == pytest.approx(of_rows + 7.0 + float(x @ x))


def test_a_settled_solution_has_the_common_parts_that_follow_from_it(solution):
    after, solver = solution.after, solution.solver
    covariance = covariance_by_detections(solver, after, solution.options)
    raw = solver.equations(after.x, after.sigmas, losses.CAUCHY)
    found = _common_parts(solver.problem, raw, covariance, after.sigmas)
    np.testing.assert_allclose(found, after.common, rtol=0.05, atol=1e-5)
    assert np.all(np.array(after.common) >= 0.0)


def test_scales_are_the_factors_on_the_sigmas_to_begin_with(solution):
    for scale, sigma, block in zip(
        solution.after.scales, solution.after.sigmas, solution.solver.problem.residual_blocks
    ):
        np.testing.assert_allclose(sigma / block.sigma, scale, rtol=1e-9)


def test_rows_are_corrected_by_the_errors_and_insets_of_the_answer(solution):
    after, problem = solution.after, solution.solver.problem
    assert problem.model_errors[ERROR] == after.model_errors[ERROR] != 0.0
    for i, block in enumerate(problem.residual_blocks):
        steps = after.inset_steps[i]
        if isinstance(block, BorderBlock):
            assert 0.0 <= steps <= 1.0
            across = block.steps_across(problem.poses(after.x))
            np.testing.assert_allclose(block.inset, steps * across, rtol=1e-9, atol=1e-12)
        else:
            assert steps == 0.0


def test_a_further_round_moves_no_shared_pose_by_a_sigma(solution):
    again = weighted_by_detections(solution.solver, solution.after, solution.options)
    covariance = covariance_by_detections(solution.solver, again, solution.options)
    sigmas = np.sqrt(np.diagonal(covariance.shared))
    moved = (again.x - solution.after.x)[: len(sigmas)]
    assert np.max(np.abs(moved) / sigmas) < 0.2


def test_common_parts_make_poses_less_sure(solution):
    after, solver = solution.after, solution.solver
    plain = Covariance(solver.equations(after.x, after.sigmas, losses.CAUCHY))
    careful = covariance_by_detections(solver, after, solution.options)
    shares = shares_of(solver.problem, after.sigmas, after.common)
    assert min(np.min(share) for share in shares) < 1.0
    assert np.all(np.diagonal(careful.shared) > np.diagonal(plain.shared))
    assert careful.error_sigmas[ERROR] > 0.0


def test_what_moves_still_is_not_converged(solution, monkeypatch):
    def never(largest):
        return f"moved by {largest:.1f}"

    monkeypatch.setattr("atom_core.solvers.detection_noise._MOVING", -1.0)
    monkeypatch.setattr("atom_core.solvers.detection_noise._ROUNDS", 1)
    monkeypatch.setattr("atom_core.solvers.detection_noise._moving_still", never)
    end = weighted_by_detections(solution.solver, solution.after, solution.options)
    assert end.status == NOT_CONVERGED and not end.settled
    assert end.message.startswith("moved by")


def test_the_message_says_how_far_the_last_round_moved_in_how_many():
    message = _moving_still(0.234)
    assert "in 30 rounds" in message and "by 0.2 of its standard deviation" in message
