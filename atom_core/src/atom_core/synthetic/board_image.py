"""Pictures of boards: the print of a pattern, seen by a camera before a grey background."""

from __future__ import annotations

from functools import lru_cache
from typing import List, Optional, Tuple

import numpy as np
from scipy import sparse

from atom_core import opencv as cv2
from atom_core.aruco import charuco_print
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.config import PatternConfig
from atom_core.model.pattern import CHARUCO, Pattern
from atom_core.synthetic.board import border_points, facing

GREY, WHITE = 110, 255
_PIXELS_PER_SQUARE = 40  # of the print
_FINER = 2  # the picture is sampled finer and averaged, so that edges keep their place
_COARSE_PX = 4  # grid on which the lens distortion is undone exactly; linear in between

Board = Tuple[Tuple[Pattern, PatternConfig], np.ndarray]


def render(
    camera: Camera, boards: List[Board], negative: bool = False, border_grey: int = WHITE
) -> np.ndarray:
    """Return the picture (height, width, 3), blue green red, of boards before grey.

    Args:
        camera: intrinsics, distortion included.
        boards: each a pattern with its configuration, and ``camera_T_pattern`` (4, 4).
        negative: exchange black and white of the print.
        border_grey: grey value of the border around the print, and of the back.
    """
    picture = np.full((camera.height, camera.width), GREY, dtype=np.uint8)
    farthest_first = sorted(boards, key=lambda board: -float(np.linalg.norm(board[1][:3, 3])))
    for (pattern, config), camera_T_pattern in farthest_first:
        window = _window(camera, pattern, camera_T_pattern)
        if window is not None:
            squares = printed(pattern, config)
            squares = cv2.bitwise_not(squares) if negative else squares
            _draw(picture, camera, (pattern, squares, border_grey), camera_T_pattern, window)
    return cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR)


def _draw(
    picture: np.ndarray,
    camera: Camera,
    board: Tuple[Pattern, np.ndarray, int],
    camera_T_pattern: np.ndarray,
    window: Tuple[np.ndarray, np.ndarray],
) -> None:
    """Draw one board: for each pixel of its window, what its ray meets in the board's plane.

    ``board`` is the pattern, its printed squares and the grey value around them.
    """
    (left, top), (right, bottom) = window
    pattern, squares, border_grey = board
    x, y, in_front = _in_plane(camera, camera_T_pattern, left, top, right, bottom)
    border = pattern.border
    covered = in_front & (np.abs(x - border.centre[0]) <= border.half_size[0])
    covered &= np.abs(y - border.centre[1]) <= border.half_size[1]
    grey = np.full(x.shape, border_grey, dtype=np.uint8)
    if facing(camera_T_pattern, border) > 0:  # the back is blank
        # pixel i of the print covers i to i + 1 in units of its side, hence the half
        start = 0.0 if pattern.kind == CHARUCO else -pattern.square_m
        scale = _PIXELS_PER_SQUARE / pattern.square_m
        for v in (x, y):
            v -= start
            v *= scale
            v -= 0.5
            v[~covered] = -10.0
        grey = cv2.remap(squares, x, y, cv2.INTER_LINEAR, borderValue=border_grey)
    part = picture[top:bottom, left:right]
    fine = np.where(covered, grey, np.repeat(np.repeat(part, _FINER, axis=0), _FINER, axis=1))
    part[:] = cv2.resize(fine, (right - left, bottom - top), interpolation=cv2.INTER_AREA)


def _window(
    camera: Camera, pattern: Pattern, camera_T_pattern: np.ndarray
) -> Optional[Tuple[np.ndarray, np.ndarray]]:
    """Return the first and one past the last pixel (x, y) around a board, None if out of view."""
    in_camera = se3.apply(camera_T_pattern, border_points(pattern))
    if np.max(in_camera[:, 2]) < 0.05:
        return None
    limit = np.array([camera.width, camera.height])
    if np.min(in_camera[:, 2]) < 0.05:
        return np.zeros(2, dtype=int), limit
    pixels = camera.project(in_camera)
    low = np.clip(np.floor(pixels.min(axis=0)) - 2, 0, limit).astype(int)
    high = np.clip(np.ceil(pixels.max(axis=0)) + 3, 0, limit).astype(int)
    return (low, high) if np.all(high > low) else None


def _in_plane(
    camera: Camera, camera_T_pattern: np.ndarray, left: int, top: int, right: int, bottom: int
) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x, y [m] in the board's plane of a window's fine pixels, and whether in front."""
    to_columns, columns = _interpolation(left, right)
    to_rows, rows = _interpolation(top, bottom)
    coarse = camera.normalise(np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2))
    # ray = s [first axis, second axis, origin] (x, y, 1) with s > 0 for what lies in front
    h = np.linalg.inv(camera_T_pattern[:3, [0, 1, 3]])
    at_knots = (coarse @ h[:, :2].T + h[:, 2]).T.reshape(3, len(rows), len(columns))
    x, y, w = (to_rows @ (to_columns @ c.T.astype(np.float32)).T for c in at_knots)
    in_front = w > 0
    w[~in_front] = 1.0
    return x / w, y / w, in_front


def _interpolation(first: int, end: int) -> Tuple[sparse.csr_matrix, np.ndarray]:
    """Return the matrix from values at knots to those at fine pixels, and the knots [px]."""
    knots = np.arange(first - _COARSE_PX, end + 2 * _COARSE_PX, _COARSE_PX, dtype=float)
    fine = (np.arange(first * _FINER, end * _FINER) + 0.5) / _FINER - 0.5
    place = (fine - knots[0]) / _COARSE_PX
    before = place.astype(int)
    share = np.column_stack([before + 1 - place, place - before]).astype(np.float32)
    columns = np.column_stack([before, before + 1])
    starts = 2 * np.arange(len(fine) + 1)
    shape = (len(fine), len(knots))
    return sparse.csr_matrix((share.ravel(), columns.ravel(), starts), shape), knots


def printed(
    pattern: Pattern, config: PatternConfig, pixels_per_square: int = _PIXELS_PER_SQUARE
) -> np.ndarray:
    """Return the printed squares of a pattern (height, width), grey values."""
    squares = (pattern.columns + 1, pattern.rows + 1)
    if pattern.kind != CHARUCO:
        return _chessboard(squares, pixels_per_square)
    assert config.inner_size is not None and config.dictionary is not None
    marker_share = config.inner_size / pattern.square_m
    return charuco_print(squares, marker_share, config.dictionary, pixels_per_square)


@lru_cache(maxsize=8)
def _chessboard(squares: Tuple[int, int], pixels_per_square: int) -> np.ndarray:
    row, column = np.mgrid[0 : squares[1], 0 : squares[0]]
    fields = np.where((row + column) % 2 == 0, 0, WHITE).astype(np.uint8)
    return np.kron(fields, np.ones((pixels_per_square, pixels_per_square), dtype=np.uint8))
