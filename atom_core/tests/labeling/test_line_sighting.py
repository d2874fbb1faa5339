"""Whether a board stands still, by its cuts in the scans of a 2D LiDAR."""

import numpy as np
import pytest

from atom_core.labeling.line_sighting import line_sighting

STEP_M, SIGMA_M = 0.01, 0.010
TURN = np.deg2rad(30.0)
ALONG, ACROSS = np.array([np.cos(TURN), np.sin(TURN), 0.0]), np.array([-np.sin(TURN), 0.866025, 0])
PAIRS = 200


def cut(rng, shift_m=0.0, slide_m=0.0, turn_rad=0.0, beams=(0, 60)):
    """Return points (n, 3) of a cut 0.6 m long; `beams` are those that are on it."""
    along = STEP_M * (np.arange(*beams) - 30.0) + slide_m
    off = shift_m + np.tan(turn_rad) * along + SIGMA_M * rng.standard_normal(len(along))
    return [2.0, 1.0, 0.0] + along[:, None] * ALONG + off[:, None] * ACROSS


def motions(seed=0, **moved):
    rng = np.random.default_rng(seed)
    pairs = [(cut(rng), cut(rng, **moved)) for _ in range(PAIRS)]
    return np.array([line_sighting(a).motion(line_sighting(b)) for a, b in pairs])


def test_noise_is_no_motion():
    assert np.mean(motions() < 0.5) > 0.95 and motions().max() < 1.0


def test_few_points_are_no_motion_either():
    rng = np.random.default_rng(3)
    short = [line_sighting(cut(rng, beams=(26, 34))) for _ in range(2 * PAIRS)]
    assert np.mean([a.motion(b) < 1.0 for a, b in zip(short[::2], short[1::2])]) > 0.99


@pytest.mark.parametrize("beams", [(1, 60), (0, 59), (1, 59), (1, 58)])
def test_returns_that_come_and_go_at_the_ends_are_no_motion(beams):
    assert motions(beams=beams).max() < 1.0


@pytest.mark.parametrize(
    "moved",
    [{"shift_m": 0.03}, {"shift_m": -0.03}, {"turn_rad": 0.15}, {"slide_m": 0.06}],
    ids=str,
)
def test_a_board_that_moved_is_told(moved):
    assert motions(**moved).min() > 1.0


def test_a_cut_that_shrinks_at_both_ends_moved():
    """A leaned board that is lifted: the line stays, the ends come nearer to each other."""
    assert motions(beams=(6, 54)).min() > 1.0


def test_it_does_not_matter_which_end_comes_first():
    rng = np.random.default_rng(1)
    first, second = cut(rng), cut(rng, slide_m=0.02)
    there = line_sighting(first).motion(line_sighting(second))
    back = line_sighting(first).motion(line_sighting(second[::-1]))
    flipped = line_sighting(second)
    flipped = type(flipped)(
        **{**vars(flipped), "direction": -flipped.direction, "ends": -flipped.ends[::-1]}
    )
    assert there == pytest.approx(back) == pytest.approx(line_sighting(first).motion(flipped))


def test_one_point_is_no_line():
    assert line_sighting(np.ones((1, 3))) is None and line_sighting(np.ones((5, 3))) is None
