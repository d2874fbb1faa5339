"""What a round of reweighting needs to know: equations, and how rows depend on insets."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from problems import problem_of  # noqa: E402

from atom_core.problem.residuals import BorderBlock  # noqa: E402
from atom_core.solvers import losses  # noqa: E402
from atom_core.solvers.assessment import assess  # noqa: E402
from atom_core.solvers.normal_equations import Layout  # noqa: E402
from atom_core.synthetic import scenes  # noqa: E402


@pytest.fixture(scope="module")
def problem():
    found = problem_of(scenes.random_scene, rgb=1, depth=0, lidar3d=1)
    insets = {i: np.full((b.count, 2), 0.004) for i, b in borders(found)}
    return found.with_insets(insets)


def borders(problem):
    blocks = enumerate(problem.residual_blocks)
    return [(i, block) for i, block in blocks if isinstance(block, BorderBlock)]


def at(problem):
    rng = np.random.default_rng(2)
    return 3e-3 * rng.standard_normal(problem.parameters.size)


def assessed(problem, loss):
    return assess(problem, Layout(problem.parameters), at(problem), problem.initial_sigmas, loss)


def weights_of(problem, place, loss):
    """Return weights (n,) and residuals (n,) of one block."""
    sigma = problem.residual_blocks[place].sigma
    residual = problem.residuals(at(problem))[place][:, 0]
    return losses.weight(loss, (residual / sigma) ** 2) / sigma**2, residual


@pytest.mark.parametrize("loss", losses.LOSSES)
def test_a_column_is_the_derivative_of_distances_by_the_inset_in_steps(problem, loss):
    x, h = at(problem), 1e-4
    (column,) = assessed(problem, loss).columns
    ((place, block),) = borders(problem)
    assert column.block == place
    ends = []
    for sign in (1.0, -1.0):
        moved = problem.with_insets({place: block.inset + sign * h * column.across})
        ends.append(moved.residuals(x)[place][:, 0])
    by_steps = (ends[0] - ends[1]) / (2.0 * h)
    np.testing.assert_allclose(column.by_steps, by_steps, atol=1e-7)
    weight, residual = weights_of(problem, place, loss)
    assert column.curvature == pytest.approx(np.sum(weight * by_steps**2), rel=1e-5)
    assert column.slope == pytest.approx(np.sum(weight * by_steps * residual), rel=1e-4)


@pytest.mark.parametrize("loss", [losses.NONE, losses.CAUCHY])
def test_what_inset_and_twists_share_is_the_sum_over_the_rows_of_a_detection(problem, loss):
    (column,) = assessed(problem, loss).columns
    ((place, block),) = borders(problem)
    weight, _ = weights_of(problem, place, loss)
    rows = problem.linearise(at(problem)).by_state[place][:, 0]
    np.testing.assert_array_equal(column.detection, np.unique(block.detection))
    assert len(column.detection) > 1
    for detection, by_twist in zip(column.detection, column.by_twist):
        mine = block.detection == detection
        expected = (weight * column.by_steps)[mine] @ rows[mine]
        np.testing.assert_allclose(by_twist, expected, rtol=1e-9)


def test_steps_across_are_those_in_the_boards_planes(problem):
    (column,) = assessed(problem, losses.NONE).columns
    ((_, block),) = borders(problem)
    poses = problem.poses(at(problem))[block.detection]
    in_board = np.einsum("nki,nij->nkj", block.steps, poses[:, :3, :2])
    np.testing.assert_allclose(column.across, np.abs(in_board).max(axis=1), atol=1e-12)


def test_an_inset_that_the_data_cannot_tell_has_no_column(problem):
    ((place, block),) = borders(problem)
    still = BorderBlock(**{**vars_of(block), "steps": np.zeros_like(block.steps)})
    blocks = [still if i == place else b for i, b in enumerate(problem.residual_blocks)]
    without = type(problem)(problem.parameters, problem.detections, problem.chains, tuple(blocks))
    assert assessed(without, losses.NONE).columns == ()


def vars_of(block):
    return {name: getattr(block, name) for name in block.__dataclass_fields__}


@pytest.mark.parametrize("loss", losses.LOSSES)
def test_the_equations_are_those_of_the_weighted_rows(problem, loss):
    x, equations = at(problem), assessed(problem, loss).equations
    sigmas, gradient = problem.initial_sigmas, 0.0
    linearised = problem.linearise(x)
    for place, residual in enumerate(linearised.residuals):
        square = np.sum((residual / sigmas[place][:, None]) ** 2, axis=1)
        root = np.sqrt(losses.weight(loss, square)) / sigmas[place]
        rows = problem._rows(
            problem.residual_blocks[place],
            linearised.by_state[place] * root[:, None, None],
            linearised.state_jacobians,
        )
        gradient = gradient + rows.T @ (residual * root[:, None]).ravel()
    found = equations.layout.join(equations.gradient_shared, equations.gradient_local)
    np.testing.assert_allclose(found, gradient, atol=1e-8 * np.max(np.abs(gradient)))
