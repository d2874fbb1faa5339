"""Corners in pictures: where they truly are, all of them, and a reason where there are none."""

import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from rgb_labelers import CAMERA, labeler, sensor, without_intrinsics  # noqa: E402

from atom_core import aruco  # noqa: E402
from atom_core.errors import LabelingError  # noqa: E402
from atom_core.geometry import se3  # noqa: E402
from atom_core.labeling.base import labeler_for  # noqa: E402
from atom_core.labeling.marker_search import smoothed_where_flat  # noqa: E402
from atom_core.labeling.rgb import RgbLabeler  # noqa: E402
from atom_core.model.pattern import pattern_from_config  # noqa: E402
from atom_core.synthetic import board_image  # noqa: E402
from atom_core.synthetic.board import charuco, chessboard, facing  # noqa: E402

SMALL = {"dimension": (6, 4), "size": 0.03, "inner_size": 0.022, "dictionary": "DICT_4X4_50"}
OPENCV_CHESSBOARDS = Path("/usr/share/doc/opencv-doc/examples/data")


def held(distance_m, rpy=(0.0, 0.0, 0.0), config=None, offset=(0.0, 0.0)):
    """Return ``camera_T_pattern``: the board's middle on the axis, turned about it."""
    border = pattern_from_config("p", config or charuco()).border
    pose = se3.from_rpy(np.zeros(3), np.array(rpy))
    middle = pose[:3, :3] @ np.append(border.centre, 0.0)
    pose[:3, 3] = np.array([*offset, distance_m]) - middle
    return pose


def picture(config, pose, seed=0, camera=CAMERA):
    """Return a picture with noise of 2 grey levels and a print that is neither black nor white."""
    pattern = pattern_from_config("pattern_1", config)
    clean = board_image.render(camera, [((pattern, config), pose)])
    noise = 2.0 * np.random.default_rng(seed).standard_normal(clean.shape[:2])
    return np.clip(np.rint(clean * 0.8 + 20 + noise[..., None]), 0, 255).astype(np.uint8)


def errors(found, config, pose, camera=CAMERA):
    pattern = pattern_from_config("pattern_1", config)
    truth = camera.project(se3.apply(pose, pattern.corners_of(found.label.ids)))
    return found.label.pixels - truth


def poses(count, seed=1, least_square_px=22.0, largest_angle_deg=60.0, config=None):
    """Draw poses within an incidence, with squares of a size before foreshortening."""
    rng = np.random.default_rng(seed)
    border = pattern_from_config("p", config or charuco()).border
    farthest = CAMERA.focal_px[0] * (config or charuco()).size / least_square_px
    drawn = []
    while len(drawn) < count:
        tilt = np.radians(largest_angle_deg) * rng.uniform(-1, 1, 2)
        pose = held(
            rng.uniform(0.8, farthest),
            (*tilt, rng.uniform(-3, 3)),
            config,
            rng.uniform(-0.3, 0.3, 2),
        )
        if facing(pose, border) >= np.cos(np.radians(largest_angle_deg)):
            drawn.append(pose)
    return drawn


# ---- where the corners are


@pytest.mark.sampled(1)
@pytest.mark.parametrize("known", [True, False], ids=["camera", "no camera"])
def test_corners_are_exact_and_without_bias(known):
    config = charuco()
    finder = labeler(config) if known else without_intrinsics(labeler(config))
    all_errors, in_view = [], 0
    for number, pose in enumerate(poses(25)):
        found = finder.label(picture(config, pose, number))
        pattern = finder.pattern
        seen = CAMERA.in_image(se3.apply(pose, pattern.corners_of(np.arange(88))), 3.0)
        if np.sum(seen) >= 22:
            assert found.detected, found.reason
            assert len(found.label.ids) >= 0.9 * np.sum(seen)
            in_view += 1
            all_errors.append(errors(found, config, pose))
    together = np.concatenate(all_errors)
    assert in_view >= 20
    assert np.max(np.abs(together.mean(axis=0))) <= 0.02
    assert np.max(np.sqrt(np.mean(together**2, axis=0))) <= 0.08
    assert np.max(np.abs(together)) <= 0.6


def test_squares_of_fifteen_pixels_are_still_exact():
    config = charuco()
    for number, pose in enumerate(poses(6, 3, 15.0, 30.0)):
        found = labeler(config).label(picture(config, pose, number))
        assert np.sqrt(np.mean(errors(found, config, pose) ** 2)) <= 0.1


