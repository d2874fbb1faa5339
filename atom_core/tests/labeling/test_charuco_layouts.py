"""Which square each marker of a ChArUco fills: layout, size, and markers of other things."""

import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from rgb_labelers import labeler, without_intrinsics  # noqa: E402

from atom_core import aruco  # noqa: E402
from atom_core.synthetic.board import charuco  # noqa: E402


@pytest.mark.parametrize("legacy", [True, False])
def test_the_layout_of_an_even_number_of_rows_is_recognised(legacy):
    squares, side = (8, 6), 60
    config = charuco(dimension=(7, 5), size=0.06, inner_size=0.045)
    printed = aruco.charuco_print(squares, 0.75, "DICT_5X5_100", side, legacy)
    image = cv2.copyMakeBorder(printed, 60, 60, 60, 60, cv2.BORDER_CONSTANT, value=255)
    finder = without_intrinsics(labeler(config))
    found = finder.label(image)
    row, column = np.divmod(found.label.ids, 7)
    expected = np.column_stack([column + 1, row + 1]) * side + 60 - 0.5
    assert len(found.label.ids) == 35
    np.testing.assert_allclose(found.label.pixels, expected, atol=0.02)


def painted_over(image, pixels, margin_px):
    """Return the picture with all grey but what is around some of the corners."""
    low, high = pixels.min(axis=0) - margin_px, pixels.max(axis=0) + margin_px
    left, top, right, bottom = (int(round(v)) for v in (*low, *high))
    kept = np.full_like(image, 150)
    kept[top:bottom, left:right] = image[top:bottom, left:right]
    return kept


# With an odd number of columns of squares, most markers of one layout stand in the other, too,
# one square beside.
@pytest.mark.parametrize("dimension", [(4, 7), (6, 5), (4, 3)])
@pytest.mark.parametrize("legacy", [True, False])
def test_the_layout_of_an_odd_number_of_columns_is_not_mistaken(dimension, legacy):
    config = charuco(dimension=dimension, size=0.06, inner_size=0.045)
    squares = (dimension[0] + 1, dimension[1] + 1)
    printed = aruco.charuco_print(squares, 0.75, "DICT_5X5_100", 40, legacy)
    image = cv2.copyMakeBorder(printed, 60, 60, 60, 60, cv2.BORDER_CONSTANT, value=255)
    image = cv2.GaussianBlur(image, (0, 0), 1.0)
    row, column = np.divmod(np.arange(dimension[0] * dimension[1]), dimension[0])
    expected = np.column_stack([column + 1, row + 1]) * 40.0 + 59.5
    finder = without_intrinsics(labeler(config))
    found = finder.label(image)
    assert len(found.label.ids) == len(expected)
    np.testing.assert_allclose(found.label.pixels, expected, atol=0.1)
    # a part that both layouts explain: no label, or the right one
    for ids in (column >= 1, column <= dimension[0] - 2, (column >= 1) & (row >= 1)):
        found = finder.label(painted_over(image, expected[ids], 25))
        assert found.detected or found.reason
        if found.detected:
            np.testing.assert_allclose(found.label.pixels, expected[found.label.ids], atol=0.2)


def test_markers_that_two_layouts_explain_are_refused():
    config = charuco(dimension=(4, 3), size=0.06, inner_size=0.045)
    printed = aruco.charuco_print((5, 4), 0.75, "DICT_5X5_100", 40)
    image = cv2.copyMakeBorder(printed, 60, 60, 60, 60, cv2.BORDER_CONSTANT, value=255)
    three = painted_over(image, np.array([[100.0, 60.0], [220.0, 140.0]]), 1)
    finder = without_intrinsics(labeler(config))
    found = finder.label(three)
    assert not found.detected and "write legacy: true" in found.reason
    told = without_intrinsics(labeler(replace(config, legacy=False))).label(three)
    assert "legacy" not in told.reason


def test_a_layout_that_is_demanded_and_wrong_is_named():
    config = replace(charuco(dimension=(7, 5)), legacy=True)
    image = cv2.copyMakeBorder(
        aruco.charuco_print((8, 6), 0.75, "DICT_5X5_100", 60), 60, 60, 60, 60, 0, value=255
    )
    found = without_intrinsics(labeler(config)).label(image)
    assert not found.detected and "legacy: false fits" in found.reason


# (squares, printed before 4.6), (inner corners, legacy) as configured, and what is to be told.
OTHER_PRINTS = [
    (((7, 6), True), ((6, 5), False), "legacy: true fits"),
    (((7, 6), False), ((6, 5), True), "legacy: false fits"),
    (((7, 4), True), ((6, 4), "auto"), "{x: 6, y: 3} fits"),
    (((7, 6), False), ((6, 4), "auto"), "{x: 6, y: 5} fits"),
    (((7, 7), False), ((6, 5), "auto"), "{x: 6, y: 6} fits"),
]


@pytest.mark.parametrize("printed, configured, told", OTHER_PRINTS)
def test_a_print_whose_markers_mostly_stand_as_configured_is_named(printed, configured, told):
    """Most of them do one square beside: the labels were off by a square, without a word."""
    squares, legacy = printed
    image = cv2.copyMakeBorder(
        aruco.charuco_print(squares, 0.75, "DICT_5X5_100", 60, legacy), 60, 60, 60, 60, 0, value=255
    )
    dimension, wanted = configured
    config = replace(charuco(dimension=dimension, size=0.06, inner_size=0.045), legacy=wanted)
    found = without_intrinsics(labeler(config)).label(image)
    assert not found.detected and told in found.reason
    right = charuco(dimension=(squares[0] - 1, squares[1] - 1), size=0.06, inner_size=0.045)
    for said in ("auto", legacy):
        found = without_intrinsics(labeler(replace(right, legacy=said))).label(image)
        assert len(found.label.ids) == (squares[0] - 1) * (squares[1] - 1)


@pytest.mark.parametrize("count", [4, 10])
def test_markers_of_something_else_do_not_hide_the_board(count):
    """Their numbers are none of the board's; they count as none of its."""
    config = charuco(dimension=(6, 4), size=0.06, inner_size=0.045)
    printed = aruco.charuco_print((7, 5), 0.75, "DICT_5X5_100", 60)
    image = cv2.copyMakeBorder(printed, 60, 260, 60, 60, cv2.BORDER_CONSTANT, value=255)
    others = aruco.charuco_print((20, 5), 0.75, "DICT_5X5_100", 60)
    places = aruco.marker_squares(20, 5, False)[20 : 20 + count]
    for index, (column, row) in enumerate(places):
        marker = others[60 * row : 60 * (row + 1), 60 * column : 60 * (column + 1)]
        x, y = 10 + 90 * (index % 5), 400 + 80 * (index // 5)
        image[y : y + 60, x : x + 60] = marker
    found = without_intrinsics(labeler(config)).label(image)
    row, column = np.divmod(found.label.ids, 6)
    expected = np.column_stack([column + 1, row + 1]) * 60 + 60 - 0.5
    assert len(found.label.ids) == 24
    np.testing.assert_allclose(found.label.pixels, expected, atol=0.1)


def test_two_boards_with_the_same_markers_are_named():
    printed = aruco.charuco_print((7, 5), 0.75, "DICT_5X5_100", 60)
    one = cv2.copyMakeBorder(printed, 60, 60, 60, 60, cv2.BORDER_CONSTANT, value=255)
    config = charuco(dimension=(6, 4), size=0.06, inner_size=0.045)
    found = without_intrinsics(labeler(config)).label(np.hstack([one, one]))
    assert not found.detected
    assert "17 markers of DICT_5X5_100 are seen twice" in found.reason
