"""Chessboards of any polarity, size and turn: found, in the right order, exact."""

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from rgb_labelers import labeler, without_intrinsics  # noqa: E402

from atom_core.labeling import chessboard, chessboard_detection  # noqa: E402
from atom_core.labeling.chessboard import ChessboardFinder, mirror_shows  # noqa: E402
from atom_core.synthetic import scenes  # noqa: E402
from atom_core.synthetic.board import chessboard as board_of  # noqa: E402
from atom_core.synthetic.board_pictures import chessboard_pictures, corner_errors  # noqa: E402

CAMERA = scenes.COLOUR_CAMERA


def label_all(pictures):
    """Return errors (n, 2) [px] by blur, and how many pictures there are and were found."""
    errors, count, found = {}, 0, 0
    for picture in pictures:
        corners, reason, *_ = ChessboardFinder(*picture.config.dimension).find(picture.image)
        count += 1
        if corners is None:
            assert "no chessboard" in reason or "hidden or blurred" in reason
            continue
        error, ordered = corner_errors(picture, corners.pixels)
        assert ordered, picture.config.dimension
        errors.setdefault(picture.blur_px, []).append(error)
        found += 1
    return {blur: np.concatenate(parts) for blur, parts in errors.items()}, count, found


@pytest.mark.sampled(1)
@pytest.mark.parametrize("count", [12, pytest.param(400, marks=pytest.mark.long)])
def test_any_board_is_found_in_its_order_and_without_bias(count):
    errors, count, found = label_all(chessboard_pictures(CAMERA, count, 3))
    assert found >= 0.99 * count
    together = np.concatenate(list(errors.values()))
    assert np.max(np.abs(together.mean(axis=0))) <= 0.05
    sharp = np.concatenate([error for blur, error in errors.items() if blur <= 1.0])
    assert np.max(np.sqrt(np.mean(sharp**2, axis=0))) <= 0.2


def test_a_grid_that_a_detector_puts_beside_the_board_is_put_right():
    """Of this small board of 3 x 4 corners one finds four lines of four, one of them the margin."""
    *_, picture = chessboard_pictures(CAMERA, 83, 3)
    corners, reason, *_ = ChessboardFinder(*picture.config.dimension).find(picture.image)
    assert corners is not None, reason
    error, ordered = corner_errors(picture, corners.pixels)
    assert ordered and np.max(np.abs(error)) < 0.5


@pytest.mark.parametrize("size", [(9, 6), (7, 5)])
def test_the_edge_of_the_plate_is_no_row_of_corners(size):
    """As in left01.jpg of OpenCV, configured with a row too many: nine points along the edge."""
    image, corners = flat_board(*size, starts_white=False, side=30, background=90)
    columns, rows = size
    image[: 50 - 14], image[rows * 30 + 30 + 50 + 14 :] = 90, 90
    image[50 - 14 : 50, 50 - 14 : -36] = (
        225  # a white margin, half a square wide, before a grey room
    )
    image = cv2.GaussianBlur(image, (0, 0), 1.0)
    edge = corners[:1] - [0.0, 45.0]
    edge[0, ::2, 1] += 8.0  # the points zigzag there
    grid = np.concatenate([edge, corners])
    finder = ChessboardFinder(columns, rows + 1)
    found = finder._labeled(image, grid)
    assert found.corners is None
    assert f"a chessboard of {columns} x {rows} inner corners is seen" in found.reason


def test_an_outer_row_must_be_nearly_as_clear_as_the_others():
    """The edge of OpenCV's left01.jpg has 0.55, true outer rows of its pictures 0.97 and more."""
    for outer in (0, -1):
        for axis in (0, 1):
            quality = np.ones((7, 9))
            np.moveaxis(quality, axis, 0)[outer] = 0.55
            assert not chessboard._clear(quality)
    quality = np.ones((7, 9))
    quality[3] = 0.55  # a reflection
    assert chessboard._clear(quality)


def flat_board(columns, rows, starts_white, side=24, background=255):
    """Return a board seen straight from the front, and the grid of its corners."""
    row, column = np.mgrid[0 : rows + 1, 0 : columns + 1]
    white = (row + column) % 2 == (0 if starts_white else 1)
    board = np.kron(np.where(white, 235, 30).astype(np.uint8), np.ones((side, side), np.uint8))
    image = cv2.copyMakeBorder(board, 50, 50, 50, 50, cv2.BORDER_CONSTANT, value=background)
    row, column = np.mgrid[1 : rows + 1, 1 : columns + 1]
    return image, np.stack([column, row], axis=-1) * float(side) + 49.5


