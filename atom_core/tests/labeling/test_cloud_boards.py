"""Boards in clouds without scan layers, against truth: kinds of clouds, surroundings, refusals."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from cloud_scenes import EYE, KINDS, cloud_of, rosette, scene_with, strewn, tof
from lidar_scenes import BORDER, Cylinder, Scene, board_facing, pose, scan, shares

from atom_core import native
from atom_core.geometry import se3
from atom_core.geometry.rectangle import Rectangle
from atom_core.io.pcd import read_pcd
from atom_core.labeling.lidar3d import (
    Cloud,
    Lidar3dLabeler,
    Lidar3dOptions,
    board_at,
    find_boards,
    find_layers,
)
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import LIDAR3D, Sensor
from atom_core.model.transforms import Edge
from atom_core.synthetic.board import charuco
from atom_core.synthetic.rig import Room

pytestmark = pytest.mark.skipif(not native.available(), reason="the compiled core is not built")

HALL = Room((-4.0, -4.0, 0.0), (6.0, 4.0, 3.0))
OUSTER_SIDE_M = 1.016
OUTLINE = Lidar3dOptions(beam_width_rad=2 * 2 * np.pi / 1024, use_layers=False)


def beyond_border(scene, cloud, indices):
    board_T_sensor = se3.inverse(scene.world_T_board) @ scene.world_T_lidar
    in_board = se3.apply(board_T_sensor, cloud.points[indices])
    return BORDER.signed_distance(in_board[:, :2])[0]


def centre_error(scene, found):
    board_T_sensor = se3.inverse(scene.world_T_board) @ scene.world_T_lidar
    return np.linalg.norm((board_T_sensor @ found.sensor_T_centre)[:3, 3] - [*BORDER.centre, 0.0])


def check(scene, cloud, found):
    label = found.labeled.label
    assert found.labeled.detected, found.labeled.reason
    precision, recall = shares(label.indices, cloud)
    assert precision >= 0.98
    assert recall >= 0.9
    assert set(label.limit_indices) <= set(label.indices)
    beyond, spacing = (
        beyond_border(scene, cloud, label.limit_indices),
        found.labeled.quality["point_spacing_m"],
    )
    assert len(beyond) >= 10
    assert np.max(beyond) < 0.015
    assert np.min(beyond) > -1.2 * spacing - 0.01
    assert centre_error(scene, found) < 0.012


@pytest.mark.sampled(3)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("distance", "incidence_deg"), [(1.8, 5.0), (2.4, 40.0), (3.2, 60.0)])
def test_a_board_is_found_among_floor_wall_person_and_box(kind, distance, incidence_deg):
    rng = np.random.default_rng(int(10 * distance))
    scene = scene_with(rng, None, distance, incidence_deg, wall_behind=0.3)
    cloud = KINDS[kind](scene, 1)
    data = Cloud(cloud.points)
    assert not find_layers(data).has_layers
    check(scene, cloud, board_at(data, BORDER, cloud.seed + rng.normal(0.0, 0.1, 3)))
    boards = find_boards(data, BORDER)
    assert len(boards) == 1
    check(scene, cloud, boards[0])


@pytest.mark.sampled(3)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", KINDS)
def test_a_room_without_a_board_has_none(kind, seed):
    rng = np.random.default_rng(seed)
    scene = scene_with(rng, None, rng.uniform(1.2, 3.5), 0.0, board=False)
    data = Cloud(KINDS[kind](scene, seed).points)
    assert find_boards(data, BORDER) == []
    for thing in scene.things[::2]:
        box = not hasattr(thing, "x")
        middle = np.mean(thing, axis=0) if box else np.array([thing.x, thing.y, 1.1])
        found = board_at(data, BORDER, middle - EYE)
        assert not found.labeled.detected
        assert found.labeled.reason


@pytest.mark.parametrize("turn_deg", [0.0, 45.0])
@pytest.mark.parametrize("model", [rosette, strewn, tof])
def test_the_side_is_measured_without_bias(model, turn_deg):
    sizes = []
    for roll_deg in (0.0, 20.0, 45.0):
        board = board_facing(EYE, (2.2, 0.0, 1.2), roll_deg, turn_deg)
        cloud = scan(Scene(pose(EYE), board, [], HALL, model()), 1, mixed_within_rad=0.0)
        quality = board_at(Cloud(cloud.points), BORDER, cloud.seed).labeled.quality
        sizes.append([quality["measured_width_m"] / 0.8, quality["measured_height_m"] / 0.6])
    assert np.mean(sizes) == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("scale", [0.7, 0.93, 1.07, 1.4])
def test_a_board_of_another_size_is_refused_with_both_sizes(scale):
    other = Rectangle(0.0, 0.0, 0.8 * scale, 0.6 * scale)
    board = board_facing(EYE, (2.2, 0.1, 1.2), 20.0, 15.0, border=other)
    cloud = scan(Scene(pose(EYE), board, [], HALL, strewn()), 1, border=other)
    found = board_at(Cloud(cloud.points), BORDER, cloud.seed).labeled
    assert not found.detected
    assert "the plane there measures" in found.reason
    assert "the configuration says 0.80 x 0.60" in found.reason
    assert found.quality["measured_width_m"] == pytest.approx(0.8 * scale, rel=0.04)
    assert find_boards(Cloud(cloud.points), BORDER) == []


TOUCHING = {
    "floor": (0.3, HALL, []),
    "wall": (1.2, Room((-4.0, -4.0, 0.0), (6.0, 0.4, 3.0)), []),
    "hand": (1.2, HALL, [Cylinder(2.45, 0.42, 0.06, 0.9, 1.3)]),
    "wall_behind": (1.2, Room((-4.0, -4.0, 0.0), (2.62, 4.0, 3.0)), []),
}


@pytest.mark.parametrize("name", TOUCHING)
@pytest.mark.parametrize("model", [strewn, tof])
def test_what_touches_the_board_is_not_labeled(model, name):
    height, room, things = TOUCHING[name]
    board = board_facing((0.0, 0.0, height), (2.5, 0.0, height), 0.0)
    scene = Scene(pose((0.0, 0.0, 1.0)), board, things, room, model())
    cloud = scan(scene, 1)
    check(scene, cloud, board_at(Cloud(cloud.points), BORDER, cloud.seed))


def test_a_pole_before_the_board_is_not_labeled():
    scene = Scene(
        pose(EYE),
        board_facing(EYE, (2.5, 0.0, 1.2), 0.0),
        [Cylinder(1.6, 0.1, 0.04, 0.0, 3.0)],
        HALL,
        strewn(),
    )
    cloud = cloud_of(scene, 2)
    found = board_at(Cloud(cloud.points), BORDER, cloud.seed)
    check(scene, cloud, found)
    assert found.labeled.quality["hidden"] > 0.05


def test_a_sphere_as_large_as_the_board_is_not_flat():
    rng = np.random.default_rng(0)
    y, z = rng.uniform(-0.4, 0.4, 3000), rng.uniform(-0.3, 0.3, 3000)
    points = np.column_stack([2.0 + 0.25 * (y**2 + z**2), y, z]) + rng.normal(0, 0.001, (3000, 3))
    found = board_at(Cloud(points), BORDER, np.array([2.0, 0.0, 0.0])).labeled
    assert not found.detected
    assert "not flat" in found.reason


def test_too_few_points_say_how_many_are_needed():
    scene = Scene(pose(EYE), board_facing(EYE, (3.0, 0.0, 1.2)), [], HALL, strewn(2000))
    cloud = cloud_of(scene)
    found = board_at(Cloud(cloud.points), BORDER, cloud.seed).labeled
    assert not found.detected
    assert "needed" in found.reason


def test_nothing_is_said_of_layers():
    scene = Scene(pose(EYE), None, [], HALL, strewn())
    data = Cloud(cloud_of(scene).points)
    pattern = pattern_from_config("board", charuco())
    labeler = Lidar3dLabeler(Sensor("tof", LIDAR3D, "tof", Edge("world", "tof")), pattern)
    for seed in (None, np.array([6.0, 0.0, 0.0]), np.array([0.5, 0.0, 1.0])):
        found = labeler.label(data, seed)
        assert not found.detected
        assert "layer" not in found.reason


def test_same_label_in_any_order_of_the_points():
    scene = Scene(pose(EYE), board_facing(EYE, (2.2, 0.0, 1.2), 25.0), [], HALL, rosette())
    cloud = cloud_of(scene, shuffled=False)
    found = board_at(Cloud(cloud.points), BORDER, cloud.seed)
    order = np.random.default_rng(0).permutation(len(cloud.points))
    other = board_at(Cloud(cloud.points[order]), BORDER, cloud.seed)
    first, second = set(found.labeled.label.indices), set(order[other.labeled.label.indices])
    assert len(first & second) > 0.97 * len(first | second)
    assert np.linalg.norm((found.sensor_T_centre - other.sensor_T_centre)[:3, 3]) < 0.004


@pytest.mark.sampled(1)
@pytest.mark.parametrize("number", [0, 27])
def test_a_real_board_is_found_without_its_layers(real_data, number):
    file = read_pcd(real_data("ouster_board") / f"pointcloud{number}.pcd")
    half = OUSTER_SIDE_M / 2.0
    border = Rectangle(-half, -half, half, half)
    layered = Lidar3dOptions(beam_width_rad=OUTLINE.beam_width_rad)
    data = Cloud(file.xyz, file.fields["ring"], file.width, file.height)
    expected = set(find_boards(data, border, layered)[0].labeled.label.indices)
    order = np.random.default_rng(number).permutation(len(file.xyz))
    boards = find_boards(Cloud(file.xyz[order]), border, OUTLINE)
    assert len(boards) == 1
    found = set(order[boards[0].labeled.label.indices])
    assert len(expected & found) > 0.9 * len(expected | found)
