"""The minimiser against scipy.optimize.least_squares, and what its flags may claim."""

import itertools
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

sys.path.insert(0, str(Path(__file__).parent))

from problems import problem_of, rows  # noqa: E402

from atom_core.solvers import losses
from atom_core.solvers.base import SolverOptions
from atom_core.solvers.covariance import Covariance
from atom_core.solvers.criteria import ROUGH
from atom_core.solvers.levenberg_marquardt import LevenbergMarquardt
from atom_core.solvers.reweighting import atom_normalisers, solve
from atom_core.synthetic import scenes

SCENES = {
    "random_scene": scenes.random_scene,
    "hand_eye": scenes.hand_eye,
    "board_on_arm": scenes.board_on_arm,
    "two_patterns": scenes.two_patterns,
}


@pytest.mark.parametrize("scene", SCENES)
def test_the_optimum_is_that_of_scipy_optimize(scene):
    problem = problem_of(SCENES[scene])
    sigmas, start = problem.initial_sigmas, np.zeros(problem.parameters.size)
    mine = LevenbergMarquardt(problem).minimise(start, sigmas, losses.NONE, 200)
    assert mine.converged
    theirs = least_squares(
        lambda x: rows(problem, x, sigmas),
        mine.x + 1e-3,
        jac=lambda x: problem.jacobian(x, sigmas).toarray(),
        method="trf",
        x_scale="jac",
        ftol=1e-15,
        xtol=1e-15,
        gtol=1e-15,
    )
    assert mine.cost == pytest.approx(theirs.cost, rel=1e-9)
    np.testing.assert_allclose(mine.x, theirs.x, atol=1e-6)


@pytest.mark.parametrize("scene", SCENES)
def test_block_normal_equations_are_those_of_the_jacobian(scene):
    problem = problem_of(SCENES[scene])
    sigmas, x = problem.initial_sigmas, np.full(problem.parameters.size, 0.01)
    equations = LevenbergMarquardt(problem).equations(x, sigmas, losses.NONE)
    jacobian = problem.jacobian(x, sigmas).toarray()
    residual = rows(problem, x, sigmas)
    step, predicted = equations.solve(1e-3)
    hessian = jacobian.T @ jacobian
    damped = hessian + 1e-3 * np.diag(np.diag(hessian))
    expected = np.linalg.solve(damped, -jacobian.T @ residual)
    np.testing.assert_allclose(step, expected, rtol=1e-6, atol=1e-9)
    after = 0.5 * np.sum((residual + jacobian @ step) ** 2)
    assert predicted == pytest.approx(0.5 * residual @ residual - after, rel=1e-6)


def meeting_blocks(problem):
    """Return pairs of parameter blocks that are shared, or meet in a detection."""
    shared = range(problem.parameters.shared_count)
    pairs = set(itertools.product(shared, shared))
    for chain in problem.chains.block:
        used = chain[chain >= 0]
        pairs |= set(itertools.product(used, used))
    return sorted(pairs)


@pytest.mark.parametrize("scene", SCENES)
def test_covariance_is_the_inverse_of_the_whole_matrix(scene):
    problem = problem_of(SCENES[scene])
    sigmas, x = problem.initial_sigmas, np.zeros(problem.parameters.size)
    equations = LevenbergMarquardt(problem).equations(x, sigmas, losses.NONE)
    covariance = Covariance(equations)
    jacobian = problem.jacobian(x, sigmas).toarray()
    whole = np.linalg.inv(jacobian.T @ jacobian)
    for i in range(len(problem.parameters.blocks)):
        at = slice(6 * i, 6 * i + 6)
        np.testing.assert_allclose(
            covariance.block(i), whole[at, at], rtol=1e-5, atol=1e-7 * np.max(whole[at, at])
        )
    for first, second in meeting_blocks(problem):
        found = covariance.pairs(np.array([first]), np.array([second]))[0]
        rows_, columns = (slice(6 * i, 6 * i + 6) for i in (first, second))
        np.testing.assert_allclose(
            found, whole[rows_, columns], rtol=1e-5, atol=1e-7 * np.max(np.abs(found))
        )
    explained = covariance.explained(problem, equations)
    assert np.sum(explained) == pytest.approx(problem.parameters.size, rel=1e-6)


