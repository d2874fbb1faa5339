"""Intrinsics as numbers to estimate: a camera moved by twelve numbers, and derivatives by them.

The numbers are relative to a camera to start from, and all of one size, displacements in normalised
image coordinates:

* 0, 1: fx and fy become ``f exp(number)``
* 2, 3: cx and cy move by ``f number``
* 4 to 11: the coefficients of the model, in its order, move so that the image's farthest corner is
  displaced by the number

Numbers beyond those of the model have no effect.
"""

from __future__ import annotations

from typing import Tuple

import numpy as np

from atom_core.geometry.camera import Camera, inverse_depth, radial_factor

COUNT = 12
_FIRST_COEFFICIENT = 4
MOST_LOG = 20.0  # a focal length stays positive and finite
_POLYNOMIAL = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
_EQUIDISTANT = ("k1", "k2", "k3", "k4")
_POWERS = {"k1": 3, "k2": 5, "k3": 7, "p1": 2, "p2": 2, "k4": 3, "k5": 5, "k6": 7}


def intrinsics_names(camera: Camera) -> Tuple[str, ...]:
    """Return the names of what the camera's model has: fx, fy, cx, cy and its coefficients."""
    names = _EQUIDISTANT if camera.model == "equidistant" else _POLYNOMIAL
    return ("fx", "fy", "cx", "cy", *names[: camera.D.size])


def intrinsics_values(camera: Camera) -> np.ndarray:
    """Return fx, fy, cx, cy [px] and the coefficients (n,), in the order of their names."""
    return np.concatenate([camera.focal_px, camera.centre_px, camera.D])


def number_scales(camera: Camera) -> np.ndarray:
    """Return (n,): by how much a value changes with its number, at the camera to start from."""
    names = intrinsics_names(camera)[_FIRST_COEFFICIENT:]
    radius = np.sqrt(_corner_square(camera))
    odd = camera.model == "equidistant"
    powers = [2 * i + 3 if odd else _POWERS[name] for i, name in enumerate(names)]
    per_coefficient = radius ** -np.array(powers, dtype=float)
    return np.concatenate([camera.focal_px, camera.focal_px, per_coefficient])


def _corner_square(camera: Camera) -> float:
    corners = np.array(
        [[0, 0], [camera.width, 0], [0, camera.height], [camera.width, camera.height]], dtype=float
    )
    return float(np.max(np.sum(((corners - camera.centre_px) / camera.focal_px) ** 2, axis=1)))


def moved_camera(start: Camera, numbers: np.ndarray) -> Camera:
    """Return the camera at the numbers (12,)."""
    scales, K = number_scales(start), start.K.copy()
    logarithms = np.clip(numbers[:2], -MOST_LOG, MOST_LOG)
    K[[0, 1], [0, 1]] = start.focal_px * np.exp(logarithms)
    K[:2, 2] = start.centre_px + start.focal_px * numbers[2:4]
    count = start.D.size
    change = scales[_FIRST_COEFFICIENT:] * numbers[_FIRST_COEFFICIENT : _FIRST_COEFFICIENT + count]
    return Camera(start.width, start.height, K, start.D + change, start.model)


def numbers_between(start: Camera, camera: Camera) -> np.ndarray:
    """Return the numbers (12,) that move one camera to another of the same model."""
    numbers, scales = np.zeros(COUNT), number_scales(start)
    numbers[:2] = np.log(camera.focal_px / start.focal_px)
    numbers[2:4] = (camera.centre_px - start.centre_px) / start.focal_px
    end = _FIRST_COEFFICIENT + start.D.size
    numbers[_FIRST_COEFFICIENT:end] = (camera.D - start.D) / scales[_FIRST_COEFFICIENT:]
    return numbers


def project_with_derivatives(
    start: Camera, camera: Camera, points: np.ndarray
) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return pixels (n, 2), their derivatives (n, 2, 3) by the points and (n, 2, 12) by numbers.

    Args:
        start: the camera to which the numbers are relative.
        camera: the camera at the numbers.
        points: (n, 3) in the optical frame [m].
    """
    pixels, by_point = camera.project_with_jacobian(points)
    return pixels, by_point, pixels_by_numbers(start, camera, points, pixels)


def pixels_by_numbers(
    start: Camera, camera: Camera, points: np.ndarray, pixels: np.ndarray
) -> np.ndarray:
    """Return (n, 2, 12): derivatives of pixels by the numbers.

    Args:
        start: the camera to which the numbers are relative.
        camera: the camera at the numbers.
        points: (n, 3) in the optical frame [m].
        pixels: (n, 2) to which the camera projects them.
    """
    by_number = np.zeros((len(points), 2, COUNT))
    by_number[:, [0, 1], [0, 1]] = pixels - camera.centre_px
    by_number[:, [0, 1], [2, 3]] = start.focal_px
    scales = number_scales(start)[_FIRST_COEFFICIENT:]
    end = _FIRST_COEFFICIENT + camera.D.size
    by_coefficient = distortion_by_coefficients(camera, points)
    by_number[:, :, _FIRST_COEFFICIENT:end] = camera.focal_px[:, None] * by_coefficient * scales
    return by_number


def distortion_by_coefficients(camera: Camera, points: np.ndarray) -> np.ndarray:
    """Return (n, 2, c): derivatives of the distorted, normalised image by the c coefficients.

    Args:
        camera: any model; without distortion c is 0.
        points: (n, 3) in the optical frame [m].
    """
    points = np.asarray(points, dtype=float)
    if camera.model == "none":
        return np.zeros((len(points), 2, 0))
    if camera.model == "equidistant":
        return _equidistant_by_coefficients(points)
    ideal = points[:, :2] * inverse_depth(points[:, 2])[:, None]
    square = np.sum(ideal**2, axis=1)
    outside = square > camera.limit_square
    shrink = np.where(outside, np.sqrt(camera.limit_square / np.where(outside, square, 1.0)), 1.0)
    near = ideal * shrink[:, None]
    return _polynomial_by_coefficients(camera, near) / shrink[:, None, None]


def _equidistant_by_coefficients(points: np.ndarray) -> np.ndarray:
    radius = np.hypot(points[:, 0], points[:, 1])
    angle = np.arctan2(radius, points[:, 2])
    axis = radius < 1e-9 * np.abs(points[:, 2])
    powers = angle[:, None] ** np.array([3, 5, 7, 9]) / np.where(axis, 1.0, radius)[:, None]
    return points[:, :2, None] * np.where(axis[:, None], 0.0, powers)[:, None, :]


def _polynomial_by_coefficients(camera: Camera, ideal: np.ndarray) -> np.ndarray:
    x, y = ideal[:, 0], ideal[:, 1]
    square = x * x + y * y
    powers = square[:, None] ** np.array([1, 2, 3])
    result = np.zeros((len(ideal), 2, 8))
    factor, below = np.ones(len(ideal)), np.ones(len(ideal))
    if camera.model == "rational_polynomial":
        factor, _ = radial_factor(camera.model, camera.D, square)
        below = 1 + powers @ camera.D[5:8]
    radial = ideal[:, :, None] * (powers / below[:, None])[:, None, :]
    result[:, :, [0, 1, 4]] = radial
    result[:, 0, 2], result[:, 1, 2] = 2 * x * y, square + 2 * y * y
    result[:, 0, 3], result[:, 1, 3] = square + 2 * x * x, 2 * x * y
    result[:, :, 5:8] = -factor[:, None, None] * radial
    return result[:, :, : camera.D.size]
