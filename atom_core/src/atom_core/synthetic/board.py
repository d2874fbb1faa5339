"""Boards as sensors meet them: where a ray hits one, from which side, at which angle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.rectangle import Rectangle
from atom_core.model.config import PatternConfig
from atom_core.model.pattern import CHARUCO, CHESSBOARD, Pattern

_BEND_ROUNDS = 4  # each leaves a thousandth of the way along the ray


@dataclass(frozen=True)
class BentPattern(Pattern):
    """A board bent about the y axis: z = sagitta_m (u^2 - 1/3), u = -1 to 1 from left to right.

    Attributes:
        sagitta_m: how much deeper its left and right sides lie than its middle.
        thickness_m: how far its back lies behind the print.
    """

    sagitta_m: float = 0.0
    thickness_m: float = 0.0

    def height_m(self, in_plane: np.ndarray) -> np.ndarray:
        """Return z (n,) of places (n, 2) on the board [m]; its mean over the board is 0."""
        u = (in_plane[:, 0] - self.border.centre[0]) / self.border.half_size[0]
        return self.sagitta_m * (u**2 - 1.0 / 3.0)

    def corners_of(self, ids: np.ndarray) -> np.ndarray:
        """Return the corners (n, 3) of ids (n,) [m]."""
        corners = super().corners_of(ids)
        corners[:, 2] = self.height_m(corners[:, :2])
        return corners


def charuco(
    parent_link: str = "world",
    link: str = "pattern_link",
    *,
    fixed: bool = False,
    dimension: Tuple[int, int] = (11, 8),
    size: float = 0.06,
    inner_size: float = 0.045,
    border_size: Tuple[float, float] = (0.04, 0.03),
    dictionary: str = "DICT_5X5_100",
) -> PatternConfig:
    """Return a ChArUco; the default is the paper's 800 x 600 mm board."""
    return PatternConfig(
        link=link,
        parent_link=parent_link,
        fixed=fixed,
        pattern_type=CHARUCO,
        dimension=dimension,
        size=size,
        border_size=border_size,
        inner_size=inner_size,
        dictionary=dictionary,
    )


def chessboard(
    parent_link: str = "world",
    link: str = "chessboard_link",
    *,
    fixed: bool = False,
    dimension: Tuple[int, int] = (9, 6),
    size: float = 0.06,
    border_size: Tuple[float, float] = (0.04, 0.04),
) -> PatternConfig:
    """Return a chessboard."""
    return PatternConfig(
        link=link,
        parent_link=parent_link,
        fixed=fixed,
        pattern_type=CHESSBOARD,
        dimension=dimension,
        size=size,
        border_size=border_size,
    )


