"""How far a board that stays is turned, from one collection to another."""

import numpy as np
import pytest

from atom_core.evaluation.board_pose import board_pose, turn_variance
from atom_core.evaluation.evaluate import evaluate
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.dataset import pose
from atom_core.model.labels import DetectionKey
from atom_core.problem.corner_measurement import CornerMeasurement
from atom_core.report.evaluation_verdict import evaluation_verdict
from atom_core.report.verdict import GOOD, WEAK, WRONG
from atom_core.synthetic import scenes


def evaluated(scene, turn_deg=0.0):
    """Evaluate the true calibration, its camera turned about its optical axis."""
    (sensor,) = scene.dataset.sensors.values()
    first = next(iter(scene.dataset.collections.values()))
    link_T_camera = pose(first, scene.dataset.graph, sensor.edge.child, sensor.frame)
    turn = se3.from_rpy(np.zeros(3), np.array([0.0, 0.0, np.radians(turn_deg)]))
    moved = scene.truth.edges[sensor.edge] @ link_T_camera @ turn @ se3.inverse(link_T_camera)
    edges = {**scene.truth.edges, sensor.edge: moved}
    train = scene.dataset.with_transforms(dict.fromkeys(scene.dataset.collections, edges))
    return evaluate(train, scene.dataset)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("make", [scenes.hand_eye, scenes.board_on_arm])
def test_noise_of_corners_is_no_turn(make, seed):
    scene = make(seed, collections=8)
    (spread,) = evaluated(scene).spread
    assert spread.measured.rotation_deg > 0.05
    assert np.degrees(spread.turned_rad) < 0.2


@pytest.mark.parametrize(("turn_deg", "grade"), [(0.0, GOOD), (1.5, WEAK), (6.0, WRONG)])
def test_a_camera_that_is_turned_about_its_own_axis_is_not_good(turn_deg, grade):
    """It moves no board that it looks at, and was good with a real arm."""
    verdict = evaluation_verdict(evaluated(scenes.hand_eye(1, collections=8), turn_deg))
    assert verdict.grade == grade
    assert ("turned" in verdict.sensors["rgb_1"].sentence) == (grade != GOOD)


@pytest.mark.parametrize(("distance_m", "told"), [(0.5, True), (8.0, False)])
def test_a_board_that_may_be_tilted_the_other_way_as_well_tells_no_turn(distance_m, told):
    camera = Camera(640, 480, np.array([[600.0, 0, 320], [0, 600, 240], [0, 0, 1]]), np.zeros(0))
    row, column = np.mgrid[0:5, 0:7]
    corners = 0.03 * np.column_stack([column.ravel(), row.ravel(), 0 * row.ravel()])
    tilted = se3.from_rpy(np.array([-0.1, -0.05, distance_m]), np.array([0.4, 0.0, 0.0]))
    noise_px = np.random.default_rng(0).normal(0.0, 0.2, (35, 2))
    pixels = camera.project(se3.apply(tilted, corners)) + noise_px
    key = DetectionKey("000", "camera", "board")
    seen = CornerMeasurement(key, camera, np.arange(35), corners, pixels)
    variance = turn_variance(seen, board_pose(seen))
    assert variance < np.radians(0.5) ** 2 if told else np.isinf(variance)
