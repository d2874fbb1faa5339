"""Boards as sensors meet them: where a ray hits one, from which side, at which angle."""

from __future__ import annotations

from typing import Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.rectangle import Rectangle
from atom_core.model.config import PatternConfig
from atom_core.model.pattern import CHARUCO, CHESSBOARD, Pattern


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
    on_board = np.all(np.abs(in_plane - border.centre) <= border.half_size, axis=1) & (t > 0)
    return np.where(on_board, t, np.inf), in_plane


def facing(sensor_T_pattern: np.ndarray, border: Rectangle) -> float:
    """Return the cosine between the printed side's normal and the direction to the sensor.

    The print is seen from -z of the pattern: x right, y down, z into the board, as OpenCV lays
    its boards out. Negative: the sensor is behind the board.
    """
    to_sensor = se3.inverse(sensor_T_pattern)[:3, 3] - np.append(border.centre, 0.0)
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
    middle = np.append(border.centre, 0.0)
    return se3.transform(world_R_pattern, centre - world_R_pattern @ middle)


def centre_in_sensor(sensor_T_pattern: np.ndarray, border: Rectangle) -> np.ndarray:
    """Return the board's middle (3,) in the sensor's frame [m]."""
    return se3.apply(sensor_T_pattern, np.append(border.centre, 0.0)[None])[0]


def border_points(pattern: Pattern, step_m: float = 0.05) -> np.ndarray:
    """Return points (n, 3) along the border in the pattern's frame [m]."""
    outline = pattern.border.sample(step_m)
    return np.column_stack([outline, np.zeros(len(outline))])
