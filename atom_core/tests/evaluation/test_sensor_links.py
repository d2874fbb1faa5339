"""Poses of one sensor in another: what counts as one, and how a rig is put together from them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from atom_core.errors import DatasetError
from atom_core.evaluation.baselines.links import (
    Link,
    board_by_range,
    board_middle,
    check_separable,
    edge_value,
    linked_rig,
    motion_between,
    move_against_each_other,
    placed_at,
    seen_by_both,
    sensors_of,
    usual_pose,
)
from atom_core.geometry import se3
from atom_core.model.dataset import DataSource, pose
from atom_core.model.labels import DetectionKey
from atom_core.model.transforms import Edge
from atom_core.synthetic import Noise, Sampling, scenes
from atom_core.synthetic.carried import on_another

BOARD = "pattern_1"


@pytest.fixture(scope="module")
def scene():
    """Return three cameras, the first one anchored, a depth camera and a LiDAR."""
    return scenes.random_scene(
        1,
        rgb=3,
        depth=1,
        lidar3d=1,
        collections=3,
        noise=Noise.none(),
        sampling=Sampling(exact_border=True),
    )


@pytest.fixture(scope="module")
def dataset(scene):
    return scene.dataset


def shifted(x_m, angle_rad=0.0):
    turn = se3.rotation_from_rotation_vector(np.array([0.0, 0.0, angle_rad]))
    return se3.transform(turn, np.array([x_m, 0.0, 0.0]))


def place_of(dataset, target, source, collection="000"):
    frames = (dataset.sensors[name].frame for name in (target, source))
    return pose(dataset.collections[collection], dataset.graph, *frames)


def with_post_moved(dataset, name, collection, x_m):
    """Return the dataset with a sensor's post shifted in one collection."""
    edge = Edge("rig_base", f"{name}_post")
    value = shifted(x_m) @ dataset.collections[collection].transforms[edge]
    return dataset.with_transforms({collection: {edge: value}})


def same_edges(one, other, names):
    edges = [one.sensors[name].edge for name in names]
    return [np.array_equal(one.first_value(e), other.first_value(e)) for e in edges]


# ---- a rig from links


def test_the_links_of_most_collections_make_the_rig_whichever_way_they_point(dataset):
    rng = np.random.default_rng(0)
    first_T_second, second_T_third = (se3.random_move(1.0, 1.0, rng) for _ in range(2))
    links = [
        Link("rgb_3", "rgb_1", np.eye(4), 2),
        Link("rgb_1", "rgb_2", np.linalg.inv(first_T_second), 3),
        Link("rgb_3", "rgb_2", second_T_third, 4),
    ]
    rig = linked_rig("m", dataset, links, {("a", "b"): "why"}, ["before"])
    assert set(rig.placed) == {"rgb_1", "rgb_2", "rgb_3"} and rig.placed[0] == "rgb_1"
    assert rig.method == "m" and rig.links == tuple(links) and rig.unsolved == {("a", "b"): "why"}
    assert rig.remarks == ("before",)
    for key in dataset.collections:
        second, third = (place_of(rig.dataset, "rgb_1", n, key) for n in ("rgb_2", "rgb_3"))
        np.testing.assert_allclose(second, first_T_second, atol=1e-9)
        np.testing.assert_allclose(third, first_T_second @ second_T_third, atol=1e-9)
    assert same_edges(rig.dataset, dataset, ("rgb_1", "depth_1", "lidar_1")) == [True] * 3


def test_what_no_link_reaches_is_told_after_other_remarks_and_stays(dataset):
    links = [
        Link("depth_1", "lidar_1", np.eye(4), 9),
        Link("rgb_2", "rgb_1", np.eye(4), 1),
    ]
    rig = linked_rig("m", dataset, links, {}, ["before"])
    assert rig.placed == ("rgb_1", "rgb_2")
    assert rig.remarks == (
        "before",
        "m: nothing links depth_1, lidar_1 to rgb_1; they are not placed",
    )
    assert same_edges(rig.dataset, dataset, ("depth_1", "lidar_1", "rgb_2")) == [True, True, False]


def test_without_the_anchored_sensor_the_first_that_has_a_link_stays(dataset):
    links = [Link("lidar_1", "rgb_3", np.eye(4), 1), Link("lidar_1", "depth_1", np.eye(4), 1)]
    rig = linked_rig("m", dataset, links, {})
    assert rig.placed[0] == "rgb_3" and set(rig.placed[1:]) == {"depth_1", "lidar_1"}
    assert same_edges(rig.dataset, dataset, ("rgb_3",)) == [True]


