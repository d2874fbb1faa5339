"""A camera on a real arm before a chessboard that stands still (ViSP's tutorial on eye-in-hand).

Eight pictures; the arm's poses are wrong by millimetres.
"""

from pathlib import Path

import cv2
import numpy as np
import yaml

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.labeling.rgb import RgbLabeler
from atom_core.model.config import CalibrationConfig
from atom_core.model.config_entries import PatternConfig, SensorConfig
from atom_core.model.dataset import Collection, Dataset
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import Sensor
from atom_core.model.transforms import Edge

FOLDER = "visp_eye_in_hand"
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


def arm_pose(path: Path) -> np.ndarray:
    """Return the arm's pose (4, 4) that a file holds."""
    x = np.array(yaml.safe_load(path.read_text(encoding="utf-8"))["data"], dtype=float).ravel()
    return se3.transform(se3.rotation_from_rotation_vector(x[3:]), x[:3])


def real_arm(folder: Path) -> Dataset:
    """Label the pictures of a folder and return the dataset; its camera starts in the flange."""
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
