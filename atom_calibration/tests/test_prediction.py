"""Predicted seeds: near with the first estimate, nearer with every board seen."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from atom_calibration.labels.frame_labeler import _vouched
from atom_calibration.labels.guess import misfit
from atom_calibration.labels.prediction import BoardPredictor
from atom_calibration.sources.transform_tree import TransformTree
from atom_core.geometry import se3
from atom_core.labeling.base import Labeled, nothing
from atom_core.labeling.line_sighting import LineSighting
from atom_core.labeling.stillness import PlaneSighting
from atom_core.model.labels import RangeLabel
from atom_core.synthetic import paper_cell

CELL = paper_cell(0, "train").dataset
PATTERN = next(iter(CELL.patterns.values()))
CAMERA, LIDAR = CELL.sensors["rgb_3"], CELL.sensors["lidar_1"]
WORLD_T_CAMERA = se3.from_rpy(np.array([0.0, 0.0, 2.0]), np.array([np.pi, 0.0, 0.0]))
WORLD_T_LIDAR = se3.from_rpy(np.array([2.0, 0.5, 1.0]), np.array([0.1, 0.2, 2.0]))


@pytest.fixture
def tree(make):
    """The first estimate: the LiDAR is 0.1 m and 0.1 rad off."""
    rng = np.random.default_rng(0)
    off = WORLD_T_LIDAR @ se3.random_move(0.1, 0.1, rng)
    tree = TransformTree()
    for sensor, pose in ((CAMERA, WORLD_T_CAMERA), (LIDAR, off)):
        tree.add(make.tf("world", sensor.frame, pose).transforms, fixed=True)
    return tree


def show(predictor, tree, stamp_s, rng):
    """Let the camera see a board somewhere; return its true pose for the LiDAR."""
    camera_T_pattern = se3.transform(
        se3.random_rotation(0.5, rng), rng.uniform(-1, 1, 3) + [0, 0, 2]
    )
    predictor.see(CAMERA.frame, PATTERN, stamp_s, camera_T_pattern, tree)
    return se3.inverse(WORLD_T_LIDAR) @ WORLD_T_CAMERA @ camera_T_pattern


def middle(lidar_T_pattern):
    return se3.apply(lidar_T_pattern, np.append(PATTERN.border.centre, 0.0)[None])[0]


def label(lidar_T_pattern, rng, beside_m=0.15):
    """Return the plane that a label of part of the board shows, from either side."""
    along = lidar_T_pattern[:3, :2] @ rng.uniform(-beside_m, beside_m, 2)
    normal = lidar_T_pattern[:3, 2] + 0.01 * rng.normal(size=3)
    normal *= rng.choice([-1, 1]) / np.linalg.norm(normal)
    centre = middle(lidar_T_pattern) + along + 0.005 * rng.normal(size=3)
    return PlaneSighting(centre, normal, 0.25, 0.01, 300, 15.0)


def cut(lidar_T_pattern, rng, beside_m=0.15):
    """Return the line that a label of a 2D LiDAR shows; scans have all directions here."""
    plane = label(lidar_T_pattern, rng, beside_m)
    direction = np.cross(plane.normal, rng.normal(size=3))
    direction /= np.linalg.norm(direction)
    return LineSighting(plane.centre, direction, np.array([-0.3, 0.3]), 0.17, 0.01, 0.01, 60)


def stand_still(predictor, tree, stamp_s, rng):
    """Let the camera see a board twice, so that it is known to stand still."""
    state = rng.bit_generator.state
    show(predictor, tree, stamp_s - 0.5, rng)
    rng.bit_generator.state = state
    return show(predictor, tree, stamp_s, rng)


@pytest.mark.parametrize("shown", [label, cut])
def test_the_error_shrinks_from_decimetres_to_centimetres_within_a_few_places(tree, shown):
    rng, predictor, errors = np.random.default_rng(1), BoardPredictor("world"), []
    for number in range(30):
        stamp_s = 5.0 * number
        true = stand_still(predictor, tree, stamp_s, rng)
        guess = predictor.predict(LIDAR, PATTERN, stamp_s, tree)
        found = shown(true, rng)
        assert guess.agrees(found)
        errors.append(np.linalg.norm(guess.middle - middle(true)))
        predictor.learn(LIDAR, PATTERN, stamp_s, found, tree)
    assert errors[0] > 0.1
    assert np.mean(errors[10:]) < 0.03


def test_a_cut_elsewhere_or_across_is_not_the_boards(tree):
    rng, predictor = np.random.default_rng(2), BoardPredictor("world")
    true = stand_still(predictor, tree, 0.0, rng)
    guess, found = predictor.predict(LIDAR, PATTERN, 0.0, tree), cut(true, rng)
    assert guess.agrees(found)
    assert not guess.agrees(replace(found, direction=true[:3, 2]))
    assert not guess.agrees(replace(found, centre=found.centre + 2.5 * true[:3, 2]))
    assert not guess.agrees(replace(found, centre=found.centre + 2.5 * found.direction))


@pytest.mark.parametrize("shown", [label, cut])
def test_the_misfit_changes_as_its_derivative_says(shown):
    rng = np.random.default_rng(8)
    for _ in range(20):
        pose = se3.transform(se3.random_rotation(0.5, rng), rng.uniform(-1, 1, 3) + [0, 0, 2])
        found = shown(pose @ se3.random_move(0.05, 0.05, rng), rng)
        if isinstance(found, LineSighting) and abs(found.direction @ pose[:3, 2]) > 0.9:
            continue
        before = misfit(middle(pose), pose[:3, 2], found)
        numeric = np.zeros_like(before.jacobian)
        for column, step in enumerate(1e-6 * np.eye(6)):
            moved = [
                se3.transform(se3.rotation_from_rotation_vector(s * step[:3]), s * step[3:]) @ pose
                for s in (1, -1)
            ]
            plus, minus = (misfit(middle(m), m[:3, 2], found).numbers for m in moved)
            numeric[:, column] = (plus - minus) / 2e-6
        known = before.directions + 1  # beside, it is taken as if the axes stood still
        np.testing.assert_allclose(before.jacobian[:known], numeric[:known], atol=2e-2)


def test_a_thing_elsewhere_or_slanted_otherwise_is_not_the_board(tree):
    rng, predictor = np.random.default_rng(2), BoardPredictor("world")
    true = stand_still(predictor, tree, 0.0, rng)
    guess = predictor.predict(LIDAR, PATTERN, 0.0, tree)
    found = label(true, rng)
    elsewhere = replace(found, centre=found.centre + [2.5, 0.0, 0.0])
    across = np.cross(found.normal, [1.0, 0.0, 0.0])
    slanted = replace(found, normal=across / np.linalg.norm(across))
    assert guess.agrees(found)
    assert not guess.agrees(elsewhere)
    assert not guess.agrees(slanted)


def test_what_was_learnt_tells_the_board_from_a_thing_beside_it(tree):
    rng, predictor = np.random.default_rng(6), BoardPredictor("world")
    for number in range(6):
        true = stand_still(predictor, tree, 5.0 * number, rng)
        predictor.learn(LIDAR, PATTERN, 5.0 * number, label(true, rng), tree)
    true = stand_still(predictor, tree, 99.0, rng)
    guess, found = predictor.predict(LIDAR, PATTERN, 99.0, tree), label(true, rng)
    turn = se3.rotation_from_rotation_vector(0.35 * np.cross(found.normal, [0.0, 0.0, 1.0]))
    assert guess.agrees(found)
    assert not guess.agrees(replace(found, normal=turn @ found.normal))
    assert not guess.agrees(replace(found, centre=found.centre + 0.3 * found.normal))


def test_what_the_view_cuts_is_taken_where_an_exact_prediction_has_the_board(tree):
    rng, predictor = np.random.default_rng(6), BoardPredictor("world")
    true = stand_still(predictor, tree, 0.0, rng)
    found = label(true, rng)
    doubtful = nothing(LIDAR.modality, "the view cuts it", unsure=some_label())

    def taken(guess, seen):
        frame = SimpleNamespace(ros=SimpleNamespace(sighting=lambda frame, label: seen))
        return _vouched(frame, doubtful, guess).detected

    first = predictor.predict(LIDAR, PATTERN, 0.0, tree)
    assert first.agrees(found) and not taken(first, found)  # known to decimetres
    for number in range(6):
        true = stand_still(predictor, tree, 5.0 * number, rng)
        predictor.learn(LIDAR, PATTERN, 5.0 * number, label(true, rng), tree)
    true = stand_still(predictor, tree, 99.0, rng)
    guess, found = predictor.predict(LIDAR, PATTERN, 99.0, tree), label(true, rng)
    assert taken(guess, found)
    assert not taken(guess, replace(found, centre=found.centre + 0.3 * found.normal))
    assert not taken(None, found)


def some_label():
    return Labeled(RangeLabel(np.arange(3), np.arange(1)))


def test_one_false_label_among_many_is_no_harm(tree):
    rng, predictor = np.random.default_rng(3), BoardPredictor("world")
    for number in range(20):
        stamp_s = 5.0 * number
        found = label(stand_still(predictor, tree, stamp_s, rng), rng)
        if number == 2:
            found = replace(found, centre=found.centre + [0.4, -0.4, 0.4])
        predictor.learn(LIDAR, PATTERN, stamp_s, found, tree)
    true = stand_still(predictor, tree, 999.0, rng)
    guess = predictor.predict(LIDAR, PATTERN, 999.0, tree)
    assert np.linalg.norm(guess.middle - middle(true)) < 0.03


def test_nothing_is_learnt_from_a_board_in_motion(tree):
    rng, predictor = np.random.default_rng(5), BoardPredictor("world")
    show(predictor, tree, 0.0, rng)
    true = show(predictor, tree, 0.5, rng)
    before = predictor.predict(LIDAR, PATTERN, 0.9, tree)
    predictor.learn(LIDAR, PATTERN, 0.9, label(true, rng), tree)
    after = predictor.predict(LIDAR, PATTERN, 0.9, tree)
    assert before.drift_m > 0.1
    assert np.array_equal(before.middle, after.middle)


def test_without_a_fresh_sight_there_is_no_prediction(tree):
    predictor = BoardPredictor("world")
    assert predictor.predict(LIDAR, PATTERN, 0.0, tree) is None
    show(predictor, tree, 0.0, np.random.default_rng(4))
    assert predictor.predict(LIDAR, PATTERN, 9.0, tree) is None
    assert predictor.predict(LIDAR, PATTERN, 0.1, TransformTree()) is None


# ------------------------------------------------------------ transforms that are wholly wrong


@pytest.fixture
def wrong_tree(make):
    """The LiDAR is given the camera's place: metres away, and turned by a right angle and more."""
    tree = TransformTree()
    for sensor in (CAMERA, LIDAR):
        tree.add(make.tf("world", sensor.frame, WORLD_T_CAMERA).transforms, fixed=True)
    return tree