def test_without_links_there_is_no_rig_but_the_reasons_stay(dataset):
    rig = linked_rig("m", dataset, [], {("a", "b"): "why"}, ["remark"])
    assert (rig.links, rig.dataset, rig.placed) == ((), None, ())
    assert rig.unsolved == {("a", "b"): "why"} and rig.remarks == ("remark",)


# ---- placing


def test_a_sensor_that_cannot_be_placed_costs_the_later_ones_nothing(dataset):
    poses = {name: shifted(0.5) for name in ("rgb_2", "rgb_1", "rgb_3", "lidar_1")}
    swinging = with_post_moved(dataset, "rgb_2", "001", 0.2)
    solved, placed, remarks = placed_at(swinging, "rgb_1", poses)
    assert placed == ["rgb_1", "rgb_3", "lidar_1"]
    assert remarks == [
        "random_scene: 'rgb_1' moves against the parent of 'rgb_2', so that one pose cannot place "
        "it in all collections"
    ]
    for name in placed[1:]:
        np.testing.assert_allclose(place_of(solved, "rgb_1", name), shifted(0.5), atol=1e-9)
    assert same_edges(solved, swinging, ("rgb_1", "rgb_2")) == [True, True]


@pytest.mark.parametrize("twin, other", [("rgb_2", "rgb_1"), ("rgb_3", "rgb_2")])
def test_a_sensor_on_the_edge_of_another_stays_below_it(dataset, twin, other):
    sensor = replace(dataset.sensors[twin], edge=dataset.sensors[other].edge)
    shared = replace(dataset, sensors={**dataset.sensors, twin: sensor})
    poses = {name: np.eye(4) for name in ("rgb_1", "rgb_2", "rgb_3", "lidar_1")}
    _, placed, remarks = placed_at(shared, "rgb_1", poses)
    assert placed == [name for name in poses if name != twin]
    assert remarks == [f"'{twin}' shares its edge with another sensor, and stays below it"]


@pytest.mark.parametrize("move_m, one_value", [(0.9e-6, True), (1.1e-6, False)])
def test_transforms_that_differ_by_a_micrometre_are_different(dataset, move_m, one_value):
    turned = with_post_moved(dataset, "rgb_2", "002", move_m)
    poses = [place_of(turned, "rgb_1", "rgb_2", key) for key in turned.collections]
    apart = np.max(np.abs(poses[2] - poses[0]))  # along one axis of the frame of rgb_1
    level = with_post_moved(dataset, "rgb_2", "002", move_m**2 / apart)
    assert move_against_each_other(level, "rgb_1", "rgb_2") is not one_value
    assert move_against_each_other(level, "rgb_1", "rgb_3") is False


def test_without_collections_nothing_moves(dataset):
    nothing = dataset.selected(collections=[])
    assert move_against_each_other(nothing, "rgb_1", "rgb_2") is False


@pytest.mark.parametrize("move_m, refused", [(0.9e-6, False), (1.1e-6, True)])
def test_one_pose_places_a_sensor_if_its_parent_moves_by_less_than_a_micrometre(
    dataset, move_m, refused
):
    edge = Edge("rig_base", "rgb_2_post")
    value = dataset.first_value(edge) @ shifted(move_m)  # along an axis of the parent
    moving = dataset.with_transforms({"001": {edge: value}})
    _, placed, _ = placed_at(moving, "rgb_1", {"rgb_2": np.eye(4)})
    assert (placed == ["rgb_1"]) == refused


def test_the_value_of_an_edge_puts_the_sensor_where_it_is_to_be(dataset):
    wanted = se3.random_move(1.0, 1.0, np.random.default_rng(2))
    edge = dataset.sensors["lidar_1"].edge
    value = edge_value(dataset, "rgb_2", "lidar_1", wanted)
    solved = dataset.with_transforms(dict.fromkeys(dataset.collections, {edge: value}))
    np.testing.assert_allclose(place_of(solved, "rgb_2", "lidar_1"), wanted, atol=1e-9)


# ---- sensors below others


@pytest.fixture(scope="module")
def nested(dataset):
    """Return the dataset with rgb_2 on rgb_1, and the LiDAR on rgb_2."""
    return on_another(on_another(dataset, "rgb_2", "rgb_1"), "lidar_1", "rgb_2")


