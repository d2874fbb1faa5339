"""A step is no longer than its linearisation holds; one board does not hold up all others."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.preparation import free_edges
from atom_core.calibration.start.boards import initial_boards
from atom_core.geometry import se3
from atom_core.model.truth import with_truth
from atom_core.problem.builder import build_problem
from atom_core.problem.measurements import read_measurements
from atom_core.solvers import losses
from atom_core.solvers.choice import SOLVERS
from atom_core.synthetic import scenes

LIMIT_RAD = 0.5


@pytest.fixture(scope="module")
def turned():
    """Return a problem at the truth, but one board turned by 1.2 rad, and that board's index."""
    scene = scenes.two_cameras(0, collections=6)
    dataset = with_truth(scene.dataset, scene.truth)
    free = free_edges(dataset, CalibrationOptions())
    measurements, _ = read_measurements(dataset)
    boards = initial_boards(dataset, measurements, free)
    problem = build_problem(dataset, measurements, boards, free)
    blocks = problem.parameters.blocks
    board = next(i for i, b in enumerate(blocks) if b.kind == "pattern")
    turn = se3.from_rpy(np.zeros(3), np.array([0.0, 0.0, 1.2]))
    start = {board: blocks[board].initial @ turn}
    return replace(problem, parameters=problem.parameters.with_initial(start)), board


@pytest.mark.parametrize("name", list(SOLVERS))
def test_the_first_step_is_taken_and_cut_for_that_board(turned, name):
    problem, board = turned
    solver, zero = SOLVERS[name](problem), np.zeros(problem.parameters.size)
    sigmas = problem.initial_sigmas
    before = solver.minimise(zero, sigmas, losses.NONE, 0).cost
    end = solver.minimise(zero, sigmas, losses.NONE, 1)
    turns = np.linalg.norm(end.x.reshape(-1, 6)[:, :3], axis=1)
    assert turns[board] == pytest.approx(LIMIT_RAD, rel=1e-6)
    assert np.argmax(turns) == board
    assert end.cost < 0.7 * before


@pytest.mark.parametrize("name", list(SOLVERS))
def test_it_ends_where_the_board_belongs_and_the_cost_that_is_told_only_falls(turned, name):
    problem, _ = turned
    solver, zero = SOLVERS[name](problem), np.zeros(problem.parameters.size)
    sigmas = problem.initial_sigmas
    told = []

    def progress(number, cost, x):
        told.append(cost)

    end = solver.minimise(zero, sigmas, losses.NONE, 100, progress=progress)
    assert end.converged and end.iterations < 12
    assert 2.0 * end.cost < 1.5 * problem.row_count
    assert np.all(np.diff(told) <= 0.0)