def test_a_board_that_is_large_enough_is_found_in_a_picture_of_any_size():
    config, pose = charuco(), held(2.2, (0.2, -0.2, 0.1))
    small = picture(config, pose)
    above, beside = (3648 - small.shape[0]) // 2, (5472 - small.shape[1]) // 2
    around = ((above, above), (beside, beside), (0, 0))
    finder = without_intrinsics(labeler(config))
    alone, found = finder.label(small), finder.label(np.pad(small, around, "edge"))
    assert found.detected, found.reason
    assert np.array_equal(found.label.ids, alone.label.ids)
    moved = found.label.pixels - [beside, above]
    assert np.allclose(moved, alone.label.pixels, atol=0.01)


def test_a_chessboard_is_exact_and_numbered_from_its_black_corner():
    config = chessboard()
    for roll in np.radians([0.0, 80.0, 170.0, -100.0]):
        pose = held(1.4, (0.3, -0.4, roll), config)
        found = labeler(config).label(picture(config, pose))
        assert found.detected, found.reason
        assert np.max(np.abs(errors(found, config, pose))) <= 0.2


def test_a_small_chessboard_is_found_in_the_enlarged_image():
    config = chessboard()
    pose = held(5.5, (0.1, 0.2, 0.1), config)
    found = labeler(config).label(picture(config, pose))
    assert found.detected
    assert np.sqrt(np.mean(errors(found, config, pose) ** 2)) <= 0.15


def test_a_chessboard_alike_after_half_a_turn_is_said():
    config = chessboard(dimension=(8, 6))
    found = labeler(config).label(picture(config, held(1.4, (0.1, 0.1, 2.9), config)))
    assert found.detected and "half a turn" in found.warnings[0]
    first, last = found.label.pixels[0], found.label.pixels[7]
    assert last[0] > first[0]


@pytest.mark.parametrize("noise", [0.0, 4.0, 12.0])
def test_a_picture_of_noise_is_searched_once(noise, monkeypatch):
    searches, seen = [], aruco.find_squares

    def counted(grey, dictionary):
        searches.append(grey.size)
        return seen(grey, dictionary)

    monkeypatch.setattr("atom_core.labeling.marker_search.find_squares", counted)
    monkeypatch.setattr("atom_core.aruco.find_squares", counted)
    image = 128.0 + noise * np.random.default_rng(1).standard_normal((800, 1280))
    found = labeler(charuco()).label(np.clip(np.rint(image), 0, 255).astype(np.uint8))
    assert not found.detected and searches == [800 * 1280]


