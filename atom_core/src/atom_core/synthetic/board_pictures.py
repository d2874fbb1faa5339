"""Boards of any size, polarity and turn in blurred, noisy pictures, with their corners."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Callable, Iterator, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.config import PatternConfig
from atom_core.model.pattern import Pattern, pattern_from_config
from atom_core.synthetic.board import charuco, chessboard
from atom_core.synthetic.board_image import render

_SQUARE_M, _BORDERS_M = 0.06, (0.0, 0.03, 0.06)
_BLURS_PX, _NOISES = (0.0, 0.7, 1.0, 1.5), (0.0, 4.0, 8.0, 12.0)
_LEAST_SQUARE_PX, _LARGEST_SIDE_PX, _LARGEST_BOARD_PX = 8.0, 40.0, 700.0
_LARGEST_CHARUCO_SIDE_PX = 70.0
_DICTIONARIES = {"DICT_4X4_50": 50, "DICT_4X4_100": 100, "DICT_5X5_100": 100, "DICT_6X6_250": 250}
_MARKER_SHARES = (0.6, 0.75, 0.8)
_LARGEST_TILT_DEG = 50.0
_CONTRAST, _BLACK = 0.75, 25.0  # a print is neither black nor white
_MARGIN_SQUARES = 0.7  # around the corners: the picture shows most of the outer squares


@dataclass(frozen=True)
class BoardPicture:
    """A picture of one board.

    Attributes:
        image: (height, width) uint8.
        config: the board.
        corners_px: (columns * rows, 2) in the order of the pattern's ids, as it is printed [px].
        negative: whether the first square is white.
        blur_px: standard deviation [px].
        noise: standard deviation [grey values].
        square_px: side of a square, as seen from the front.
    """

    image: np.ndarray
    config: PatternConfig
    corners_px: np.ndarray
    negative: bool
    blur_px: float
    noise: float
    square_px: float


def chessboard_pictures(camera: Camera, count: int, seed: int) -> Iterator[BoardPicture]:
    """Yield pictures of boards of 3 x 3 to 14 x 11 inner corners that are wholly in view.

    Both polarities, any turn, tilted by up to 50 degrees, with and without a white border.
    """
    return _pictures(camera, count, seed, _LARGEST_SIDE_PX, _drawn_chessboard)


def charuco_pictures(camera: Camera, count: int, seed: int) -> Iterator[BoardPicture]:
    """Yield pictures of ChArUcos as of chessboards; few below 15 px a square show markers."""
    return _pictures(camera, count, seed, _LARGEST_CHARUCO_SIDE_PX, _drawn_charuco)


Draw = Callable[[np.random.Generator, Tuple[int, int], float], PatternConfig]


def _drawn_chessboard(
    _: np.random.Generator, dimension: Tuple[int, int], border_m: float
) -> PatternConfig:
    return chessboard(dimension=dimension, size=_SQUARE_M, border_size=(border_m, border_m))


def _drawn_charuco(
    rng: np.random.Generator, dimension: Tuple[int, int], border_m: float
) -> PatternConfig:
    markers = ((dimension[0] + 1) * (dimension[1] + 1) + 1) // 2
    enough = [name for name, count in _DICTIONARIES.items() if count >= markers]
    return charuco(
        dimension=dimension,
        size=_SQUARE_M,
        inner_size=_SQUARE_M * float(rng.choice(_MARKER_SHARES)),
        dictionary=str(rng.choice(enough)),
        border_size=(border_m, border_m),
    )


def _pictures(
    camera: Camera, count: int, seed: int, largest_square_px: float, draw: Draw
) -> Iterator[BoardPicture]:
    rng = np.random.default_rng(seed)
    while count > 0:
        dimension = (int(rng.integers(3, 15)), int(rng.integers(3, 12)))
        largest = min(largest_square_px, _LARGEST_BOARD_PX / (max(dimension) + 3))
        square_px = float(np.exp(rng.uniform(*np.log([_LEAST_SQUARE_PX, largest]))))
        config = draw(rng, dimension, float(rng.choice(_BORDERS_M)))
        pattern = pattern_from_config("board", config)
        pose = _drawn_pose(rng, camera, pattern, square_px)
        corners = pattern.corners_of(np.arange(pattern.corner_count))
        pixels = camera.project(se3.apply(pose, corners))
        margin = _MARGIN_SQUARES * square_px
        limit = np.array([camera.width, camera.height]) - 1 - margin
        if not np.all((pixels > margin) & (pixels < limit)):
            continue
        count -= 1
        negative, blur_px = bool(rng.integers(2)), float(rng.choice(_BLURS_PX))
        noise = float(rng.choice(_NOISES))
        image = render(camera, [((pattern, config), pose)], negative)[..., 0]
        image = _as_taken(rng, image, blur_px, noise)
        yield BoardPicture(image, config, pixels, negative, blur_px, noise, square_px)


def _drawn_pose(
    rng: np.random.Generator, camera: Camera, pattern: Pattern, square_px: float
) -> np.ndarray:
    """Return ``camera_T_pattern`` of a board tilted about an axis of any direction."""
    distance_m = float(camera.focal_px[0]) * pattern.square_m / square_px
    tilt = np.radians(rng.uniform(0.0, _LARGEST_TILT_DEG))
    axis, turn = rng.uniform(-np.pi, np.pi, 2)
    pose = np.eye(4)
    for rpy in ((0.0, 0.0, axis), (tilt, 0.0, 0.0), (0.0, 0.0, turn)):
        pose = pose @ se3.from_rpy(np.zeros(3), np.array(rpy))
    reach = 0.3 * distance_m * np.array([camera.width, camera.height]) / camera.focal_px[0]
    room = np.maximum(reach - np.linalg.norm(pattern.border.half_size), 0.0)
    middle = np.array([*(rng.uniform(-1.0, 1.0, 2) * room), distance_m])
    pose[:3, 3] = middle - pose[:3, :3] @ pattern.border.centre_in_pattern
    return pose


def _as_taken(
    rng: np.random.Generator, image: np.ndarray, blur_px: float, noise: float
) -> np.ndarray:
    taken = image * _CONTRAST + _BLACK
    if blur_px > 0.0:
        taken = cv2.GaussianBlur(taken, (0, 0), blur_px)
    taken = taken + noise * rng.standard_normal(taken.shape)
    return np.clip(np.rint(taken), 0, 255).astype(np.uint8)


def corner_errors(picture: BoardPicture, pixels: np.ndarray) -> Tuple[np.ndarray, bool]:
    """Return errors (n, 2) [px] of corners in the order of their ids, and if the order is right.

    Right is what docs/conventions.md says: right-handed, black before corner 0 where the board has
    such a turn; where it does not tell more, the x axis points to the right.
    """
    columns, rows = picture.config.dimension
    printed = picture.corners_px.reshape(rows, columns, 2)
    turns = [(printed, not picture.negative)]
    turns.append((printed[::-1, ::-1], (not picture.negative) == ((columns + rows) % 2 == 0)))
    if columns == rows:
        black = (not picture.negative) == (columns % 2 == 0)
        turns += [(np.rot90(printed), black), (np.rot90(printed, 3), black)]
    black_turns = [turn for turn, black in turns if black]
    allowed = black_turns or [turn for turn, _ in turns]
    errors = [pixels - turn.reshape(-1, 2) for turn in allowed]
    sizes = [float(np.max(np.abs(error))) for error in errors]
    best = int(np.argmin(sizes))
    rightwards = [_rightwards(turn) for turn in allowed]
    ordered = rightwards[best] >= max(rightwards) - _TIE
    return errors[best], sizes[best] < picture.square_px / 2.0 and ordered


_TIE = 0.05  # directions so alike cannot be told apart


def _rightwards(grid: np.ndarray) -> float:
    along = grid[0, -1] - grid[0, 0]
    return float(along[0] / np.linalg.norm(along))
