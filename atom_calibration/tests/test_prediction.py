"""Predicted seeds: near with the first estimate, nearer with every board seen."""

import numpy as np
import pytest

from atom_calibration.prediction import BoardPredictor
from atom_calibration.tf_snapshot import TransformTree
from atom_core.geometry import se3
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
    """Let the camera see a board somewhere; return where its middle truly is for the LiDAR."""
    camera_T_pattern = se3.transform(
        se3.random_rotation(0.5, rng), rng.uniform(-1, 1, 3) + [0, 0, 2]
    )
    predictor.see(CAMERA.frame, PATTERN.name, stamp_s, camera_T_pattern, tree)
    middle = np.append(PATTERN.border.centre, 0.0)[None]
    lidar_T_pattern = se3.inverse(WORLD_T_LIDAR) @ WORLD_T_CAMERA @ camera_T_pattern
    return se3.apply(lidar_T_pattern, middle)[0]


def test_the_error_shrinks_from_decimetres_to_what_labels_leave(tree):
    rng, predictor, errors = np.random.default_rng(1), BoardPredictor("world"), []
    for number in range(30):
        true = show(predictor, tree, float(number), rng)
        predicted = predictor.predict(LIDAR, PATTERN, float(number), tree)
        assert predictor.is_plausible(LIDAR, predicted, true)
        errors.append(np.linalg.norm(predicted - true))
        label = true + rng.normal(size=3) * 0.03  # parts of the board are hidden
        predictor.learn(LIDAR, PATTERN, float(number), label, tree)
    assert errors[0] > 0.1
    assert np.mean(errors[10:]) < 0.05


def test_a_thing_elsewhere_is_not_plausible(tree):
    predictor = BoardPredictor("world")
    true = show(predictor, tree, 0.0, np.random.default_rng(2))
    predicted = predictor.predict(LIDAR, PATTERN, 0.0, tree)
    assert not predictor.is_plausible(LIDAR, predicted, true + [2.0, 0.0, 0.0])


def test_one_false_label_among_many_is_no_harm(tree):
    rng, predictor = np.random.default_rng(3), BoardPredictor("world")
    for number in range(20):
        true = show(predictor, tree, float(number), rng)
        wrong = np.array([0.5, -0.5, 0.5]) if number == 7 else 0.0
        predictor.learn(LIDAR, PATTERN, float(number), true + wrong, tree)
    true = show(predictor, tree, 99.0, rng)
    assert np.linalg.norm(predictor.predict(LIDAR, PATTERN, 99.0, tree) - true) < 0.02


def test_without_a_fresh_sight_there_is_no_prediction(tree):
    predictor = BoardPredictor("world")
    assert predictor.predict(LIDAR, PATTERN, 0.0, tree) is None
    show(predictor, tree, 0.0, np.random.default_rng(4))
    assert predictor.predict(LIDAR, PATTERN, 9.0, tree) is None
    assert predictor.predict(LIDAR, PATTERN, 0.1, TransformTree()) is None