def test_only_places_without_contrast_are_smoothed():
    rng = np.random.default_rng(0)
    image = np.clip(128 + 8 * rng.standard_normal((400, 600)), 0, 255).astype(np.uint8)
    image[150:250, 200:300] = (np.add.outer(np.arange(100) // 10, np.arange(100) // 10) % 2) * 200
    smooth = smoothed_where_flat(image)
    np.testing.assert_array_equal(smooth[145:255, 195:305], image[145:255, 195:305])
    assert smooth[:100].std() < 0.3 * image[:100].std()


def test_a_charuco_with_black_and_white_exchanged_is_as_exact():
    config = charuco()
    pattern = pattern_from_config("pattern_1", config)
    pose = held(1.3, (0.3, -0.2, 2.0), config)
    image = board_image.render(CAMERA, [((pattern, config), pose)], negative=True, border_grey=0)
    found = labeler(config).label(image)
    assert len(found.label.ids) == 88
    assert np.max(np.abs(errors(found, config, pose))) <= 0.2


def test_a_mirrored_charuco_is_named():
    image = np.ascontiguousarray(picture(charuco(), held(1.3))[:, ::-1])
    found = labeler(charuco()).label(image)
    assert not found.detected and found.reason.startswith("the pattern is mirrored: ")


def test_a_mirrored_charuco_is_named_though_some_of_its_markers_have_other_meanings(monkeypatch):
    config = charuco()
    image = np.ascontiguousarray(picture(config, held(1.3))[:, ::-1])
    seen = aruco.find_squares

    def also_others(grey, dictionary):
        ids, outlines, unread = seen(grey, dictionary)
        if len(ids):
            return ids, outlines, unread
        _, outlines, _ = seen(np.ascontiguousarray(grey[:, ::-1]), dictionary)
        turned = (outlines * [-1.0, 1.0] + [grey.shape[1] - 1.0, 0.0])[:, ::-1]
        return np.arange(len(turned))[::-1], turned, unread

    monkeypatch.setattr("atom_core.labeling.marker_search.find_squares", also_others)
    found = labeler(config).label(image)
    assert not found.detected and found.reason.startswith("the pattern is mirrored: ")


def test_a_covered_corner_is_dropped_and_the_others_stay():
    config, pose = charuco(), held(1.3, (0.2, 0.3, 0.1))
    image = picture(config, pose)
    finder = labeler(config)
    whole = finder.label(image)
    hidden = whole.label.pixels[whole.label.ids == 40][0]
    cv2.circle(image, (int(hidden[0]) + 3, int(hidden[1]) + 2), 14, (150, 140, 90), -1)
    found = finder.label(image)
    assert 40 not in found.label.ids
    assert len(found.label.ids) >= 80
    assert np.max(np.abs(errors(found, config, pose))) < 0.3


# ---- what is no board, or another one


def test_swapped_rows_and_columns_are_named():
    image = picture(charuco(), held(1.3))
    found = labeler(charuco(dimension=(8, 11))).label(image)
    assert not found.detected
    assert "rows and columns are swapped" in found.reason and "{x: 11, y: 8}" in found.reason


def test_a_board_with_another_number_of_columns_is_named():
    image = picture(charuco(), held(1.3))
    found = labeler(charuco(dimension=(10, 8))).label(image)
    assert not found.detected and "{x: 11, y: 8} fits" in found.reason


@pytest.mark.parametrize(
    "printed, configured",
    [((12, 9), (11, 8)), ((12, 9), (13, 10)), ((9, 6), (8, 11)), ((6, 4), (8, 6))],
)
def test_the_board_that_is_seen_is_named_with_its_rows(printed, configured):
    config = charuco(dimension=printed)
    image = picture(config, held(1.5, (0.2, 0.1, 0.1), config))
    found = labeler(charuco(dimension=configured)).label(image)
    columns, rows = printed
    assert not found.detected and f"{{x: {columns}, y: {rows}}} fits" in found.reason
    assert "swapped" not in found.reason


@pytest.mark.parametrize(
    "printed", ["DICT_4X4_100", "DICT_4X4_250", "DICT_6X6_100", "DICT_7X7_1000"]
)
def test_the_dictionary_that_a_board_is_printed_with_is_named(printed):
    config = charuco(dictionary=printed)
    found = labeler(charuco()).label(picture(config, held(0.9, (0.2, 0.1, 0.1), config)))
    enough = f"{printed.rpartition('_')[0]}_100"  # for 54 markers
    assert not found.detected and f"markers of {enough} stand as on it" in found.reason
    assert "correct dictionary" in found.reason


def test_markers_of_another_dictionary_that_stand_as_on_no_such_board_are_not_named():
    config = charuco(dimension=(6, 5), dictionary="DICT_4X4_50")
    found = labeler(charuco()).label(picture(config, held(0.9, (0.2, 0.1, 0.1), config)))
    assert found.reason == "no marker of DICT_5X5_100 is seen"


@pytest.mark.sampled(3)
@pytest.mark.parametrize("times", [0.6, 0.8, 0.9, 0.93, 0.95, 0.98, 1.02, 1.05, 1.1, 1.2, 1.3])
def test_an_inner_size_that_is_wrong_is_named_and_misleads_no_corner(times):
    for dimension in ((6, 5), (11, 8)):
        printed = charuco(dimension=dimension)
        configured = replace(printed, inner_size=printed.inner_size * times)
        for number, pose in enumerate(poses(4, 5, 25.0, 45.0, printed)):
            found = labeler(configured).label(picture(printed, pose, number))
            if found.detected:
                assert 0.85 < times < 1.15
                assert np.max(np.abs(errors(found, printed, pose))) <= 0.6
            elif not 0.95 <= times <= 1.05:
                assert "of their squares' sides; the configuration says" in found.reason


@pytest.mark.parametrize("config", [charuco(), chessboard()], ids=["charuco", "chessboard"])
def test_no_board_has_a_reason(config):
    noise = np.random.default_rng(0).integers(0, 255, (800, 1280, 3)).astype(np.uint8)
    found = labeler(config).label(noise)
    assert not found.detected and len(found.label.pixels) == 0
    assert "no marker" in found.reason or "no chessboard" in found.reason


def test_a_blurred_board_is_exact_or_not_found():
    config, pose = charuco(), held(1.6, (0.3, -0.2, 0.4))
    for sigma in (1.0, 2.0, 4.0, 8.0):
        found = labeler(config).label(cv2.GaussianBlur(picture(config, pose), (0, 0), sigma))
        assert found.detected or found.reason
        if found.detected:
            assert np.sqrt(np.mean(errors(found, config, pose) ** 2)) < 0.3
    assert not found.detected


def test_a_quarter_of_the_corners_is_needed():
    config = charuco()
    pose = held(1.0, offset=(-0.93, 0.0))
    found = labeler(config).label(picture(config, pose))
    seen = CAMERA.in_image(se3.apply(pose, labeler(config).pattern.corners_of(np.arange(88))), 3.0)
    assert 0 < np.sum(seen) < 22
    assert not found.detected and "are needed" in found.reason


# ---- data that are no image


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.zeros((800, 1280), np.uint16), "uint16"),
        (np.zeros((800, 1280, 3), np.float32), "float32"),
        (np.zeros((800, 1280, 4), np.uint8), "bgr8"),
        (np.zeros((0, 0, 3), np.uint8), "empty"),
        (np.zeros((480, 640, 3), np.uint8), "camera_info says 1280 x 800"),
    ],
)
def test_wrong_images_are_refused(image, message):
    with pytest.raises(LabelingError, match=message):
        labeler(charuco()).label(image)


