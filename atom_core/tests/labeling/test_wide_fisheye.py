"""ChArUcos far off a fisheye's axis, where x/z about it says little, and at the rim nothing."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from rgb_labelers import labeler  # noqa: E402

from atom_core.geometry import se3  # noqa: E402
from atom_core.geometry.camera import Camera  # noqa: E402
from atom_core.labeling.view_axis import axis_about  # noqa: E402
from atom_core.model.pattern import pattern_from_config  # noqa: E402
from atom_core.synthetic import board_image  # noqa: E402
from atom_core.synthetic.board import charuco  # noqa: E402

K = np.array([[420.0, 0.0, 640.0], [0.0, 420.0, 480.0], [0.0, 0.0, 1.0]])
FISHEYE = Camera(1280, 960, K, [0.02, -0.005, 0.001, 0.0], "equidistant")
CONFIG = charuco()
PATTERN = pattern_from_config("pattern_1", CONFIG)


def held(angle_deg, rpy_deg=(0.0, 0.0, 0.0), distance_m=0.8):
    """Return ``camera_T_pattern`` of a board that faces the camera, but for a turn."""
    angle = np.radians(angle_deg)
    z = np.array([np.sin(angle), 0.1, np.cos(angle)])
    x = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    z /= np.linalg.norm(z)
    rotation = np.column_stack([x, np.cross(z, x), z])
    rotation = rotation @ se3.rotation_from_rpy(np.radians(rpy_deg))
    return se3.transform(
        rotation, distance_m * z - rotation @ np.append(PATTERN.border.centre, 0.0)
    )


def picture(pose):
    clean = board_image.render(FISHEYE, [((PATTERN, CONFIG), pose)]) * 0.75 + 25.0
    noise = 4.0 * np.random.default_rng(0).standard_normal(clean.shape[:2])
    return np.clip(clean + noise[..., None], 0, 255).astype(np.uint8)


@pytest.mark.parametrize("rpy_deg", [(0.0, 0.0, 0.0), (15.0, -20.0, 0.0)], ids=["faces", "tilted"])
@pytest.mark.parametrize("angle_deg", [0, 60, 65, 75, 84])
def test_corners_are_exact_up_to_the_rim_of_a_fisheye(angle_deg, rpy_deg):
    pose = held(angle_deg, rpy_deg)
    found = labeler(CONFIG, FISHEYE).label(picture(pose))
    points = se3.apply(pose, PATTERN.corners_of(np.arange(PATTERN.corner_count)))
    assert found.detected, found.reason
    assert len(found.label.ids) >= 0.95 * np.sum(FISHEYE.in_image(points))
    seen = points[found.label.ids]
    off_px = found.label.pixels - FISHEYE.project(seen)
    assert np.sqrt(np.mean(np.sum(off_px**2, axis=1))) <= 0.1
    assert np.all(seen[:, 2] > 0.0)  # what lies beside the camera is of no use as a label


@pytest.mark.parametrize("angle_deg", [55, 65])
@pytest.mark.parametrize("rpy_deg", [(0.0, 55.0, 0.0), (55.0, 0.0, 0.0)], ids=["yaw", "pitch"])
def test_small_markers_far_off_the_axis_stand_as_on_their_board(angle_deg, rpy_deg):
    pose = held(angle_deg, rpy_deg, distance_m=1.4)
    found = labeler(CONFIG, FISHEYE).label(picture(pose))
    assert found.detected, found.reason
    off_px = found.label.pixels - FISHEYE.project(
        se3.apply(pose, PATTERN.corners_of(found.label.ids))
    )
    assert len(found.label.ids) >= 0.8 * PATTERN.corner_count
    assert np.sqrt(np.mean(np.sum(off_px**2, axis=1))) <= 0.25


def test_an_axis_of_its_own_has_the_same_pixels_and_a_board_amid_the_image_has_none():
    off = np.radians([70.0, 80.0, 88.0, 100.0])
    points = np.column_stack([np.sin(off), 0.2 * np.ones(4), np.cos(off)])
    pixels = FISHEYE.project(points)
    assert np.allclose(FISHEYE.unit_rays(pixels), units(points), atol=1e-9)
    axis = axis_about(FISHEYE, pixels)
    flat = axis.normalise(pixels)
    assert axis.camera_R_view is not None and np.max(np.abs(flat)) < 1.0
    assert np.allclose(axis.project(flat), pixels, atol=1e-6)
    assert axis.of_use(flat).tolist() == [True, True, True, False]
    near = FISHEYE.project(np.array([[0.5, 0.1, 1.0]]))
    assert axis_about(FISHEYE, near).camera_R_view is None


def units(points):
    return points / np.linalg.norm(points, axis=1, keepdims=True)
