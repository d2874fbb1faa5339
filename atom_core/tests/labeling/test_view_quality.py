"""Figures of a label are those that the picture was made with."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.labeling.advice import Failure, advice, least_square_px, same_reason
from atom_core.labeling.stillness import CornerSighting, PlaneSighting
from atom_core.labeling.view_quality import (
    clear_squares,
    corner_view,
    described,
    exposure_word,
    foreseen_view,
    speed_figure,
    surface_view,
)
from atom_core.model.labels import RgbLabel
from atom_core.model.pattern import pattern_from_config
from atom_core.synthetic.board import charuco, chessboard
from atom_core.synthetic.board_image import render
from atom_core.synthetic.exposure import Exposure, exposed

PIXEL_PX = 12**-0.5  # standard deviation of a pixel's own width
K = np.array([[900.0, 0.0, 480.0], [0.0, 900.0, 360.0], [0.0, 0.0, 1.0]])
CAMERA = Camera(960, 720, K, np.zeros(5))
BOARDS = {"chessboard": chessboard(dimension=(8, 6), size=0.06), "charuco": charuco()}


def pose_at(distance_m, tilt_deg, pattern):
    """Return a board whose middle stands on the optical axis, tilted about y, a little rolled."""
    pose = se3.from_rpy(np.zeros(3), np.array([0.0, np.radians(tilt_deg), 0.0]))
    pose = pose @ se3.from_rpy(np.zeros(3), np.array([0.0, 0.0, np.radians(8.0)]))
    pose[:3, 3] = [0.0, 0.0, distance_m] - pose[:3, :3] @ np.append(pattern.border.centre, 0.0)
    return pose


def view_of(
    config,
    distance_m=1.0,
    tilt_deg=20.0,
    blur=(0.0, 0.0),
    scale=0.75,
    offset=25.0,
    motion=(0.0, 0.0),
):
    pattern = pattern_from_config("board", config)
    pose = pose_at(distance_m, tilt_deg, pattern)
    image = render(CAMERA, [((pattern, config), pose)])[..., 0].astype(float)
    if max(blur) > 0.0:
        image = cv2.GaussianBlur(image, (0, 0), max(blur[0], 0.01), sigmaY=max(blur[1], 0.01))
    image = exposed(image, Exposure(motion_px=motion), np.random.default_rng(0)).astype(float)
    noise = 4.0 * np.random.default_rng(0).standard_normal(image.shape)
    image = np.clip(np.rint(image * scale + offset + noise), 0, 255).astype(np.uint8)
    ids = np.arange(pattern.corner_count)
    label = RgbLabel(ids, CAMERA.project(se3.apply(pose, pattern.corners_of(ids))))
    return corner_view(image, pattern, label, clear_squares(config), pose)


@pytest.mark.parametrize("board", list(BOARDS))
@pytest.mark.parametrize("sigma", [0.7, 1.2, 2.0])
def test_blur_is_that_of_the_picture(board, sigma):
    found = view_of(BOARDS[board], blur=(sigma, sigma))["blur_px"]
    assert found == pytest.approx(np.hypot(sigma, PIXEL_PX), abs=0.15)


@pytest.mark.parametrize("board", list(BOARDS))
def test_a_sharp_picture_has_the_blur_of_its_pixels_and_of_drawing(board):
    assert PIXEL_PX <= view_of(BOARDS[board])["blur_px"] < 0.55


def test_of_motion_blur_the_worse_direction_counts():
    found = view_of(BOARDS["chessboard"], blur=(2.0, 0.5))["blur_px"]
    assert found == pytest.approx(np.hypot(2.0, PIXEL_PX), abs=0.2)


@pytest.mark.parametrize("board", list(BOARDS))
@pytest.mark.parametrize("towards_deg", [0, 37, 53, 90, 143])
def test_motion_is_told_from_other_blur_in_any_direction(board, towards_deg):
    direction = np.array([np.cos(np.radians(towards_deg)), np.sin(np.radians(towards_deg))])
    figures = view_of(BOARDS[board], blur=(0.7, 0.7), motion=5.0 * direction)
    assert figures["smear_px"] == pytest.approx(5.0, rel=0.25)
    assert "px while the shutter was open" in described(figures)


@pytest.mark.parametrize("board", list(BOARDS))
@pytest.mark.parametrize("tilt_deg", [0.0, 45.0])
@pytest.mark.parametrize("sigma", [0.0, 1.5])
def test_other_blur_is_no_motion(board, tilt_deg, sigma):
    figures = view_of(BOARDS[board], tilt_deg=tilt_deg, blur=(sigma, sigma))
    assert figures["smear_px"] == 0.0 and "shutter" not in described(figures)


def test_a_picture_without_edges_has_no_blur():
    figures = view_of(BOARDS["chessboard"], scale=0.0, offset=120.0)
    assert "blur_px" not in figures and "blur" not in described(figures)


@pytest.mark.parametrize("distance_m, tilt_deg", [(0.9, 0.0), (1.4, 35.0), (1.1, 50.0)])
def test_distance_tilt_and_size_are_those_of_the_pose(distance_m, tilt_deg):
    config = BOARDS["charuco"]
    figures = view_of(config, distance_m, tilt_deg)
    assert figures["distance_m"] == pytest.approx(distance_m)
    assert figures["tilt_deg"] == pytest.approx(tilt_deg, abs=0.01)
    expected = 900.0 * config.size / distance_m * np.cos(np.radians(tilt_deg))
    assert figures["square_px"] == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize(
    "scale, offset, word", [(0.75, 25.0, "good"), (1.6, 60.0, "over"), (0.15, 5.0, "under")]
)
def test_exposure(scale, offset, word):
    figures = view_of(BOARDS["chessboard"], scale=scale, offset=offset)
    assert exposure_word(figures) == word
    assert ("exposed" in described(figures)) == (word != "good")


def test_a_surface_is_told_from_either_side():
    centre, normal = np.array([0.0, 3.0, 4.0]), np.array([0.0, 0.0, -1.0])
    for sign in (1.0, -1.0):
        figures = surface_view(centre, sign * normal)
        assert figures["distance_m"] == pytest.approx(5.0)
        assert figures["tilt_deg"] == pytest.approx(np.degrees(np.arccos(0.8)))
    assert set(surface_view(centre, None)) == {"distance_m"}


def test_motion_has_the_unit_of_the_sensor():
    corners = CornerSighting(np.arange(3), np.zeros((3, 2)))
    plane = PlaneSighting(np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.3, 0.01, 100, 4.0)
    assert speed_figure(corners, 10.0) == {"speed_px_s": pytest.approx(3.0)}
    assert speed_figure(plane, 10.0) == {"speed_mm_s": pytest.approx(100.0)}
    assert speed_figure(None, 10.0) == {}


# ---------------------------------------------------------------------------------- advice


def advised(config, distance_m, tilt_deg=0.0, found=(), camera=CAMERA, shift_m=0.0, times=2):
    pattern = pattern_from_config("board", config)
    pose = pose_at(distance_m, tilt_deg, pattern)
    pose[0, 3] += shift_m
    view = foreseen_view(camera, pattern, pose)
    failures = [Failure("2 marker(s) are seen, 3 are needed", view)] * times
    return advice(failures, list(found), pattern, config)


def test_a_board_too_small_has_the_distance_from_which_on_it_is_not():
    config = BOARDS["charuco"]
    text = advised(config, 6.0)
    nearer = float(text.split("nearer than ")[1].split(" m")[0])
    assert "9 px per square" in text and "board too small" in text
    assert nearer == pytest.approx(900.0 * config.size / least_square_px(config), abs=0.06)
    assert "too small" not in advised(config, nearer - 0.1)


def test_a_board_too_slanted_is_to_be_turned():
    config = BOARDS["charuco"]
    near = 0.8 * 900.0 * config.size / least_square_px(config)
    assert "turn it towards" in advised(config, near, 60.0)


def test_a_board_that_shows_its_back_is_to_be_turned_to_a_camera():
    board = BOARDS["charuco"]
    assert "seen from behind" in advised(board, 1.0, 160.0)
    assert "behind" not in advised(board, 1.0, 160.0, camera=None)


def test_a_board_out_of_the_image_is_to_be_moved():
    text = advised(BOARDS["chessboard"], 1.0, shift_m=0.6)
    assert "out of the image" in text and "48 are needed" in text


def test_without_intrinsics_what_was_found_tells():
    found = [{"distance_m": 1.0, "tilt_deg": 20.0}, {"distance_m": 2.5, "tilt_deg": 55.0}]
    board = BOARDS["charuco"]
    assert "nearer than 2.5 m" in advised(board, 4.0, found=found, camera=None)
    assert "less than 55 deg" in advised(board, 2.0, 70.0, found=found, camera=None)
    neither = advised(board, 2.0, 30.0, found=found, camera=None)
    assert "2 marker(s) are seen" in neither and "2.0 m away" in neither


def test_where_nobody_tells_the_place_the_reason_stands_alone():
    config = BOARDS["charuco"]
    pattern = pattern_from_config("board", config)
    assert advice([Failure("no seed")], [], pattern, config) == "no seed"


def test_reasons_are_the_same_whatever_their_numbers():
    assert same_reason("3 of 88 corners, 0.5 m") == same_reason("12 of 88 corners, 1.25 m")
    assert same_reason("no board") != same_reason("no marker")


def test_markers_of_more_bits_need_larger_squares():
    small, large = (replace(charuco(), dictionary=f"DICT_{n}_250") for n in ("4X4", "6X6"))
    assert least_square_px(small) < least_square_px(large)
    assert least_square_px(chessboard(dimension=(8, 6))) == 8.0
