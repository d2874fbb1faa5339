"""A camera on a real arm whose poses are wrong by millimetres (ViSP's tutorial on eye-in-hand)."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.labeling.rgb import RgbLabeler
from atom_core.model.config import CalibrationConfig
from atom_core.model.config_entries import PatternConfig, SensorConfig
from atom_core.model.dataset import Collection, Dataset
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import Sensor
from atom_core.model.transforms import Edge
from atom_core.report.calibration_results import calibration_results

K = np.array(
    [
        [607.5931396484375, 0, 323.46282958984375],
        [0, 607.574951171875, 243.25529479980469],
        [0, 0, 1],
    ]
)
HAND, EYE, BOARD = Edge("base", "flange"), Edge("flange", "camera"), Edge("base", "board")
# The answer that is published with the pictures; its residual is 0.456 deg and 5.41 mm.
PUBLISHED = se3.transform(
    se3.rotation_from_rotation_vector(np.array([0.001784, 0.009174, 1.581782])),
    np.array([0.057715, -0.033925, -0.042277]),
)


def arm_pose(path):
    x = np.array(yaml.safe_load(path.read_text(encoding="utf-8"))["data"], dtype=float).ravel()
    return se3.transform(se3.rotation_from_rotation_vector(x[3:]), x[:3])


@pytest.fixture(scope="module")
def dataset(real_data):
    folder = real_data("visp_eye_in_hand")
    pattern_config = PatternConfig("board", "base", True, "chessboard", (9, 6), 0.0236, 0.02)
    sensor_config = SensorConfig("camera", "flange", "camera", "/camera/image_raw", "rgb")
    config = CalibrationConfig("base", {"camera": sensor_config}, {"board": pattern_config})
    camera = Camera(640, 480, K, np.zeros(0), "none")
    sensor = Sensor("camera", "rgb", "camera", EYE, camera)
    pattern = pattern_from_config("board", pattern_config)
    labeler, collections = RgbLabeler(sensor, pattern, pattern_config), {}
    for i in range(1, 9):
        image = cv2.imread(str(folder / f"franka_image-{i}.png"))
        labeled = labeler.label(image)
        assert labeled.label.detected, (i, labeled.reason)
        transforms = {HAND: arm_pose(folder / f"franka_pose_rPe_{i}.yaml"), EYE: np.eye(4)}
        key = f"{i:03d}"
        collections[key] = Collection(key, {("camera", "board"): labeled.label}, transforms)
    return Dataset(Path("visp"), config, {"camera": sensor}, {"board": pattern}, collections)


@pytest.mark.parametrize("guess", ["none", "description"])
def test_the_arm_is_named_and_the_published_answer_within_two_sigmas(dataset, guess):
    result = calibrate(dataset, CalibrationOptions(initial_guess=guess))
    (edge,) = [e for e in calibration_results(result, "ceres").edges if e.edge == EYE]
    off = edge.parent_T_child[:3, 3] - PUBLISHED[:3, 3]
    turn = se3.rotation_vector_from_rotation(edge.parent_T_child[:3, :3] @ PUBLISHED[:3, :3].T)
    assert result.status == "inconsistent"
    assert result.message.startswith("the poses of 'flange' in 'base' do not fit")
    (found,) = result.moving
    # The published residual is the length of three of each.
    assert found.sigma_m * np.sqrt(3.0) == pytest.approx(0.00541, rel=0.3)
    assert np.degrees(found.sigma_rad) * np.sqrt(3.0) == pytest.approx(0.456, rel=0.3)
    assert np.all(np.abs(off) < 2.0 * edge.sigma_translation_m)
    assert np.all(np.abs(turn) < 2.0 * edge.sigma_rotation_rad)


@pytest.mark.parametrize("wanted", ["asked for", "auto"])
def test_with_room_for_the_arm_the_published_answer_is_within_two_sigmas(dataset, wanted):
    options = (
        CalibrationOptions(model_errors="auto")
        if wanted == "auto"
        else CalibrationOptions(moving_edge_sigma={"flange": None})
    )
    result = calibrate(dataset, options)
    (edge,) = [e for e in calibration_results(result, "ceres").edges if e.edge == EYE]
    off = edge.parent_T_child[:3, 3] - PUBLISHED[:3, 3]
    turn = se3.rotation_vector_from_rotation(edge.parent_T_child[:3, :3] @ PUBLISHED[:3, :3].T)
    assert (result.status, result.moving) == ("converged", ())
    part = result.free.moving[HAND]
    assert part.is_estimated
    assert part.sigma_m * np.sqrt(3.0) == pytest.approx(0.00541, rel=0.3)
    assert np.degrees(part.sigma_rad) * np.sqrt(3.0) == pytest.approx(0.456, rel=0.3)
    assert np.all(np.abs(off) < 2.0 * edge.sigma_translation_m)
    assert np.all(np.abs(turn) < 2.0 * edge.sigma_rotation_rad)