def test_grey_and_colour_give_the_same_label():
    config = charuco()
    colour = picture(config, held(1.3))
    grey = cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY)
    one, other = labeler(config).label(colour), labeler(config).label(grey[..., None])
    np.testing.assert_array_equal(one.label.pixels, other.label.pixels)


def test_the_registry_knows_the_modality():
    config = charuco()
    pattern = pattern_from_config("pattern_1", config)
    assert isinstance(labeler_for(sensor(), pattern, config), RgbLabeler)


# ---- real pictures

VERSION = tuple(map(int, cv2.__version__.split(".")[:2]))
OLD_BOARDS = VERSION < (4, 6)  # which number a board's rows from the bottom up


def test_charuco_real(real_data):
    """28 pictures: all found, a good calibration, OpenCV 4.5.5 and 4.6 off by half a pixel."""
    config = charuco(**SMALL)
    finder = without_intrinsics(labeler(config))
    objects, images, differences = [], [], []
    for path in sorted(real_data("charuco_real").glob("*.png")):
        image = cv2.imread(str(path))
        found = finder.label(image)
        assert len(found.label.ids) == 24, path.name
        objects.append(finder.pattern.corners_of(found.label.ids).astype(np.float32))
        images.append(found.label.pixels.astype(np.float32))
        differences.append(raw_difference(image, found))
    assert len(images) == 28
    rms, K, *_ = cv2.calibrateCamera(objects, images, (1280, 720), None, None)
    assert rms <= 0.65
    assert K[0, 0] == pytest.approx(898.3, abs=2) and K[0, 2] == pytest.approx(649.0, abs=2)
    if hasattr(cv2.aruco, "CharucoBoard_create"):  # until 4.6
        bias = 0.0 if VERSION < (4, 5) else -0.5
        np.testing.assert_allclose(np.concatenate(differences).mean(axis=0), bias, atol=0.05)


def raw_difference(image, found):
    if not hasattr(cv2.aruco, "CharucoBoard_create"):
        return np.zeros((0, 2))
    markers = cv2.aruco.Dictionary_get(cv2.aruco.DICT_4X4_50)
    board = cv2.aruco.CharucoBoard_create(7, 5, 0.03, 0.022, markers)
    corners, ids, _ = cv2.aruco.detectMarkers(image, markers)
    _, raw, raw_ids = cv2.aruco.interpolateCornersCharuco(corners, ids, image, board)
    if OLD_BOARDS:
        raw_ids = (3 - raw_ids // 6) * 6 + raw_ids % 6
    _, ours, theirs = np.intersect1d(found.label.ids, raw_ids.ravel(), return_indices=True)
    return found.label.pixels[ours] - raw[theirs, 0]


def test_charuco_real_with_rows_and_columns_swapped(real_data):
    config = charuco(**{**SMALL, "dimension": (4, 6)})
    path = sorted(real_data("charuco_real").glob("*.png"))[0]
    found = without_intrinsics(labeler(config)).label(cv2.imread(str(path)))
    assert not found.detected and "swapped" in found.reason


def test_chessboards_of_opencv():
    """The 13 left pictures that Debian's opencv-doc brings, 9 x 6 corners."""
    paths = sorted(OPENCV_CHESSBOARDS.glob("left[0-9][0-9].jpg"))
    if not paths:
        pytest.skip("no opencv-doc: apt-get install opencv-doc")
    config = chessboard()
    finder = without_intrinsics(labeler(config))
    objects, images = [], []
    for path in paths:
        found = finder.label(cv2.imread(str(path)))
        assert found.detected, path.name
        objects.append(finder.pattern.corners_of(found.label.ids).astype(np.float32))
        images.append(found.label.pixels.astype(np.float32))
    rms, *_ = cv2.calibrateCamera(objects, images, (640, 480), None, None)
    assert rms <= 0.20