@pytest.mark.parametrize("anchored", ["rgb_1", "rgb_2", "rgb_3", "lidar_1"])
def test_in_a_chain_of_edges_all_sensors_stand_where_the_links_have_them(nested, anchored):
    rng = np.random.default_rng(7)
    wanted_poses = {name: se3.random_move(1.0, 1.0, rng) for name in ("rgb_2", "rgb_3", "lidar_1")}
    links = [Link(name, "rgb_1", found, 1) for name, found in reversed(list(wanted_poses.items()))]
    anchoring = replace(nested, config=replace(nested.config, anchored_sensor=anchored))
    rig = linked_rig("m", anchoring, links, {})
    assert set(rig.placed) == {"rgb_1", *wanted_poses}
    for key in nested.collections:
        for name, wanted in wanted_poses.items():
            np.testing.assert_allclose(place_of(rig.dataset, "rgb_1", name, key), wanted, atol=1e-9)
    stays = "rgb_3" if anchored == "rgb_3" else "rgb_1"
    assert rig.placed[0] == stays and same_edges(rig.dataset, nested, [stays]) == [True]
    assert rig.remarks == (
        ()
        if anchored == stays
        else (
            f"m: '{anchored}' hangs below the edge of 'rgb_1', so that 'rgb_1' stays where it is",
        )
    )


def test_a_carrier_that_is_not_placed_takes_what_hangs_on_it_along(nested):
    """The camera below it stands to the camera that stays where it is to be all the same."""
    solved, placed, remarks = placed_at(nested, "rgb_3", {"lidar_1": shifted(0.5)})
    assert placed == ["rgb_3", "lidar_1"] and not remarks
    np.testing.assert_allclose(place_of(solved, "rgb_3", "lidar_1"), shifted(0.5), atol=1e-9)
    assert same_edges(solved, nested, ("rgb_1", "rgb_2", "rgb_3")) == [True] * 3
    rigid = place_of(nested, "rgb_2", "lidar_1")
    solved, _, _ = placed_at(nested, "rgb_3", {"rgb_1": shifted(0.5)})
    np.testing.assert_allclose(place_of(solved, "rgb_2", "lidar_1"), rigid, atol=1e-9)


def test_a_sensor_is_not_calibrated_against_one_that_it_carries(nested):
    for fixed, name in (("rgb_2", "rgb_1"), ("lidar_1", "rgb_1"), ("lidar_1", "rgb_2")):
        with pytest.raises(DatasetError) as refusal:
            edge_value(nested, fixed, name, np.eye(4))
        assert str(refusal.value) == (
            f"random_scene: '{fixed}' hangs below the edge of '{name}', which moves both; "
            f"calibrate '{fixed}' against '{name}', the other way round"
        )
        check_separable(nested, name, fixed)
    check_separable(nested, "rgb_3", "rgb_1")


def test_two_sensors_on_one_edge_are_not_calibrated_against_each_other(dataset):
    edge = dataset.sensors["rgb_1"].edge
    below = replace(dataset.sensors["rgb_2"], edge=edge, frame=dataset.sensors["rgb_1"].frame)
    shared = replace(dataset, sensors={**dataset.sensors, "rgb_2": below})
    with pytest.raises(DatasetError, match=f"'rgb_2' and 'rgb_1' share the edge '{edge}'"):
        edge_value(shared, "rgb_1", "rgb_2", np.eye(4))


# ---- what two sensors see


def test_sensors_of_a_kind_come_in_the_datasets_order(dataset):
    assert sensors_of(dataset, "lidar3d", "rgb") == ["rgb_1", "rgb_2", "rgb_3", "lidar_1"]
    assert sensors_of(dataset, "depth") == ["depth_1"] and sensors_of(dataset) == []


def test_boards_count_that_both_detected_in_order_of_the_collections(dataset):
    label = dataset.collections["001"].labels["rgb_2", BOARD]
    empty = replace(label, ids=label.ids[:0], pixels=label.pixels[:0])
    for changes in ({("rgb_2", BOARD): empty}, {("rgb_2", BOARD): None}):
        fewer = dataset.with_labels("001", changes)
        for one, other in (("rgb_1", "rgb_2"), ("rgb_2", "rgb_1")):
            assert seen_by_both(fewer, one, other) == [
                (DetectionKey(key, one, BOARD), DetectionKey(key, other, BOARD))
                for key in ("000", "002")
            ]


def test_both_boards_of_a_collection_count_in_the_datasets_order(dataset):
    two = replace(
        dataset, patterns={"other": replace(dataset.patterns[BOARD], name="other"), BOARD: None}
    ).selected(collections=["000"])
    labels = {
        (name, "other"): two.collections["000"].labels[name, BOARD] for name in ("rgb_1", "rgb_2")
    }
    found = seen_by_both(two.with_labels("000", labels), "rgb_1", "rgb_2")
    assert [one.pattern for one, _ in found] == ["other", BOARD]


