"""Gaps of a scan, as lost packets leave them: a board behind one is found, and nothing else is."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))

from lidar_scenes import BORDER, Scene, board_facing, many_scenes, person, pose, scan, shares

from atom_core import native
from atom_core.geometry import se3
from atom_core.labeling.base import labeler_for
from atom_core.labeling.lidar3d import Cloud
from atom_core.labeling.scan_gaps import scan_gaps
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import LIDAR3D, Sensor
from atom_core.model.transforms import Edge
from atom_core.synthetic.board import charuco

EYE = (0.0, 0.0, 1.5)
compiled = pytest.mark.skipif(not native.available(), reason="the compiled core is not built")


def label(cloud, seed=None):
    sensor = Sensor("lidar", LIDAR3D, "lidar", Edge("world", "lidar"))
    labeler = labeler_for(sensor, pattern_from_config("pattern", charuco()), charuco())
    return labeler.label(Cloud(cloud.points, cloud.ring), seed)


def with_gap(cloud, middle_deg, width_deg):
    """Take the returns out between two azimuths [deg] in the LiDAR's frame."""
    azimuth = np.degrees(np.arctan2(cloud.points[:, 1], cloud.points[:, 0]))
    off = np.abs((azimuth - middle_deg + 180.0) % 360.0 - 180.0)
    return type(cloud)(*(values[off > width_deg / 2.0] for values in cloud))


def azimuth_deg(point):
    return float(np.degrees(np.arctan2(point[1], point[0])))


@compiled
@pytest.mark.parametrize("width_deg, least", [(2.0, 19), (4.8, 11)])
def test_a_board_behind_a_gap_is_found(width_deg, least):
    found_by_search = found_at_seed = 0
    for k, scene in enumerate(many_scenes(20, 5)):
        whole = scan(scene, k)
        off_deg = np.random.default_rng(k).uniform(-4.0, 4.0)
        cloud = with_gap(whole, azimuth_deg(whole.seed) + off_deg, width_deg)
        for found, is_search in ((label(cloud), True), (label(cloud, cloud.seed), False)):
            if not found.detected:
                continue
            precision, recall = shares(found.label.indices, cloud)
            assert precision >= 0.98 and recall >= 0.9
            board_T_lidar = se3.inverse(scene.world_T_board) @ scene.world_T_lidar
            limits = se3.apply(board_T_lidar, cloud.points[found.label.limit_indices])
            assert np.all(np.abs(BORDER.signed_distance(limits[:, :2])[0]) < 0.05)
            found_by_search += is_search
            found_at_seed += not is_search
    assert found_by_search >= least and found_at_seed >= least


@compiled
@pytest.mark.parametrize("middle_deg", range(-160, 200, 40))
def test_where_no_board_is_a_gap_makes_none(middle_deg):
    for k, width_deg in enumerate((1.0, 2.0, 4.8, 7.0)):
        direction = np.radians(middle_deg)
        things = person(2.0 * np.cos(direction), 2.0 * np.sin(direction))
        cloud = with_gap(scan(Scene(pose(EYE), None, things), k), middle_deg, width_deg)
        assert not label(cloud).detected


@compiled
def test_a_board_of_another_size_is_none_behind_a_gap_either():
    for k, scale in enumerate((0.7, 0.85, 1.2, 1.4)):
        border = type(BORDER)(*(scale * value for value in vars(BORDER).values()))
        centre = (2.2, 0.3, 1.45)
        scene = Scene(pose(EYE), board_facing(EYE, centre, border=border))
        whole = scan(scene, k, border=border)
        cloud = with_gap(whole, azimuth_deg(whole.seed), 2.5)
        assert not label(cloud).detected and not label(cloud, cloud.seed).detected


def test_places_behind_a_gap_lie_between_what_is_seen_beside_it():
    cloud = with_gap(scan(Scene(pose(EYE), board_facing(EYE, (2.0, 0.0, 1.5)))), 1.0, 3.0)
    gaps = scan_gaps(cloud.points, 0.6)
    np.testing.assert_allclose(gaps[0].seed, [2.0, 2.0 * np.tan(np.radians(1.0)), 0.0], atol=0.15)
    assert 0.09 < gaps[0].width_m < 0.16  # 2 m x 3 degrees, and some for a slant
    far = [np.linalg.norm(gap.seed) for gap in gaps]
    assert far == sorted(far)


def test_clouds_without_gaps_have_none():
    whole = scan(Scene(pose(EYE), None))
    assert scan_gaps(whole.points, 0.6) == []
    assert scan_gaps(np.zeros((0, 3)), 0.6) == []
    assert scan_gaps(np.full((5, 3), np.nan), 0.6) == []
    half = whole.points[whole.points[:, 0] > 0]  # a view of half a turn ends; that is no gap
    assert scan_gaps(half, 0.6) == []
