"""OpenCV's solvers of poses: the only place that calls them.

OpenCV 4.2, which ROS Noetic has, differs from later versions in what it takes.
"""

from __future__ import annotations

from typing import Any, List, Optional, Sequence, Tuple

import cv2
import numpy as np

from atom_core.geometry import se3

HAND_EYE_METHODS = ("tsai", "park", "horaud", "andreff", "daniilidis")
ROBOT_WORLD_METHODS = ("shah", "li")


def planar_poses(points: np.ndarray, rays: np.ndarray) -> List[np.ndarray]:
    """Return the poses ``camera_T_points`` (4, 4) of flat points by planar PnP, the better first.

    Collins, Bartoli, "Infinitesimal plane-based pose estimation" (IJCV 2014), by OpenCV.

    Args:
        points: (n, 3) [m] with z = 0, at least four, not on a line.
        rays: (n, 2) normalised pixels of the points.
    """
    centre = points.mean(axis=0)  # IPPE wants points around the origin
    found, rotations, translations, _ = cv2.solvePnPGeneric(
        (points - centre).reshape(-1, 1, 3),
        rays.reshape(-1, 1, 2),
        np.eye(3),
        np.zeros(5),
        flags=cv2.SOLVEPNP_IPPE,
        reprojectionError=np.zeros((1, 1)),  # OpenCV 4.2 refuses to allocate it itself
    )
    poses = []
    for rotation, translation in zip(rotations[:found], translations[:found]):
        pose = se3.transform(
            se3.rotation_from_rotation_vector(rotation.ravel()), translation.ravel()
        )
        pose[:3, 3] -= pose[:3, :3] @ centre
        poses.append(pose)
    return poses


def hand_eye_pose(
    G: Sequence[np.ndarray], H: Sequence[np.ndarray], method: str = "park"
) -> Optional[np.ndarray]:
    """Return the X (4, 4) of ``G_i X H_i = const``, or None where the motion does not tell it.

    By OpenCV; its default here is Park, Martin, "Robot sensor calibration: solving AX=XB on the
    Euclidean group" (1994).

    Args:
        G: poses (4, 4), one for each position, at least three.
        H: poses (4, 4), as many.
        method: one of ``HAND_EYE_METHODS``.
    """
    how = getattr(cv2, f"CALIB_HAND_EYE_{method.upper()}")
    try:
        rotation, translation = cv2.calibrateHandEye(*_parts(G), *_parts(H), method=how)
    except cv2.error:
        return None
    return _proper(rotation, translation)


def has_robot_world() -> bool:
    """Tell whether this OpenCV has the methods of ``robot_world_poses``; that of Noetic has not."""
    return hasattr(cv2, "calibrateRobotWorldHandEye")


def robot_world_poses(
    G: Sequence[np.ndarray], H: Sequence[np.ndarray], method: str
) -> Optional[Tuple[np.ndarray, np.ndarray]]:
    """Return X and F (4, 4) of ``G_i X H_i = F``, both in one; None where they are not told.

    By OpenCV, where it `has_robot_world`.

    Args:
        G: poses (4, 4), one for each position, at least three.
        H: poses (4, 4), as many.
        method: one of ``ROBOT_WORLD_METHODS``.
    """
    how = getattr(cv2, f"CALIB_ROBOT_WORLD_HAND_EYE_{method.upper()}")
    solve: Any = getattr(cv2, "calibrateRobotWorldHandEye")  # noqa: B009 (mypy knows no such)
    inverses = [se3.inverse(g) for g in G]
    try:  # H_i F^-1 = X^-1 G_i^-1
        found = solve(*_parts(H), *_parts(inverses), method=how)
    except cv2.error:
        return None
    board_inverse, eye_inverse = _proper(*found[:2]), _proper(*found[2:])
    if board_inverse is None or eye_inverse is None:
        return None
    return se3.inverse(eye_inverse), se3.inverse(board_inverse)


def _parts(poses: Sequence[np.ndarray]) -> Tuple[List[np.ndarray], List[np.ndarray]]:
    """Return rotations and translations, as OpenCV takes them."""
    return [pose[:3, :3] for pose in poses], [pose[:3, 3] for pose in poses]


def _proper(rotation: np.ndarray, translation: np.ndarray) -> Optional[np.ndarray]:
    pose = se3.transform(rotation, np.ravel(translation))
    if not np.all(np.isfinite(pose)) or np.linalg.det(rotation) < 0:
        return None
    return pose if np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6) else None


def rigid_fit(
    source: np.ndarray, target: np.ndarray, weight: Optional[np.ndarray] = None
) -> np.ndarray:
    """Return ``target_T_source`` (4, 4) that carries points (n, 3) best onto others, weighted (n,).

    Kabsch (1976), with the determinant kept at +1.
    """
    share = np.ones(len(source)) if weight is None else weight
    share = share / share.sum()
    source_mean, target_mean = share @ source, share @ target
    covariance = (target - target_mean).T @ ((source - source_mean) * share[:, None])
    left, _, right = np.linalg.svd(covariance)
    sign = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    rotation = left @ sign @ right
    return se3.transform(rotation, target_mean - rotation @ source_mean)
