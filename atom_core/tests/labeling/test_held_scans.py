"""Boards in a 2D LiDAR's scan that a hand holds at an end, or that hang before a wall."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from scan_scenes import BORDER, QUARTER, segments_met

from atom_core.labeling.lidar2d import cut_at
from atom_core.model.laser_scan import LaserScan

AWAY_M, HALF_M, ROOM_M, NOISE_M = 1.5, 0.4, 6.0, 0.004


def scan_of(segments, seed=1):
    """Return a scan of things in a room, and which returns are the first one's."""
    angles = QUARTER.angles
    each = np.stack([segments_met(angles, np.array([segment])) for segment in segments])
    ranges = np.minimum(each.min(axis=0), ROOM_M)
    on_board = (each[0] == ranges) & (each[0] < ROOM_M)
    ranges += NOISE_M * np.random.default_rng(seed).standard_normal(len(ranges))
    limits = (QUARTER.angle_min, QUARTER.angle_increment, *QUARTER.range_m)
    return LaserScan(ranges, *limits), on_board


def board():
    return [[AWAY_M, -HALF_M], [AWAY_M, HALF_M]]


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_hand_at_an_end_is_not_labeled_and_that_end_is_no_limit_point(side):
    hand = [[AWAY_M - 0.02, side * (HALF_M - 0.02)], [AWAY_M - 0.02, side * (HALF_M + 0.07)]]
    scan, on_board = scan_of([board(), hand])
    found = cut_at(scan, BORDER, np.array([AWAY_M, 0.0, 0.0]))
    assert found.detected, found.reason
    assert np.all(on_board[found.label.indices])
    (limit,) = found.label.limit_indices
    assert scan.points[limit][1] == pytest.approx(-side * HALF_M, abs=0.01)


def test_a_board_that_nobody_holds_keeps_both_ends():
    for seed in range(20):
        scan, on_board = scan_of([board()], seed)
        found = cut_at(scan, BORDER, np.array([AWAY_M, 0.0, 0.0]))
        assert len(found.label.limit_indices) == 2
        assert np.count_nonzero(on_board) - len(found.label.indices) <= 2


def test_an_arm_or_a_wall_right_behind_is_named_where_a_box_is():
    wall = [[AWAY_M + 0.1, -4.0], [AWAY_M + 0.1, 4.0]]
    found = cut_at(scan_of([board(), wall])[0], BORDER, np.array([AWAY_M, 0.0, 0.0]))
    assert not found.detected
    assert "a wall right behind it" in found.reason and "hand" in found.reason


def test_a_wall_hardly_behind_a_board_is_named():
    wall = [[AWAY_M + 0.01, -4.0], [AWAY_M + 0.01, 4.0]]
    found = cut_at(scan_of([board(), wall])[0], BORDER, np.array([AWAY_M, 0.0, 0.0]))
    assert not found.detected
    assert "before a wall is not told from it" in found.reason