def hits(
    sensor_T_pattern: np.ndarray, border: Rectangle, directions: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Intersect rays from a sensor's origin with a board.

    Args:
        sensor_T_pattern: (4, 4) pose of the board.
        border: the board's edges in its plane [m].
        directions: (n, 3) rays in the sensor's frame.

    Returns:
        t (n,) with ``t * direction`` on the board, infinite where the ray misses it; and the
        hits (n, 2) in the board's plane [m].
    """
    pattern_T_sensor = se3.inverse(sensor_T_pattern)
    origin = pattern_T_sensor[:3, 3]
    turned = directions @ sensor_T_pattern[:3, :3]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -origin[2] / turned[:, 2]
        in_plane = origin[:2] + t[:, None] * turned[:, :2]
    on_board = _within(border, in_plane) & (t > 0)
    return np.where(on_board, t, np.inf), in_plane


def _within(border: Rectangle, in_plane: np.ndarray) -> np.ndarray:
    """Tell which points (n, 2) of the plane lie on the board (n,)."""
    (x, y), (x_m, y_m) = in_plane.T, border.centre
    half_x_m, half_y_m = border.half_size
    return (np.abs(x - x_m) <= half_x_m) & (np.abs(y - y_m) <= half_y_m)


def board_hits(
    sensor_T_pattern: np.ndarray, pattern: Pattern, directions: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Intersect rays with a board that may be bent; arguments and result as of `hits`."""
    if not isinstance(pattern, BentPattern):
        return hits(sensor_T_pattern, pattern.border, directions)
    origin = se3.inverse(sensor_T_pattern)[:3, 3]
    turned = directions @ sensor_T_pattern[:3, :3]
    back_m = pattern.thickness_m if origin[2] > 0.0 else 0.0  # the back is what is seen
    height, border = np.full(len(directions), back_m), pattern.border
    reach = 2.0 * border.half_size  # far beside the board its bend does not go on
    with np.errstate(divide="ignore", invalid="ignore"):
        for _ in range(_BEND_ROUNDS):
            t = (height - origin[2]) / turned[:, 2]
            in_plane = origin[:2] + t[:, None] * turned[:, :2]
            near = np.clip(in_plane, border.centre - reach, border.centre + reach)
            height = pattern.height_m(near) + back_m
    on_board = _within(border, in_plane) & (t > 0)
    return np.where(on_board, t, np.inf), in_plane


def is_dark(sensor_T_pattern: np.ndarray, pattern: Pattern, in_plane: np.ndarray) -> np.ndarray:
    """Tell where a sensor sees dark squares; the back of a board has none.

    Args:
        sensor_T_pattern: (4, 4) pose of the board.
        pattern: the board.
        in_plane: places (n, 2) on it [m].
    """
    if facing(sensor_T_pattern, pattern.border) <= 0.0:
        return np.zeros(len(in_plane), dtype=bool)
    start = 0.0 if pattern.kind == CHARUCO else -pattern.square_m
    square = np.floor((in_plane - start) / pattern.square_m)
    printed = np.all((square >= 0) & (square <= [pattern.columns, pattern.rows]), axis=1)
    return printed & (np.sum(square, axis=1) % 2 == 0)


def facing(sensor_T_pattern: np.ndarray, border: Rectangle) -> float:
    """Return the cosine between the printed side's normal and the direction to the sensor.

    The print is seen from -z of the pattern: x right, y down, z into the board, as OpenCV lays
    its boards out. Negative: the sensor is behind the board.
    """
    to_sensor = se3.inverse(sensor_T_pattern)[:3, 3] - border.centre_in_pattern
    return float(-to_sensor[2] / np.linalg.norm(to_sensor))


def held_before(
    eye: np.ndarray,
    centre: np.ndarray,
    border: Rectangle,
    rng: np.random.Generator,
    tilt_rad: float = 0.35,
) -> np.ndarray:
    """Return ``world_T_pattern`` (4, 4) of a board held so that its print looks at ``eye``.

    Args:
        eye: (3,) in world [m]; not straight above the board.
        centre: (3,) where the board's middle is, in world [m].
        border: the board's edges.
        rng: draws the roll, uniformly, and the tilt.
        tilt_rad: standard deviation of the tilt about each axis.
    """
    away = (centre - eye) / np.linalg.norm(centre - eye)
    z = se3.rotation_from_rotation_vector(tilt_rad * rng.standard_normal(3)) @ away
    x = np.cross([0.0, 0.0, 1.0], z)
    x /= np.linalg.norm(x)
    upright = np.column_stack([x, np.cross(z, x), z])
    world_R_pattern = upright @ se3.rotation_from_rpy(np.array([0, 0, rng.uniform(-np.pi, np.pi)]))
    middle = border.centre_in_pattern
    return se3.transform(world_R_pattern, centre - world_R_pattern @ middle)


def centre_in_sensor(sensor_T_pattern: np.ndarray, border: Rectangle) -> np.ndarray:
    """Return the board's middle (3,) in the sensor's frame [m]."""
    return se3.apply(sensor_T_pattern, border.centre_in_pattern[None])[0]


def border_points(pattern: Pattern, step_m: float = 0.05) -> np.ndarray:
    """Return points (n, 3) along the border in the pattern's frame [m]."""
    outline = pattern.border.sample(step_m)
    return np.column_stack([outline, np.zeros(len(outline))])
