"""Which points of a LiDAR's label are on the board's border."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from lidar_scenes import BORDER, Scene, board_facing, many_scenes, pose, scan

from atom_core import native
from atom_core.geometry import se3
from atom_core.labeling.lidar3d import Cloud, board_at

pytestmark = pytest.mark.skipif(not native.available(), reason="the compiled core is not built")

EYE = (0.0, 0.0, 1.5)


def label(cloud):
    return board_at(Cloud(cloud.points, cloud.ring), BORDER, cloud.seed).labeled.label


def test_limit_points_are_on_the_border_but_for_a_beam_step():
    for k, scene in enumerate(many_scenes(20, 4)):
        cloud = scan(scene, k)
        indices = label(cloud).limit_indices
        board_T_lidar = se3.inverse(scene.world_T_board) @ scene.world_T_lidar
        in_board = se3.apply(board_T_lidar, cloud.points[indices])
        distance, _ = BORDER.signed_distance(in_board[:, :2])
        assert np.max(distance) < 0.015
        assert np.median(distance) > -0.02
        assert np.min(distance) > -0.08


def test_limit_points_belong_to_the_label_and_stand_on_both_sides():
    cloud = scan(Scene(pose(EYE), board_facing(EYE, (2.0, 0.3, 1.45), roll_deg=30.0)))
    found = label(cloud)
    assert set(found.limit_indices) <= set(found.indices)
    azimuth = np.arctan2(cloud.points[:, 1], cloud.points[:, 0])
    middle = np.median(azimuth[found.indices])
    for layer in np.unique(cloud.ring[found.limit_indices]):
        ends = found.limit_indices[cloud.ring[found.limit_indices] == layer]
        assert 1 <= len(ends) <= 2
    limits = azimuth[found.limit_indices]
    assert 4 <= np.sum(limits < middle) <= len(limits) - 4


def test_ends_that_are_no_limit_points_lie_farther_inside():
    taken = left = 0
    for k, scene in enumerate(many_scenes(20, 4)):
        cloud = scan(scene, k)
        found = label(cloud)
        board_T_lidar = se3.inverse(scene.world_T_board) @ scene.world_T_lidar
        inside_m = -BORDER.signed_distance(se3.apply(board_T_lidar, cloud.points)[:, :2])[0]
        azimuth = np.arctan2(cloud.points[:, 1], cloud.points[:, 0])
        ends = {-1: [], 1: []}
        for layer in np.unique(cloud.ring[found.indices]):
            of_layer = found.indices[cloud.ring[found.indices] == layer]
            ends[-1].append(of_layer[np.argmin(azimuth[of_layer])])
            ends[1].append(of_layer[np.argmax(azimuth[of_layer])])
        for side in ends.values():
            limits = np.intersect1d(side, found.limit_indices)
            others = np.setdiff1d(side, found.limit_indices)
            taken, left = taken + len(limits), left + len(others)
            if len(limits) and len(others):
                assert np.max(inside_m[limits]) < np.max(inside_m[others]) + 0.01
    assert left > 0.2 * taken > 0
