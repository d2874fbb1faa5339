"""Points on the board and in the image, as a first guess has them."""

import numpy as np
import pytest

from atom_core.editing.guess_fit import FEWEST_POINTS, draw_points, off_board, pixels_of_points
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.pattern import pattern_from_config
from atom_core.synthetic.board import charuco

CAMERA = Camera(640, 480, np.array([[500.0, 0, 320], [0, 500.0, 240], [0, 0, 1]]), np.zeros(5))
PATTERN = pattern_from_config("board", charuco())
CAMERA_T_PATTERN = se3.transform(
    se3.rotation_from_rotation_vector(np.array([0.3, -0.2, 0.1])), np.array([-0.3, -0.2, 2.0])
)
CAMERA_T_LIDAR = se3.transform(
    se3.rotation_from_rotation_vector(np.array([0.1, 0.9, -0.4])), np.array([0.5, 0.2, -0.3])
)


def points_of_a_scene():
    """The board, and a wall a metre and a half behind it, in the LiDAR's frame."""
    border = PATTERN.border
    steps = np.linspace(-0.95, 0.95, 20)
    flat = np.array([border.centre + border.half_size * [x, y] for x in steps for y in steps])
    board = np.column_stack([flat, np.zeros(len(flat))])
    wall = np.array([[x, y, 1.5] for x in np.linspace(-3, 3, 30) for y in np.linspace(-3, 3, 30)])
    in_camera = se3.apply(CAMERA_T_PATTERN, np.vstack([board, wall]))
    return se3.apply(se3.inverse(CAMERA_T_LIDAR), in_camera), len(board)


def test_at_the_truth_points_lie_on_the_board_and_the_wall_does_not_count():
    points, on_board = points_of_a_scene()
    found = off_board(points, CAMERA_T_LIDAR, CAMERA_T_PATTERN, PATTERN)
    assert found.points == on_board
    assert found.median_m == pytest.approx(0.0, abs=1e-12)


def test_a_guess_that_is_off_along_the_normal_is_off_by_as_much():
    points, _ = points_of_a_scene()
    for off_m in (0.034, -0.12):
        moved = CAMERA_T_LIDAR.copy()
        moved[:3, 3] += off_m * CAMERA_T_PATTERN[:3, 2]
        found = off_board(points, moved, CAMERA_T_PATTERN, PATTERN)
        assert found.median_m == pytest.approx(abs(off_m), abs=1e-9)


def test_without_points_on_the_board_nothing_is_known():
    points, on_board = points_of_a_scene()
    aside = se3.transform(np.eye(3), np.array([5.0, 0.0, 0.0])) @ CAMERA_T_LIDAR
    assert np.isnan(off_board(points[:on_board], aside, CAMERA_T_PATTERN, PATTERN).median_m)
    few = off_board(points[: FEWEST_POINTS - 1], CAMERA_T_LIDAR, CAMERA_T_PATTERN, PATTERN)
    assert few.points == FEWEST_POINTS - 1 and np.isnan(few.median_m)


def test_points_are_drawn_where_the_camera_projects_them_and_not_from_behind():
    in_camera = np.array([[0.0, 0.0, 2.0], [0.4, -0.2, 2.0], [0.0, 0.0, -2.0], [9.0, 0.0, 1.0]])
    pixels = pixels_of_points(CAMERA, np.vstack([in_camera, [[np.nan, 0.0, 1.0]]]))
    np.testing.assert_array_equal(pixels, [[320, 240], [420, 190]])
    picture = np.zeros((480, 640, 3), np.uint8)
    draw_points(picture, pixels, (1, 2, 3))
    assert tuple(picture[240, 320]) == (1, 2, 3) and not picture[0, 0].any()
