"""OpenCV's solvers of poses: the only place that calls them.

OpenCV 4.2, which ROS Noetic has, differs from later versions in what it takes.
"""

from __future__ import annotations

from typing import List, Optional, Sequence

import cv2
import numpy as np

from atom_core.geometry import se3


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


def hand_eye_pose(G: Sequence[np.ndarray], H: Sequence[np.ndarray]) -> Optional[np.ndarray]:
    """Return the X (4, 4) of ``G_i X H_i = const``, or None where the motion does not tell it.

    Park, Martin, "Robot sensor calibration: solving AX=XB on the Euclidean group" (1994), by
    OpenCV.

    Args:
        G: poses (4, 4), one for each position, at least three.
        H: poses (4, 4), as many.
    """
    try:
        rotation, translation = cv2.calibrateHandEye(
            [g[:3, :3] for g in G],
            [g[:3, 3] for g in G],
            [h[:3, :3] for h in H],
            [h[:3, 3] for h in H],
            method=cv2.CALIB_HAND_EYE_PARK,
        )
    except cv2.error:
        return None
    X = se3.transform(rotation, translation.ravel())
    proper = np.all(np.isfinite(X)) and np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6)
    return X if proper else None
