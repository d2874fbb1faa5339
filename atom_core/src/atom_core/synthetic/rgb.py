"""What a camera labels: corners of a board in the image."""

from __future__ import annotations

from typing import Any, Dict, Optional

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.labels import RgbLabel
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import Sensor
from atom_core.synthetic.board import facing
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.planted import CameraErrors
from atom_core.synthetic.realism import Realism
from atom_core.synthetic.rig import Rig, camera_of
from atom_core.synthetic.sensing import Outlook, View

LARGEST_ANGLE_DEG = 75.0  # beyond it no detector finds the markers
LEAST_SHARE = 0.25  # of the corners; ATOM's rule for a valid detection
LEAST_SQUARE_PX = 12.0  # a detector loses the markers of smaller squares


def visible_corners(camera: Camera, camera_T_pattern: np.ndarray, pattern: Pattern) -> np.ndarray:
    """Return the ids (n,) of the corners that the camera sees; empty when it sees too few."""
    none = np.zeros(0, dtype=int)
    if facing(camera_T_pattern, pattern.border) < np.cos(np.radians(LARGEST_ANGLE_DEG)):
        return none
    ids = np.arange(pattern.corner_count)
    in_camera = se3.apply(camera_T_pattern, pattern.corners_of(ids))
    least = LEAST_SHARE * len(ids)
    ids = ids[camera.in_image(in_camera, margin_px=2.0)]
    if len(ids) < least:
        return none
    square_px = _square_px(camera, camera_T_pattern, in_camera[ids], pattern.square_m)
    ids = ids[square_px >= LEAST_SQUARE_PX]
    return ids if len(ids) >= least else none


def _square_px(
    camera: Camera, camera_T_pattern: np.ndarray, in_camera: np.ndarray, square_m: float
) -> np.ndarray:
    """Return the width (n,) of a square at each corner where it is most foreshortened [px]."""
    _, by_point = camera.project_with_jacobian(in_camera)
    by_xy = by_point @ camera_T_pattern[:3, :2]
    a, b, c, d = by_xy[:, 0, 0], by_xy[:, 0, 1], by_xy[:, 1, 0], by_xy[:, 1, 1]
    # smallest singular value of a 2 x 2 matrix
    return square_m * np.abs(np.hypot(a + d, b - c) - np.hypot(a - d, b + c)) / 2.0


def label_corners(
    camera: Camera,
    camera_T_pattern: np.ndarray,
    pattern: Pattern,
    noise: Noise,
    rng: np.random.Generator,
) -> Optional[RgbLabel]:
    """Return the label of a board in an image, or None when it is not detected."""
    ids = visible_corners(camera, camera_T_pattern, pattern)
    ids = ids[rng.random(len(ids)) >= noise.dropout]
    if len(ids) == 0:
        return None
    pixels = camera.project(se3.apply(camera_T_pattern, pattern.corners_of(ids)))
    return RgbLabel(ids, pixels + noise.corner_errors(len(ids), rng))


def observe(view: View) -> Dict[str, RgbLabel]:
    """Return the labels of the boards in an image, and keep what the camera looks at."""
    view.data.add_view(view.collection, view.sensor, view.sensor_T_patterns)
    camera = camera_of(view.sensor)
    labels = {
        name: label_corners(camera, pose, view.patterns[name], view.noise, view.rng)
        for name, pose in view.sensor_T_patterns.items()
    }
    return {name: label for name, label in labels.items() if label is not None}


def outlook(_: Rig, sensor: Sensor, camera_T_pattern: np.ndarray, pattern: Pattern) -> Outlook:
    """Tell what a camera would make of a board."""
    count = len(visible_corners(camera_of(sensor), camera_T_pattern, pattern))
    return Outlook(count > 0, 0 < count < pattern.corner_count, 2 * count)


def errors(realism: Realism, sensor: Sensor, _: Any, rng: np.random.Generator) -> CameraErrors:
    """Draw the systematic errors of a camera."""
    return CameraErrors.drawn(realism, sensor, rng)
