"""Pictures of boards: the texture of a pattern, warped into a camera's image."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, List, Mapping, Tuple

import cv2
import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.geometry.rectangle import Rectangle
from atom_core.model.pattern import CHARUCO, Pattern

GREY, WHITE = 110, 255
_PIXELS_PER_SQUARE = 40  # of the texture
_FINER = 2  # the picture is sampled finer and averaged, so that edges keep their place

Board = Tuple[Tuple[Pattern, Mapping[str, Any]], np.ndarray]


def render(camera: Camera, boards: List[Board]) -> np.ndarray:
    """Return the picture (height, width, 3), blue green red, of boards before grey.

    Args:
        camera: intrinsics, distortion included.
        boards: each a pattern with its configuration, and ``camera_T_pattern`` (4, 4).
    """
    grey = np.full((camera.height, camera.width), GREY, dtype=np.uint8)
    farthest_first = sorted(boards, key=lambda board: -float(np.linalg.norm(board[1][:3, 3])))
    for (pattern, config), camera_T_pattern in farthest_first:
        _draw(grey, camera, pattern, config, camera_T_pattern)
    return cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)


def _draw(grey, camera: Camera, pattern: Pattern, config, camera_T_pattern: np.ndarray) -> None:
    """Draw one board by asking, for each pixel of its window, where its ray meets the board."""
    window = _window(camera, pattern, camera_T_pattern)
    if window is None:
        return
    (left, top), (right, bottom) = window
    offset = (np.arange(_FINER) + 0.5) / _FINER - 0.5
    columns = (np.arange(left, right)[:, None] + offset).ravel()
    rows = (np.arange(top, bottom)[:, None] + offset).ravel()
    uv = np.stack(np.meshgrid(columns, rows), axis=-1)
    xy, in_front = _on_board(camera, camera_T_pattern, uv.reshape(-1, 2))
    picture = texture(pattern, config)
    scale, border = _PIXELS_PER_SQUARE / pattern.square_m, pattern.border
    pixel = (xy - [border.x_min, border.y_min]) * scale - 0.5
    pixel[~in_front] = -1e4
    maps = pixel.reshape(uv.shape).astype(np.float32)
    drawn = cv2.remap(
        picture, maps[..., 0], maps[..., 1], cv2.INTER_LINEAR, borderValue=(0.0, 0.0)
    ).astype(np.float32)
    size = (right - left, bottom - top)
    value, cover = cv2.split(cv2.resize(drawn, size, interpolation=cv2.INTER_AREA) / 255.0)
    part = grey[top:bottom, left:right]
    part[:] = np.clip(np.rint(part * (1 - cover) + 255.0 * value), 0, 255).astype(np.uint8)


def _window(camera: Camera, pattern: Pattern, camera_T_pattern: np.ndarray):
    outline = np.column_stack(
        [pattern.border.sample(0.05), np.zeros(len(pattern.border.sample(0.05)))]
    )
    in_camera = se3.apply(camera_T_pattern, outline)
    if np.max(in_camera[:, 2]) < 0.05:
        return None
    limit = np.array([camera.width, camera.height])
    if np.min(in_camera[:, 2]) < 0.05:
        return np.zeros(2, dtype=int), limit
    pixels = camera.project(in_camera)
    low = np.clip(np.floor(pixels.min(axis=0)) - 2, 0, limit).astype(int)
    high = np.clip(np.ceil(pixels.max(axis=0)) + 3, 0, limit).astype(int)
    return (low, high) if np.all(high > low) else None


def _on_board(camera: Camera, camera_T_pattern: np.ndarray, uv: np.ndarray):
    """Return where the rays of pixels (n, 2) meet the board's plane (n, 2) [m], and if before."""
    normalised = camera.normalise(uv)
    plane_from_ray = np.linalg.inv(camera_T_pattern[:3, [0, 1, 3]])
    h = np.column_stack([normalised, np.ones(len(uv))]) @ plane_from_ray.T
    in_front = h[:, 2] > 0
    return h[:, :2] / np.where(in_front, h[:, 2], 1.0)[:, None], in_front


def texture(pattern: Pattern, config: Mapping[str, Any]) -> np.ndarray:
    """Return the printed board (height, width, 2): grey value and coverage, both 0 to 255.

    Its first pixel lies at the border's x_min, y_min.
    """
    border: Rectangle = pattern.border
    key = (
        pattern.kind,
        pattern.columns + 1,
        pattern.rows + 1,
        pattern.square_m,
        float(config.get("inner_size", 0.75 * pattern.square_m)),
        str(config.get("dictionary", "DICT_5X5_100")),
        tuple(2.0 * border.half_size),
    )
    return _texture(*key)


@lru_cache(maxsize=8)
def _texture(kind, squares_x, squares_y, square_m, marker_m, dictionary, size_m) -> np.ndarray:
    scale = _PIXELS_PER_SQUARE / square_m
    width, height = (int(round(side * scale)) for side in size_m)
    sheet = np.full((height, width), WHITE, dtype=np.uint8)
    printed = (
        _charuco_print(squares_x, squares_y, square_m, marker_m, dictionary)
        if kind == CHARUCO
        else _chessboard_print(squares_x, squares_y)
    )
    top, left = (height - printed.shape[0]) // 2, (width - printed.shape[1]) // 2
    sheet[top : top + printed.shape[0], left : left + printed.shape[1]] = printed
    return np.dstack([sheet, np.full_like(sheet, 255)])


def _chessboard_print(squares_x: int, squares_y: int) -> np.ndarray:
    row, column = np.mgrid[0:squares_y, 0:squares_x]
    squares = np.where((row + column) % 2 == 0, 0, WHITE).astype(np.uint8)
    return np.kron(squares, np.ones((_PIXELS_PER_SQUARE, _PIXELS_PER_SQUARE), dtype=np.uint8))


def _charuco_print(squares_x, squares_y, square_m, marker_m, dictionary) -> np.ndarray:
    """Return the print of a ChArUco; OpenCV renamed everything at 4.7."""
    aruco = cv2.aruco
    size = (squares_x * _PIXELS_PER_SQUARE, squares_y * _PIXELS_PER_SQUARE)
    number = getattr(aruco, dictionary)
    if hasattr(aruco, "CharucoBoard_create"):
        markers = aruco.Dictionary_get(number)
        board = aruco.CharucoBoard_create(squares_x, squares_y, square_m, marker_m, markers)
        return board.draw(size)
    markers = aruco.getPredefinedDictionary(number)
    board = aruco.CharucoBoard((squares_x, squares_y), square_m, marker_m, markers)
    return board.generateImage(size)
