"""The rectangle of a board's border: signed distance to it, exact and continuous."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Tuple

import numpy as np

from atom_core.geometry import se3


@dataclass(frozen=True)
class Rectangle:
    """An axis-aligned rectangle in a board's plane [m]."""

    x_min: float
    y_min: float
    x_max: float
    y_max: float

    def __post_init__(self) -> None:
        if not (self.x_max > self.x_min and self.y_max > self.y_min):
            raise ValueError("a rectangle needs x_max > x_min and y_max > y_min")

    @property
    def centre(self) -> np.ndarray:
        """(2,) [m]."""
        return np.array([self.x_min + self.x_max, self.y_min + self.y_max]) / 2.0

    @property
    def half_size(self) -> np.ndarray:
        """(2,) half of width and height [m]."""
        return np.array([self.x_max - self.x_min, self.y_max - self.y_min]) / 2.0

    @property
    def corners(self) -> np.ndarray:
        """(4, 2) top left, top right, bottom right, bottom left ("top" is the smaller y)."""
        return np.array(
            [
                [self.x_min, self.y_min],
                [self.x_max, self.y_min],
                [self.x_max, self.y_max],
                [self.x_min, self.y_max],
            ]
        )

    @property
    def centre_in_pattern(self) -> np.ndarray:
        """(3,) the centre in the pattern's frame [m]."""
        return np.append(self.centre, 0.0)

    @property
    def corners_in_pattern(self) -> np.ndarray:
        """(4, 3) the corners in the pattern's frame [m], in the same order."""
        return np.column_stack([self.corners, np.zeros(4)])

    def way_m(self, a_T_pattern: np.ndarray, other_a_T_pattern: np.ndarray) -> float:
        """Return how far any point of the board moves, at most, between two poses."""
        middle = self.centre_in_pattern[None]
        shift = se3.apply(other_a_T_pattern, middle) - se3.apply(a_T_pattern, middle)
        angle = se3.rotation_angle(a_T_pattern[:3, :3].T @ other_a_T_pattern[:3, :3])
        return float(np.linalg.norm(shift) + angle * np.linalg.norm(self.half_size))

    def signed_distance(self, points: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return distances to the border, negative inside, and their gradients.

        Args:
            points: (n, 2) in the board's plane [m].

        Returns:
            (n,) distances [m] and (n, 2) unit gradients: the outward direction of the nearest
            border point. On the ridge where two sides are equally near, the one found first.
        """
        return signed_distance_to_rectangles(points, self.centre, self.half_size)

    def sample(self, step: float) -> np.ndarray:
        """Return points (n, 2) along the whole border, at most ``step`` [m] apart."""
        corners = self.corners
        sides = []
        for start, end in zip(corners, np.roll(corners, -1, axis=0)):
            count = max(int(np.ceil(np.linalg.norm(end - start) / step)), 1)
            sides.append(start + np.linspace(0, 1, count, endpoint=False)[:, None] * (end - start))
        return np.concatenate(sides)


def signed_distance_to_rectangles(
    points: np.ndarray, centre: np.ndarray, half_size: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Return signed distances (n,) and gradients (n, 2); one rectangle, or one for each point.

    Args:
        points: (n, 2) [m].
        centre: (2,) or (n, 2) [m].
        half_size: (2,) or (n, 2) half of width and height [m].
    """
    offset = np.asarray(points, dtype=float) - centre
    beyond = np.abs(offset) - half_size
    outward = np.where(offset < 0, -1.0, 1.0)
    positive = np.maximum(beyond, 0.0)
    outside = np.linalg.norm(positive, axis=1)
    is_outside = outside > 0
    rows, nearest = np.arange(len(offset)), np.argmax(beyond, axis=1)
    gradient_inside = np.zeros_like(offset)
    gradient_inside[rows, nearest] = outward[rows, nearest]
    safe = np.where(is_outside, outside, 1.0)[:, None]
    gradient = np.where(is_outside[:, None], outward * positive / safe, gradient_inside)
    return np.where(is_outside, outside, np.max(beyond, axis=1)), gradient


# Share of the way to the corner's ridge on which the two sides are blended. The blend is the
# narrower, the nearer the border; on the border itself nothing changes. With a half, a point on
# the ridge bends the sum of squares down by 0.75 of what a point at a side bends it up.
BLEND = 0.5


def blended_distance_to_rectangles(
    points: np.ndarray, centre: np.ndarray, half_size: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Return signed distances (n,) whose gradients (n, 2) are continuous inside, too.

    The distance to the nearest side has a ridge on the bisector of each corner, where the nearest
    side changes: a sum of its squares has a minimum on either side of it. Here the two depths
    below the sides are blended near the ridge, by the polynomial of a smooth minimum. Where one is
    less than a third of the other, and outside, it is the Euclidean distance. It is zero on the
    border and nowhere else; the gradients' lengths are 0.53 to 1.

    Args:
        points: (n, 2) [m].
        centre: (2,) or (n, 2) [m].
        half_size: (2,) or (n, 2) half of width and height [m].
    """
    distance, gradient = signed_distance_to_rectangles(points, centre, half_size)
    offset = np.asarray(points, dtype=float) - centre
    beyond = np.abs(offset) - half_size
    width = -BLEND * np.sum(beyond, axis=1)
    apart = beyond[:, 0] - beyond[:, 1]
    share = np.maximum(width - np.abs(apart), 0.0) / np.where(width > 0.0, width, 1.0)
    share = np.where(np.max(beyond, axis=1) < 0.0, share, 0.0)
    near = np.stack([apart >= 0.0, apart < 0.0], axis=1)
    # distance = max + (width - |apart|)^2 / (4 width), by parts
    by_width = BLEND * share * (2.0 - share) / 4.0
    by_beyond = near * (1.0 - share[:, None]) + share[:, None] / 2.0 - by_width[:, None]
    outward = np.where(offset < 0, -1.0, 1.0)
    blended = share[:, None] > 0.0
    return (
        distance + width * share**2 / 4.0,
        np.where(blended, outward * by_beyond, gradient),
    )
