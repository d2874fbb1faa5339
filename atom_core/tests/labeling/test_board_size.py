"""Boards of another size are named over several labels, and told from wide beams by distance."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from lidar_scenes import BORDER
from model_scenes import model_cell

from atom_core import native
from atom_core.geometry.rectangle import Rectangle
from atom_core.labeling.board_size import (
    SeenBoard,
    few_boards_remark,
    find_size,
    is_surely_smaller,
    seen_boards,
    size_remark,
)
from atom_core.labeling.lidar3d import board_at
from atom_core.model.pattern import pattern_from_config
from atom_core.synthetic import charuco

NOISE_M = 0.004


def seen(share=0.0, width_rad=0.0, near_m=1.5, far_m=3.5, count=10, seed=0, offset_m=0.0):
    """Return labels of a board that is larger by a share, seen by beams of a width.

    Ranges are too long by an offset, which enlarges all that is seen by its share of them.
    """
    rng, boards = np.random.default_rng(seed), []
    for away in np.linspace(near_m, far_m, count):
        sides = 2.0 * BORDER.half_size * (1.0 + share) * (1.0 + offset_m / away) + width_rad * away
        noise = NOISE_M * rng.standard_normal(2)
        boards.append(SeenBoard(away + offset_m, tuple(sides + noise)))
    return boards


def remark(boards):
    return size_remark("lidar_1", "pattern_1", BORDER, find_size(boards, BORDER))


@pytest.mark.parametrize("seed", range(10))
def test_a_board_as_configured_is_nothing_to_tell(seed):
    assert remark(seen(seed=seed)) is None
    assert remark(seen(0.005, seed=seed)) is None


@pytest.mark.parametrize("seed", range(10))
def test_distance_tells_a_larger_board_from_wide_beams(seed):
    larger, wide = find_size(seen(0.05, seed=seed), BORDER), find_size(seen(0.0, 0.012), BORDER)
    assert (larger.by_size, larger.by_beams) == (True, False)
    assert (wide.by_size, wide.by_beams) == (False, True)
    both = find_size(seen(0.06, 0.02, 1.0, 5.0, 20, seed=seed), BORDER)
    assert (both.by_size, both.by_beams) == (True, True)


@pytest.mark.parametrize("offset_m", [0.1, -0.1])
@pytest.mark.parametrize("seed", range(10))
def test_distance_tells_ranges_that_are_off_from_both(seed, offset_m):
    finding = find_size(seen(offset_m=offset_m, seed=seed), BORDER)
    assert finding.range_offset_m == pytest.approx(offset_m, abs=0.02)
    assert (finding.by_size, finding.by_beams) == (False, False)
    assert not is_surely_smaller(BORDER, finding)
    for other in (seen(0.05, seed=seed), seen(0.0, 0.012, seed=seed), seen(-0.05, seed=seed)):
        assert find_size(other, BORDER).range_offset_m is None


@pytest.mark.parametrize("seed", range(10))
def test_ranges_that_are_off_are_never_surely_another_board(seed):
    for offset_m in (-0.1, -0.06, -0.03, 0.03, 0.06, 0.1):
        assert not find_size(seen(offset_m=offset_m, seed=seed), BORDER).by_size


def test_the_remark_says_how_far_off_ranges_are():
    for offset_m, said in ((0.1, "larger it looks, as"), (-0.1, "smaller it looks, as")):
        told = remark(seen(offset_m=offset_m))
        assert said in told and "calibrate with --range_offset lidar_1" in told
        assert "measure the board" not in told
    assert "mm too long" in remark(seen(offset_m=0.1))
    assert "mm too short" in remark(seen(offset_m=-0.1))
    alike = seen(-0.05, near_m=2.0, far_m=2.5)
    assert "do not tell a smaller board from ranges that are too short" in remark(alike)


def test_the_remark_names_both_sizes_and_what_distance_says():
    larger = remark(seen(0.05))
    assert "pattern 'pattern_1' looks 0.8" in larger and "to sensor 'lidar_1'" in larger
    assert "the configuration says 0.800 m wide and 0.600 m high" in larger
    assert "at any distance (1.5 to 3.5 m)" in larger
    assert "the larger the farther" in remark(seen(0.0, 0.012))
    assert "do not tell a larger board from wide beams" in remark(seen(0.05, 0.0, 2.0, 2.5))
    smaller = remark(seen(-0.05))
    assert "looks 0.7" in smaller and "beams" not in smaller


def test_few_labels_and_hidden_sides_tell_nothing():
    assert find_size(seen(0.05)[:2], BORDER) is None
    hidden = [SeenBoard(board.away_m, (np.nan, np.nan)) for board in seen(0.05)]
    assert find_size(hidden, BORDER) is None
    wide_alone = [SeenBoard(board.away_m, (board.sides_m[0], np.nan)) for board in seen(0.05)]
    assert "m wide to" in remark(wide_alone) and "high" not in remark(wide_alone)


@pytest.mark.skipif(not native.available(), reason="the compiled core is not built")
def test_a_few_labels_name_a_smaller_board_and_no_other():
    def few(boards):
        return few_boards_remark("lidar_1", "pattern_1", BORDER, boards)

    one = [SeenBoard(2.0, (0.76, np.nan))]
    assert few(one) == (
        "pattern 'pattern_1' looks 0.760 m wide to sensor 'lidar_1', in the only label there is; "
        "the configuration says 0.800 m wide: measure the board, and correct its size and border. "
        "A board of another size is refused mostly, which may be why there are so few labels"
    )
    two = [*one, SeenBoard(3.0, (0.764, 0.57))]
    assert "0.762 m wide and 0.570 m high" in few(two) and "in all 2 labels there are" in few(two)
    for right in ((0.775, 0.58), (0.76, 0.59), (0.84, 0.63), (np.nan, np.nan)):
        assert few([SeenBoard(2.0, right)]) is None
    assert few([]) is None


@pytest.mark.skipif(not native.available(), reason="the compiled core is not built")
def test_eight_boards_of_the_rough_profile_name_five_per_cent():
    border = pattern_from_config("pattern_1", charuco()).border
    boards = [(board.data, middle_of(board)) for board in model_cell("vlp_16", 3, 8).boards]
    for share in (0.0, 0.05):
        half = border.half_size / (1.0 + share)
        configured = Rectangle(*(border.centre - half), *(border.centre + half))
        finding = find_size(seen_boards(boards, configured, 0.0), configured)
        told = size_remark("lidar_1", "pattern_1", configured, finding)
        assert (told is None) is (share == 0.0), told


def middle_of(board):
    points = np.asarray(board.cloud.points)
    return points[board.cloud.on_board].mean(axis=0)


@pytest.mark.skipif(not native.available(), reason="the compiled core is not built")
def test_a_board_five_per_cent_smaller_than_configured_is_refused_with_both_sizes():
    border = pattern_from_config("pattern_1", charuco()).border
    half = border.half_size / 0.95
    larger = Rectangle(*(border.centre - half), *(border.centre + half))
    for board in model_cell("vlp_16", 0, 6).boards:
        assert board_at(board.data, border, middle_of(board)).labeled.detected
        labeled = board_at(board.data, larger, middle_of(board)).labeled
        assert not labeled.detected and "the configuration says 0.84 x 0.63" in labeled.reason
