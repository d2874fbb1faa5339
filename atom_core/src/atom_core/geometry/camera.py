"""Camera models: projection to distorted pixels, back again, with analytic Jacobians.

A point (x, y, z) in the optical frame (z forward, x right, y down, metres) becomes

* ``none``                 u = fx x/z + cx
* ``plumb_bob``            k1 k2 p1 p2 [k3]                 (Brown-Conrady, as in OpenCV)
* ``rational_polynomial``  k1 k2 p1 p2 k3 k4 k5 k6          (as in OpenCV)
* ``equidistant``          k1 k2 k3 k4                      (Kannala-Brandt, OpenCV's fisheye)

Pixel (0, 0) is the centre of the top-left pixel. Names are those of sensor_msgs/CameraInfo;
``fisheye`` is accepted for ``equidistant``.

Points behind a camera: a pinhole would mirror them into the image, so that a camera that looks
away could fit. Below ``NEAR_M`` the factor 1/z is continued along its tangent, and the
distortion stops growing outside the field of view: a point that moves backwards moves steadily
out of the image, and the residual pulls it back to the front.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Sequence, Tuple

import numpy as np

NEAR_M = 0.05
_LARGEST_ANGLE = 0.75 * np.pi  # off the axis of a fisheye [rad]; none sees as far
_SMALL_SKEW_PX = 0.01  # at the top and bottom of the image; far below what a corner is known to
_COEFFICIENTS = {
    "none": (0,),
    "plumb_bob": (4, 5),
    "rational_polynomial": (8,),
    "equidistant": (4,),
}
_OF_OPENCV = {"thin prism": slice(8, 12), "tilted sensor": slice(12, 14)}  # where in a longer D
_ALIASES = {"fisheye": "equidistant", "": "plumb_bob", "kannala_brandt4": "equidistant"}


def distortion_model_name(name: str) -> str:
    """Return the one name that this library uses for a distortion model.

    Raises:
        ValueError: the model is unknown.
    """
    model = _ALIASES.get(name, name)
    if model not in _COEFFICIENTS:
        known = ", ".join(sorted(_COEFFICIENTS))
        raise ValueError(f"distortion model '{name}' is unknown; use one of {known}")
    return model


@dataclass(frozen=True)
class Camera:
    """Intrinsics of one camera.

    Attributes:
        width: image columns.
        height: image rows.
        K: (3, 3) matrix with fx, fy, cx, cy [px] and zero skew.
        D: (n,) distortion coefficients in the model's order.
        model: none, plumb_bob, rational_polynomial or equidistant.

    Raises:
        ValueError: K is of another form, or the number of coefficients does not fit the model.
    """

    width: int
    height: int
    K: np.ndarray
    D: np.ndarray = field(default_factory=lambda: np.zeros(0))
    model: str = "plumb_bob"
    # r^2 (normalised) beyond which the distortion stops growing
    _limit_square: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "model", distortion_model_name(self.model))
        K = np.array(self.K, dtype=float)
        D = np.array(self.D, dtype=float).reshape(-1)
        if K.size != 9:
            raise ValueError(f"K has {K.size} numbers, 9 are needed (3 x 3, row by row)")
        K = K.reshape(3, 3)
        if D.size == 0 and self.model != "equidistant":  # so drivers write "no distortion"
            object.__setattr__(self, "model", "none")
        D = _trim_coefficients(self.model, D)
        if not (np.all(np.isfinite(K)) and np.all(np.isfinite(D))):
            raise ValueError("K and D must be finite numbers")
        if K[0, 0] <= 0 or K[1, 1] <= 0:
            raise ValueError(f"focal lengths in K must be positive, found {K[0, 0]}, {K[1, 1]}")
        _check_form(K, self.height)
        object.__setattr__(self, "K", K)
        object.__setattr__(self, "D", D)
        object.__setattr__(self, "_limit_square", self._radius_limit_square())

    @property
    def limit_square(self) -> float:
        """Square of the normalised radius from which on the distortion stops growing."""
        return self._limit_square

    @property
    def focal_px(self) -> np.ndarray:
        """(2,) fx, fy."""
        return np.array([self.K[0, 0], self.K[1, 1]])

    @property
    def centre_px(self) -> np.ndarray:
        """(2,) cx, cy."""
        return np.array([self.K[0, 2], self.K[1, 2]])

    def part(
        self, offset_px: Tuple[int, int], binning: Tuple[int, int], size_px: Tuple[int, int]
    ) -> Camera:
        """Return the camera of a part of its image whose pixels are each made of several.

        Args:
            offset_px: first pixel (x, y) of the part.
            binning: how many columns and rows make a pixel.
            size_px: width and height of the result, in its own pixels.
        """
        K, coarser = self.K.copy(), np.array(binning)
        K[:2, :2] /= coarser[:, None]
        # Pixels are where their centres are: one of the part lies amid those that it is made of.
        K[:2, 2] = (self.centre_px - offset_px + 0.5) / coarser - 0.5
        return replace(self, width=size_px[0], height=size_px[1], K=K)

    def project(self, points: np.ndarray) -> np.ndarray:
        """Return distorted pixels (n, 2) of points (n, 3) [m] in the optical frame."""
        points = np.asarray(points, dtype=float)
        if self.model == "equidistant":
            normalised = _project_equidistant(points, self.D)[0]
        else:
            normalised = self._distorted(_ideal(points))
        return normalised * self.focal_px + self.centre_px

    def project_with_jacobian(self, points: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return pixels (n, 2) and their derivatives (n, 2, 3) by the points [px/m]."""
        normalised, by_point = self._normalised(points)
        pixels = normalised * self.focal_px + self.centre_px
        return pixels, by_point * self.focal_px[:, None]

    def in_image(self, points: np.ndarray, margin_px: float = 0.0) -> np.ndarray:
        """Return (n,) bool: in front of the camera and projected into the image."""
        pixels = self.project(points)
        low, high = margin_px - 0.5, np.array([self.width, self.height]) - 0.5 - margin_px
        inside = np.all((pixels >= low) & (pixels <= high), axis=1)
        return inside & (points[:, 2] > NEAR_M) & self._in_distortion_range(points)

    def normalise(self, pixels: np.ndarray) -> np.ndarray:
        """Return x/z, y/z (n, 2) of distorted pixels (n, 2), by Newton's method."""
        distorted = (np.asarray(pixels, dtype=float) - self.centre_px) / self.focal_px
        if self.model == "none":
            return distorted
        if self.model == "equidistant":
            return _undistort_equidistant(distorted, self.D)
        point = distorted.copy()
        for _ in range(25):
            value, jacobian = self._distort(point)
            step = _solved(jacobian, distorted - value)
            point += step
            if step.size == 0 or np.max(np.abs(step)) < 1e-14:
                break
        return point

    def unit_rays(self, pixels: np.ndarray) -> np.ndarray:
        """Return unit vectors (n, 3) of pixels (n, 2), also behind the plane z = 0 of a fisheye."""
        if self.model == "equidistant":
            distorted = (np.asarray(pixels, dtype=float) - self.centre_px) / self.focal_px
            radius = np.linalg.norm(distorted, axis=1)
            angle = _angle_of_radius(radius, self.D, _LARGEST_ANGLE)
            across = np.sin(angle) / np.where(radius < 1e-12, 1.0, radius)
            return np.column_stack([distorted * across[:, None], np.cos(angle)])
        points = np.column_stack([self.normalise(pixels), np.ones(len(pixels))])
        return points / np.linalg.norm(points, axis=1, keepdims=True)

    def ray_points(self, pixels: np.ndarray, depth_m: np.ndarray) -> np.ndarray:
        """Return points (n, 3) [m] at the z-depths (n,) behind the pixels (n, 2)."""
        xy = self.normalise(pixels)
        return np.column_stack([xy * depth_m[:, None], depth_m])

    def _in_distortion_range(self, points: np.ndarray) -> np.ndarray:
        if self.model == "equidistant":
            return np.ones(len(points), dtype=bool)
        z = np.maximum(points[:, 2], NEAR_M)
        return np.sum((points[:, :2] / z[:, None]) ** 2, axis=1) <= self._limit_square

    def _radius_limit_square(self) -> float:
        """Return r^2 (normalised) of the farthest image corner and a little more."""
        if self.model in ("none", "equidistant"):
            return np.inf
        corners = np.array(
            [[0, 0], [self.width, 0], [0, self.height], [self.width, self.height]], dtype=float
        )
        ideal = (corners - self.centre_px) / self.focal_px
        largest = np.max(np.sum(ideal**2, axis=1))
        # The undistorted corner may lie farther out than the ideal one: search the radius
        # where the distorted one passes the image's corner, or turns back before it.
        radius = np.sqrt(largest) * np.linspace(0.2, 3.0, 281)
        factor, slope = radial_factor(self.model, self.D, radius**2)
        growing = factor + 2.0 * radius**2 * slope > 0.05
        reached = radius * factor >= np.sqrt(largest) * 1.1
        turned = np.flatnonzero(~growing)
        past = np.flatnonzero(reached)
        end = min([len(radius) - 1] + list(turned[:1] - 1) + list(past[:1]))
        return float(radius[max(end, 0)] ** 2)

    def _normalised(self, points: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return distorted normalised coordinates (n, 2) and derivatives (n, 2, 3) [1/m]."""
        points = np.asarray(points, dtype=float)
        if self.model == "equidistant":
            return _project_equidistant(points, self.D)
        return self._project_pinhole(points)

    def _project_pinhole(self, points: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        x, y, z = points[:, 0], points[:, 1], points[:, 2]
        front, inverse_z = z >= NEAR_M, inverse_depth(z)
        slope = np.where(front, -(inverse_z**2), -1.0 / NEAR_M**2)
        ideal = points[:, :2] * inverse_z[:, None]
        by_point = np.zeros((len(points), 2, 3))
        by_point[:, 0, 0] = by_point[:, 1, 1] = inverse_z
        by_point[:, 0, 2], by_point[:, 1, 2] = x * slope, y * slope
        if self.model == "none":
            return ideal, by_point
        distorted, by_ideal = self._distort(ideal)
        return distorted, by_ideal @ by_point

    def _distorted(self, ideal: np.ndarray) -> np.ndarray:
        """Return distorted normalised coordinates (n, 2)."""
        if self.model == "none":
            return ideal
        square = _square(ideal)
        outside = square > self._limit_square
        if not outside.any():
            return _distort_inside(self.model, self.D, ideal, square)[0]
        shrink = self._shrink(square, outside)
        near = ideal * shrink[:, None]
        return _distort_inside(self.model, self.D, near, _square(near))[0] / shrink[:, None]

    def _distort(self, ideal: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return distorted normalised coordinates (n, 2) and derivatives (n, 2, 2)."""
        if self.model == "none":
            return ideal, np.broadcast_to(np.eye(2), (len(ideal), 2, 2))
        square = _square(ideal)
        outside = square > self._limit_square
        if not outside.any():
            value, radial = _distort_inside(self.model, self.D, ideal, square)
            return value, _distortion_jacobian(self.D, ideal, *radial)
        shrink = self._shrink(square, outside)[:, None]
        near = ideal * shrink
        value, radial = _distort_inside(self.model, self.D, near, _square(near))
        jacobian = _distortion_jacobian(self.D, near, *radial)
        value = value / shrink
        # value = D(s p) / s with s = L/|p|; ds/dp = -s p/|p|^2
        direction = ideal / np.maximum(square, 1e-300)[:, None]
        along = value - np.einsum("nij,nj->ni", jacobian, ideal)
        extended = jacobian + along[:, :, None] * direction[:, None, :]
        return value, np.where(outside[:, None, None], extended, jacobian)

    def _shrink(self, square: np.ndarray, outside: np.ndarray) -> np.ndarray:
        """Return factors (n,) to the limit of the field of view for what is outside it, else 1.

        There a point is distorted as its neighbour on the limit.
        """
        return np.where(outside, np.sqrt(self._limit_square / np.where(outside, square, 1.0)), 1.0)


def _check_form(K: np.ndarray, height: int) -> None:
    """Refuse a K whose further numbers say what no model here has, rather than pass over them."""
    if np.any(K[2] != [0.0, 0.0, 1.0]) or K[1, 0] != 0.0:
        raise ValueError(
            f"K is not fx 0 cx, 0 fy cy, 0 0 1, row by row, but {K.ravel().tolist()}; correct it "
            f"(written column by column, or scaled as a whole?)"
        )
    if abs(K[0, 1]) * height > 2.0 * _SMALL_SKEW_PX * K[1, 1]:
        raise ValueError(
            f"K has a skew of {K[0, 1]:g} px (its second number), which no camera model here has; "
            f"calibrate the intrinsics without skew"
        )


def _solved(matrices: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return x (n, 2) of ``matrices @ x = values``, (n, 2, 2) and (n, 2).

    Written out, since LAPACK takes fifty times as long for so small ones.
    """
    (a, b), (c, d) = matrices[:, 0].T, matrices[:, 1].T
    x, y = values.T
    determinant = a * d - b * c
    if not np.all(determinant):
        raise np.linalg.LinAlgError("Singular matrix")
    return np.stack([d * x - b * y, a * y - c * x], axis=1) / determinant[:, None]


def inverse_depth(z: np.ndarray) -> np.ndarray:
    """Return 1/z (n,), nearer than NEAR_M and behind the camera along its tangent there."""
    front = z >= NEAR_M
    return np.where(front, 1.0 / np.where(front, z, 1.0), (2 * NEAR_M - z) / NEAR_M**2)


def _ideal(points: np.ndarray) -> np.ndarray:
    """Return undistorted normalised coordinates (n, 2) of points (n, 3)."""
    return points[:, :2] * inverse_depth(points[:, 2])[:, None]


def _trim_coefficients(model: str, D: np.ndarray) -> np.ndarray:
    """Return D in the model's length: longer ones are accepted when the rest is zero."""
    lengths = _COEFFICIENTS[model]
    if D.size in lengths:
        return D
    longest = lengths[-1]
    if D.size > longest and not np.any(D[longest:]):
        return D[:longest]
    wanted = " or ".join(str(n) for n in lengths)
    fitting = [other for other, n in _COEFFICIENTS.items() if other != model and _has(D, n)]
    hint = f"; they would be of {' or '.join(fitting)}: correct distortion_model" if fitting else ""
    more = [part for part, place in _OF_OPENCV.items() if np.any(D[place])]
    if D.size in (12, 14) and not fitting:
        terms = " and ".join(more)
        hint = f"; OpenCV's terms of {terms} are not known here: calibrate the camera without them"
    raise ValueError(f"D has {D.size} numbers, the model {model} needs {wanted}{hint}")


def _has(D: np.ndarray, lengths: Sequence[int]) -> bool:
    """Tell whether a model with coefficients of these lengths has all of D that is not zero."""
    longest = lengths[-1]
    return D.size in lengths or (D.size > longest > 0 and not np.any(D[longest:]))


def radial_factor(model: str, D: np.ndarray, square: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return the radial factor and its derivative by r^2, of r^2."""
    k1, k2 = D[0], D[1]
    k3 = D[4] if D.size > 4 else 0.0
    above = 1 + square * (k1 + square * (k2 + square * k3))
    above_slope = k1 + square * (2 * k2 + 3 * square * k3)
    if model != "rational_polynomial":
        return above, above_slope
    k4, k5, k6 = D[5:8]
    below = 1 + square * (k4 + square * (k5 + square * k6))
    below_slope = k4 + square * (2 * k5 + 3 * square * k6)
    return above / below, (above_slope * below - above * below_slope) / below**2


def _square(points: np.ndarray) -> np.ndarray:
    """Return the squared lengths (n,) of points (n, 2)."""
    x, y = points[:, 0], points[:, 1]
    return x * x + y * y


def _distort_inside(
    model: str, D: np.ndarray, ideal: np.ndarray, square: np.ndarray
) -> Tuple[np.ndarray, Tuple[np.ndarray, np.ndarray]]:
    """Return distorted coordinates (n, 2), and the radial factor (n,) with its slope by r^2."""
    x, y = ideal[:, 0], ideal[:, 1]
    p1, p2 = D[2], D[3]
    factor, slope = radial_factor(model, D, square)
    twice_xy = 2 * x * y
    value = np.empty((len(ideal), 2))
    value[:, 0] = x * factor + p1 * twice_xy + p2 * (square + 2 * x * x)
    value[:, 1] = y * factor + p1 * (square + 2 * y * y) + p2 * twice_xy
    return value, (factor, slope)


def _distortion_jacobian(
    D: np.ndarray, ideal: np.ndarray, factor: np.ndarray, slope: np.ndarray
) -> np.ndarray:
    """Return the derivatives (n, 2, 2) of what `_distort_inside` returns by the ideal points."""
    x, y = ideal[:, 0], ideal[:, 1]
    p1, p2 = D[2], D[3]
    jacobian = np.empty((len(ideal), 2, 2))
    jacobian[:, 0, 0] = factor + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x
    jacobian[:, 0, 1] = jacobian[:, 1, 0] = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y
    jacobian[:, 1, 1] = factor + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x
    return jacobian


def _equidistant_angle(angle: np.ndarray, D: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return the distorted angle [rad] and its derivative."""
    square = angle * angle
    k1, k2, k3, k4 = D
    value = angle * (1 + square * (k1 + square * (k2 + square * (k3 + square * k4))))
    slope = 1 + square * (3 * k1 + square * (5 * k2 + square * (7 * k3 + 9 * k4 * square)))
    return value, slope


def _project_equidistant(points: np.ndarray, D: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    x, y, z = points[:, 0], points[:, 1], points[:, 2]
    radius = np.hypot(x, y)
    angle = np.arctan2(radius, z)
    value, slope = _equidistant_angle(angle, D)
    distance_square = np.maximum(radius**2 + z**2, 1e-300)
    axis = radius < 1e-9 * np.abs(z)  # on the optical axis the image is x/z
    safe = np.where(axis, 1.0, radius)
    scale = np.where(axis, 1.0 / np.where(axis, z, 1.0), value / safe)
    # d(scale)/d(radius) and d(scale)/dz through angle = atan2(radius, z)
    by_radius = np.where(axis, 0.0, (slope * z / distance_square - scale) / safe)
    by_z = np.where(axis, -scale / np.where(axis, z, 1.0), -slope / distance_square)
    jacobian = np.zeros((len(points), 2, 3))
    for row, coordinate in enumerate((x, y)):
        jacobian[:, row, 0] = coordinate * by_radius * np.where(axis, 0.0, x / safe)
        jacobian[:, row, 1] = coordinate * by_radius * np.where(axis, 0.0, y / safe)
        jacobian[:, row, 2] = coordinate * by_z
        jacobian[:, row, row] += scale
    return np.stack([x * scale, y * scale], axis=1), jacobian


def _angle_of_radius(radius: np.ndarray, D: np.ndarray, largest: float) -> np.ndarray:
    """Return the angles (n,) off the axis [rad], none above a largest, of radii (n,)."""
    angle = np.minimum(radius, 0.5 * np.pi)
    for _ in range(30):
        value, slope = _equidistant_angle(angle, D)
        angle = np.clip(angle - (value - radius) / slope, 0.0, largest)
    return angle


def _undistort_equidistant(distorted: np.ndarray, D: np.ndarray) -> np.ndarray:
    radius = np.linalg.norm(distorted, axis=1)
    angle = _angle_of_radius(radius, D, 0.499 * np.pi)
    scale = np.where(radius < 1e-12, 1.0, np.tan(angle) / np.where(radius < 1e-12, 1.0, radius))
    return distorted * scale[:, None]
