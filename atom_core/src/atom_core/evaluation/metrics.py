"""Errors of one source against one target, on plain arrays.

Every function returns errors of single items, not yet summed up; ``statistics.py`` does that.
Definitions: docs/evaluation.md.
"""

from __future__ import annotations

from typing import Tuple

import numpy as np
from scipy.spatial import cKDTree

from atom_core.geometry.camera import Camera
from atom_core.geometry.plane import fit_plane
from atom_core.geometry.polyline import offsets_to_segments


def carried_corners(
    source: Camera,
    target: Camera,
    source_T_pattern: np.ndarray,
    target_T_source: np.ndarray,
    pixels_in_source: np.ndarray,
) -> np.ndarray:
    """Carry corners from one image to another over the plane of the board.

    The homography is ``[r1 r2 t]_target @ inv([r1 r2 t]_source)`` between undistorted, normalised
    coordinates (the camera matrices on both sides of ATOM's pixel homography cancel).

    Args:
        source: camera that detected the corners.
        target: camera to carry them to.
        source_T_pattern: (4, 4), from the source's own corners.
        target_T_source: (4, 4), the calibration under test.
        pixels_in_source: (n, 2) detected corners, distorted [px].

    Returns:
        (n, 2) distorted pixels in the target image.
    """
    target_T_pattern = target_T_source @ source_T_pattern
    board_to_source = source_T_pattern[:3, [0, 1, 3]]
    board_to_target = target_T_pattern[:3, [0, 1, 3]]
    rays = np.column_stack([source.normalise(pixels_in_source), np.ones(len(pixels_in_source))])
    on_board = np.linalg.solve(board_to_source, rays.T)
    return target.project((board_to_target @ (on_board / on_board[2])).T)


def border_offsets(
    camera: Camera, points_in_camera: np.ndarray, border: np.ndarray
) -> Tuple[np.ndarray, int]:
    """Project points and compare them with a continuous border.

    Args:
        camera: intrinsics of the image.
        points_in_camera: (n, 3) points of the board's border [m].
        border: (m, 2, 2) segments of the border in the image [px].

    Returns:
        (k, 2) from the nearest border point to each of the points that the image shows [px], and
        the number of points that it does not show: behind the camera, or out of the image.
    """
    shown = camera.in_image(points_in_camera)
    pixels = camera.project(points_in_camera[shown])
    return offsets_to_segments(pixels, border), int(np.sum(~shown))


def pixel_offsets(
    camera: Camera, points_in_camera: np.ndarray, border_pixels: np.ndarray
) -> Tuple[np.ndarray, int]:
    """Project points and compare them with the nearest labeled border pixel.

    Args:
        camera: intrinsics of the image.
        points_in_camera: (n, 3) points of the board's border [m].
        border_pixels: (m, 2) labeled pixels.

    Returns:
        As `border_offsets`.
    """
    shown = camera.in_image(points_in_camera)
    pixels = camera.project(points_in_camera[shown])
    _, nearest = cKDTree(border_pixels).query(pixels)
    return pixels - border_pixels[nearest], int(np.sum(~shown))


def nearest_distances(from_points: np.ndarray, to_points: np.ndarray) -> np.ndarray:
    """Return the distance (n,) of each of the points (n, 3) to the nearest of (m, 3) [m]."""
    return cKDTree(to_points).query(from_points)[0]


def mutual_nearest_offsets(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return offsets (n + m, 3) of points (n, 3), (m, 3) from the nearest of the others [m]."""
    of_a, of_b = cKDTree(b).query(a)[1], cKDTree(a).query(b)[1]
    return np.concatenate([a - b[of_a], b - a[of_b]])


def plane_distances(points: np.ndarray, plane_points: np.ndarray) -> np.ndarray:
    """Return signed distances (n,) of points to the plane fitted to other points [m].

    Args:
        points: (n, 3).
        plane_points: (m, 3), m >= 3.

    Raises:
        ValueError: the other points do not define a plane.
    """
    centroid, normal, _ = fit_plane(plane_points)
    return (points - centroid) @ normal