@pytest.mark.parametrize("seed", range(4))
def test_labels_that_all_contradict_the_transforms_alike_are_believed(wrong_tree, seed):
    rng, predictor = np.random.default_rng(seed), BoardPredictor("world")
    off_m = []
    for number in range(12):
        stamp_s = 5.0 * number
        true = stand_still(predictor, wrong_tree, stamp_s, rng)
        guess = predictor.predict(LIDAR, PATTERN, stamp_s, wrong_tree)
        found = label(true, rng)
        if predictor.relocated:
            assert guess.agrees(found)
        off_m.append(np.linalg.norm(guess.middle - middle(true)))
        predictor.learn(LIDAR, PATTERN, stamp_s, found, wrong_tree)
    assert min(off_m[:5]) > 0.5 and max(off_m[-4:]) < 0.12
    assert "'lidar_1' is not where the transforms have it" in predictor.relocated["lidar_1"]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("seed", range(4))
def test_other_things_that_contradict_them_are_not(tree, seed):
    rng, predictor = np.random.default_rng(seed), BoardPredictor("world")
    for number in range(40):
        stamp_s = 5.0 * number
        stand_still(predictor, tree, stamp_s, rng)
        elsewhere = se3.transform(se3.random_rotation(3.0, rng), rng.uniform(-3, 3, 3))
        predictor.learn(LIDAR, PATTERN, stamp_s, label(elsewhere, rng), tree)
    assert not predictor.relocated


