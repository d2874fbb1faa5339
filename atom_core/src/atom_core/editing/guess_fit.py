"""How well a first guess fits what the sensors see: points on the board, clouds in the images."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.pattern import Pattern

NEAREST_M = 0.05  # before a camera; what is nearer has no place in its image
FARTHEST_OFF_M = 0.3  # of the board's plane: what is farther is the wall behind it
FEWEST_POINTS = 20
_WIDEST = 4.0  # tangent: beyond, the models of lenses are not meant


class OffBoard(NamedTuple):
    """How far points are off the plane of a board.

    Attributes:
        median_m: of the distances; NaN where too few points are there.
        points: how many.
    """

    median_m: float
    points: int


def off_board(
    points: np.ndarray, camera_T_points: np.ndarray, camera_T_pattern: np.ndarray, pattern: Pattern
) -> OffBoard:
    """Return how far those points are off the board's plane that a camera sees within its outline.

    Args:
        points: (n, 3) of a range sensor, in its frame [m].
        camera_T_points: (4, 4) as guessed.
        camera_T_pattern: (4, 4) the board as the camera sees it.
        pattern: the board.
    """
    finite = points[np.all(np.isfinite(points), axis=1)]
    seen = se3.apply(se3.inverse(camera_T_pattern) @ camera_T_points, finite)
    eye = se3.inverse(camera_T_pattern)[:3, 3]  # the camera before the board: z below 0
    ahead = seen[:, 2] - eye[2]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = -eye[2] / ahead  # of the ray from the camera to the point, where it meets the plane
        on_plane = eye[:2] + share[:, None] * (seen[:, :2] - eye[:2])
    inside = np.all(np.abs(on_plane - pattern.border.centre) <= pattern.border.half_size, axis=1)
    near = np.abs(seen[:, 2]) <= FARTHEST_OFF_M
    distances = np.abs(seen[inside & near & (share > 0.0), 2])
    if len(distances) < FEWEST_POINTS:
        return OffBoard(np.nan, len(distances))
    return OffBoard(float(np.median(distances)), len(distances))


def pixels_of_points(camera: Camera, points_in_camera: np.ndarray) -> np.ndarray:
    """Return the pixels (m, 2), rounded, of those points (n, 3) [m] that lie in the image."""
    points = points_in_camera[np.all(np.isfinite(points_in_camera), axis=1)]
    ahead = points[:, 2] > NEAREST_M
    wide = np.max(np.abs(points[:, :2]), axis=1) > _WIDEST * points[:, 2]
    pixels = np.rint(camera.project(points[ahead & ~wide])).astype(int)
    size = np.array([camera.width, camera.height])
    return pixels[np.all((pixels >= 0) & (pixels < size), axis=1)]


def draw_points(picture: np.ndarray, pixels: np.ndarray, bgr: tuple) -> None:
    """Draw pixels (n, 2) into a picture (height, width, 3), as dots that do not hide it."""
    for column, row in ((0, 0), (1, 0), (0, 1), (1, 1)):
        x = np.clip(pixels[:, 0] + column, 0, picture.shape[1] - 1)
        y = np.clip(pixels[:, 1] + row, 0, picture.shape[0] - 1)
        picture[y, x] = bgr


def smaller(picture: np.ndarray, widest_px: int) -> np.ndarray:
    """Return a picture that is no wider than so many pixels."""
    height, width = picture.shape[:2]
    if width <= widest_px:
        return picture
    size = (widest_px, int(round(height * widest_px / width)))
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
