"""Every start leads to one answer: no point and no board may stand at one of several places."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.preparation import prepare
from atom_core.calibration.refine.deeper_minima import with_boards_in_deepest_minima
from atom_core.geometry import se3
from atom_core.solvers.base import SolverOptions
from atom_core.solvers.choice import solver_factory
from atom_core.solvers.reweighting import solve_again
from atom_core.synthetic import scenes

SAME_M = 1e-6


def places(result, scene):
    return np.array([result.dataset.first_value(e)[:3, 3] for e in scene.truth.edges])


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "kind, seed",
    [
        ("lidar_only", 0),  # one point within 4 mm of two sides
        ("lidar_only", 3),  # the same
        ("lidar_only", 12),  # a board turned in its plane
        ("lidar_only", 13),  # a board shifted along a side that few points hold
        ("two_patterns", 3),  # boards turned by half, against a camera's corners
    ],
)
def test_the_answer_is_that_of_the_exact_start(kind, seed):
    scene = getattr(scenes, kind)(seed, collections=12)
    exact = calibrate(scene.dataset)
    options = CalibrationOptions(noisy_initial_guess=(0.5, 0.5), seed=seed)
    disturbed = calibrate(scene.dataset, options)
    assert exact.status == disturbed.status == "converged"
    apart = np.linalg.norm(places(exact, scene) - places(disturbed, scene), axis=1)
    assert np.max(apart) < SAME_M


@pytest.fixture(scope="module")
def solved():
    scene = scenes.lidar_only(1, collections=8)
    return calibrate(scene.dataset), prepare(scene.dataset, CalibrationOptions()).measurements


def test_boards_that_stand_well_stay(solved):
    result, measurements = solved
    make_solver = solver_factory("ceres")
    solver = make_solver(result.problem)
    after = with_boards_in_deepest_minima(
        solver, result.summary, measurements, SolverOptions(), make_solver
    )
    assert after == (solver, result.summary)


def test_a_board_that_was_turned_in_its_plane_comes_back(solved):
    result, measurements = solved
    problem, options, make_solver = result.problem, SolverOptions(), solver_factory("ceres")
    blocks, poses = problem.parameters.blocks, problem.parameters.poses(result.summary.x)
    board = next(i for i, b in enumerate(blocks) if b.kind == "pattern")
    start = dict(enumerate(poses))
    centre = problem.residual_blocks[1].centre[0]
    turn = se3.from_rpy(np.zeros(3), np.array([0.0, 0.0, np.radians(60.0)]))
    about = se3.transform(np.eye(3), np.append(centre, 0.0))
    start[board] = poses[board] @ about @ turn @ se3.inverse(about)
    wrong = make_solver(replace(problem, parameters=problem.parameters.with_initial(start)))
    stuck = solve_again(wrong, options, problem, result.summary)
    assert stuck.cost_final > result.summary.cost_final + 10.0
    _, freed = with_boards_in_deepest_minima(wrong, stuck, measurements, options, make_solver)
    assert freed.cost_final == pytest.approx(result.summary.cost_final, rel=1e-5)
