"""The one pose of a fixed board that suits a camera's corners of all collections best."""

from __future__ import annotations

from typing import List, NamedTuple, Sequence

import numpy as np

from atom_core.evaluation.board_pose import linearised, moved
from atom_core.geometry import se3
from atom_core.problem.corner_measurement import CornerMeasurement

_ITERATIONS, _SMALL_STEP = 50, 1e-12
_STARTS = 12  # poses by single images that are tried


class BoardView(NamedTuple):
    """A board in one image.

    Attributes:
        corners: detected.
        camera_T_parent: (4, 4), where the camera is.
        camera_T_pattern: (4, 4), by these corners alone.
    """

    corners: CornerMeasurement
    camera_T_parent: np.ndarray
    camera_T_pattern: np.ndarray


def fixed_board_pose(views: Sequence[BoardView]) -> np.ndarray:
    """Return ``parent_T_pattern`` (4, 4) with the least sum of squared distances in all images.

    Levenberg-Marquardt from the best of the poses that single images give. All corners count
    alike, and the cameras' places are held.

    Args:
        views: one at least.
    """
    chosen = np.unique(np.linspace(0, len(views) - 1, min(_STARTS, len(views))).astype(int))
    starts = [se3.inverse(views[i].camera_T_parent) @ views[i].camera_T_pattern for i in chosen]
    pose = min(starts, key=lambda start: _cost(views, start))
    cost, damping = _cost(views, pose), 1e-6
    for _ in range(_ITERATIONS):
        normal, gradient = _normal_equations(views, pose)
        step = np.linalg.solve(normal + damping * np.diag(np.diagonal(normal)), -gradient)
        candidate = moved(pose, step)
        new_cost = _cost(views, candidate)
        if new_cost > cost:
            damping *= 10.0
        else:
            pose, cost, damping = candidate, new_cost, max(damping / 10.0, 1e-12)
        if np.max(np.abs(step)) < _SMALL_STEP:
            break
    return pose


def offsets_px(view: BoardView, parent_T_pattern: np.ndarray) -> np.ndarray:
    """Return projected minus detected corners (n, 2) [px]."""
    points = se3.apply(view.camera_T_parent @ parent_T_pattern, view.corners.corners_in_pattern)
    return np.asarray(view.corners.camera.project(points) - view.corners.pixels)


def _cost(views: Sequence[BoardView], parent_T_pattern: np.ndarray) -> float:
    return float(sum(np.sum(offsets_px(view, parent_T_pattern) ** 2) for view in views))


def _normal_equations(views: Sequence[BoardView], parent_T_pattern: np.ndarray) -> List[np.ndarray]:
    """Return the normal matrix (6, 6) and the gradient (6,), by a motion in the parent's axes."""
    normal, gradient = np.zeros((6, 6)), np.zeros(6)
    for corners, camera_T_parent, _ in views:
        pose = camera_T_parent @ parent_T_pattern
        error, jacobian = linearised(
            corners.camera, pose, corners.corners_in_pattern, corners.pixels
        )
        turned = jacobian.reshape(-1, 2, 3) @ camera_T_parent[:3, :3]
        jacobian = turned.reshape(-1, 6)
        normal += jacobian.T @ jacobian
        gradient += jacobian.T @ error
    return [normal, gradient]
