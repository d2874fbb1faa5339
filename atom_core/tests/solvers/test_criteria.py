"""When a minimiser has done enough, and how far one of its steps may go."""

from types import SimpleNamespace

import numpy as np
import pytest

from atom_core.solvers.criteria import (
    EXACT,
    LONGEST_MOVE_M,
    LONGEST_TURN_RAD,
    ROUGH,
    SETTLING,
    SMALLEST_UNIT,
    relative_length,
    unit_cost,
)


def test_the_unit_is_the_mean_square_of_a_row():
    squares = np.array([4.0, 1.0, 9.0, 0.0])
    cost = 0.5 * squares.sum()
    assert unit_cost(SimpleNamespace(row_count=4), cost) == pytest.approx(np.mean(squares))


@pytest.mark.parametrize("mean, expected", [(0.0, 0.1), (0.09, 0.1), (0.11, 0.11), (50.0, 50.0)])
def test_the_unit_is_no_smaller_than_a_tenth(mean, expected):
    assert unit_cost(SimpleNamespace(row_count=10), 5.0 * mean) == pytest.approx(expected)


def test_a_problem_without_rows_has_a_unit():
    assert unit_cost(SimpleNamespace(row_count=0), 0.0) == SMALLEST_UNIT
    assert unit_cost(SimpleNamespace(row_count=1), 3.0) == pytest.approx(6.0)


@pytest.mark.parametrize(
    "turn_rad, move_m, expected",
    [(0.5, 0.0, 1.0), (0.0, 0.5, 1.0), (0.25, 0.1, 0.5), (0.1, 0.25, 0.5), (1.0, 1.5, 3.0)],
)
def test_a_step_is_as_long_as_the_longer_of_turn_and_move(turn_rad, move_m, expected):
    found = relative_length(np.array([turn_rad, 0.0]), np.array([move_m, 0.0]))
    np.testing.assert_allclose(found, [expected, 0.0])
    assert LONGEST_TURN_RAD == LONGEST_MOVE_M == 0.5


def test_tolerances_are_what_they_say_of_standard_deviations():
    """A Newton step of d sigmas lowers the cost by d^2 / 2 squared sigmas."""
    assert EXACT.decrease < 0.5 * (1e-5) ** 2
    assert ROUGH.decrease == pytest.approx(0.1**2)
    assert EXACT.decrease < SETTLING.decrease < ROUGH.decrease
    assert EXACT.relative == SETTLING.relative == 0.0 < ROUGH.relative < 0.01
