"""The LiDAR labeler against truth: poses, clutter, layouts of clouds, what it must refuse."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from lidar_scenes import (
    BORDER,
    Box,
    Cylinder,
    Scene,
    board_facing,
    many_scenes,
    person,
    pose,
    scan,
    shares,
)

from atom_core import native
from atom_core.errors import LabelingError
from atom_core.geometry import se3
from atom_core.geometry.rectangle import Rectangle
from atom_core.io.pcd import read_pcd
from atom_core.labeling.base import labeler_for
from atom_core.labeling.lidar3d import (
    Cloud,
    Lidar3dLabeler,
    Lidar3dOptions,
    as_cloud,
    board_at,
    expected_points,
    find_boards,
    find_layers,
)
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import LIDAR3D, Sensor
from atom_core.model.transforms import Edge
from atom_core.synthetic.board import charuco
from atom_core.synthetic.lidar_models import LidarModel
from atom_core.synthetic.rig import Room

pytestmark = pytest.mark.skipif(not native.available(), reason="the compiled core is not built")

EYE = (0.0, 0.0, 1.5)
OUSTER_SIDE_M = 1.016
# A beam is smeared over its azimuth step while it turns, and about as wide beside (10 mm where it
# leaves the sensor, 0.18 degrees of divergence, at 3 m): two steps of 360 / 1024 degrees.
OUSTER = Lidar3dOptions(beam_width_rad=2 * 2 * np.pi / 1024)


def label(cloud, seed=None, ring=True, **options):
    data = Cloud(cloud.points, cloud.ring if ring else None)
    seed = cloud.seed if seed is None else np.asarray(seed, dtype=float)
    return board_at(data, BORDER, seed, Lidar3dOptions(**options)).labeled


def check(labeled, cloud, precision=0.98, recall=0.9):
    assert labeled.detected, labeled.reason
    found = shares(labeled.label.indices, cloud)
    assert found[0] >= precision
    assert found[1] >= recall


def before(distance=2.0, roll_deg=30.0, y=0.3, **turned):
    return board_facing(EYE, (distance, y, 1.45), roll_deg=roll_deg, **turned)


# ---- poses


@pytest.mark.sampled(2)
@pytest.mark.parametrize("tilted", [False, True])
@pytest.mark.parametrize("noise_m", [0.008, 0.010])
def test_board_is_labeled_in_many_poses(tilted, noise_m):
    for k, scene in enumerate(many_scenes(25, 3, tilted)):
        cloud = scan(scene, k, noise_m)
        away = np.random.default_rng(k).normal(0.0, 0.15, 3)
        check(label(cloud, cloud.seed + away), cloud)


def test_noise_is_measured_not_assumed():
    scene = Scene(pose(EYE), before(turn_deg=0.0))
    for noise_m in (0.004, 0.015):
        found = label(scan(scene, 1, noise_m))
        assert found.quality["plane_sigma_m"] == pytest.approx(noise_m, rel=0.25)


def test_half_a_beam_step_is_added_to_the_size():
    figures = []
    for k in range(10):
        cloud = scan(Scene(pose(EYE), before(1.7, 20.0)), k, mixed_within_rad=0.0)
        figures.append(label(cloud).quality["measured_height_m"])
    assert np.mean(figures) == pytest.approx(0.6, rel=0.02)


# ---- what stands around

CLUTTER = {
    "person_beside": person(2.0, 1.05),
    "person_behind": person(2.25, 0.3),
    "two_people": person(2.1, 1.1) + person(2.4, -0.4),
    "box_beside": [Box((1.8, 0.85, 0.0), (2.2, 1.25, 1.8))],
    "table_under": [Box((1.4, -0.8, 0.85), (2.6, 1.4, 0.92))],
    "tripod": [Cylinder(2.06, 0.3, 0.03, 0.0, 1.5)],
}


@pytest.mark.parametrize("things", CLUTTER.values(), ids=CLUTTER.keys())
@pytest.mark.parametrize("roll_deg", [0.0, 30.0, 90.0])
def test_clutter_does_not_win(things, roll_deg):
    cloud = scan(Scene(pose(EYE), before(roll_deg=roll_deg), things), 2)
    check(label(cloud), cloud)


@pytest.mark.parametrize("roll_deg", [0.0, 45.0])
def test_wall_behind_the_board_does_not_win(roll_deg):
    room = Room((-4.0, -4.0, 0.0), (2.15, 4.0, 3.2))
    cloud = scan(Scene(pose(EYE), before(roll_deg=roll_deg), room=room), 3)
    check(label(cloud), cloud)


def test_a_hidden_side_gives_no_limit_points():
    hiding = Box((1.5, -0.6, 0.0), (1.6, 0.05, 3.0))
    scene = Scene(pose(EYE), before(roll_deg=0.0), [hiding])
    cloud = scan(scene, 4)
    found = label(cloud)
    check(found, cloud)
    board_T_lidar = se3.inverse(scene.world_T_board) @ scene.world_T_lidar
    in_board = se3.apply(board_T_lidar, cloud.points[found.label.limit_indices])
    assert len(in_board) >= 4  # about half of the ends lie near enough to the border
    assert np.all(np.abs(BORDER.signed_distance(in_board[:, :2])[0]) < 0.05)
    assert found.quality["hidden"] > 0.05


def test_an_arm_before_the_board_is_not_labeled():
    cloud = scan(Scene(pose(EYE), before(), [Cylinder(1.7, 0.3, 0.05, 0.0, 3.0)]), 5)
    check(label(cloud), cloud)


@pytest.mark.parametrize("seed", range(8))
def test_nothing_is_found_where_no_board_is(seed):
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(1.5, 3.0), rng.uniform(-1.0, 1.0)
    things = [
        *person(x, y),
        Box((x - 0.2, y + 0.5, 0.0), (x + 0.2, y + 0.9, 1.7)),
        Box((x - 0.5, y - 1.5, 0.7), (x + 0.5, y + 0.3, 0.75)),
    ]
    cloud = scan(Scene(pose(EYE, rng.uniform(-0.1, 0.1, 3)), None, things), seed)
    for place in ([x, y, 0.0], [x, y + 0.7, 0.0], [x, y - 0.6, -0.5], [4.0, 0.0, 0.0]):
        found = label(cloud, place)
        assert not found.detected
        assert found.reason
        assert len(found.label.limit_indices) == 0
    assert find_boards(Cloud(cloud.points, cloud.ring), BORDER) == []


@pytest.mark.parametrize("scale", [0.6, 0.75, 1.35])
def test_a_board_of_another_size_is_refused(scale):
    other = Rectangle(0.0, 0.0, 0.8 * scale, 0.6 * scale)
    scene = Scene(pose(EYE), board_facing(EYE, (1.8, 0.2, 1.5), 20.0, border=other))
    cloud = scan(scene, 6, border=other)
    found = label(cloud)
    assert not found.detected
    assert "measures" in found.reason and "the configuration says 0.80 x 0.60" in found.reason
    config, sensor = charuco(), Sensor("lidar", LIDAR3D, "lidar", Edge("world", "lidar"))
    labeler = labeler_for(sensor, pattern_from_config("pattern_1", config), config)
    searched = labeler.label(Cloud(cloud.points, cloud.ring))
    assert not searched.detected
    assert "the configuration says 0.80 x 0.60" in searched.reason or scale < 0.7


@pytest.mark.parametrize("layers", [1, 3])
def test_too_few_layers_are_named_with_the_size_of_what_they_see(layers):
    scene = Scene(pose(EYE), board_facing(EYE, (1.8, 0.2, 1.5), 0.0))
    cloud = scan(scene, 6)
    rings = np.unique(cloud.ring[cloud.on_board])[:layers]
    kept = ~cloud.on_board | np.isin(cloud.ring, rings)
    found = board_at(Cloud(cloud.points[kept], cloud.ring[kept]), BORDER, cloud.seed).labeled
    assert not found.detected and "only 1 layers" not in found.reason
    assert "the configuration says 0.80 x 0.60" in found.reason


# ---- clouds of other layouts


@pytest.mark.parametrize("rpy", [(0, 0, 0), (0.1, -0.08, 0.3), (np.pi / 2, 0, 0), (0.7, 0.5, 0)])
def test_layers_are_found_without_ring_field_in_any_orientation(rpy):
    cloud = scan(Scene(pose(EYE), before()), 7)
    frame_R_spin = se3.rotation_from_rpy(np.array(rpy, dtype=float))
    turned = Cloud(cloud.points @ frame_R_spin.T)
    layers = find_layers(turned)
    assert len(layers.layer_elevation) == 16
    np.testing.assert_allclose(np.abs(layers.axis @ frame_R_spin[:, 2]), 1.0, atol=1e-6)
    found = board_at(turned, BORDER, frame_R_spin @ cloud.seed).labeled
    assert found.label.indices.tolist() == label(cloud).label.indices.tolist()


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("with_seed", [True, False])
def test_noise_across_the_beams_does_not_hide_the_board(seed, with_seed):
    cloud, rng = scan(Scene(pose(EYE), before()), 12), np.random.default_rng(seed)
    points = cloud.points.copy()
    points[-300:] *= 0.8 / np.linalg.norm(points[-300:], axis=1)[:, None]  # an arm: jitters most
    points += 0.004 * rng.standard_normal(points.shape)
    shaken, exact = Cloud(points), find_layers(Cloud(cloud.points))
    layers = find_layers(shaken)
    assert len(layers.layer_elevation) == len(exact.layer_elevation)
    np.testing.assert_allclose(layers.layer_elevation, exact.layer_elevation, atol=3e-3)
    assert layers.azimuth_step == pytest.approx(exact.azimuth_step, rel=0.1)
    truth = set(label(cloud).label.indices)
    found = (
        board_at(shaken, BORDER, cloud.seed).labeled
        if with_seed
        else find_boards(shaken, BORDER)[0].labeled
    )
    assert found.detected, found.reason
    shared = truth & set(found.label.indices)
    assert len(shared) > 0.95 * max(len(truth), len(found.label.indices))


@pytest.mark.parametrize("ring", ["zeros", "noise", "float"])
def test_a_useless_ring_field_is_passed_over(ring):
    cloud = scan(Scene(pose(EYE), before()), 8)
    rng = np.random.default_rng(0)
    rings = {
        "zeros": np.zeros(len(cloud.ring)),
        "noise": rng.integers(0, 16, len(cloud.ring)),
        "float": cloud.ring.astype(np.float32),
    }
    found = board_at(Cloud(cloud.points, rings[ring]), BORDER, cloud.seed).labeled
    assert found.label.indices.tolist() == label(cloud).label.indices.tolist()


def test_invalid_points_keep_their_place():
    cloud = scan(Scene(pose(EYE), before()), 9)
    rng = np.random.default_rng(0)
    size = len(cloud.points) + 3000
    valid = np.sort(rng.permutation(size)[: len(cloud.points)])
    points = np.zeros((size, 3))
    points[rng.permutation(size)[: size // 2]] = np.nan
    points[valid] = cloud.points
    found = board_at(Cloud(points), BORDER, cloud.seed).labeled
    assert found.label.indices.tolist() == valid[label(cloud).label.indices].tolist()


@pytest.mark.parametrize("transposed", [False, True])
def test_organised_clouds_have_their_rows_as_layers(transposed):
    model = LidarModel(azimuth_steps=1800)
    cloud = scan(Scene(pose(EYE), before(), model=model), 10, dropout=0.0)
    image = cloud.points.reshape(16, 1800, 3)
    image = image.transpose(1, 0, 2) if transposed else image
    found = Lidar3dLabeler(sensor(), pattern()).label(image, cloud.seed)
    points = image.reshape(-1, 3)[found.label.indices]
    expected = cloud.points[label(cloud).label.indices]
    assert sorted(map(tuple, points)) == sorted(map(tuple, expected))


def test_a_board_across_the_seam_of_the_azimuth_is_one():
    centre = (-2.0, 0.02, 1.5)
    cloud = scan(Scene(pose(EYE), board_facing(EYE, centre, 30.0)), 11)
    assert np.any(cloud.points[cloud.on_board][:, 1] > 0.2)
    assert np.any(cloud.points[cloud.on_board][:, 1] < -0.2)
    check(label(cloud), cloud)
    assert len(find_boards(Cloud(cloud.points, cloud.ring), BORDER)) == 1


# ---- refusals


def test_too_few_layers_are_counted():
    scene = Scene(pose(EYE), board_facing(EYE, (3.9, 0.0, 1.5), roll_deg=0.0, tilt_deg=70.0))
    found = label(scan(scene, 12))
    assert not found.detected
    assert "4 are needed: bring the board nearer" in found.reason
    assert found.quality["layers"] < 4


def test_fewer_layers_can_be_allowed():
    room = Room((-9.0, -9.0, 0.0), (9.0, 9.0, 3.0))
    scene = Scene(pose(EYE), board_facing(EYE, (5.2, 0.0, 1.5), roll_deg=0.0), room=room)
    cloud = scan(scene, 12)
    assert len(np.unique(cloud.ring[cloud.on_board])) == 4
    check(label(cloud, least_layers=3), cloud, precision=0.95)


def test_a_seed_far_off_finds_nothing():
    cloud = scan(Scene(pose(EYE), before()), 13)
    found = label(cloud, cloud.seed + [0.0, 2.5, 0.0])
    assert not found.detected


def test_a_seed_in_the_air_says_so():
    cloud = scan(Scene(pose(EYE), before()), 13)
    assert "points within" in label(cloud, [-1.0, 0.0, 0.2]).reason


@pytest.mark.parametrize("seeded", [True, False])
def test_millimetres_are_named(seeded):
    cloud = scan(Scene(pose(EYE), before()), 13)
    wrong = Cloud(1000.0 * cloud.points, cloud.ring)
    seed = cloud.seed if seeded else None
    with pytest.raises(LabelingError, match="multiplied by 0.001; they look like millimetres"):
        Lidar3dLabeler(sensor(), pattern()).label(wrong, seed)
    assert Lidar3dLabeler(sensor(), pattern()).label(Cloud(cloud.points, cloud.ring), seed).detected
    away = Cloud(1000.0 * cloud.points[~cloud.on_board], None)
    assert not Lidar3dLabeler(sensor(), pattern()).label(away, seed).detected


def test_an_empty_cloud_is_no_error():
    for points in (np.zeros((0, 3)), np.full((50, 3), np.nan), np.zeros((50, 3))):
        assert not board_at(Cloud(points), BORDER, np.ones(3)).labeled.detected
        assert find_boards(Cloud(points), BORDER) == []


@pytest.mark.parametrize(
    ("data", "seed", "words"),
    [
        (np.zeros((5, 4)), (1, 0, 0), "shape"),
        (np.zeros((5, 3)), (1, 0), "seed"),
        (np.zeros((5, 3)), (np.nan, 0, 0), "seed"),
        (np.zeros(5, dtype=[("x", "f4"), ("y", "f4")]), (1, 0, 0), "no field 'z'"),
        (Cloud(np.zeros((5, 3)), np.zeros(4)), (1, 0, 0), "ring"),
    ],
)
def test_data_that_are_no_cloud_are_named(data, seed, words):
    with pytest.raises(LabelingError, match=words) as caught:
        Lidar3dLabeler(sensor(), pattern()).label(data, np.array(seed, dtype=float))
    assert "sensor 'lidar'" in str(caught.value)


# ---- seeds and the labeler


def sensor():
    return Sensor("lidar", LIDAR3D, "lidar", Edge("world", "lidar_base"))


def pattern():
    return pattern_from_config("board", charuco())


def test_the_labeler_is_the_modalitys():
    assert isinstance(labeler_for(sensor(), pattern(), charuco()), Lidar3dLabeler)


def test_fields_of_a_message_are_read():
    cloud = scan(Scene(pose(EYE), before()), 14)
    fields = [("x", "f4"), ("y", "f4"), ("z", "f4"), ("intensity", "f4"), ("ring", "u2")]
    message = np.zeros(len(cloud.points), dtype=fields)
    for k, axis in enumerate("xyz"):
        message[axis] = cloud.points[:, k]
    message["ring"] = cloud.ring
    assert as_cloud(message).ring.tolist() == cloud.ring.tolist()
    found = Lidar3dLabeler(sensor(), pattern()).label(message, cloud.seed)
    assert found.label.indices.tolist() == label(cloud).label.indices.tolist()


def test_without_a_seed_the_cloud_is_searched():
    cloud = scan(Scene(pose(EYE), before(), person(2.3, 1.2)), 15)
    data = Cloud(cloud.points, cloud.ring)
    check(Lidar3dLabeler(sensor(), pattern()).label(data), cloud)
    nothing = scan(Scene(pose(EYE), None, person(2.3, 1.2)), 15)
    found = Lidar3dLabeler(sensor(), pattern()).label(Cloud(nothing.points, nothing.ring))
    assert not found.detected
    assert "board's size" in found.reason


def test_next_seed_follows_the_board_not_what_stands_beside():
    things, seed = person(2.3, 1.0), None
    for step in range(8):
        board = before(y=0.3 - 0.15 * step)
        cloud = scan(Scene(pose(EYE), board, things), step)
        found = label(cloud, cloud.seed if seed is None else seed)
        check(found, cloud)
        seed = found.next_seed
        assert np.linalg.norm(seed - cloud.seed) < 0.05


def test_same_input_same_output_whatever_was_called_before():
    clouds = [scan(scene, k) for k, scene in enumerate(many_scenes(4, 6))]
    first = [label(cloud) for cloud in clouds]
    second = [label(cloud) for cloud in reversed(clouds)][::-1]
    for a, b in zip(first, second):
        assert a.label.indices.tolist() == b.label.indices.tolist()
        assert a.label.limit_indices.tolist() == b.label.limit_indices.tolist()
        assert a.quality == b.quality


@pytest.mark.parametrize("distance", [2.0, 2.5, 3.5])
def test_expected_points_are_those_that_come(distance):
    model = LidarModel(azimuth_steps=1800)
    steps = (model.azimuth_step_rad, np.radians(2.0))
    points, layers = [], []
    for roll_deg in range(0, 180, 15):
        world_T_board = board_facing(EYE, (distance, 0.0, 1.5), roll_deg)
        cloud = scan(Scene(pose(EYE), world_T_board), roll_deg, dropout=0.0)
        points.append(np.sum(cloud.on_board))
        layers.append(len(np.unique(cloud.ring[cloud.on_board])))
    expected = expected_points(BORDER, distance, *steps)
    assert expected.points == pytest.approx(np.mean(points), rel=0.1)
    assert abs(expected.layers - np.mean(layers)) <= 1.5


# ---- real clouds


@pytest.mark.sampled(1)
@pytest.mark.parametrize("number", [0, 7, 11, 15, 22])
def test_real_board_is_found_without_a_seed(real_data, number):
    file = read_pcd(real_data("ouster_board") / f"pointcloud{number}.pcd")
    half = OUSTER_SIDE_M / 2.0
    border = Rectangle(-half, -half, half, half)
    data = Cloud(file.xyz, file.fields["ring"], file.width, file.height)
    found = find_boards(data, border, OUSTER)
    assert len(found) == 1
    quality = found[0].labeled.quality
    side = (quality["measured_width_m"] + quality["measured_height_m"]) / 2.0
    assert side == pytest.approx(OUSTER_SIDE_M, rel=0.02)
    without_ring = find_boards(Cloud(file.xyz, None, file.width, file.height), border, OUSTER)
    assert without_ring[0].labeled.label.indices.tolist() == (
        found[0].labeled.label.indices.tolist()
    )
