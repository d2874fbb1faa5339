"""A camera and a board on an arm: what motion tells, which frames may stand for them."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.errors import DatasetError
from atom_core.evaluation.hand_eye_views import (
    HandEyeViews,
    Sides,
    board_of,
    depends_on_calibration,
    hand_eye_views,
    mean_pose,
    undetermined,
    usual_sides,
    with_hand_eye,
)
from atom_core.geometry import se3
from atom_core.model.dataset import board_edge, pose
from atom_core.model.transforms import Edge
from atom_core.synthetic import Noise, scenes
from atom_core.synthetic.carried import on_tilting_head

CAMERA, BOARD = "rgb_1", "pattern_1"
SCENES = {"camera moves": scenes.hand_eye, "board moves": scenes.board_on_arm}


@pytest.fixture(scope="module", params=SCENES)
def scene(request):
    return SCENES[request.param](2, collections=5, noise=Noise.none())


@pytest.fixture(scope="module")
def dataset():
    return scenes.hand_eye(2, collections=5, noise=Noise.none()).dataset


@pytest.fixture(scope="module")
def rig():
    """Return cameras and a depth camera before boards that are moved by hand."""
    return scenes.random_scene(
        1, rgb=2, depth=1, lidar3d=0, collections=1, noise=Noise.none()
    ).dataset


def turned(x_rad=0.0, y_rad=0.0, z_rad=0.0, move=(0.0, 0.0, 0.0)):
    """Return a turn about one axis or more, and a move [m]."""
    turn = se3.rotation_from_rotation_vector(np.array([x_rad, y_rad, z_rad], dtype=float))
    return se3.transform(turn, np.array(move, dtype=float))


def with_other_board(dataset, collections, **changes):
    """Return the dataset with a second board that the camera sees in some collections."""
    other = replace(dataset.patterns[BOARD], name="other", frame="other_link", **changes)
    two = replace(dataset, patterns={"other": other, **dataset.patterns})
    for key in collections:
        label = dataset.collections[key].labels[CAMERA, BOARD]
        two = two.with_labels(key, {(CAMERA, "other"): label})
    return two


def without_label(dataset, *collections):
    for key in collections:
        dataset = dataset.with_labels(key, {(CAMERA, BOARD): None})
    return dataset


# ---- what motion tells

NOTHING, SHIFTS, ONE_AXIS = "neither of them moves", "only translates", "turns about one axis only"


@pytest.mark.parametrize(
    "moves, said",
    [
        ([turned(move=(0.9e-4, 0, 0)), turned(0.9e-4, 0, 0)], NOTHING),
        ([turned(move=(-1.1e-4, 0, 0)), turned()], SHIFTS),
        ([turned(), turned(move=(0, 0, 1.1e-4))], SHIFTS),
        ([turned(0, -1.1e-4, 0), turned()], SHIFTS),
        ([turned(), turned()], NOTHING),
    ],
)
def test_a_tenth_of_a_millimetre_or_of_a_milliradian_is_no_standing_still(moves, said):
    assert said in undetermined([turned(), *moves])


@pytest.mark.parametrize("degrees, said", [(0.95, SHIFTS), (1.05, ONE_AXIS)])
def test_turns_are_none_below_one_degree_in_the_root_of_the_mean_square(degrees, said):
    about_x = np.radians(degrees)
    for turns in ([about_x] * 3, [about_x * np.sqrt(3.0), 0.0, 0.0]):
        moves = [turned(turn, 0, 0, move=(0.1 * i, 0, 0)) for i, turn in enumerate(turns)]
        assert said in undetermined([turned(), *moves])


@pytest.mark.parametrize("degrees, determined", [(0.95, False), (1.05, True)])
def test_a_second_axis_is_turned_about_from_one_degree_on(degrees, determined):
    about_y = np.radians(degrees) * np.sqrt(2.0)  # in one of two relative turns
    said = undetermined([turned(), turned(0.5, 0, 0), turned(0, about_y, 0)])
    assert (said == "") == determined and (determined or ONE_AXIS in said)


def test_turns_count_relative_to_the_first_pose_wherever_it_is():
    base = se3.random_move(3.0, 2.0, np.random.default_rng(0))
    for moves in ([turned(0.5, 0, 0), turned(0.3, 0, 0)], [turned(0.5, 0, 0), turned(0, 0.5, 0)]):
        assert undetermined([base, *(base @ m for m in moves)]) == undetermined([turned(), *moves])


# ---- which board


def test_the_fixed_board_that_is_seen_most_is_taken(dataset):
    assert board_of(with_other_board(dataset, ["000", "001"]), CAMERA) == BOARD
    fewer = without_label(with_other_board(dataset, ["000", "001"]), "001", "002", "003", "004")
    assert board_of(fewer, CAMERA) == "other"
    moved_by_hand = with_other_board(fewer.selected(patterns=[BOARD]), ["000"], fixed=False)
    assert board_of(moved_by_hand, CAMERA) == BOARD


def test_of_boards_that_are_seen_alike_the_first_is_taken(dataset):
    assert board_of(with_other_board(dataset, dataset.collections), CAMERA) == "other"


def test_what_another_camera_sees_does_not_count(dataset):
    second = replace(dataset.sensors[CAMERA], name="another")
    two = replace(dataset, sensors={**dataset.sensors, "another": second})
    two = two.with_labels(
        "000", {("another", BOARD): dataset.collections["000"].labels[CAMERA, BOARD]}
    )
    two = without_label(two, *dataset.collections)
    assert board_of(two, "another") == BOARD
    with pytest.raises(DatasetError) as refusal:
        board_of(two, CAMERA)
    assert str(refusal.value) == (
        f"{dataset.source}: camera 'rgb_1' sees no board that is fixed in its parent_link; set "
        f"`fixed: true` of the pattern in the configuration if it is"
    )


# ---- what the collections say


def test_in_every_collection_the_board_is_in_one_place_by_the_true_camera(scene):
    dataset = scene.dataset
    views = hand_eye_views(dataset, CAMERA, BOARD)
    edge, graph = dataset.sensors[CAMERA].edge, dataset.graph
    assert views.sides == usual_sides(dataset, CAMERA, BOARD)
    assert views.sides == Sides(edge.parent, dataset.patterns[BOARD].parent_frame)
    assert views.collections == list(dataset.collections)
    X = pose(dataset.collections["000"], graph, edge.parent, dataset.sensors[CAMERA].frame)
    boards = [g @ X @ h for g, h in zip(views.G, views.H)]
    for key, board in zip(views.collections, boards):
        np.testing.assert_allclose(board, scene.truth.boards[BOARD, key], atol=1e-5)


def test_collections_in_which_the_board_is_not_told_cost_the_later_ones_nothing(dataset):
    label = dataset.collections["001"].labels[CAMERA, BOARD]
    few = replace(label, ids=label.ids[:3], pixels=label.pixels[:3])
    none = replace(label, ids=label.ids[:0], pixels=label.pixels[:0])
    for label in (few, none, None):
        fewer = dataset.with_labels("001", {(CAMERA, BOARD): label})
        views = hand_eye_views(fewer, CAMERA, BOARD)
        assert views.collections == ["000", "002", "003", "004"]
        assert len(views.G) == len(views.H) == 4


def test_three_collections_are_enough_and_two_are_refused(dataset):
    assert len(hand_eye_views(without_label(dataset, "001", "003"), CAMERA, BOARD).G) == 3
    with pytest.raises(DatasetError) as refusal:
        hand_eye_views(without_label(dataset, "000", "001", "003"), CAMERA, BOARD)
    assert str(refusal.value) == (
        f"{dataset.source}: camera 'rgb_1' and board 'pattern_1': the board's pose is told in 2 "
        f"collections, a hand-eye calibration takes 3 at least; collect more"
    )


def test_why_motion_does_not_tell_it_is_said_of_camera_and_board(dataset):
    first = dict(dataset.collections["000"].transforms)
    still = dataset.with_transforms(dict.fromkeys(dataset.collections, first))
    with pytest.raises(DatasetError, match="'rgb_1' and board 'pattern_1': neither of them moves"):
        hand_eye_views(still, CAMERA, BOARD)


def test_labels_that_were_read_are_not_read_again(dataset):
    class Known:
        def camera_T_pattern(self, key):
            return turned(move=(0.0, 0.0, float(key.collection)))

    views = hand_eye_views(dataset, CAMERA, BOARD, None, Known())
    assert [h[2, 3] for h in views.H] == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_where_the_camera_tilts_the_child_of_its_edge_is_in_one_place(scene):
    edge = scene.dataset.sensors[CAMERA].edge
    still = hand_eye_views(scene.dataset, CAMERA, BOARD)
    assert still.frame == scene.dataset.sensors[CAMERA].frame
    dataset = on_tilting_head(scene.dataset, CAMERA, [0.1, 0.4, -0.3, 0.2, 0.0])
    views = hand_eye_views(dataset, CAMERA, BOARD)
    assert views.frame == edge.child
    for key, g, h in zip(views.collections, views.G, views.H):
        board = g @ scene.truth.edges[edge] @ h
        np.testing.assert_allclose(board, scene.truth.boards[BOARD, key], atol=1e-5)
    moved = se3.random_move(0.3, 0.5, np.random.default_rng(1))
    solved = with_hand_eye(dataset, CAMERA, BOARD, views, moved)
    np.testing.assert_allclose(solved.first_value(edge), moved, atol=1e-12)


# ---- frames that stand for them


def test_other_frames_stand_for_camera_and_board_if_they_are_rigid_to_them(dataset):
    sides = Sides("rgb_1_link", "rig_base")
    views = hand_eye_views(dataset, CAMERA, BOARD, sides)
    assert views.sides == sides
    for key, g in zip(views.collections, views.G):
        wanted = pose(dataset.collections[key], dataset.graph, "rig_base", "rgb_1_link")
        np.testing.assert_allclose(g, wanted, atol=1e-12)


@pytest.mark.parametrize(
    "sides, names",
    [
        (Sides("rig_base", "world"), "frame 'rig_base' moves against 'flange'"),
        (Sides("flange", "rgb_1_link"), "frame 'rgb_1_link' moves against 'world'"),
    ],
)
def test_a_frame_that_moves_cannot_stand_for_them(dataset, sides, names):
    with pytest.raises(DatasetError) as refusal:
        hand_eye_views(dataset, CAMERA, BOARD, sides)
    assert str(refusal.value) == (
        f"{dataset.source}: {names}, which it is to stand for; name the frame that carries it"
    )


@pytest.mark.parametrize("move_m, rigid", [(0.9e-9, True), (1.2e-9, False)])
def test_a_frame_that_moves_by_a_nanometre_moves(dataset, move_m, rigid):
    edge = Edge("rgb_1_link", "beside")
    values = {
        k: {edge: turned(move=(move_m if k == "003" else 0.0, 0, 0))} for k in dataset.collections
    }
    # The frame for the camera is below its edge, which here is the unit.
    level = {k: {**v, dataset.sensors[CAMERA].edge: np.eye(4)} for k, v in values.items()}
    sided = dataset.with_transforms(level)
    if rigid:
        assert hand_eye_views(sided, CAMERA, BOARD, Sides("beside", "world")).G
    else:
        with pytest.raises(DatasetError, match="'beside' moves against 'flange'"):
            hand_eye_views(sided, CAMERA, BOARD, Sides("beside", "world"))


# ---- no such pair


@pytest.mark.parametrize(
    "camera, board, said",
    [
        ("rgb_9", BOARD, "there is no rgb camera 'rgb_9'; there are: rgb_1, rgb_2"),
        ("depth_1", BOARD, "there is no rgb camera 'depth_1'; there are: rgb_1, rgb_2"),
        (CAMERA, "none", "there is no pattern 'none'; there are: pattern_1"),
        (CAMERA, BOARD, "pattern 'pattern_1' is not fixed in its parent_link, so that no hand-eye"),
    ],
)
def test_what_is_no_camera_or_no_fixed_board_is_refused(rig, camera, board, said):
    with pytest.raises(DatasetError) as refusal:
        hand_eye_views(rig, camera, board)
    assert str(refusal.value).startswith(f"{rig.source}: {said}")


def test_where_there_is_no_camera_none_is_named(rig):
    blind = rig.selected(sensors=["depth_1"])
    with pytest.raises(DatasetError, match="no rgb camera 'rgb_1'; there are: none"):
        hand_eye_views(blind, CAMERA, BOARD)


# ---- whether the calibration matters


@pytest.mark.parametrize("move_m, depends", [(0.9e-4, False), (1.1e-4, True)])
def test_a_calibration_matters_where_camera_and_board_move_a_tenth_of_a_millimetre(
    dataset, move_m, depends
):
    flange = Edge("rig_base", "flange")
    first = dict(dataset.collections["000"].transforms)
    still = dataset.with_transforms(dict.fromkeys(dataset.collections, {**first}))
    world_R_base = pose(still.collections["000"], still.graph, "world", "rig_base")[:3, :3]
    step = se3.transform(np.eye(3), world_R_base.T @ [move_m, 0.0, 0.0])
    value = step @ first[flange]
    moved = still.with_transforms({"002": {flange: value}})
    assert depends_on_calibration(moved, CAMERA, BOARD) == depends
    assert not depends_on_calibration(without_label(moved, "002"), CAMERA, BOARD)
    assert not depends_on_calibration(without_label(moved, *moved.collections), CAMERA, BOARD)


# ---- the result


def test_a_result_stands_in_the_cameras_edge_and_the_board_where_it_is_seen(scene):
    dataset, rng = scene.dataset, np.random.default_rng(1)
    sensor, board = dataset.sensors[CAMERA], dataset.patterns[BOARD]
    X = se3.random_move(0.3, 0.5, rng)
    views = hand_eye_views(dataset, CAMERA, BOARD)
    solved = with_hand_eye(dataset, CAMERA, BOARD, views, X)
    seen = mean_pose([g @ X @ h for g, h in zip(views.G, views.H)])
    for collection in solved.collections.values():
        found = pose(collection, solved.graph, sensor.edge.parent, sensor.frame)
        np.testing.assert_allclose(found, X, atol=1e-12)
        np.testing.assert_allclose(collection.transforms[board_edge(board)], seen, atol=1e-12)


def test_a_result_between_other_frames_is_carried_to_the_edges(dataset):
    truth, key = SCENES["camera moves"](2, collections=5, noise=Noise.none()).truth, "000"
    sides = Sides("rgb_1_link", "rig_base")
    views = hand_eye_views(dataset, CAMERA, BOARD, sides)
    X = pose(dataset.collections[key], dataset.graph, "rgb_1_link", "rgb_1_optical_frame")
    solved = with_hand_eye(dataset, CAMERA, BOARD, views, X)
    edge = dataset.sensors[CAMERA].edge
    np.testing.assert_allclose(solved.first_value(edge), dataset.first_value(edge), atol=1e-12)
    board = solved.first_value(board_edge(dataset.patterns[BOARD]))
    np.testing.assert_allclose(board, truth.boards[BOARD, key], atol=1e-5)


def test_frames_are_taken_from_the_first_collection_of_the_views(dataset):
    edge = Edge("flange", "beside")
    sided = dataset.with_transforms(
        {k: {edge: turned(move=(float(k), 0, 0))} for k in dataset.collections}
    )
    views = HandEyeViews(
        Sides("beside", "world"),
        "rgb_1_optical_frame",
        ["003", "001"],
        [np.eye(4)],
        [np.eye(4)],
    )
    solved = with_hand_eye(sided, CAMERA, BOARD, views, np.eye(4))
    collection = solved.collections["003"]
    found = pose(collection, solved.graph, "beside", "rgb_1_optical_frame")
    np.testing.assert_allclose(found, np.eye(4), atol=1e-12)


# ---- means


def test_the_mean_pose_is_halfway_on_one_axis():
    one, other = turned(0, 0, 0.2, move=(1, 2, 3)), turned(0, 0, 0.6, move=(3, 0, 4))
    wanted = turned(0, 0, 0.4, move=(2, 1, 3.5))
    np.testing.assert_allclose(mean_pose([one, other]), wanted, atol=1e-12)
    np.testing.assert_allclose(mean_pose([other, one]), wanted, atol=1e-12)


def test_the_mean_of_poses_is_a_rotation_and_turns_with_them():
    rng = np.random.default_rng(3)
    poses = [se3.random_move(1.0, 0.7, rng) for _ in range(5)]
    mean = mean_pose(poses)
    np.testing.assert_allclose(mean[:3, :3].T @ mean[:3, :3], np.eye(3), atol=1e-12)
    assert np.linalg.det(mean[:3, :3]) == pytest.approx(1.0)
    move = se3.random_move(1.0, 2.0, rng)
    np.testing.assert_allclose(mean_pose([move @ p for p in poses]), move @ mean, atol=1e-12)


def test_the_mean_is_a_rotation_even_of_half_turns_about_three_axes():
    half_turns = [turned(*(np.pi * axis)) for axis in np.eye(3)]
    mean = mean_pose(half_turns)  # the rotations add up to minus the unit matrix
    assert np.linalg.det(mean[:3, :3]) == pytest.approx(1.0)
