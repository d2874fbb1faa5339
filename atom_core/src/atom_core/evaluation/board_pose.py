"""The board's pose from the corners of one image alone: planar PnP, refined in pixels."""

from __future__ import annotations

from typing import Callable, NamedTuple, Optional, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.problem.corner_measurement import CornerMeasurement

_ITERATIONS = 50
_SMALL_STEP = 1e-12
_LEAST_PX = 0.05  # corners are wrong by at least as much, along each axis
_AS_GOOD = 1.5  # times as far off, the other solution of the planar ambiguity may be the right one
_ANOTHER_RAD = 0.02  # by which two solutions differ


class BoardPose(NamedTuple):
    """A board before a camera.

    Attributes:
        camera_T_pattern: (4, 4).
        rms_px: root mean square of its reprojection errors.
        rival_px: likewise of the other solution of the planar ambiguity; infinite: there is none.
    """

    camera_T_pattern: np.ndarray
    rms_px: float
    rival_px: float = np.inf


def board_pose(measurement: CornerMeasurement) -> Optional[BoardPose]:
    """Return the pose that explains the corners best; None if they do not determine one.

    Both solutions of the planar ambiguity are refined, the better one is returned.
    """
    refined = [refine_pose(measurement, start) for start in measurement.candidates()]
    if not refined:
        return None
    best = min(refined, key=lambda found: found.rms_px)
    turns = [se3.pose_difference(best[0], found.camera_T_pattern)[1] for found in refined]
    rivals = [found.rms_px for found, turn in zip(refined, turns) if turn > _ANOTHER_RAD]
    return best._replace(rival_px=min(rivals, default=np.inf))


def turn_variance(measurement: CornerMeasurement, found: BoardPose) -> float:
    """Return the mean squared angle [rad^2] by which the corners' noise turns a board's pose.

    Infinite where the other solution explains the corners nearly as well.

    Args:
        measurement: the corners.
        found: the board's pose by them.
    """
    corners, pixels = measurement.corners_in_pattern, measurement.pixels
    noise_px = max(found.rms_px * np.sqrt(len(corners) / max(2 * len(corners) - 6, 1)), _LEAST_PX)
    if found.rival_px < _AS_GOOD * max(found.rms_px, _LEAST_PX):
        return float(np.inf)
    _, jacobian = linearised(measurement.camera, found.camera_T_pattern, corners, pixels)
    covariance = np.linalg.pinv(jacobian.T @ jacobian)
    return float(noise_px**2 * np.trace(covariance[:3, :3]))


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
