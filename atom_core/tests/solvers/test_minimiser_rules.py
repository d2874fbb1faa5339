"""The rules of the reference minimiser, on costs whose steps are known beforehand."""

from types import SimpleNamespace

import numpy as np
import pytest

from atom_core.problem.parameters import Parameters
from atom_core.solvers import losses
from atom_core.solvers.criteria import ENOUGH, EXACT, ROUNDING, Tolerance
from atom_core.solvers.levenberg_marquardt import LevenbergMarquardt

START = np.array([0.0, 0.0, 0.0, 0.3, 0.0, 0.0])


class Valley(LevenbergMarquardt):
    """A minimiser of a cost that is told from outside, and of what its equations say."""

    def __init__(self, cost, step=lambda x, damping: -x, promised=None, blocks=1, boards=()):
        is_board = np.isin(np.arange(blocks), boards)
        parameters = SimpleNamespace(
            by_block=Parameters.by_block,
            is_board_of_collection=is_board,
            is_transform=np.ones(blocks, dtype=bool),
        )
        self.problem = SimpleNamespace(parameters=parameters, row_count=2)
        self.cost_at, self.step_at, self.promised = cost, step, promised or cost
        self.dampings = []

    def equations(self, x, sigmas, loss):
        def solve(damping):
            self.dampings.append(damping)
            step = self.step_at(x, damping)
            return step, self.cost_at(x) - self.cost_at(x + step) or 1.0

        return SimpleNamespace(solve=solve, newton_decrease=lambda: self.promised(x))

    def _cost(self, x, sigmas, loss):
        return self.cost_at(x)

    def end(self, rounds=100, tolerance=EXACT, loss=losses.NONE, progress=None):
        return self.minimise(START, [], loss, rounds, tolerance, progress)


def square(x):
    return 0.5 * float(x @ x)


def halving(x, damping):
    return -0.5 * x


def test_at_the_minimum_nothing_is_done():
    end = Valley(square, promised=lambda x: 0.0).end()
    assert end.converged and end.iterations == 0 and end.message == ENOUGH
    np.testing.assert_array_equal(end.x, START)


@pytest.mark.parametrize("times, iterations", [(0.99, 0), (1.01, 1)])
def test_a_step_that_promises_less_than_the_tolerance_is_not_tried(times, iterations):
    """The unit is a tenth where there is hardly any noise."""
    tolerance = Tolerance(0.01, 0.0)
    end = Valley(square, promised=lambda x: times * 0.01 * 0.1 * (x[3] == 0.3)).end(
        tolerance=tolerance
    )
    assert end.converged and end.iterations == iterations


def test_one_exact_step_is_enough_for_a_square():
    end = Valley(square).end()
    assert end.converged and end.iterations == 1 and end.cost == 0.0
    np.testing.assert_array_equal(end.x, 0.0)


def test_damping_falls_to_a_third_with_every_step_that_keeps_its_promise():
    valley = Valley(square, halving, promised=lambda x: 1.0)
    end = valley.end(rounds=30)
    assert not end.converged and end.iterations == 30 and "after 30 iterations" in end.message
    expected = np.maximum(1e-3 / 3.0 ** np.arange(30), 1e-12)
    np.testing.assert_allclose(valley.dampings, expected)
    assert valley.dampings[-1] == 1e-12
    np.testing.assert_allclose(end.x, START * 0.5**30)
    assert end.cost == square(end.x)


@pytest.mark.parametrize("gain", [0.1, 0.5, 0.7, 0.99])
def test_damping_follows_the_gain_by_nielsens_rule(gain):
    valley = Valley(square, halving, promised=lambda x: 1.0)
    solve_of = valley.equations

    def equations(x, sigmas, loss):
        found = solve_of(x, sigmas, loss)

        def solve(damping):
            step, decrease = found.solve(damping)
            return step, decrease / gain

        return SimpleNamespace(solve=solve, newton_decrease=found.newton_decrease)

    valley.equations = equations
    valley.end(rounds=2)
    expected = max(1.0 / 3.0, 1.0 - (2.0 * gain - 1.0) ** 3)
    assert valley.dampings[1] / valley.dampings[0] == pytest.approx(expected)


@pytest.mark.parametrize("promised, converged", [(0.99, True), (1.01, False)])
def test_where_no_step_lowers_the_cost_damping_grows_faster_and_faster_to_its_end(
    promised, converged
):
    """It counts as done where the cost cannot tell steps apart any more."""
    never = Tolerance(0.0, 0.0)
    valley = Valley(lambda x: 1.0, promised=lambda x: promised * ROUNDING)
    end = valley.end(tolerance=never)
    damping, growth, expected = 1e-3, 2.0, []
    while damping <= 1e12:
        expected.append(damping)
        damping, growth = damping * growth, 2.0 * growth
    np.testing.assert_allclose(valley.dampings, expected)
    assert end.iterations == len(expected) - 1
    assert end.converged == converged and "no step lowers the cost" in end.message
    np.testing.assert_array_equal(end.x, START)


