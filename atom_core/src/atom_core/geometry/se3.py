"""Rigid motions: rotations, homogeneous transforms, and their derivatives.

Every function takes one item or a stack of them: leading axes broadcast. A rotation is a
(..., 3, 3) matrix, a transform ``parent_T_child`` is (..., 4, 4) and maps coordinates in child to
coordinates in parent; a rotation vector is (..., 3) in radians; quaternions are x y z w; roll,
pitch, yaw are about the fixed axes x, y, z as in URDF.

Formulas: Sola, Deray, Atchuthan, "A micro Lie theory for state estimation in robotics" (2018).
"""

from __future__ import annotations

from typing import Tuple

import numpy as np

_IDENTITY = np.eye(3)
_SMALL_ANGLE = 1e-4  # below it the series of sin(a)/a and its kin are exact to the last digit


def skew(vector: np.ndarray) -> np.ndarray:
    """Return the (..., 3, 3) matrix with ``skew(a) @ b == cross(a, b)``."""
    vector = np.asarray(vector, dtype=float)
    matrix = np.zeros(vector.shape[:-1] + (3, 3))
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    matrix[..., 0, 1], matrix[..., 0, 2] = -z, y
    matrix[..., 1, 0], matrix[..., 1, 2] = z, -x
    matrix[..., 2, 0], matrix[..., 2, 1] = -y, x
    return matrix


class _Angles:
    """The functions of the angles a of rotation vectors that exp and its kin need, (..., 1, 1)."""

    def __init__(self, rotation_vector: np.ndarray):
        self.square = np.sum(rotation_vector * rotation_vector, axis=-1)[..., None, None]
        angle = np.sqrt(self.square)
        self.small = angle < _SMALL_ANGLE
        self.safe = np.where(self.small, 1.0, angle)

    def sine(self) -> np.ndarray:
        """Return sin(a)/a."""
        return np.where(self.small, 1.0 - self.square / 6.0, np.sin(self.safe) / self.safe)

    def versine(self) -> np.ndarray:
        """Return (1-cos(a))/a^2."""
        half_sine = np.sin(0.5 * self.safe) / self.safe
        return np.where(self.small, 0.5 - self.square / 24.0, 2.0 * half_sine * half_sine)

    def rest(self) -> np.ndarray:
        """Return (a-sin(a))/a^3."""
        exact = (self.safe - np.sin(self.safe)) / self.safe**3
        return np.where(self.small, 1.0 / 6.0 - self.square / 120.0, exact)


def rotation_from_rotation_vector(rotation_vector: np.ndarray) -> np.ndarray:
    """Return exp of the rotation vectors (..., 3) [rad] as matrices (..., 3, 3)."""
    rotation_vector = np.asarray(rotation_vector, dtype=float)
    angles, cross = _Angles(rotation_vector), skew(rotation_vector)
    return _IDENTITY + angles.sine() * cross + angles.versine() * (cross @ cross)


def right_jacobian(rotation_vector: np.ndarray) -> np.ndarray:
    """Return J (..., 3, 3) with ``exp(r + dr) == exp(r) exp(J dr)`` to first order."""
    rotation_vector = np.asarray(rotation_vector, dtype=float)
    angles, cross = _Angles(rotation_vector), skew(rotation_vector)
    return _IDENTITY - angles.versine() * cross + angles.rest() * (cross @ cross)


def quaternion_from_rotation(rotation: np.ndarray) -> np.ndarray:
    """Return unit quaternions (..., 4), x y z w with w >= 0, of the matrices (..., 3, 3)."""
    r = np.asarray(rotation, dtype=float)
    xx, yy, zz = r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]
    trace = xx + yy + zz
    # Rows: four candidates, the same quaternion scaled; the longest is the best conditioned.
    candidates = np.empty(r.shape[:-2] + (4, 4))
    candidates[..., 0, 0], candidates[..., 1, 1] = 1 + 2 * xx - trace, 1 + 2 * yy - trace
    candidates[..., 2, 2], candidates[..., 3, 3] = 1 + 2 * zz - trace, 1 + trace
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        candidates[..., i, j] = candidates[..., j, i] = r[..., i, j] + r[..., j, i]
        candidates[..., k, 3] = candidates[..., 3, k] = r[..., j, i] - r[..., i, j]
    rows = candidates.reshape(-1, 4, 4)
    best = np.diagonal(rows, axis1=1, axis2=2).argmax(axis=1)
    quaternion = rows[np.arange(len(rows)), best].reshape(r.shape[:-2] + (4,))
    quaternion /= np.linalg.norm(quaternion, axis=-1, keepdims=True)
    return np.where(quaternion[..., 3:] < 0, -quaternion, quaternion)