def test_one_thing_that_stands_still_is_no_common_motion(tree):
    rng, predictor = np.random.default_rng(3), BoardPredictor("world")
    thing = se3.transform(se3.random_rotation(1.0, rng), np.array([3.0, 2.0, 0.0]))
    for number in range(20):
        stand_still(predictor, tree, 5.0 * number, rng)
        predictor.learn(LIDAR, PATTERN, 5.0 * number, label(thing, rng, 0.02), tree)
    assert not predictor.relocated


SECOND = CELL.sensors["rgb_2"]
WORLD_T_SECOND = se3.from_rpy(np.array([0.5, -0.4, 2.1]), np.array([np.pi, 0.3, 0.4]))


@pytest.fixture
def identity_tree(make):
    """All sensors are given the same place."""
    tree = TransformTree()
    for sensor in (CAMERA, SECOND, LIDAR):
        tree.add(make.tf("world", sensor.frame, np.eye(4)).transforms, fixed=True)
    return tree


def shown_to(predictor, tree, stamp_s, world_T_pattern, cameras):
    """Let cameras see a board twice; return its true pose for the LiDAR."""
    for at_s in (stamp_s - 0.5, stamp_s):
        for sensor in cameras:
            world_T_camera = WORLD_T_CAMERA if sensor is CAMERA else WORLD_T_SECOND
            seen = se3.inverse(world_T_camera) @ world_T_pattern
            predictor.see(sensor.frame, PATTERN, at_s, seen, tree)
    return se3.inverse(WORLD_T_LIDAR) @ world_T_pattern


