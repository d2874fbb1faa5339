"""The one pose of a board that stands: the least squares, from any frame, in any order."""

import numpy as np
import pytest

from atom_core.evaluation import fixed_board as module
from atom_core.evaluation.board_pose import board_pose
from atom_core.evaluation.fixed_board import BoardView, fixed_board_pose, offsets_px
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.labels import DetectionKey
from atom_core.problem.corner_measurement import CornerMeasurement

K = np.array([[800.0, 0, 500], [0, 820.0, 400], [0, 0, 1]])
CAMERA = Camera(1000, 800, K, np.array([-0.1, 0.02, 0.001, -0.001, 0.0]))
GRID_M = np.array([[0.1 * x, 0.1 * y, 0.0] for y in range(4) for x in range(5)])
KEY = DetectionKey("000", "rgb", "board")
PARENT_T_BOARD = se3.random_move(0.5, 0.8, np.random.default_rng(100))


def view(seed, sigma_px=0.0, count=20):
    """Return the board as a camera some 1.2 m before it sees it."""
    rng = np.random.default_rng(seed)
    camera_T_board = se3.transform(
        se3.random_rotation(0.6, rng), np.array([-0.2, -0.15, 1.2]) + rng.uniform(-0.1, 0.1, 3)
    )
    corners = GRID_M[:count]
    pixels = CAMERA.project(se3.apply(camera_T_board, corners))
    pixels = pixels + sigma_px * rng.standard_normal(pixels.shape)
    measured = CornerMeasurement(KEY, CAMERA, np.arange(count), corners, pixels)
    camera_T_parent = camera_T_board @ se3.inverse(PARENT_T_BOARD)
    return BoardView(measured, camera_T_parent, camera_T_board)


def views(count, sigma_px=0.0):
    return [view(seed, sigma_px) for seed in range(count)]


def cost_px2(seen, parent_T_board):
    total = 0.0
    for corners, camera_T_parent, _ in seen:
        points = se3.apply(camera_T_parent @ parent_T_board, corners.corners_in_pattern)
        total += np.sum((CAMERA.project(points) - corners.pixels) ** 2)
    return total


def lost(one):
    """Return the view as if its corners alone had put the board far up and to the left."""
    far = se3.transform(np.diag([1.0, -1.0, -1.0]), np.array([-3.0, -3.0, 0.5]))
    return one._replace(camera_T_pattern=far)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_without_noise_it_is_the_true_pose(count):
    np.testing.assert_allclose(fixed_board_pose(views(count)), PARENT_T_BOARD, atol=1e-9)


def test_of_a_single_image_it_is_the_pose_by_its_corners_alone():
    one = view(3, sigma_px=0.5)
    alone = board_pose(one.corners).camera_T_pattern
    found = fixed_board_pose([one._replace(camera_T_pattern=alone)])
    np.testing.assert_allclose(one.camera_T_parent @ found, alone, atol=1e-7)


def test_every_other_pose_near_by_fits_worse():
    seen = views(4, sigma_px=1.0)
    found = fixed_board_pose(seen)
    least = cost_px2(seen, found)
    assert least < cost_px2(seen, PARENT_T_BOARD)
    steps = np.concatenate([1e-4 * np.eye(6), -1e-4 * np.eye(6)])
    for step in steps:
        rotation = se3.rotation_from_rotation_vector(step[:3])
        assert cost_px2(seen, se3.moved(found, se3.transform(rotation, step[3:]))) > least


def test_the_sum_of_squares_has_no_slope_there():
    seen = views(3, sigma_px=1.0)
    found, h = fixed_board_pose(seen), 1e-5
    for axis in np.eye(6):
        sides = []
        for step in (h * axis, -h * axis):
            rotation = se3.rotation_from_rotation_vector(step[:3])
            sides.append(cost_px2(seen, se3.moved(found, se3.transform(rotation, step[3:]))))
        assert abs(sides[0] - sides[1]) / (2 * h) < 0.05


def test_the_frame_in_which_the_board_stands_makes_no_difference():
    seen = views(3, sigma_px=0.5)
    other_T_parent = se3.random_move(2.0, 1.5, np.random.default_rng(7))
    elsewhere = [
        v._replace(camera_T_parent=v.camera_T_parent @ se3.inverse(other_T_parent)) for v in seen
    ]
    expected = other_T_parent @ fixed_board_pose(seen)
    np.testing.assert_allclose(fixed_board_pose(elsewhere), expected, atol=1e-8)


def test_the_order_of_images_makes_no_difference():
    seen = views(5, sigma_px=0.5)
    np.testing.assert_allclose(fixed_board_pose(seen[::-1]), fixed_board_pose(seen), atol=1e-8)


def start_of(monkeypatch, seen):
    """Return the pose from which the squares are made least."""
    monkeypatch.setattr(module, "best_pose", lambda linearise, pose: (pose, None))
    return fixed_board_pose(seen)


@pytest.mark.parametrize("sound", [0, 1, 2])
def test_it_starts_from_the_image_whose_own_pose_suits_all_best(monkeypatch, sound):
    seen = [one if i == sound else lost(one) for i, one in enumerate(views(3))]
    np.testing.assert_allclose(start_of(monkeypatch, seen), PARENT_T_BOARD, atol=1e-9)


def test_one_image_off_by_far_is_worse_than_all_off_by_little(monkeypatch):
    """Squares are added: the start is the pose by the middle one of three images."""
    seen = []
    for one, off_m in zip(views(3), (0.0, 0.05, 0.1)):
        shift = se3.transform(np.eye(3), np.array([off_m, 0.0, 0.0]))
        put = one.camera_T_parent @ shift @ PARENT_T_BOARD
        pixels = CAMERA.project(se3.apply(put, GRID_M))
        measured = CornerMeasurement(KEY, CAMERA, one.corners.ids, GRID_M, pixels)
        seen.append(BoardView(measured, one.camera_T_parent, put))
    middle = se3.transform(np.eye(3), np.array([0.05, 0.0, 0.0])) @ PARENT_T_BOARD
    np.testing.assert_allclose(start_of(monkeypatch, seen), middle, atol=1e-9)


@pytest.mark.parametrize("sound, is_tried", [(0, True), (10, True), (11, False), (22, True)])
def test_of_23_images_twelve_are_tried_evenly_from_the_first_to_the_last(
    monkeypatch, sound, is_tried
):
    seen = [one if i == sound else lost(one) for i, one in enumerate(views(23))]
    off = np.max(np.abs(start_of(monkeypatch, seen) - PARENT_T_BOARD))
    assert (off < 1e-9) == is_tried


def test_corners_count_alike_so_that_images_with_more_of_them_pull_more():
    """A board that moved between two images is nearer to where more corners saw it."""
    full, few = view(0), view(1, count=8)
    moved = se3.transform(np.eye(3), np.array([0.01, 0.0, 0.0]))
    shifted = few._replace(camera_T_parent=few.camera_T_parent @ se3.inverse(moved))
    found = fixed_board_pose([full, shifted])
    assert cost_px2([full], found) < cost_px2([shifted], found)


def test_offsets_are_projected_minus_detected():
    one = view(2)
    shift_px = np.array([3.0, -4.0])
    corners = CornerMeasurement(KEY, CAMERA, one.corners.ids, GRID_M, one.corners.pixels + shift_px)
    offsets = offsets_px(one._replace(corners=corners), PARENT_T_BOARD)
    np.testing.assert_allclose(offsets, np.tile(-shift_px, (len(GRID_M), 1)), atol=1e-9)