@pytest.mark.sampled(16)
@pytest.mark.parametrize("turns", range(4))
@pytest.mark.parametrize("starts_white", [False, True], ids=["black", "white"])
@pytest.mark.parametrize("size", [(7, 5), (8, 6), (6, 6), (5, 5), (9, 6)])
def test_numbers_follow_the_one_rule(size, starts_white, turns):
    image, _ = flat_board(*size, starts_white)
    found = ChessboardFinder(*size).find(np.ascontiguousarray(np.rot90(image, turns)))
    labeled = found.corners.pixels.reshape(size[1], size[0], 2)
    along, down = labeled[0, -1] - labeled[0, 0], labeled[-1, 0] - labeled[0, 0]
    assert along[0] * down[1] - along[1] * down[0] > 0  # never mirrored
    before = np.rint(labeled[0, 0] - 0.5 * (along / (size[0] - 1) + down / (size[1] - 1)))
    turned = np.rot90(image, turns)
    black_first = turned[int(before[1]), int(before[0])] < 128
    has_black_turn = not starts_white or sum(size) % 2 == 1 or (size[0] == size[1] and size[0] % 2)
    assert black_first == bool(has_black_turn)
    if sum(size) % 2 == 0 and not (size[0] == size[1] and size[0] % 2):
        assert along[0] > 1 or (abs(along[0]) < 1 and along[1] > 0)


@pytest.mark.parametrize("size", [(9, 6), (6, 9), (8, 6), (6, 6), (5, 5), (7, 5), (5, 7)])
def test_a_mirror_image_is_that_of_the_same_board_but_for_odd_by_odd_of_two_sizes(size):
    """Mathematics, not detection: no turn of the board makes its mirror image where that shows."""
    image, _ = flat_board(*size, False)
    mirrored = image[:, ::-1]
    turns = [np.rot90(image, turn) for turn in range(4)]
    same = any(np.array_equal(mirrored, turn) for turn in turns)
    assert same != mirror_shows(*size)
    exchanged, _ = flat_board(*size, True)
    if mirror_shows(*size):
        assert np.array_equal(mirrored, exchanged)


@pytest.mark.parametrize("size", [(7, 5), (5, 7)])
def test_of_odd_by_odd_corners_the_colour_before_the_first_one_tells_the_mirror_image(size):
    image, _ = flat_board(*size, False)
    for turn in range(4):
        turned = np.rot90(image, turn)
        assert ChessboardFinder(*size).find(np.ascontiguousarray(turned)).starts_black
        mirrored = np.ascontiguousarray(turned[:, ::-1])
        assert not ChessboardFinder(*size).find(mirrored).starts_black


def test_part_of_a_larger_board_is_refused_by_name():
    image, _ = flat_board(9, 6, False)
    for size in ((9, 5), (8, 6), (7, 4)):
        found = ChessboardFinder(*size).find(image)
        assert found.corners is None and f"{size[0]} x {size[1]}" in found.reason


def test_the_lines_beyond_a_part_of_a_board_are_counted():
    image, grid = flat_board(9, 6, True)
    part = grid[1:5, 2:7]
    assert chessboard._whole_grid(image, part, chessboard._starts_black(image, part)) == (9, 6)
    assert chessboard._whole_grid(image, grid, chessboard._starts_black(image, grid)) == (9, 6)


def test_a_board_without_a_border_on_a_dark_floor_is_found():
    image, grid = flat_board(7, 5, True, background=30)
    found = ChessboardFinder(7, 5).find(image)
    np.testing.assert_allclose(found.corners.pixels, grid.reshape(-1, 2), atol=0.02)


def test_too_small_a_board_is_a_sentence():
    image, _ = flat_board(2, 5, False)
    assert "at least 3 x 3" in ChessboardFinder(2, 5).find(image).reason


def test_noise_alone_is_no_board():
    noise = np.random.default_rng(0).integers(0, 255, (480, 640), dtype=np.uint8)
    assert ChessboardFinder(7, 5).find(noise).corners is None


