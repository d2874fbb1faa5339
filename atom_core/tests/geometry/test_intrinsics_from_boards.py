"""The camera that pictures of a board tell: the true one, of as few as can tell it."""

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.geometry.intrinsics_from_boards import camera_of_boards

K = np.array([[600.0, 0.0, 330.0], [0.0, 610.0, 235.0], [0.0, 0.0, 1.0]])
TRUE = Camera(640, 480, K, np.array([-0.2, 0.05, 0.001, -0.001, 0.0]), "plumb_bob")
TILTS = ([0.4, 0.1, 0.0], [-0.3, 0.4, 0.1], [0.1, -0.5, 0.2], [0.3, 0.3, -0.2])


def pictures(columns, rows, count):
    """Return points of a board and where the true camera sees them."""
    grid = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    points = np.column_stack([0.8 * grid / max(columns - 1, 1), np.zeros(len(grid))])
    points -= points.mean(axis=0)
    poses = [
        se3.transform(se3.rotation_from_rotation_vector(np.array(tilt)), np.array([0.0, 0.0, 1.4]))
        for tilt in TILTS[:count]
    ]
    return [points] * count, [TRUE.project(se3.apply(pose, points)) for pose in poses]


def test_exact_corners_give_the_true_camera():
    camera, rms_px = camera_of_boards(*pictures(9, 6, 4), 640, 480)
    assert rms_px < 1e-3 and (camera.width, camera.height) == (640, 480)
    np.testing.assert_allclose(camera.K, K, rtol=1e-4)
    np.testing.assert_allclose(camera.D, TRUE.D, atol=2e-3)
    assert camera.D.shape == (5,)


def test_three_pictures_of_six_corners_are_enough_and_fewer_are_not():
    points, pixels = pictures(3, 2, 3)
    camera_of_boards(points, pixels, 640, 480)
    with pytest.raises(ValueError, match="2 pictures show enough of a board, 3 are needed"):
        camera_of_boards(points[:2], pixels[:2], 640, 480)
    with pytest.raises(ValueError, match="2 pictures show"):
        camera_of_boards([*points[:2], points[2][:5]], [*pixels[:2], pixels[2][:5]], 640, 480)


def test_what_opencv_cannot_use_is_said():
    points, pixels = pictures(9, 6, 3)
    with pytest.raises(ValueError, match="OpenCV finds no camera"):
        camera_of_boards([p + [0.0, 0.0, 1e-1 * i] for i, p in enumerate(points)], pixels, 0, 0)