def test_after_a_good_step_damping_grows_from_two_again():
    """Two steps are refused, the third is taken, and then all are refused."""
    valley = Valley(lambda x: 1.0 if x[3] in (0.3, 0.15) else 2.0, promised=lambda x: 1.0)
    valley.cost_at = lambda x: {0.3: 1.0, 0.15: 0.5}.get(float(x[3]), 2.0)
    valley.step_at = lambda x, damping: -0.5 * x if damping > 7e-3 and x[3] == 0.3 else -0.1 * x
    valley.end(rounds=6)
    taken = 1e-3 * 2.0 * 4.0
    expected = [1e-3, 2e-3, taken, taken / 3.0, taken / 3.0 * 2.0, taken / 3.0 * 8.0]
    np.testing.assert_allclose(valley.dampings, expected)


def test_equations_that_cannot_be_solved_are_damped_more():
    def step(x, damping):
        if damping < 1e-2:
            raise np.linalg.LinAlgError
        return -x

    valley = Valley(square, step)
    end = valley.end()
    assert end.converged and end.cost == 0.0
    np.testing.assert_allclose(valley.dampings, [1e-3, 2e-3, 8e-3, 64e-3])


@pytest.mark.parametrize("relative, iterations", [(0.74, 100), (0.76, 2)])
def test_two_slow_steps_in_a_row_are_enough(relative, iterations):
    """Each of these lowers the cost by three quarters."""
    valley = Valley(square, halving, promised=lambda x: 1.0)
    end = valley.end(tolerance=Tolerance(1e-30, relative))
    assert end.iterations == iterations and end.converged == (iterations == 2)


def test_a_fast_step_between_slow_ones_goes_on():
    shares = iter([0.1, 0.9, 0.1, 0.9, 0.1, 0.1, 0.9])
    valley = Valley(square, lambda x, damping: -next(shares) * x, promised=lambda x: 1.0)
    end = valley.end(tolerance=Tolerance(1e-30, 0.5))
    assert end.converged and end.iterations == 6


def test_progress_is_told_from_the_start_and_may_stop():
    told = []

    def progress(iteration, cost, x):
        told.append((iteration, cost, float(x[3])))
        return iteration < 2

    end = Valley(square, halving, promised=lambda x: 1.0).end(progress=progress)
    assert end.interrupted and not end.converged and end.iterations == 2
    at = 0.3 * 0.5 ** np.arange(3)
    np.testing.assert_allclose(told, np.column_stack([np.arange(3), 0.5 * at**2, at]))
    assert end.x[3] == pytest.approx(at[-1])


def test_progress_that_says_nothing_does_not_stop():
    end = Valley(square).end(progress=lambda iteration, cost, x: None)
    assert end.converged and not end.interrupted


def test_a_cost_that_is_not_finite_is_told_at_once():
    end = Valley(lambda x: np.inf).end()
    assert not end.converged and end.iterations == 0 and "not finite" in end.message


def test_steps_of_a_loss_are_as_much_longer_as_weights_alone_fall_short():
    valley = Valley(square, halving, promised=lambda x: 1.0)
    end = valley.end(rounds=1, loss=losses.CAUCHY)
    assert end.x[3] == pytest.approx(0.3 - 0.5 * 0.3 * losses.step_length(losses.CAUCHY))


# --- how far a step may go -----------------------------------------------------------------------


@pytest.mark.parametrize("place", [0, 3])
@pytest.mark.parametrize("length, is_cut", [(0.49, False), (0.5, True), (2.0, True)])
def test_the_step_of_a_board_is_cut_to_half_a_metre_or_radian(place, length, is_cut):
    valley = Valley(square, blocks=3, boards=(1,))
    step = np.zeros(18)
    step[6 + place], step[12 + place], step[1] = -length, 0.2, 0.1
    cut = valley._cut(step)
    expected = step.copy()
    expected[6 + place] = -min(length, 0.5)
    np.testing.assert_allclose(cut, expected, rtol=1e-8)
    assert (np.abs(cut[6 + place]) < length) == is_cut
    assert valley._is_short(cut)


def test_the_step_of_a_sensor_is_not_cut_but_refused():
    valley = Valley(square, blocks=2, boards=(1,))
    step = np.zeros(12)
    step[3] = 0.51
    np.testing.assert_array_equal(valley._cut(step), step)
    assert not valley._is_short(step)
    step[3] = 0.5
    assert not valley._is_short(step)
    step[3] = 0.49
    assert valley._is_short(step)


def test_a_cut_keeps_the_direction_of_a_step():
    valley = Valley(square, boards=(0,))
    step = np.array([0.3, -0.6, 0.1, 2.0, -1.0, 0.5])
    cut = valley._cut(step)
    np.testing.assert_allclose(cut / np.linalg.norm(cut), step / np.linalg.norm(step))
    assert np.linalg.norm(cut[3:]) == pytest.approx(0.5)