def test_a_range_sensor_has_the_boards_middle_where_it_is(scene):
    """In the first collection it sees all of the board; of less, several places may fit alike."""
    dataset, pattern = scene.dataset, scene.dataset.patterns[BOARD]
    key = DetectionKey("000", "lidar_1", BOARD)
    border, frame = pattern.border, dataset.sensors["lidar_1"].frame
    lidar_T_world = pose(dataset.collections["000"], dataset.graph, frame, pattern.parent_frame)
    lidar_T_board = lidar_T_world @ scene.truth.boards[BOARD, "000"]
    middle = [(border.x_min + border.x_max) / 2.0, (border.y_min + border.y_max) / 2.0, 0.0]
    found = board_middle(dataset, key)
    np.testing.assert_allclose(found, se3.apply(lidar_T_board, np.array([middle]))[0], atol=0.01)
    in_board = se3.apply(np.linalg.inv(board_by_range(dataset, key)), found[None])[0]
    np.testing.assert_allclose(in_board, middle, atol=1e-9)


def test_without_data_a_range_sensor_tells_no_board(dataset):
    key = DetectionKey("000", "lidar_1", BOARD)
    assert board_by_range(dataset, key) is not None
    blind = replace(dataset, data=DataSource())
    assert board_by_range(blind, key) is None and board_middle(blind, key) is None


@pytest.mark.parametrize("candidates", [["best", "other", "last"], ["only"], [], None])
def test_of_places_that_fit_alike_the_first_is_taken(candidates):
    key = DetectionKey("000", "lidar_1", BOARD)
    told = None if candidates is None else SimpleNamespace(candidates=lambda: candidates)
    kind = SimpleNamespace(measure=lambda dataset, asked: (told, asked == key))
    data = SimpleNamespace(has_data=lambda *place: place == ("000", "lidar_1"))
    dataset = SimpleNamespace(data=data, sensors={"lidar_1": SimpleNamespace(kind=kind)})
    assert board_by_range(dataset, key) == (candidates[0] if candidates else None)


# ---- motions and means


def test_three_points_tell_a_motion_and_two_do_not():
    move = se3.random_move(1.0, 1.0, np.random.default_rng(1))
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    np.testing.assert_allclose(motion_between(points, se3.apply(move, points)), move, atol=1e-9)
    assert motion_between(points[:2], points[:2]) is None


@pytest.mark.parametrize("factor, told", [(0.95, False), (1.05, True)])
def test_points_are_a_line_whose_second_size_squared_is_below_a_billionth(factor, told):
    width = factor * np.sqrt(1e-9)  # sizes of the product of both sides are squares
    cross = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, width, 0.0], [0.0, -width, 0.0]])
    assert (motion_between(cross, cross) is not None) == told


def test_a_motion_is_told_by_the_smallest_cloud_that_has_a_width():
    tiny = 1e-5 * np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.5, 0.0]])
    np.testing.assert_allclose(motion_between(tiny, tiny), np.eye(4), atol=1e-9)


def test_one_place_many_times_tells_no_motion():
    points = np.ones((5, 3))
    assert motion_between(points, points) is None


def test_one_pose_is_its_own_mean():
    only = se3.random_move(1.0, 1.0, np.random.default_rng(4))
    np.testing.assert_allclose(usual_pose([only]), only, atol=1e-12)


@pytest.mark.parametrize("far_m, counts", [(2.9, True), (3.0, True), (3.01, False)])
def test_a_pose_counts_up_to_three_times_the_median_distance(far_m, counts):
    found = usual_pose([shifted(-1.0), shifted(1.0), shifted(0.0), shifted(far_m)])
    np.testing.assert_allclose(found[0, 3], far_m / 4.0 if counts else 0.0, atol=1e-12)


@pytest.mark.parametrize("far_rad, counts", [(0.29, True), (0.31, False)])
def test_a_radian_counts_as_a_metre(far_rad, counts):
    poses = [shifted(-0.1), shifted(0.1), shifted(0.0), shifted(0.0, far_rad)]
    found = usual_pose(poses)
    chordal = np.arctan2(np.sin(far_rad), 3.0 + np.cos(far_rad))
    angle = np.arctan2(found[1, 0], found[0, 0])
    np.testing.assert_allclose(angle, chordal if counts else 0.0, atol=1e-12)


@pytest.mark.parametrize("far_m, counts", [(0.9e-9, True), (1.1e-9, False)])
def test_among_poses_that_are_alike_a_nanometre_is_far(far_m, counts):
    found = usual_pose([np.eye(4), np.eye(4), np.eye(4), shifted(far_m)])
    np.testing.assert_allclose(found[0, 3], far_m / 4.0 if counts else 0.0, rtol=1e-6)
