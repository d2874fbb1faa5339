"""OpenCV's solvers of poses: the only place that calls them.

OpenCV 4.2, which ROS Noetic has, differs from later versions in what it takes; the wheels of 5.0
have no solver for hand and eye.
"""

from __future__ import annotations

from itertools import combinations
from typing import Any, List, Optional, Sequence, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.geometry import se3

HAND_EYE_METHODS = ("tsai", "park", "horaud", "andreff", "daniilidis")
ROBOT_WORLD_METHODS = ("shah", "li")
_ONE_AXIS = 1e-6  # part of the motion about a second axis below which there is none


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
    if method == "park" and not hasattr(cv2, "calibrateHandEye"):
        return _park_martin(G, H)
    how = getattr(cv2, f"CALIB_HAND_EYE_{method.upper()}")
    try:
        rotation, translation = cv2.calibrateHandEye(*_parts(G), *_parts(H), method=how)
    except cv2.error:
        return None
    return _proper(rotation, translation)


def lacking(method: str) -> str:
    """Return why this OpenCV has not a method of hand and eye; nothing where it has."""
    if method == "park":
        return ""
    name = "calibrateRobotWorldHandEye" if method in ROBOT_WORLD_METHODS else "calibrateHandEye"
    first = "4.5" if method in ROBOT_WORLD_METHODS else "4.1"
    if hasattr(cv2, name):
        return ""
    return f"OpenCV {cv2.__version__} has no {name}, which is in versions from {first} to 4.x"


def robot_world_poses(
    G: Sequence[np.ndarray], H: Sequence[np.ndarray], method: str
) -> Optional[Tuple[np.ndarray, np.ndarray]]:
    """Return X and F (4, 4) of ``G_i X H_i = F``, both in one; None where they are not told.

    By OpenCV, where nothing is `lacking`.

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


def _park_martin(G: Sequence[np.ndarray], H: Sequence[np.ndarray]) -> Optional[np.ndarray]:
    """Return X (4, 4) by the closed form of Park and Martin (1994), over all pairs of positions.

    ``A X = X B`` with the motions A of one side and B of the other: their rotation vectors differ
    by the rotation of X, and its translation is then linear.
    """
    pairs = list(combinations(range(len(G)), 2))
    A = [se3.inverse(G[j]) @ G[i] for i, j in pairs]
    B = [H[j] @ se3.inverse(H[i]) for i, j in pairs]
    turns_a, turns_b = (
        np.array([se3.rotation_vector_from_rotation(m[:3, :3]) for m in motions])
        for motions in (A, B)
    )
    left, sizes, right = np.linalg.svd(turns_a.T @ turns_b)
    if sizes[1] < _ONE_AXIS * max(sizes[0], _ONE_AXIS):
        return None
    rotation = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    rows = np.concatenate([a[:3, :3] - np.eye(3) for a in A])
    values = np.concatenate([rotation @ b[:3, 3] - a[:3, 3] for a, b in zip(A, B)])
    translation, _, rank, _ = np.linalg.lstsq(rows, values, rcond=1e-9)
    return _proper(rotation, translation) if rank == 3 else None


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