def boards(rng, count):
    return [
        WORLD_T_CAMERA
        @ se3.transform(se3.random_rotation(0.5, rng), rng.uniform(-1, 1, 3) + [0, 0, 2])
        for _ in range(count)
    ]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("both", [True, False])
def test_boards_of_two_cameras_count_together_where_they_saw_one_at_once(identity_tree, seed, both):
    rng, predictor = np.random.default_rng(seed), BoardPredictor("world")
    for number, world_T_pattern in enumerate(boards(rng, 8)):
        cameras = [CAMERA] if number < 4 else [SECOND]
        cameras = [CAMERA, SECOND] if both and number == 3 else cameras
        true = shown_to(predictor, identity_tree, 5.0 * number, world_T_pattern, cameras)
        predictor.learn(LIDAR, PATTERN, 5.0 * number, label(true, rng), identity_tree)
    assert ("lidar_1" in predictor.relocated) is both  # four boards of one camera are too few
    if not both:
        return
    for cameras in ([CAMERA], [SECOND]):
        (board,) = boards(rng, 1)
        true = shown_to(predictor, identity_tree, 99.0 + len(cameras[0].name), board, cameras)
        guess = predictor.predict(LIDAR, PATTERN, 99.0 + len(cameras[0].name), identity_tree)
        assert guess.agrees(label(true, rng))
        predictor.forget_sights()


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("wrong", [0, 1])
def test_three_boards_are_enough_at_the_end_if_all_agree(identity_tree, seed, wrong):
    rng, predictor = np.random.default_rng(seed), BoardPredictor("world")
    for number, world_T_pattern in enumerate(boards(rng, 3 + wrong)):
        true = shown_to(predictor, identity_tree, 5.0 * number, world_T_pattern, [CAMERA])
        found = label(true, rng)
        if number == 3:
            found = replace(found, centre=found.centre + [1.5, -1.0, 0.5])
        predictor.learn(LIDAR, PATTERN, 5.0 * number, found, identity_tree)
    assert not predictor.relocated
    predictor.settle()
    assert ("lidar_1" in predictor.relocated) is (wrong == 0)


@pytest.mark.parametrize("seed", range(12))
def test_a_few_other_things_are_not_believed_at_the_end(tree, seed):
    rng, predictor = np.random.default_rng(seed), BoardPredictor("world")
    for number in range(3):
        stamp_s = 5.0 * number
        stand_still(predictor, tree, stamp_s, rng)
        elsewhere = se3.transform(se3.random_rotation(3.0, rng), rng.uniform(-3, 3, 3))
        predictor.learn(LIDAR, PATTERN, stamp_s, label(elsewhere, rng), tree)
    predictor.settle()
    assert not predictor.relocated


def test_a_camera_that_moves_otherwise_than_the_transforms_say_is_not_linked(identity_tree):
    rng, predictor = np.random.default_rng(0), BoardPredictor("world")
    for number, world_T_pattern in enumerate(boards(rng, 8)):
        elsewhere = se3.random_move(0.4, 0.4, rng) @ world_T_pattern
        for at_s in (5.0 * number - 0.5, 5.0 * number):
            for sensor, pose in ((CAMERA, world_T_pattern), (SECOND, elsewhere)):
                predictor.see(sensor.frame, PATTERN, at_s, pose, identity_tree)
    assert predictor._links.linked_with(CAMERA.frame) == [SECOND.frame]
    assert predictor._links.between(CAMERA.frame, SECOND.frame) is None
