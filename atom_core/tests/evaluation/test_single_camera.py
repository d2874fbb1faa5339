"""Each camera by itself: which pose its boards have, what is told of the calibration, and when."""

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from atom_core.errors import DatasetError
from atom_core.evaluation.board_pose import board_pose
from atom_core.evaluation.observed import Observed
from atom_core.evaluation.single_camera import single_cameras
from atom_core.geometry import se3
from atom_core.model.dataset import board_edge, pose
from atom_core.model.labels import DetectionKey
from atom_core.model.transforms import Edge
from atom_core.synthetic import Noise
from atom_core.synthetic.scenes import hand_eye, random_scene, two_cameras, two_patterns

BOARD = "pattern_1"


@pytest.fixture(scope="module")
def exact():
    return hand_eye(0, collections=4, noise=Noise.none())


@pytest.fixture(scope="module")
def noisy():
    return hand_eye(1, collections=4)


@pytest.fixture(scope="module")
def by_hand():
    """Two cameras that stand, and a board that is moved by hand."""
    return two_cameras(0, collections=4)


def single(dataset, **more):
    (found,) = single_cameras(dataset, Observed(dataset), **more)
    return found


def off(dataset, sensor="rgb_1"):
    """Return the dataset with a camera's edge off by a centimetre and a degree."""
    edge = dataset.sensors[sensor].edge
    wrong = se3.moved(
        dataset.first_value(edge), se3.random_move(0.01, 0.0175, np.random.default_rng(0))
    )
    return dataset.with_transforms(dict.fromkeys(dataset.collections, {edge: wrong}))


def with_few_corners(dataset, key, count=3):
    label = dataset.label(key)
    few = replace(label, ids=label.ids[:count], pixels=label.pixels[:count])
    return dataset.with_labels(key.collection, {(key.sensor, key.pattern): few})


def with_board(dataset, world_T_board, keys=None):
    edge = board_edge(dataset.patterns[BOARD])
    keys = dataset.collections if keys is None else keys
    return dataset.with_transforms({key: {edge: world_T_board} for key in keys})


def offsets_px(dataset, key, parent_T_board):
    """Return projected minus detected corners (n, 2) by the camera's formula."""
    sensor, pattern, label = (
        dataset.sensors[key.sensor],
        dataset.patterns[key.pattern],
        dataset.label(key),
    )
    camera_T_parent = pose(
        dataset.collections[key.collection], dataset.graph, sensor.frame, pattern.parent_frame
    )
    corners = np.column_stack([pattern.corners_by_id[label.ids], np.zeros(len(label.ids))])
    points = se3.apply(camera_T_parent @ parent_T_board, corners)
    return sensor.camera.project(points) - label.pixels


def rms_px(offsets):
    return np.sqrt(np.mean(np.sum(offsets**2, axis=1)))


# -------------------------------------------------------------------------- a board that stands


def test_without_noise_the_true_calibration_leaves_no_error(exact):
    found = single(exact.dataset)
    assert (found.sensor, found.pattern) == ("rgb_1", BOARD)
    assert found.one_pose and found.tells_of_calibration
    assert found.measured.pooled.rms < 1e-3
    assert found.at_truth is None and found.skipped is None


def test_a_camera_that_is_off_shows_and_its_labels_are_judged_by_the_truth_beside(noisy):
    wrong = off(noisy.dataset)
    found = single(wrong, true=noisy.dataset)
    at_truth = single(noisy.dataset)
    assert found.at_truth.per_collection == at_truth.measured.per_collection
    assert 0.2 < found.at_truth.rms < 0.6  # two numbers with 0.3 px each
    assert found.measured.rms > 2.0 * found.at_truth.rms


def test_the_board_s_own_pose_is_fitted_to_all_images_together(noisy):
    """No other pose of the board, the true one neither, has a smaller error."""
    dataset, truth = noisy.dataset, noisy.truth.boards[BOARD, "000"]
    every = [offsets_px(dataset, key, truth) for key, _ in dataset.detections()]
    found = single(dataset).measured.pooled
    assert found.points == sum(len(offsets) for offsets in every)
    assert 0.5 * rms_px(np.concatenate(every)) < found.rms < rms_px(np.concatenate(every))


def test_boards_that_are_given_are_taken_as_they_are(noisy):
    dataset = noisy.dataset
    shift = se3.transform(np.eye(3), np.array([0.02, 0.0, 0.0]))
    board = shift @ noisy.truth.boards[BOARD, "000"]
    found = single(dataset, boards=with_board(dataset, board)).measured
    for key, _ in dataset.detections():
        offsets = offsets_px(dataset, key, board)
        figures = found.per_collection[key.collection]
        assert figures.rms == pytest.approx(rms_px(offsets), abs=1e-3)
        along = np.mean(np.abs(offsets), axis=0)
        assert (figures.x_mean_abs, figures.y_mean_abs) == pytest.approx(along, abs=1e-3)
        assert figures.points == len(offsets)
    assert found.rms > 3.0


def test_boards_that_are_given_do_not_enter_what_the_truth_says(noisy):
    shift = se3.transform(np.eye(3), np.array([0.02, 0.0, 0.0]))
    boards = with_board(noisy.dataset, shift @ noisy.truth.boards[BOARD, "000"])
    found = single(noisy.dataset, true=noisy.dataset, boards=boards)
    assert found.at_truth.rms < 0.6 < found.measured.rms


def test_given_boards_without_the_pose_are_refused(noisy):
    with pytest.raises(DatasetError, match="there is no transform 'world-pattern_link'.*-cpt out"):
        single(noisy.dataset, boards=noisy.dataset)


