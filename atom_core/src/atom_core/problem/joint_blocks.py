"""What the six numbers of a block mean when it holds parameters of a joint.

A joint is ``origin @ motion(bias) @ motion(position)``. The first two hold for all collections, so
each is one factor of the chain with numbers of its own; the third is a constant of the collection.
The numbers stand where those of a pose do: angles before lengths. Those that are not asked for
stay zero and have no derivative.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.joints import POSITION_BIAS, motion


class Numbers(Protocol):
    """Six numbers that are no pose, relative to their initial value."""

    @property
    def free(self) -> np.ndarray:
        """(6,) bool: those that are estimated."""
        ...

    @property
    def names(self) -> Tuple[str, ...]:
        """Six names, empty where a number has no meaning."""
        ...

    def pose(self, numbers: np.ndarray) -> np.ndarray:
        """Return the factor (4, 4) of the chain at the numbers (6,)."""
        ...

    def twist(self, numbers: np.ndarray) -> np.ndarray:
        """Return (6, 6): the factor's left twist (rotation, move) by the numbers."""
        ...


@dataclass(frozen=True)
class OriginNumbers:
    """roll, pitch, yaw [rad] and x, y, z [m] of a joint's origin.

    Attributes:
        initial: (6,) values to start from.
        free: (6,) bool.
    """

    initial: np.ndarray
    free: np.ndarray

    names = ("origin_roll", "origin_pitch", "origin_yaw", "origin_x", "origin_y", "origin_z")

    def values(self, numbers: np.ndarray) -> np.ndarray:
        """Return roll, pitch, yaw, x, y, z (6,) at the numbers (6,)."""
        return self.initial + np.where(self.free, numbers, 0.0)

    def pose(self, numbers: np.ndarray) -> np.ndarray:
        """Return the origin (4, 4)."""
        values = self.values(numbers)
        return se3.from_rpy(values[3:], values[:3])

    def twist(self, numbers: np.ndarray) -> np.ndarray:
        """Return (6, 6): left twist in the parent by the numbers."""
        _, pitch, yaw = self.values(numbers)[:3]
        about_z = se3.rotation_from_rpy(np.array([0.0, 0.0, yaw]))
        about_yz = se3.rotation_from_rpy(np.array([0.0, pitch, yaw]))
        axes = np.column_stack([about_yz[:, 0], about_z[:, 1], [0.0, 0.0, 1.0]])
        result = np.zeros((6, 6))
        result[:3, :3] = axes
        result[3:, :3] = se3.skew(self.values(numbers)[3:]) @ axes
        result[3:, 3:] = np.eye(3)
        return result * self.free


@dataclass(frozen=True)
class BiasNumbers:
    """What is to be added to a joint's position: the first number [rad], or the fourth [m].

    Attributes:
        axis: (3,) unit vector of the motion, in the joint's frame.
        is_prismatic: whether the position is a length.
        initial: value to start from.
    """

    axis: np.ndarray
    is_prismatic: bool
    initial: float

    @property
    def place(self) -> int:
        """Which of the six numbers it is."""
        return 3 if self.is_prismatic else 0

    @property
    def free(self) -> np.ndarray:
        """(6,) bool."""
        return np.arange(6) == self.place

    @property
    def names(self) -> Tuple[str, ...]:
        """Six names, all but one empty."""
        return tuple(POSITION_BIAS if free else "" for free in self.free)

    def values(self, numbers: np.ndarray) -> np.ndarray:
        """Return (6,): the bias in its place, at the numbers (6,)."""
        return np.where(self.free, self.initial + numbers, 0.0)

    def pose(self, numbers: np.ndarray) -> np.ndarray:
        """Return the motion (4, 4) by the bias."""
        return motion(self.axis, self.is_prismatic, self.values(numbers)[self.place])

    def twist(self, numbers: np.ndarray) -> np.ndarray:
        """Return (6, 6): left twist by the numbers; the axis is the same in both frames."""
        result = np.zeros((6, 6))
        start = 3 if self.is_prismatic else 0
        result[start : start + 3, self.place] = self.axis
        return result
