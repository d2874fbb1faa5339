"""The one pose of a fixed board that suits a camera's corners of all collections best."""

from __future__ import annotations

from typing import NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.evaluation.board_pose import best_pose, linearised
from atom_core.geometry import se3
from atom_core.problem.corner_measurement import CornerMeasurement

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

    It starts from the best of the poses that single images give. All corners count alike, and the
    cameras' places are held.

    Args:
        views: one at least.
    """
    chosen = np.unique(np.linspace(0, len(views) - 1, min(_STARTS, len(views))).astype(int))
    starts = [se3.inverse(views[i].camera_T_parent) @ views[i].camera_T_pattern for i in chosen]
    start = min(starts, key=lambda pose: _cost(views, pose))
    return best_pose(lambda pose: _linearised(views, pose), start)[0]


def offsets_px(view: BoardView, parent_T_pattern: np.ndarray) -> np.ndarray:
    """Return projected minus detected corners (n, 2) [px]."""
    points = se3.apply(view.camera_T_parent @ parent_T_pattern, view.corners.corners_in_pattern)
    return np.asarray(view.corners.camera.project(points) - view.corners.pixels)


def _cost(views: Sequence[BoardView], parent_T_pattern: np.ndarray) -> float:
    return float(sum(np.sum(offsets_px(view, parent_T_pattern) ** 2) for view in views))


def _linearised(
    views: Sequence[BoardView], parent_T_pattern: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Return the errors (m,) [px] of all images, and their derivatives (m, 6) in parent's axes."""
    errors, jacobians = [], []
    for corners, camera_T_parent, _ in views:
        pose = camera_T_parent @ parent_T_pattern
        error, jacobian = linearised(
            corners.camera, pose, corners.corners_in_pattern, corners.pixels
        )
        errors.append(error)
        jacobians.append((jacobian.reshape(-1, 2, 3) @ camera_T_parent[:3, :3]).reshape(-1, 6))
    return np.concatenate(errors), np.concatenate(jacobians)