def rotation_from_quaternion(quaternion: np.ndarray) -> np.ndarray:
    """Return matrices (..., 3, 3) of quaternions (..., 4), x y z w, normalised first.

    Raises:
        ValueError: a quaternion has no length or is not finite.
    """
    quaternion = np.asarray(quaternion, dtype=float)
    length = np.linalg.norm(quaternion, axis=-1, keepdims=True)
    if not np.all(np.isfinite(length)) or np.any(length < 1e-6):
        raise ValueError("a quaternion of a rotation must be finite and longer than zero")
    vector, w = quaternion[..., :3] / length, (quaternion[..., 3:] / length)[..., None]
    cross = skew(vector)
    return np.eye(3) + 2.0 * w * cross + 2.0 * (cross @ cross)


def rotation_vector_from_rotation(rotation: np.ndarray) -> np.ndarray:
    """Return log of the matrices (..., 3, 3): rotation vectors (..., 3), angle in [0, pi]."""
    quaternion = quaternion_from_rotation(rotation)
    vector, w = quaternion[..., :3], quaternion[..., 3:]
    sine = np.linalg.norm(vector, axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, w)
    scale = np.where(sine < 1e-12, 2.0, angle / np.where(sine < 1e-12, 1.0, sine))
    return scale * vector


def rotation_from_rpy(rpy: np.ndarray) -> np.ndarray:
    """Return ``Rz(yaw) Ry(pitch) Rx(roll)`` (..., 3, 3) of roll, pitch, yaw (..., 3) [rad]."""
    rpy = np.asarray(rpy, dtype=float)
    cosine, sine = np.cos(rpy), np.sin(rpy)
    cr, cp, cy = cosine[..., 0], cosine[..., 1], cosine[..., 2]
    sr, sp, sy = sine[..., 0], sine[..., 1], sine[..., 2]
    rotation = np.empty(rpy.shape + (3,))
    rotation[..., 0, 0], rotation[..., 1, 0], rotation[..., 2, 0] = cy * cp, sy * cp, -sp
    rotation[..., 0, 1], rotation[..., 0, 2] = cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    rotation[..., 1, 1], rotation[..., 1, 2] = sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
    rotation[..., 2, 1], rotation[..., 2, 2] = cp * sr, cp * cr
    return rotation


def rpy_from_rotation(rotation: np.ndarray) -> np.ndarray:
    """Return roll, pitch, yaw (..., 3) [rad] that give the rotation back, at any pitch.

    Near pitch +-90 deg yaw alone is ill determined: it is taken first and undone, so that the
    roll makes good its error.
    """
    r = np.asarray(rotation, dtype=float)
    regular = np.hypot(r[..., 0, 0], r[..., 1, 0]) > 1e-15
    yaw = np.where(regular, np.arctan2(r[..., 1, 0], r[..., 0, 0]), 0.0)
    c, s = np.cos(yaw), np.sin(yaw)
    pitch = np.arctan2(-r[..., 2, 0], c * r[..., 0, 0] + s * r[..., 1, 0])
    roll = np.arctan2(s * r[..., 0, 2] - c * r[..., 1, 2], c * r[..., 1, 1] - s * r[..., 0, 1])
    return np.stack([roll, pitch, yaw], axis=-1)


