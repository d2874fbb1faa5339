"""The predicted cut of a board with the plane of a 2D LiDAR."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from scan_scenes import BORDER, QUARTER, board_pose, seen

from atom_core.geometry import se3
from atom_core.labeling.lidar2d import cut_at
from atom_core.labeling.scan_prediction import expected_cut, seed_in_plane
from atom_core.synthetic.noise import Noise

HALF_DIAGONAL_M = float(np.linalg.norm(BORDER.half_size))


def middle_and_normal(lidar_T_board):
    return (lidar_T_board @ np.append(BORDER.centre, [0.0, 1.0]))[:3], lidar_T_board[:3, 2]


@pytest.mark.parametrize("seed", range(20))
def test_the_ends_lie_on_the_border_and_in_the_plane_and_the_scan_fills_what_is_between(seed):
    rng = np.random.default_rng(seed)
    pose = board_pose(rng)
    ends = expected_cut(pose, BORDER)
    made = seen(rng, QUARTER, pose, noise=Noise.none())
    if ends is None:
        assert made.label is None
        return
    in_board = se3.apply(se3.inverse(pose), ends)
    assert np.max(np.abs(ends[:, 2])) < 1e-9 and np.max(np.abs(in_board[:, 2])) < 1e-9
    assert np.max(np.abs(BORDER.signed_distance(in_board[:, :2])[0])) < 1e-9
    if made.label is not None:
        points = made.scan.points[made.label.limit_indices]
        away = np.linalg.norm(points[:, None] - ends[None], axis=2).min(axis=1)
        assert len(points) == 2 and np.all(away < 0.1)


@pytest.mark.parametrize("seed", range(20))
def test_the_seed_lies_on_the_boards_plane_and_finds_the_cut(seed):
    rng = np.random.default_rng(100 + seed)
    pose = board_pose(rng, tilt=0.5)
    middle, normal = middle_and_normal(pose)
    point = seed_in_plane(middle, normal, HALF_DIAGONAL_M)
    made = seen(rng, QUARTER, pose)
    if point is None:
        assert made.label is None
        return
    assert point[2] == 0.0 and abs(float(normal @ (point - middle))) < 1e-9
    assert np.allclose(point, seed_in_plane(middle, -normal, HALF_DIAGONAL_M))
    if made.label is not None:
        found = cut_at(made.scan, BORDER, point)
        assert np.isin(made.label.indices, found.label.indices).mean() > 0.95


def test_a_board_above_or_within_the_plane_has_no_seed():
    upright = np.array([1.0, 0.0, 0.0])
    assert seed_in_plane(np.array([2.0, 0.0, 0.6]), upright, 0.5) is None
    assert seed_in_plane(np.array([2.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]), 0.5) is None
    assert np.allclose(seed_in_plane(np.array([2.0, 0.0, 0.4]), upright, 0.5), [2.0, 0.0, 0.0])


def test_a_board_that_the_plane_misses_has_no_cut():
    pose = board_pose(np.random.default_rng(0))
    pose[2, 3] += 5.0
    assert expected_cut(pose, BORDER) is None
