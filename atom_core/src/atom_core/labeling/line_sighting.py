"""The board as a 2D LiDAR sees it, to tell whether it stands still.

One scan says less than a plane. Many returns tell the shift across the cut and its direction
exactly; along the cut there are only the two ends, known to the distance of two beams on the board.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Optional

import numpy as np

from atom_core.geometry.expected_noise import LIDAR_SIGMA_M
from atom_core.geometry.line import fit_line

# Noise across and of the direction, two numbers, stays below this square in 99 of 100 pairs.
_MOST_NOISE_SQUARE = 9.2
_STEPS = 2.0  # an end wanders by so many beams as returns at the edge come and go


@dataclass(frozen=True)
class LineSighting:
    """The cut of the board.

    Attributes:
        centre: (3,) mean of the labeled points [m].
        direction: (3,) unit vector along the cut, either way.
        ends: (2,) places of the first and the last point along it, from the centre [m].
        extent_m: root of the mean squared distance from the centre, along the cut.
        step_m: between two beams on the board.
        sigma_m: of one range.
        count: of points.
    """

    centre: np.ndarray
    direction: np.ndarray
    ends: np.ndarray
    extent_m: float
    step_m: float
    sigma_m: float
    count: int
    known_axes: ClassVar[int] = 1

    def board_axes(self, normal: np.ndarray) -> np.ndarray:
        """Return the cut's direction, the one across it in the board, and the nearest normal."""
        nearest = normal - (normal @ self.direction) * self.direction
        nearest /= np.linalg.norm(nearest)
        return np.column_stack([self.direction, np.cross(nearest, self.direction), nearest])

    def motion(self, other: LineSighting) -> float:
        """Return by how many sigmas the board moved to another sighting."""
        shift = other.centre - self.centre
        along = float(self.direction @ shift)
        across = float(np.linalg.norm(shift - along * self.direction))
        turned = float(np.linalg.norm(np.cross(self.direction, other.direction))) * self.extent_m
        sigma = max(self.sigma_m, other.sigma_m)
        noise = 2.0 * _MOST_NOISE_SQUARE * sigma**2 / min(self.count, other.count)
        known = max(across**2 + turned**2 - noise, 0.0)
        same_way = float(np.sign(self.direction @ other.direction)) or 1.0
        moved = along + np.sort(same_way * other.ends) - self.ends
        wandering = sigma + _STEPS * max(self.step_m, other.step_m)
        return float(np.sqrt(known / sigma**2 + np.mean((moved / wandering) ** 2)))


def line_sighting(points: np.ndarray) -> Optional[LineSighting]:
    """Return the sighting of labeled points (n, 3) [m] of a scan; None if they make no line."""
    try:
        line = fit_line(points)
    except ValueError:
        return None
    along = np.sort((points - line.centroid) @ line.direction)
    return LineSighting(
        centre=line.centroid,
        direction=line.direction,
        ends=along[[0, -1]],
        extent_m=float(np.sqrt(np.mean(along**2))),
        step_m=float(np.median(np.diff(along))),
        sigma_m=LIDAR_SIGMA_M,
        count=len(points),
    )