def transform(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """Return (..., 4, 4) of rotations (..., 3, 3) and translations (..., 3) [m]."""
    rotation, translation = np.asarray(rotation, dtype=float), np.asarray(translation, dtype=float)
    shape = np.broadcast(rotation[..., 0, 0], translation[..., 0]).shape
    matrix = np.zeros(shape + (4, 4))
    matrix[..., :3, :3] = rotation
    matrix[..., :3, 3] = translation
    matrix[..., 3, 3] = 1.0
    return matrix


def inverse(a_T_b: np.ndarray) -> np.ndarray:
    """Return ``b_T_a`` (..., 4, 4) of rigid transforms ``a_T_b``."""
    b_R_a = np.swapaxes(np.asarray(a_T_b, dtype=float)[..., :3, :3], -1, -2)
    return transform(b_R_a, -(b_R_a @ a_T_b[..., :3, 3:])[..., 0])


def apply(a_T_b: np.ndarray, points_in_b: np.ndarray) -> np.ndarray:
    """Return points (n, 3) in a of points (n, 3) in b; one transform, or one for each point."""
    a_T_b = np.asarray(a_T_b, dtype=float)
    if a_T_b.ndim == 2:
        return points_in_b @ a_T_b[:3, :3].T + a_T_b[:3, 3]
    return np.einsum("nij,nj->ni", a_T_b[:, :3, :3], points_in_b) + a_T_b[:, :3, 3]


def apply_each(a_T_b: np.ndarray, points_in_b: np.ndarray) -> np.ndarray:
    """Return points (..., n, 3) in a of the same points (n, 3) in b, for transforms (..., 4, 4)."""
    a_T_b = np.asarray(a_T_b, dtype=float)
    return points_in_b @ np.swapaxes(a_T_b[..., :3, :3], -1, -2) + a_T_b[..., None, :3, 3]


def adjoint(a_T_b: np.ndarray) -> np.ndarray:
    """Return A (..., 6, 6) with ``T exp(x) T^-1 == exp(A x)`` for twists x = (rotation, move)."""
    a_T_b = np.asarray(a_T_b, dtype=float)
    rotation = a_T_b[..., :3, :3]
    matrix = np.zeros(a_T_b.shape[:-2] + (6, 6))
    matrix[..., :3, :3] = rotation
    matrix[..., 3:, 3:] = rotation
    matrix[..., 3:, :3] = skew(a_T_b[..., :3, 3]) @ rotation
    return matrix


def rotation_angle(rotation: np.ndarray) -> np.ndarray:
    """Return the geodesic angle [rad] of the matrices (..., 3, 3)."""
    return np.linalg.norm(rotation_vector_from_rotation(rotation), axis=-1)


def pose_differences(a_T_b: np.ndarray, other_a_T_b: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return translations (...) [m] and angles (...) [rad] between poses of the same things."""
    difference = inverse(a_T_b) @ other_a_T_b
    shifts_m = np.linalg.norm(difference[..., :3, 3], axis=-1)
    return shifts_m, rotation_angle(difference[..., :3, :3])


def pose_difference(a_T_b: np.ndarray, other_a_T_b: np.ndarray) -> Tuple[float, float]:
    """Return the translation [m] and the angle [rad] between two poses (4, 4) of the same thing."""
    shift_m, angle_rad = pose_differences(a_T_b, other_a_T_b)
    return float(shift_m), float(angle_rad)


def twist_sizes(twist: np.ndarray) -> Tuple[float, float]:
    """Return how far a twist (6,) shifts [m] and turns [rad]; of a velocity likewise, a second."""
    return float(np.linalg.norm(twist[3:])), float(np.linalg.norm(twist[:3]))


def random_rotation(angle_rad: float, rng: np.random.Generator) -> np.ndarray:
    """Return a rotation (3, 3) of the given angle [rad] about an isotropically random axis."""
    return rotation_from_rotation_vector(angle_rad * random_direction(rng))


def random_direction(rng: np.random.Generator) -> np.ndarray:
    """Return an isotropically random unit vector (3,)."""
    vector = rng.standard_normal(3)
    return vector / np.linalg.norm(vector)


def random_move(translation_m: float, rotation_rad: float, rng: np.random.Generator) -> np.ndarray:
    """Return a transform (4, 4) of exactly this length and angle, both in random directions."""
    translation = translation_m * random_direction(rng)
    return transform(random_rotation(rotation_rad, rng), translation)


def moved(parent_T_child: np.ndarray, move: np.ndarray) -> np.ndarray:
    """Return poses (..., 4, 4) turned about their own origin and shifted in the parent's axes."""
    rotation = parent_T_child[..., :3, :3] @ move[..., :3, :3]
    return transform(rotation, parent_T_child[..., :3, 3] + move[..., :3, 3])


def from_quaternion(translation: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    """Return ``parent_T_child`` (..., 4, 4) of a translation [m] and a quaternion x y z w."""
    return transform(rotation_from_quaternion(quaternion), translation)


def from_rpy(translation: np.ndarray, rpy: np.ndarray) -> np.ndarray:
    """Return ``parent_T_child`` (..., 4, 4) of a URDF origin: xyz [m] and rpy [rad]."""
    return transform(rotation_from_rpy(rpy), translation)
