"""How rare a change is if nothing moved: the rate of false alarms, and what is found."""

import numpy as np
import pytest

from atom_core.evaluation.changes import chi_square, limit_of
from atom_core.evaluation.edge_errors import PoseError
from atom_core.evaluation.rarity import found_from, rarity
from atom_core.problem.blocks import ROTATION, TRANSLATION

LIMIT = limit_of(1)
DRAWS = 2500


@pytest.fixture(scope="module")
def covariance():
    """Return one whose turns and shifts are correlated, in units as different as [rad] and [m]."""
    factor = np.random.default_rng(5).normal(size=(6, 6))
    scale = np.repeat([3e-4, 2e-3], 3)
    return (factor @ factor.T + 0.3 * np.eye(6)) * np.outer(scale, scale)


def changes_of(covariance, move=None, freedom=np.inf, draws=DRAWS):
    """Yield what is measured of a move, and its covariance as few numbers would misjudge it."""
    rng = np.random.default_rng(0)
    factor = np.linalg.cholesky(covariance)
    for _ in range(draws):
        numbers = factor @ rng.normal(size=6) + (np.zeros(6) if move is None else move)
        judged = 1.0 if np.isinf(freedom) else rng.chisquare(freedom) / freedom
        yield pose_error(numbers), covariance * judged


def pose_error(numbers):
    return PoseError(shift_m=numbers[TRANSLATION], turn_rad=numbers[ROTATION])


def share_beyond(drawn, freedom=np.inf):
    return np.mean([rarity(change, spread, freedom) > LIMIT for change, spread in drawn])


@pytest.mark.parametrize("alike, freedom", [(0.0, np.inf), (0.99, np.inf), (0.99, 30), (0.99, 9)])
def test_of_what_did_not_move_one_in_a_hundred_is_beyond_the_limit(alike, freedom):
    covariance = np.eye(6)
    for turn, shift in ((0, 4), (1, 3)):  # across the axis, a turn looks like a shift
        covariance[turn, shift] = covariance[shift, turn] = alike
    false = share_beyond(changes_of(covariance, freedom=freedom), freedom)
    assert 0.0055 <= false <= 0.0155  # 0.01 by two and three sigma of the draws


def test_a_scatter_that_few_numbers_told_is_no_known_one(covariance):
    assert share_beyond(changes_of(covariance, freedom=9)) > 0.03


@pytest.mark.parametrize("freedom", [np.inf, 30])
@pytest.mark.parametrize("part", [ROTATION, TRANSLATION])
def test_what_is_found_from_is_found_in_95_of_100(covariance, part, freedom):
    drawn = list(changes_of(covariance, worst_move(covariance, part, freedom), freedom))
    found = share_beyond(drawn, freedom)
    assert 0.94 <= found <= 0.965
    if np.isinf(freedom):  # among six numbers it is found less often
        assert np.mean([chi_square(*change) > LIMIT for change in drawn]) < found - 0.015


def worst_move(covariance, part, freedom):
    """Return the six numbers of a move of one part in the direction that is told worst."""
    move = np.zeros(6)
    worst = np.linalg.eigh(np.linalg.inv(covariance)[part, part])[1][:, 0]
    move[part] = found_from(covariance, LIMIT, freedom, part) * worst
    return move


def test_a_move_of_both_is_found(covariance):
    move = np.linalg.cholesky(covariance) @ (8.0 * np.ones(6) / np.sqrt(6.0))
    assert share_beyond(changes_of(covariance, move, draws=500)) > 0.98


@pytest.mark.parametrize("freedom", [np.inf, 30])
@pytest.mark.parametrize("size", [0.1, 10.0, 1e3, 1e9])
def test_a_huge_change_has_a_finite_figure(covariance, size, freedom):
    huge = pose_error(size * np.ones(6))
    assert LIMIT < rarity(huge, covariance, freedom) < np.inf
