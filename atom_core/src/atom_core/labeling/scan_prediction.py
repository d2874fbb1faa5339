"""Where the plane of a 2D LiDAR should cut a board whose pose others tell."""

from __future__ import annotations

from typing import Optional

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.rectangle import Rectangle

_LEAST_SLOPE = 0.05  # sine of the angle between board and scan's plane


def seed_in_plane(
    middle: np.ndarray, normal: np.ndarray, half_diagonal_m: float
) -> Optional[np.ndarray]:
    """Return the point (3,) [m] of the scan's plane, z = 0, on a board and nearest to its middle.

    None where the board, as large as its circumscribed circle, does not reach the scan's plane, or
    lies in it.

    Args:
        middle: (3,) of the board in the LiDAR's frame [m].
        normal: (3,) unit vector, either way.
        half_diagonal_m: of the board.
    """
    upwards = np.array([0.0, 0.0, 1.0]) - normal[2] * normal
    slope = float(np.linalg.norm(upwards))
    if slope < _LEAST_SLOPE:
        return None
    away = float(middle[2]) / slope
    if abs(away) > half_diagonal_m:
        return None
    seed = middle - away * upwards / slope
    return np.array([seed[0], seed[1], 0.0])


def expected_cut(lidar_T_pattern: np.ndarray, border: Rectangle) -> Optional[np.ndarray]:
    """Return both ends (2, 3) [m] of a board's cut in the LiDAR's frame; None if there is none.

    Args:
        lidar_T_pattern: (4, 4) pose of the board.
        border: its edges [m].
    """
    corners = se3.apply(
        lidar_T_pattern, np.column_stack([border.corners, np.zeros(len(border.corners))])
    )
    ends = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0)):
        if (start[2] > 0.0) != (end[2] > 0.0):
            ends.append(start + (end - start) * start[2] / (start[2] - end[2]))
    return np.array(ends) if len(ends) == 2 else None