@pytest.mark.parametrize("loss", losses.LOSSES)
def test_loss_weight_is_the_derivative_of_its_cost(loss):
    squares, h = np.array([0.1, 1.0, 4.0, 100.0]), 1e-6
    for s in squares:
        numeric = (losses.cost(loss, np.array([s + h])) - losses.cost(loss, np.array([s - h]))) / h
        assert losses.weight(loss, np.array([s]))[0] == pytest.approx(numeric, rel=1e-4)


@pytest.mark.parametrize("loss", losses.LOSSES)
def test_the_cost_never_rises(loss):
    problem = problem_of(scenes.random_scene)
    solver = LevenbergMarquardt(problem)
    sigmas, x = problem.initial_sigmas, np.zeros(problem.parameters.size)
    costs = [losses.total_cost(loss, solver.squares(x, sigmas))]
    for _ in range(6):
        x = solver.minimise(x, sigmas, loss, 1).x
        costs.append(losses.total_cost(loss, solver.squares(x, sigmas)))
    assert all(later <= earlier for earlier, later in zip(costs, costs[1:]))


def test_converged_is_not_claimed_when_iterations_run_out():
    problem = problem_of(scenes.random_scene)
    end = LevenbergMarquardt(problem).minimise(
        np.zeros(problem.parameters.size), problem.initial_sigmas, losses.NONE, 1
    )
    assert not end.converged
    summary = solve(LevenbergMarquardt(problem), SolverOptions(max_iterations=2))
    assert summary.status == "not_converged"


def test_a_start_that_is_not_finite_is_not_converged():
    problem = problem_of(scenes.random_scene)
    end = LevenbergMarquardt(problem).minimise(
        np.full(problem.parameters.size, np.nan), problem.initial_sigmas, losses.NONE, 5
    )
    assert not end.converged and "finite" in end.message


def test_converged_means_the_gradient_is_gone():
    problem = problem_of(scenes.random_scene)
    sigmas = problem.initial_sigmas
    end = LevenbergMarquardt(problem).minimise(
        np.zeros(problem.parameters.size), sigmas, losses.NONE, 200
    )
    jacobian = problem.jacobian(end.x, sigmas).toarray()
    newton = np.linalg.lstsq(jacobian, -rows(problem, end.x, sigmas), rcond=None)[0]
    deviations = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    assert np.max(np.abs(newton) / deviations) < 1e-3
    rough = LevenbergMarquardt(problem).minimise(
        np.zeros(problem.parameters.size), sigmas, losses.NONE, 200, ROUGH
    )
    assert rough.converged and rough.iterations < end.iterations


def test_planted_sigmas_are_found():
    problem = problem_of(scenes.random_scene, noise=scenes.Noise(corner_px=0.6, lidar_m=0.02))
    summary = solve(LevenbergMarquardt(problem), SolverOptions(loss="none"))
    found = {
        (b.modality, b.kind): float(np.median(s))
        for b, s in zip(problem.residual_blocks, summary.sigmas)
    }
    assert found[("rgb", "reprojection")] == pytest.approx(0.6, rel=0.1)


def test_atom_normalisers_make_the_mean_of_each_modality_one():
    problem = problem_of(scenes.random_scene)
    x = np.zeros(problem.parameters.size)
    sigmas = atom_normalisers(LevenbergMarquardt(problem), x)
    by_modality = {}
    for block, residual, sigma in zip(problem.residual_blocks, problem.residuals(x), sigmas):
        scaled = np.linalg.norm(residual, axis=1) / sigma
        by_modality.setdefault(block.modality, []).append(scaled)
    for values in by_modality.values():
        assert np.mean(np.concatenate(values)) == pytest.approx(1.0)
