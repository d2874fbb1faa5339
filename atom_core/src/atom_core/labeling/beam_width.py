"""How wide the beams of a 3D LiDAR are, from how much larger boards look than they are.

A wide beam returns from a board though its middle passes beside it: the outline is beyond the
border by half the beam's width, times the range. Boards are known rectangles, so several of them
tell the width. A board that is larger than the configuration says looks alike from one distance.
"""

from __future__ import annotations

from typing import Iterable, List, NamedTuple, Optional, Tuple

import numpy as np

from atom_core.geometry.rectangle import Rectangle
from atom_core.geometry.robust_sigma import OF_A_MEDIAN, robust_sigma
from atom_core.labeling.lidar3d import CloudLike, FoundBoard, Lidar3dOptions, as_cloud, board_at
from atom_core.model.sensor import WIDEST_BEAM_RAD

LEAST_BOARDS = 3
_ROUNDS = 5
_SETTLED_RAD = 1e-4
_SIGMAS = 3.0


class BeamWidth(NamedTuple):
    """The width of a sensor's beams.

    Attributes:
        width_rad: full angle within which a beam returns from the board.
        sigma_rad: of it, from how much the boards differ.
        boards: from which it was estimated.
    """

    width_rad: float
    sigma_rad: float
    boards: int


def estimate_beam_width(
    boards: Iterable[Tuple[CloudLike, np.ndarray]], border: Rectangle
) -> Optional[BeamWidth]:
    """Return how wide beams must be that the boards in several clouds have the border's size.

    Args:
        boards: clouds of one sensor, each with a seed (3,) on its board [m].
        border: the board's edges [m].

    Returns:
        The width; None where fewer than three boards are found, or where boards do not look larger
        by more than three sigmas, or by so much that no beam explains it.

    Raises:
        LabelingError: a cloud cannot be used.
    """
    width, sides = 0.0, np.zeros((0, 2))
    for _ in range(_ROUNDS):
        options = Lidar3dOptions(beam_width_rad=width)
        found = [board_at(as_cloud(cloud), border, seed, options) for cloud, seed in boards]
        sides = np.array([wider for one in found for wider in _wider(one, border)]).reshape(-1, 2)
        if len(np.unique(sides[:, 0])) < LEAST_BOARDS:
            return None
        change = float(np.median(sides[:, 1]))
        width = max(width + change, 0.0)
        if width > WIDEST_BEAM_RAD:
            return None
        if abs(change) < _SETTLED_RAD:
            break
    count = len(np.unique(sides[:, 0]))
    widths = sides[:, 1]
    scatter = robust_sigma(widths - np.median(widths))
    sigma = OF_A_MEDIAN * scatter / np.sqrt(count)  # sides of one board count once
    return BeamWidth(width, sigma, count) if width > _SIGMAS * sigma else None


def _wider(found: FoundBoard, border: Rectangle) -> List[Tuple[float, float]]:
    """Return of each side that is measured the board's range [m] and the angle that is too much."""
    if not found.labeled.detected:
        return []
    away = float(np.linalg.norm(found.sensor_T_centre[:3, 3]))
    quality, sides = found.labeled.quality, []
    for name, half in zip(("measured_width_m", "measured_height_m"), border.half_size):
        if name in quality:
            sides.append((away, (quality[name] - 2.0 * float(half)) / away))
    return sides
