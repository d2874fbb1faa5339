"""Pictures that moved, rolled, were exposed badly or shine: right corners, or none."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.labeling.charuco import CharucoFinder
from atom_core.labeling.marker_search import search_markers
from atom_core.labeling.rgb import RgbLabeler
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import RGB, Sensor
from atom_core.model.transforms import Edge
from atom_core.synthetic.board import charuco, chessboard
from atom_core.synthetic.board_image import render
from atom_core.synthetic.exposure import Exposure, exposed, rolled

K = np.array([[900.0, 0.0, 480.0], [0.0, 900.0, 360.0], [0.0, 0.0, 1.0]])
CAMERA = Camera(960, 720, K, np.zeros(5))
BOARDS = {"chessboard": chessboard(dimension=(8, 6), size=0.06), "charuco": charuco()}
USUAL = {"blur_px": 0.7, "noise": 4.0}
GLARE = {"glare_at_px": (500.0, 330.0), "glare_size_px": 60.0}
# how, whether it must be found (by chessboard, ChArUco), largest bias [px]
CASES = {
    "moves 4 px": (Exposure((3.2, 2.4), **USUAL), (True, True), 0.05),
    "moves 12 px": (Exposure((-8.5, 8.5), **USUAL), (True, False), 0.05),
    "moves 30 px": (Exposure((30.0, 0.0), **USUAL), (False, False), 0.5),
    "rolls 20 px": (Exposure(rolling_px=(20.0, -12.0), **USUAL), (True, True), 0.05),
    "a fifth of the light": (Exposure(gain=0.2, **USUAL), (True, True), 0.1),
    "a twentieth of the light": (Exposure(gain=0.05, **USUAL), (False, False), 0.5),
    "twice the light": (Exposure(gain=2.0, **USUAL), (True, True), 0.05),
    "shines a little": (Exposure(glare=0.4, **GLARE, **USUAL), (True, True), 0.05),
    "shines": (Exposure(glare=2.0, **GLARE, **USUAL), (False, True), 0.05),
}


def pose_of(pattern, rng):
    rpy = np.radians([*rng.uniform(-30.0, 30.0, 2), 0.0])
    pose = se3.from_rpy(np.zeros(3), rpy)
    pose = pose @ se3.from_rpy(np.zeros(3), np.array([0.0, 0.0, rng.uniform(-0.6, 0.6)]))
    middle = np.append(pattern.border.centre, 0.0)
    pose[:3, 3] = [0.0, 0.0, 1.3] - pose[:3, :3] @ middle
    return pose


@pytest.mark.sampled(9)
@pytest.mark.parametrize("board", list(BOARDS))
@pytest.mark.parametrize("case", list(CASES))
def test_corners_are_right_or_refused(case, board):
    how, must, most_px = CASES[case]
    config = BOARDS[board]
    pattern = pattern_from_config("board", config)
    labeler = RgbLabeler(Sensor("c", RGB, "c", Edge("world", "c"), CAMERA), pattern, config)
    rng = np.random.default_rng(0)
    pose = pose_of(pattern, rng)
    clean = render(CAMERA, [((pattern, config), pose)], border_grey=230)[..., 0]
    picture = exposed((0.75 * clean + 25.0).astype(np.uint8), how, rng)
    found = labeler.label(picture)
    assert found.detected or not must[board == "charuco"]
    assert found.detected or found.reason
    if found.detected:
        corners = CAMERA.project(se3.apply(pose, pattern.corners_of(found.label.ids)))
        error = found.label.pixels - rolled(corners, how, CAMERA.height)
        assert np.linalg.norm(error.mean(axis=0)) <= most_px
        assert np.abs(error).max() < 3.0  # in the right order


@pytest.mark.parametrize("board", list(BOARDS))
def test_a_corner_that_the_edge_of_a_shadow_moves_is_left_out(board):
    """A chessboard is found whole, and such a corner was kept, by up to 7 px off."""
    config, left_out = BOARDS[board], 0
    pattern = pattern_from_config("board", config)
    labeler = RgbLabeler(Sensor("c", RGB, "c", Edge("world", "c"), CAMERA), pattern, config)
    for seed in range(4):
        rng = np.random.default_rng(seed)
        pose = pose_of(pattern, rng)
        clean = render(CAMERA, [((pattern, config), pose)], border_grey=230)[..., 0]
        everywhere = CAMERA.project(
            se3.apply(pose, pattern.corners_of(np.arange(pattern.corner_count)))
        )
        at, angle = everywhere[rng.integers(len(everywhere))], rng.uniform(0.0, np.pi)
        y, x = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
        beyond = (x - at[0]) * np.cos(angle) + (y - at[1]) * np.sin(angle)
        light = (0.75 * clean + 25.0) * (1.0 - 0.35 * (1.0 + np.tanh(beyond)))
        found = labeler.label(exposed(light.astype(np.uint8), Exposure(**USUAL), rng))
        assert found.detected, found.reason
        off_px = np.linalg.norm(found.label.pixels - everywhere[found.label.ids], axis=1)
        assert off_px.max() < 1.2
        left_out += len(everywhere) - len(found.label.ids)
    assert left_out > 0 or board == "charuco"


def over_exposed(config, configured):
    """Label a picture of a ChArUco, of which next to no marker is read, by a configuration."""
    pattern = pattern_from_config("board", config)
    rng = np.random.default_rng(0)
    clean = render(CAMERA, [((pattern, config), pose_of(pattern, rng))], border_grey=230)[..., 0]
    picture = exposed((0.75 * clean + 25.0).astype(np.uint8), Exposure(gain=2.5, **USUAL), rng)
    finder = CharucoFinder(*configured.dimension, 0.75, configured.dictionary)
    return finder, picture


def test_markers_that_are_read_wrongly_are_of_no_other_board():
    config = charuco()
    finder, picture = over_exposed(config, config)
    ids, outlines, *_ = search_markers(picture, config.dictionary)
    few = np.random.default_rng(1).permutation(len(ids))[:6]
    reason = finder._why_nothing_fits(picture, ids[few][::-1], outlines[few], None)
    assert "the picture is over-exposed" in reason and "another" not in reason
    dark = (picture // 3).astype(np.uint8)
    reason = finder._why_nothing_fits(dark, ids[few][::-1], outlines[few], None)
    assert "check dimension" in reason and "another" not in reason


def test_another_board_is_named_however_it_is_exposed():
    config = charuco()
    finder, picture = over_exposed(config, replace(config, dimension=(10, 8)))
    ids, outlines, *_ = search_markers(picture, config.dictionary)
    reason = finder._why_nothing_fits(picture, ids, outlines, None)
    assert "{x: 11, y: 8} fits the markers" in reason
