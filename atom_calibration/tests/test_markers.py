"""What is drawn agrees with the camera and the board it is drawn for."""

import numpy as np
import pytest

from atom_calibration.messages.poses import pose_matrix, pose_message
from atom_calibration.show import markers
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.config import PatternConfig
from atom_core.model.pattern import CHARUCO, CHESSBOARD, pattern_from_config

CAMERA = Camera(
    640,
    480,
    np.array([[520.0, 0, 330], [0, 515.0, 236], [0, 0, 1]]),
    np.array([0.1, -0.2, 0.001, -0.002, 0.05]),
)


def pattern(kind):
    return pattern_from_config(
        "board",
        PatternConfig(
            "board", "world", False, kind, (5, 4), 0.06, (0.04, 0.03), 0.045, "DICT_5X5_100"
        ),
    )


def positions(marker):
    return np.array([[p.x, p.y, p.z] for p in marker.points])


def test_the_corners_of_a_frustum_project_to_the_corners_of_the_image():
    drawn = positions(markers.frustum(CAMERA, "optical", (1, 0, 0), 0.5, 2.0))
    assert set(np.unique(drawn[:, 2])) == {0.5, 2.0}
    corners = np.unique(np.round(CAMERA.project(drawn), 4), axis=0)
    expected = [[-0.5, -0.5], [-0.5, 479.5], [639.5, -0.5], [639.5, 479.5]]
    np.testing.assert_allclose(corners, expected, atol=1e-3)


@pytest.mark.parametrize("kind", [CHARUCO, CHESSBOARD])
def test_inner_corners_are_where_two_black_squares_touch(kind):
    board = pattern(kind)
    _, squares = markers.board(board, (1, 1, 1))
    outlines = positions(squares).reshape(-1, 6, 3)[:, :, :2]
    touching = [
        sum(np.any(np.linalg.norm(square - corner, axis=1) < 1e-9) for square in outlines)
        for corner in board.corners_by_id
    ]
    assert touching == [2] * board.corner_count


@pytest.mark.parametrize("kind", [CHARUCO, CHESSBOARD])
def test_a_board_fills_its_border_at_its_pose(kind):
    board = pattern(kind)
    pose = se3.from_rpy(np.array([1.0, 2.0, 0.5]), np.array([0.2, 0.1, -0.4]))
    plate, squares = markers.board(board, (1, 1, 1), pose, "world")
    centre = pose_matrix(plate.pose)[:3, 3]
    expected = se3.apply(pose, np.array([[*board.border.centre, 0.0]]))[0]
    assert np.linalg.norm(centre - expected) < 0.003  # half of its thickness
    assert plate.scale.x == pytest.approx(board.border.x_max - board.border.x_min)
    np.testing.assert_allclose(pose_matrix(squares.pose), pose, atol=1e-12)
    assert {plate.header.frame_id, squares.header.frame_id} == {"world"}


def test_markers_of_an_array_get_numbers_of_their_own():
    same = [markers.sphere("a", 0.1, (1, 0, 0)) for _ in range(3)] + [markers.axes("a", 0.1)]
    assert len({(m.ns, m.id) for m in markers.numbered(same)}) == 4


def test_pose_messages_go_both_ways():
    pose = se3.from_rpy(np.array([1.0, 2.0, 0.5]), np.array([3.0, 0.1, -0.4]))
    there = pose_matrix(pose_message(pose))
    np.testing.assert_allclose(there, pose, atol=1e-12)
