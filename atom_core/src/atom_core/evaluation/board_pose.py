"""The board's pose from the corners of one image alone: planar PnP, refined in pixels."""

from __future__ import annotations

from typing import Callable, NamedTuple, Optional, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.problem.corner_measurement import CornerMeasurement

_ITERATIONS = 50
_SMALL_STEP = 1e-12


class BoardPose(NamedTuple):
    """``camera_T_pattern`` (4, 4) and the root mean square of its reprojection errors [px]."""

    camera_T_pattern: np.ndarray
    rms_px: float


def board_pose(measurement: CornerMeasurement) -> Optional[BoardPose]:
    """Return the pose that explains the corners best; None if they do not determine one.

    Both solutions of the planar ambiguity are refined, the better one is returned.
    """
    refined = [refine_pose(measurement, start) for start in measurement.candidates()]
    return min(refined, key=lambda found: found.rms_px) if refined else None


def refine_pose(measurement: CornerMeasurement, camera_T_pattern: np.ndarray) -> BoardPose:
    """Minimise the distances between detected and projected (distorted) pixels."""
    camera, corners, pixels = (
        measurement.camera,
        measurement.corners_in_pattern,
        measurement.pixels,
    )
    pose, error = best_pose(lambda at: linearised(camera, at, corners, pixels), camera_T_pattern)
    return BoardPose(pose, float(np.sqrt(error @ error / len(corners))))


def best_pose(
    linearise: Callable[[np.ndarray], Tuple[np.ndarray, np.ndarray]], pose: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Minimise a sum of squares over a pose, by Levenberg-Marquardt.

    Args:
        linearise: pose (4, 4) -> errors (m,) and their derivatives (m, 6) by a step of `moved`: a
            rotation about the moved frame's origin and a translation, in the other frame's axes.
        pose: (4, 4), the start.

    Returns:
        The pose (4, 4), and the errors (m,) there.
    """
    damping = 1e-6
    error, jacobian = linearise(pose)
    for _ in range(_ITERATIONS):
        normal = jacobian.T @ jacobian
        damped = normal + damping * np.diag(np.diagonal(normal))
        step = np.linalg.solve(damped, -jacobian.T @ error)
        candidate = moved(pose, step)
        new_error, new_jacobian = linearise(candidate)
        if new_error @ new_error > error @ error:
            damping *= 10.0
        else:
            pose, error, jacobian = candidate, new_error, new_jacobian
            damping = max(damping / 10.0, 1e-12)
        if np.max(np.abs(step)) < _SMALL_STEP:
            break
    return pose, error


def linearised(
    camera: Camera, pose: np.ndarray, corners: np.ndarray, pixels: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Return errors (2n,) [px] and their derivatives (2n, 6) by rotation and translation."""
    turned = corners @ pose[:3, :3].T
    projected, by_point = camera.project_with_jacobian(turned + pose[:3, 3])
    jacobian = np.concatenate([-by_point @ se3.skew(turned), by_point], axis=2)
    return (projected - pixels).ravel(), jacobian.reshape(-1, 6)


def moved(pose: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Return a pose (4, 4) after a step (6,), a rotation vector and a translation, in its axes."""
    rotation = se3.rotation_from_rotation_vector(step[:3])
    return se3.transform(rotation @ pose[:3, :3], pose[:3, 3] + step[3:])