@pytest.mark.long
def test_fisheye_pictures(real_data):
    """20 pictures of 1920 x 1208: all found, and a fisheye camera agrees with the corners."""
    row, column = np.mgrid[0:5, 0:7]
    board = 0.095 * np.column_stack([column.ravel(), row.ravel(), np.zeros(35)])
    pixels = []
    for path in sorted(Path(real_data("acfr_fisheye")).glob("*.png")):
        found = ChessboardFinder(7, 5).find(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))
        assert found.corners is not None, path.name
        pixels.append(found.corners.pixels[None])
    assert len(pixels) == 20
    names = cv2.fisheye if hasattr(cv2.fisheye, "CALIB_FIX_SKEW") else cv2  # those of OpenCV 5
    flags = names.CALIB_RECOMPUTE_EXTRINSIC | names.CALIB_FIX_SKEW
    rms, *_ = cv2.fisheye.calibrate(
        [board[None]] * 20, pixels, (1920, 1208), np.eye(3), np.zeros((4, 1)), flags=flags
    )
    assert rms <= 0.14


def test_a_corner_that_the_detector_puts_elsewhere_is_put_right(monkeypatch):
    image, grid = flat_board(7, 5, False)
    shifted = grid.copy()
    shifted[0, 0] += [9.0, -4.0]
    shifted[2, 3] += [3.5, 3.5]
    monkeypatch.setattr(chessboard, "detect", lambda *_: shifted.reshape(-1, 2))
    found = ChessboardFinder(7, 5).find(image)
    np.testing.assert_allclose(found.corners.pixels, grid.reshape(-1, 2), atol=0.02)
    cv2.circle(image, tuple(int(v) for v in grid[0, 0]), 9, 130, -1)
    found = ChessboardFinder(7, 5).find(image)
    assert found.corners is None and "corner 0 of the chessboard is hidden" in found.reason


def test_a_detector_that_is_three_pixels_off_leaves_no_corner_there(monkeypatch):
    """The outlines of squares that blur parts end there."""
    image, grid = flat_board(5, 4, False, side=30)
    off = np.where(np.arange(4)[:, None, None] < 3, [-2.3, -1.8], 0.0)
    monkeypatch.setattr(chessboard, "detect", lambda *_: (grid + off).reshape(-1, 2))
    found = without_intrinsics(labeler(board_of(dimension=(5, 4)))).label(image)
    assert found.label.ids.tolist() == list(range(20))
    np.testing.assert_allclose(found.label.pixels, grid.reshape(-1, 2), atol=0.1)


def test_a_corner_that_the_picture_does_not_confirm_is_no_label(monkeypatch):
    image, grid = flat_board(7, 5, False)
    cv2.circle(image, tuple(int(v) for v in grid[2, 3]), 9, 130, -1)
    shifted = grid.copy()
    shifted[2, 3] += [0.4, 0.3]
    monkeypatch.setattr(chessboard, "detect", lambda *_: shifted.reshape(-1, 2))
    found = without_intrinsics(labeler(board_of(dimension=(7, 5)))).label(image)
    assert found.label.ids.tolist() == [i for i in range(35) if i != 2 * 7 + 3]
    np.testing.assert_allclose(
        found.label.pixels, np.delete(grid.reshape(-1, 2), 17, axis=0), atol=0.1
    )
    assert found.quality["dropped"] == 1.0


@pytest.mark.sampled(1)
@pytest.mark.parametrize("mirrored", [False, True])
def test_of_two_boards_none_is_taken(mirrored):
    """Beside the second, or a mirror: which of them is the board is not for a guess."""
    for picture in chessboard_pictures(CAMERA, 6, 5):
        other = picture.image[:, ::-1] if mirrored else picture.image
        found = ChessboardFinder(*picture.config.dimension).find(np.hstack([picture.image, other]))
        assert found.corners is None and "two chessboards of" in found.reason


def test_a_second_board_that_one_detector_misses_is_found_by_the_other(monkeypatch):
    """The right picture of OpenCV's first pair beside the left one was taken for no board."""
    monkeypatch.setattr(chessboard_detection, "_sectors", lambda *_: (False, None))
    squares = np.kron(np.indices((6, 8)).sum(axis=0) % 2, np.ones((40, 40))) * 200 + 30
    board = np.pad(squares, 60, constant_values=230).astype(np.uint8)
    both = np.hstack([board, board])
    corners = np.stack(np.meshgrid(np.arange(1, 8), np.arange(1, 6)), axis=-1) * 40 + 59.5
    _, other = chessboard_detection.detect_another(both, corners)
    middle = corners.mean(axis=(0, 1)) + [board.shape[1], 0]
    np.testing.assert_allclose(other.mean(axis=0), middle, atol=1.0)


def test_half_a_second_board_does_no_harm():
    for picture in chessboard_pictures(CAMERA, 4, 5):
        middle = int(picture.corners_px[:, 0].mean())
        found = ChessboardFinder(*picture.config.dimension).find(
            np.hstack([picture.image, picture.image[:, :middle]])
        )
        assert found.corners is not None, found.reason