def test_one_collection_of_the_given_boards_is_enough(noisy):
    board = noisy.truth.boards[BOARD, "000"]
    last = with_board(noisy.dataset, board, ["003"])
    everywhere = with_board(noisy.dataset, board)
    dataset = noisy.dataset
    assert single(dataset, boards=last).measured == single(dataset, boards=everywhere).measured


@pytest.mark.parametrize(
    "shift_m, is_refused", [(0.9e-9, False), (1e-9, False), (1.1e-9, True), (-1.1e-9, True)]
)
def test_given_boards_in_several_places_are_refused_from_a_nanometre_on(noisy, shift_m, is_refused):
    board = noisy.truth.boards[BOARD, "000"].copy()
    board[:3, 3] = 0.0  # so that the shift is exact
    moved = board.copy()
    moved[1, 3] = shift_m
    boards = with_board(with_board(noisy.dataset, board), moved, ["002"])
    if is_refused:
        with pytest.raises(DatasetError, match="pattern 'pattern_1' is in several places"):
            single(noisy.dataset, boards=boards)
    else:
        assert single(noisy.dataset, boards=boards).measured is not None


def test_an_image_that_does_not_tell_a_pose_is_left_out_and_later_ones_are_measured(noisy):
    second = DetectionKey("001", "rgb_1", BOARD)
    found = single(with_few_corners(noisy.dataset, second))
    assert list(found.measured.per_collection) == ["000", "002", "003"]
    assert found.skipped is None


def test_a_camera_that_never_tells_a_pose_is_skipped_with_the_reason(noisy):
    dataset = noisy.dataset
    for key, _ in dataset.detections():
        dataset = with_few_corners(dataset, key)
    found = single(dataset, true=dataset)
    assert found.measured is None and found.at_truth is None
    assert found.one_pose and found.tells_of_calibration
    why = "the corners of 'rgb_1' do not determine the board's pose in any collection"
    assert found.skipped == why


def standing_still(scene):
    """Return the test set as if the arm had not moved: one image four times."""
    first = next(iter(scene.dataset.collections.values()))
    same = {key: replace(first, key=key) for key in scene.dataset.collections}
    return replace(scene.dataset, collections=same)


def test_where_neither_moves_the_calibration_does_not_enter(noisy):
    still = standing_still(noisy)
    found = single(off(still), true=still)
    assert found.one_pose and not found.tells_of_calibration
    assert found.at_truth is None
    assert found.measured.rms == pytest.approx(single(still).measured.rms, abs=1e-6)


# --------------------------------------------------------------------- a board moved by hand


def test_a_board_moved_by_hand_has_the_pose_of_each_image_s_own_corners(by_hand):
    seen = Observed(by_hand.dataset)
    for found in single_cameras(by_hand.dataset, seen):
        assert not found.one_pose and not found.tells_of_calibration
        for collection, figures in found.measured.per_collection.items():
            key = DetectionKey(collection, found.sensor, BOARD)
            assert figures.rms == pytest.approx(board_pose(seen.corners(key)).rms_px, rel=1e-6)


def test_a_camera_s_place_does_not_enter_where_the_board_is_moved_by_hand(by_hand):
    seen = Observed(by_hand.dataset)
    wrong = single_cameras(off(by_hand.dataset, "rgb_2"), seen, true=by_hand.dataset)
    for found, right in zip(wrong, single_cameras(by_hand.dataset, seen)):
        assert found.measured.rms == pytest.approx(right.measured.rms, rel=1e-9)
        assert found.at_truth is None


def test_boards_that_are_given_are_not_asked_where_the_board_is_moved_by_hand(by_hand):
    seen = Observed(by_hand.dataset)
    assert len(single_cameras(by_hand.dataset, seen, boards=by_hand.dataset)) == 2


# ------------------------------------------------------------------------- which are measured


def test_a_sensor_that_is_no_rgb_camera_is_passed_over_and_those_behind_it_are_measured():
    dataset = random_scene(0, rgb=2, depth=1, lidar3d=0, collections=2, noise=Noise.none()).dataset
    order = ["depth_1", "rgb_2", "rgb_1"]
    dataset = replace(dataset, sensors={name: dataset.sensors[name] for name in order})
    found = single_cameras(dataset, Observed(dataset))
    assert [one.sensor for one in found] == ["rgb_2", "rgb_1"]


def test_each_camera_is_measured_with_each_pattern_that_it_detects():
    dataset = two_patterns(0, collections=2, noise=Noise.none()).dataset
    found = single_cameras(dataset, Observed(dataset))
    pairs = [("rgb_1", "left"), ("rgb_2", "left"), ("rgb_2", "right")]
    assert [(one.sensor, one.pattern) for one in found] == pairs
    for one in found:
        assert {row.pattern for row in one.measured.rows} == {one.pattern}
        assert one.measured.rms < 1e-3


def test_without_collections_there_is_nothing_to_measure(exact):
    assert single_cameras(exact.dataset.selected(collections=[]), Observed(exact.dataset)) == []


def test_a_single_collection_of_a_fixed_board_tells_nothing_of_the_calibration(exact):
    dataset = exact.dataset.selected(collections=["002"])
    assert Edge("world", "pattern_link") == board_edge(dataset.patterns[BOARD])
    found = single(off(dataset), true=dataset)
    assert not found.tells_of_calibration and found.at_truth is None
    assert found.measured.rms < 1e-3


def test_a_result_stays_as_it_was_made(exact):
    found = single(exact.dataset)
    with pytest.raises(FrozenInstanceError):
        found.skipped = "never mind"
