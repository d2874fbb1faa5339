"""A board that shines: lamps on the walls, reflected by its print, brighten pictures."""

from __future__ import annotations

from typing import Callable, NamedTuple, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.geometry.rectangle import Rectangle
from atom_core.synthetic.rig import Room

_LOBE_RAD = np.radians(9.0)  # a print is no mirror: standard deviation of what it reflects
_HEIGHTS_M = (0.6, 1.6)  # of the lamps, two on each wall
_WHITE = 255.0
_LEAST = 0.5  # grey levels: less does not show
_EVERY = 23  # of the pixels is looked at first, whether something hides the board

Seen = Callable[[np.ndarray], np.ndarray]


class Gloss(NamedTuple):
    """How a board shines.

    Attributes:
        brightness: of a lamp that is reflected straight into a camera, as a share of white.
        lamps: (n, 3) in the world [m].
    """

    brightness: float
    lamps: np.ndarray


def gloss_in(room: Room, brightness: float) -> Gloss:
    """Return a board's gloss with lamps on the four walls of a room."""
    low, high = np.array(room.low), np.array(room.high)
    middle = (low + high) / 2.0
    on_walls = [(x, middle[1]) for x in (low[0], high[0])]
    on_walls += [(middle[0], y) for y in (low[1], high[1])]
    return Gloss(brightness, np.array([[x, y, z] for x, y in on_walls for z in _HEIGHTS_M]))


def shining(
    drawn: np.ndarray,
    gloss: Gloss,
    pinhole: Tuple[Camera, np.ndarray],
    board: Tuple[Rectangle, np.ndarray],
    is_seen: Seen,
) -> np.ndarray:
    """Return a picture float32 with what a board reflects; white may be exceeded.

    Args:
        drawn: (height, width, 3), a whole number of times finer than the camera, bottom row first.
        gloss: the board's, and the lamps.
        pinhole: camera without distortion, and ``world_T_camera`` (4, 4).
        board: its border, and ``world_T_pattern`` (4, 4).
        is_seen: tells of directions (n, 3) in the world, from the camera, which meet the board.
    """
    camera, world_T_camera = pinhole
    picture = drawn.astype(np.float32)
    rows, columns, rays, points = _on_board(drawn.shape, pinhole, board)
    if not len(rows):
        return picture
    normal = board[1][:3, 2]  # behind the print
    mirrored = rays - 2.0 * (rays @ normal)[:, None] * normal
    light = np.zeros(len(rays))
    for lamp in gloss.lamps:
        towards = lamp - points
        towards /= np.linalg.norm(towards, axis=1)[:, None]
        off = np.arccos(np.clip(np.sum(mirrored * towards, axis=1), -1.0, 1.0))
        light += _WHITE * gloss.brightness * np.exp(-0.5 * (off / _LOBE_RAD) ** 2)
    bright = np.flatnonzero(light > _LEAST)
    if len(bright) and not np.all(is_seen(rays[bright[::_EVERY]])):
        bright = bright[is_seen(rays[bright])]
    picture[rows[bright], columns[bright]] += light[bright, None].astype(np.float32)
    return picture


def _on_board(
    shape: Tuple[int, ...], pinhole: Tuple[Camera, np.ndarray], board: Tuple[Rectangle, np.ndarray]
) -> Tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return rows and columns (n,) of the pixels on the print, unit rays and points (n, 3)."""
    (camera, world_T_camera), (border, world_T_pattern) = pinhole, board
    finer = shape[0] / camera.height
    left, top, right, bottom = _window(
        camera, se3.inverse(world_T_camera) @ world_T_pattern, border
    )
    y, x = np.mgrid[int(top * finer) : int(bottom * finer), int(left * finer) : int(right * finer)]
    y, x = y.ravel(), x.ravel()
    pixels = (np.column_stack([x, y]) + 0.5) / finer - 0.5
    rays = np.column_stack([(pixels - camera.centre_px) / camera.focal_px, np.ones(len(x))])
    rays = rays @ world_T_camera[:3, :3].T
    eye, normal, origin = world_T_camera[:3, 3], world_T_pattern[:3, 2], world_T_pattern[:3, 3]
    slope = rays @ normal
    if (origin - eye) @ normal <= 0.0:  # the back is matt
        slope = np.zeros(len(rays))
    ahead = slope > 1e-6
    away = np.where(ahead, (origin - eye) @ normal / np.where(ahead, slope, 1.0), -1.0)
    points = eye + away[:, None] * rays
    in_pattern = se3.apply(se3.inverse(world_T_pattern), points)[:, :2]
    inside = np.all(np.abs(in_pattern - border.centre) <= border.half_size, axis=1) & (away > 0.0)
    rays = rays[inside] / np.linalg.norm(rays[inside], axis=1)[:, None]
    return shape[0] - 1 - y[inside], x[inside], rays, points[inside]


def _window(
    camera: Camera, camera_T_pattern: np.ndarray, border: Rectangle
) -> Tuple[int, int, int, int]:
    """Return left, top, right and bottom of the pixels around a board; empty where it is not."""
    corners = border.corners_in_pattern
    in_camera = se3.apply(camera_T_pattern, corners)
    if np.max(in_camera[:, 2]) < 0.05:
        return 0, 0, 0, 0
    if np.min(in_camera[:, 2]) < 0.05:
        return 0, 0, camera.width, camera.height
    pixels = camera.project(in_camera)
    limit = np.array([camera.width, camera.height])
    low = np.clip(np.floor(pixels.min(axis=0)) - 1, 0, limit).astype(int)
    high = np.clip(np.ceil(pixels.max(axis=0)) + 2, 0, limit).astype(int)
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])
