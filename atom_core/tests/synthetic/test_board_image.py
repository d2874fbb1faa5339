"""Pictures show the print where the geometry says, and nothing else."""

import cv2
import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.model.pattern import pattern_from_config
from atom_core.synthetic import Noise, board_image, paper_cell, scenes
from atom_core.synthetic.board import charuco, chessboard

CONFIGS = {"charuco": charuco(), "chessboard": chessboard()}


@pytest.fixture(params=CONFIGS)
def board(request):
    config = CONFIGS[request.param]
    return pattern_from_config("pattern_1", config), config


def frontal(distance_m=1.2):
    """Return ``camera_T_pattern`` of a board straight before the camera, its print towards it."""
    pose = np.eye(4)
    pose[:3, 3] = -0.33, -0.24, distance_m
    return pose


def test_corners_are_where_the_camera_model_projects_them(board):
    pattern, config = board
    camera, pose = scenes.COLOUR_CAMERA, frontal()
    pose[:3, :3] = se3.rotation_from_rpy(np.array([0.2, -0.2, 0.1]))
    grey = cv2.cvtColor(board_image.render(camera, [((pattern, config), pose)]), cv2.COLOR_BGR2GRAY)
    ids = np.arange(pattern.corner_count)
    expected = camera.project(se3.apply(pose, pattern.corners_of(ids)))
    found = expected.astype(np.float32).reshape(-1, 1, 2).copy()
    cv2.cornerSubPix(grey, found, (3, 3), (-1, -1), (3, 100, 1e-4))
    error = found[:, 0] - expected
    assert np.sqrt(np.mean(error**2)) < 0.06
    assert np.max(np.abs(error.mean(axis=0))) < 0.02  # pixel centres, no shift by half a pixel


def test_the_board_covers_its_border_and_no_more(board):
    pattern, config = board
    pose = frontal()
    camera = scenes.COLOUR_CAMERA
    picture = board_image.render(camera, [((pattern, config), pose)])
    covered = np.any(picture != board_image.GREY, axis=(0, 2)).nonzero()[0]
    outline = camera.project(
        se3.apply(
            pose,
            np.column_stack(
                [pattern.border.sample(0.01), np.zeros(len(pattern.border.sample(0.01)))]
            ),
        )
    )
    assert covered[0] == pytest.approx(outline[:, 0].min(), abs=1.0)
    assert covered[-1] == pytest.approx(outline[:, 0].max(), abs=1.0)


def test_the_back_is_blank(board):
    pose = frontal()
    pose[:3, :3] = np.diag([-1.0, 1.0, -1.0])
    pose[0, 3] = 0.33
    picture = board_image.render(scenes.COLOUR_CAMERA, [(board, pose)])
    assert picture.max() == 255 and picture.min() == board_image.GREY


def test_a_board_behind_the_camera_is_not_drawn(board):
    picture = board_image.render(scenes.COLOUR_CAMERA, [(board, frontal(-1.0))])
    assert np.all(picture == board_image.GREY)


def test_the_nearer_board_hides_the_farther():
    config = charuco()
    pattern = pattern_from_config("pattern_1", config)
    near, far = ((pattern, config), frontal(0.9)), ((pattern, config), frontal(1.8))
    one = board_image.render(scenes.COLOUR_CAMERA, [near, far])
    other = board_image.render(scenes.COLOUR_CAMERA, [far, near])
    np.testing.assert_array_equal(one, other)


def test_pictures_of_the_cell_show_the_labeled_corners():
    dataset = paper_cell(0, noise=Noise.none()).dataset
    label = dataset.collections["003"].labels[("rgb_3", "pattern_1")]
    grey = cv2.cvtColor(dataset.data.read("003", "rgb_3"), cv2.COLOR_BGR2GRAY)
    found = label.pixels.astype(np.float32).reshape(-1, 1, 2).copy()
    cv2.cornerSubPix(grey, found, (3, 3), (-1, -1), (3, 100, 1e-4))
    assert np.median(np.linalg.norm(found[:, 0] - label.pixels, axis=1)) < 0.1
