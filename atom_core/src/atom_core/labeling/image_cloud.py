"""Clouds that are depth images: RGB-D and ToF cameras whose drivers publish points.

Such a cloud holds a point for each pixel, row by row, and each pixel looks along a line through one
point, the pinhole. Whether a cloud is one is told by its points alone, also where nothing says any
more how wide its rows are: directions leap from the end of a row to the beginning of the next, and
one projective map (three by three) takes all directions to their pixels.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple, Optional, Tuple

import numpy as np
from scipy.linalg import rq

from atom_core.geometry.camera import Camera
from atom_core.labeling.base import Labeled, nothing
from atom_core.labeling.depth import DepthLabeler
from atom_core.model.labels import RangeLabel
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import LIDAR3D, Sensor

_LEAST_SIDE, _LEAST_POINTS = 24, 2000
_FIT_POINTS = 2000
_MOST_OFF_PX = 1.0  # RMS of the pixels that the map tells
_LEAP = 8.0  # times the usual step from point to point
_LEAST_LEAPS = 8  # ends of rows that are seen
_WIDEST_DEG = 75.0  # from the middle of the image


class ImageCloud(NamedTuple):
    """A cloud as a depth image.

    Attributes:
        camera: of its pixels, without distortion.
        camera_R_cloud: (3, 3) from the cloud's axes to the camera's, the pinhole being the cloud's
            origin; a reflection where the image is mirrored.
        depth_m: (height, width) [m], NaN where there is no point; the point of a pixel has the
            index ``column + row * width``.
    """

    camera: Camera
    camera_R_cloud: np.ndarray
    depth_m: np.ndarray

    def pixel(self, point: np.ndarray) -> Optional[np.ndarray]:
        """Return the pixel (2,) at which a point (3,) is seen; None out of the image."""
        in_camera = (self.camera_R_cloud @ point)[None]
        return self.camera.project(in_camera)[0] if self.camera.in_image(in_camera)[0] else None


def as_image(points: np.ndarray, width: int = 0, height: int = 1) -> Optional[ImageCloud]:
    """Return a cloud as a depth image, None where it is none.

    Args:
        points: (n, 3) [m], row by row; NaN and zeros are invalid.
        width: points of a row, where the cloud is organised.
        height: rows; 1 where the organisation is lost.
    """
    valid = np.all(np.isfinite(points), axis=1) & np.any(points != 0.0, axis=1)
    if np.count_nonzero(valid) < _LEAST_POINTS:
        return None
    if height <= 1:
        width = _row_length(points, valid)
        height = len(points) // max(width, 1)
    if min(width, height) < _LEAST_SIDE or width * height != len(points):
        return None
    index = np.flatnonzero(valid)
    chosen = index[np.linspace(0, len(index) - 1, _FIT_POINTS).astype(int)]
    directions = points[chosen] / np.linalg.norm(points[chosen], axis=1)[:, None]
    pixels = np.column_stack([chosen % width, chosen // width]).astype(float)
    fitted = _pinhole(directions, pixels, np.array([width, height], dtype=float))
    if fitted is None:
        return None
    K, camera_R_cloud = fitted
    z = np.where(valid, points @ camera_R_cloud[2], np.nan)
    depth_m = np.where(z > 0.0, z, np.nan).astype(np.float32).reshape(height, width)
    return ImageCloud(Camera(width, height, K, model="none"), camera_R_cloud, depth_m)


def label_in_image(
    image: ImageCloud,
    points: np.ndarray,
    sensor: Sensor,
    pattern: Pattern,
    seed: Optional[np.ndarray],
) -> Labeled:
    """Label a cloud as a depth image.

    Args:
        image: the cloud's image.
        points: (n, 3) the cloud [m].
        sensor: whose cloud it is.
        pattern: the board.
        seed: (3,) [m] near the board in the cloud's axes; None: search.

    Returns:
        Indices are those of the cloud; ``quality`` is that of depth images.
    """
    pixel = None
    if seed is not None:
        pixel = image.pixel(np.asarray(seed, dtype=float))
        if pixel is None:
            return nothing(LIDAR3D, "the seed is out of the sensor's field of view")
    labeler = DepthLabeler(replace(sensor, camera=image.camera), pattern)
    found = labeler.label(image.depth_m, pixel)
    if found.detected:
        return _in_cloud(found, points)
    unsure = None if found.unsure is None else _in_cloud(found.unsure, points)
    return nothing(LIDAR3D, found.reason, found.quality, unsure)


def _in_cloud(found: Labeled, points: np.ndarray) -> Labeled:
    """Return a label of the image as one of the cloud (n, 3) [m]."""
    assert isinstance(found.label, RangeLabel)
    inside = np.asarray(points, dtype=float)[found.label.indices]
    return replace(found, next_seed=inside.mean(axis=0))


def _row_length(points: np.ndarray, valid: np.ndarray) -> int:
    """Return after how many points the direction leaps, 0 where it does not regularly."""
    both = np.flatnonzero(valid[1:] & valid[:-1])
    if len(both) < _LEAST_POINTS // 2:
        return 0
    length = np.linalg.norm(points, axis=1)
    cosine = np.einsum("ij,ij->i", points[both], points[both + 1])
    cosine /= length[both] * length[both + 1]
    step = np.sqrt(np.maximum(2.0 - 2.0 * cosine, 0.0))
    ends = both[step > _LEAP * max(float(np.median(step)), 1e-5)] + 1
    if not _LEAST_LEAPS <= len(ends) <= len(points) // _LEAST_SIDE:
        return 0
    apart = np.diff(ends)
    width = int(np.bincount(apart).argmax())
    return width if np.mean(ends % width == 0) > 0.9 else 0


def _pinhole(
    directions: np.ndarray, pixels: np.ndarray, size: np.ndarray
) -> Optional[Tuple[np.ndarray, np.ndarray]]:
    """Return K and the rotation of the pinhole camera that sees directions at pixels.

    None where there is none: the beams of a spinning scanner, a fisheye.

    Args:
        directions: (n, 3) of length 1.
        pixels: (n, 2) x, y.
        size: (2,) of the image.
    """
    middle = directions.mean(axis=0)
    if np.any(directions @ (middle / np.linalg.norm(middle)) < np.cos(np.radians(_WIDEST_DEG))):
        return None
    scaled = 2.0 * pixels / size - 1.0
    zero = np.zeros_like(directions)
    rows = np.vstack(
        [
            np.hstack([directions, zero, -scaled[:, :1] * directions]),
            np.hstack([zero, directions, -scaled[:, 1:] * directions]),
        ]
    )
    _, vectors = np.linalg.eigh(rows.T @ rows)
    to_scaled = vectors[:, 0].reshape(3, 3)
    half = size / 2.0
    to_pixel = np.array([[half[0], 0.0, half[0]], [0.0, half[1], half[1]], [0.0, 0.0, 1.0]])
    to_pixel = to_pixel @ to_scaled
    if np.median(directions @ to_pixel[2]) < 0.0:
        to_pixel = -to_pixel
    seen = directions @ to_pixel.T
    if np.any(seen[:, 2] <= 0.0):
        return None
    off = seen[:, :2] / seen[:, 2:] - pixels
    if np.sqrt(np.mean(np.sum(off**2, axis=1))) > _MOST_OFF_PX:
        return None
    return _factors(to_pixel)


def _factors(to_pixel: np.ndarray) -> Optional[Tuple[np.ndarray, np.ndarray]]:
    """Return K, with positive focal lengths and without skew, and the rotation or reflection."""
    K, rotation = rq(to_pixel)
    signs = np.sign(np.diag(K))
    if np.any(signs == 0.0):
        return None
    K, rotation = K * signs, rotation * signs[:, None]
    K = K / K[2, 2]
    K[0, 1] = 0.0
    return K, rotation
