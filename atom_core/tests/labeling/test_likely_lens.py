"""Wide lenses of which camera_info says nothing, as before a camera is calibrated."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from rgb_labelers import labeler  # noqa: E402

from atom_core.geometry import se3  # noqa: E402
from atom_core.geometry.camera import Camera  # noqa: E402
from atom_core.labeling.likely_lens import likely_lens  # noqa: E402
from atom_core.model.pattern import pattern_from_config  # noqa: E402
from atom_core.synthetic import board_image  # noqa: E402
from atom_core.synthetic.board import charuco, chessboard  # noqa: E402

K = np.array([[600.0, 0.0, 640.0], [0.0, 600.0, 400.0], [0.0, 0.0, 1.0]])
LENSES = {
    "wide": Camera(1280, 800, K, [-0.3, 0.1, 0.0, 0.0, 0.0]),
    "fisheye": Camera(1280, 800, K, [0.02, -0.005, 0.001, 0.0], "equidistant"),
}
UNKNOWN = Camera(1280, 800, K, np.zeros(5))
BOARDS = {"charuco": charuco(), "chessboard": chessboard()}
POSES = (((0.0, 0.0, 0.5), (0.1, 0.2, 0.1)), ((-0.15, 0.05, 0.6), (0.5, -0.2, 0.0)))


def picture(camera, config, pattern, place, rpy):
    pose = se3.from_rpy(np.zeros(3), np.array(rpy))
    pose[:3, 3] = place - pose[:3, :3] @ np.append(pattern.border.centre, 0.0)
    clean = board_image.render(camera, [((pattern, config), pose)]) * 0.75 + 25.0
    noise = 4.0 * np.random.default_rng(0).standard_normal(clean.shape[:2])
    points = se3.apply(pose, pattern.corners_of(np.arange(pattern.corner_count)))
    return np.clip(clean + noise[..., None], 0, 255).astype(np.uint8), points


@pytest.mark.parametrize("board", list(BOARDS))
@pytest.mark.parametrize("lens", list(LENSES))
def test_a_board_that_an_unknown_lens_bends_is_labeled_as_exactly(lens, board):
    """A ChArUco was refused, since its markers did "not stand as on this board"."""
    config, camera = BOARDS[board], LENSES[lens]
    pattern = pattern_from_config("pattern_1", config)
    for pose in POSES:
        image, points = picture(camera, config, pattern, *pose)
        found = labeler(config, UNKNOWN).label(image)
        assert found.detected, found.reason
        assert len(found.label.ids) >= 0.95 * np.sum(camera.in_image(points))
        off_px = found.label.pixels - camera.project(points[found.label.ids])
        assert np.sqrt(np.mean(np.sum(off_px**2, axis=1))) <= 0.1


@pytest.mark.parametrize("known", [True, False])
def test_another_board_is_refused_through_an_unknown_lens(known):
    config = charuco()
    pattern = pattern_from_config("pattern_1", config)
    image, _ = picture(LENSES["wide"], config, pattern, *POSES[1])
    swapped = replace(config, dimension=config.dimension[::-1])
    found = labeler(swapped, LENSES["wide"] if known else UNKNOWN).label(image)
    assert not found.detected and "rows and columns are swapped" in found.reason


def test_a_lens_is_looked_for_only_where_there_is_none_and_something_is_bent():
    board = np.stack(np.meshgrid(np.arange(12), np.arange(9)), axis=-1).reshape(-1, 2) * 1.0
    points = np.column_stack([0.06 * (board - [5.5, 4.0]), np.full(len(board), 0.45)])
    size = (1280, 800)
    straight, bent = UNKNOWN.project(points), LENSES["wide"].project(points)
    assert likely_lens(UNKNOWN, [(board, straight)], size) is UNKNOWN
    assert likely_lens(LENSES["wide"], [(board, straight)], size) is LENSES["wide"]
    for camera in (UNKNOWN, None):
        assert likely_lens(camera, [(board, bent)], size).model == "equidistant"
    scattered = np.random.default_rng(0).uniform(0.0, 700.0, (len(board), 2))
    assert likely_lens(UNKNOWN, [(board, scattered)], size) is UNKNOWN
    wrong = (board[:, ::-1], straight)  # no lens is tried where one layout is straight
    assert likely_lens(UNKNOWN, [wrong, (board, straight)], size) is UNKNOWN
