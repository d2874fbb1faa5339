"""Parameter blocks of joints.

A joint is ``origin @ motion(bias) @ motion(position)``. The first two hold for all collections, so
each is one factor of the chain with a block of its own; the third is a constant of the collection.
The numbers stand where those of a pose do: angles before lengths. Those that are not asked for
stay zero and have no derivative.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Dict, Optional, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.joints import POSITION_BIAS, motion
from atom_core.problem.blocks import (
    BLOCK_SIZE,
    POSE_UNITS,
    ROTATION,
    TRANSLATION,
    TransformBlock,
    prior_weight,
)
from atom_core.problem.priors import Prior

ORIGIN_PARAMETERS = (
    "origin_roll",
    "origin_pitch",
    "origin_yaw",
    "origin_x",
    "origin_y",
    "origin_z",
)


@dataclass(frozen=True)
class JointBlock(TransformBlock):
    """Parameters of a joint."""

    @property
    @abstractmethod
    def initial_values(self) -> np.ndarray:
        """(6,) values [rad, m] to start from."""

    @property
    def prior_mean(self) -> np.ndarray:
        """(6,) the numbers at which the estimated parameters are as described."""
        if self.prior is None:
            return np.zeros(BLOCK_SIZE)
        described = [self.prior.parameters.get(name, 0.0) for name in self.components]
        return np.where(self.free, described - self.initial_values, 0.0)

    @property
    def prior_weight(self) -> np.ndarray:
        """(6,) one over the variance of the numbers; 0: anything goes."""
        if self.prior is None:
            return np.zeros(BLOCK_SIZE)
        return np.where(self.free, prior_weight(self.prior.sigma_m, self.prior.sigma_rad), 0.0)

    @property
    def joint(self) -> str:
        """The joint's name."""
        return self.names[0]

    @property
    def title(self) -> str:
        """The name that stands before those of its numbers."""
        return f"joint {self.joint}"

    @property
    def units(self) -> Tuple[str, ...]:
        """Rad of angles, m of lengths."""
        return POSE_UNITS

    @abstractmethod
    def values(self, x: np.ndarray) -> np.ndarray:
        """Return the six parameters [rad, m] at the numbers x (6,)."""

    def free_values(self, x: np.ndarray) -> Dict[str, float]:
        """Return the estimated parameters [rad, m] at the numbers x (6,), by name."""
        values = self.values(x)
        return {name: float(values[i]) for i, name in self.free_components}


@dataclass(frozen=True)
class JointOriginBlock(JointBlock):
    """roll, pitch, yaw [rad] and x, y, z [m] of a joint's origin.

    Attributes:
        initial: (6,) values to start from.
        selected: (6,) bool: those that are estimated.
        stated: what the user knows of them beforehand; None: nothing.
    """

    initial: np.ndarray
    selected: np.ndarray
    stated: Optional[Prior] = None

    @property
    def prior(self) -> Optional[Prior]:
        """What the user knows of the joint beforehand; None: nothing."""
        return self.stated

    def without_prior(self) -> JointOriginBlock:
        """Return the block as the data alone tell it."""
        return replace(self, stated=None)

    @property
    def initial_values(self) -> np.ndarray:
        """(6,) values [rad, m] to start from."""
        return self.initial

    @property
    def components(self) -> Tuple[str, ...]:
        """Names of the six numbers."""
        return ORIGIN_PARAMETERS

    @property
    def free(self) -> np.ndarray:
        """(6,) bool."""
        return self.selected

    def values(self, x: np.ndarray) -> np.ndarray:
        """Return roll, pitch, yaw, x, y, z (6,) at the numbers x (6,)."""
        return self.initial + np.where(self.selected, x, 0.0)

    def pose(self, x: np.ndarray) -> np.ndarray:
        """Return the origin (4, 4)."""
        values = self.values(x)
        return se3.from_rpy(values[TRANSLATION], values[ROTATION])

    def twist_jacobian(self, x: np.ndarray) -> np.ndarray:
        """Return (6, 6): left twist in the parent by the numbers."""
        _, pitch, yaw = self.values(x)[ROTATION]
        about_z = se3.rotation_from_rpy(np.array([0.0, 0.0, yaw]))
        about_yz = se3.rotation_from_rpy(np.array([0.0, pitch, yaw]))
        axes = np.column_stack([about_yz[:, 0], about_z[:, 1], [0.0, 0.0, 1.0]])
        result = np.zeros((6, BLOCK_SIZE))
        result[ROTATION, ROTATION] = axes
        result[TRANSLATION, ROTATION] = se3.skew(self.values(x)[TRANSLATION]) @ axes
        result[TRANSLATION, TRANSLATION] = np.eye(3)
        return result * self.selected


@dataclass(frozen=True)
class JointBiasBlock(JointBlock):
    """What is to be added to a joint's position: the first number [rad], or the fourth [m].

    Attributes:
        axis: (3,) unit vector of the motion, in the joint's frame.
        is_prismatic: whether the position is a length.
        initial: value to start from.
        stated: what the user knows of the joint beforehand; None: nothing.
    """

    axis: np.ndarray
    is_prismatic: bool
    initial: float
    stated: Optional[Prior] = None

    @property
    def prior(self) -> Optional[Prior]:
        """What the user knows of the joint beforehand; None: nothing."""
        return self.stated

    def without_prior(self) -> JointBiasBlock:
        """Return the block as the data alone tell it."""
        return replace(self, stated=None)

    @property
    def initial_values(self) -> np.ndarray:
        """(6,) the bias in its place [rad or m]."""
        return np.where(self.free, self.initial, 0.0)

    @property
    def place(self) -> int:
        """Which of the six numbers it is."""
        return self._part.start

    @property
    def components(self) -> Tuple[str, ...]:
        """Six names, all but one empty."""
        return tuple(POSITION_BIAS if free else "" for free in self.free)

    @property
    def free(self) -> np.ndarray:
        """(6,) bool."""
        return np.arange(BLOCK_SIZE) == self.place

    def values(self, x: np.ndarray) -> np.ndarray:
        """Return (6,): the bias in its place, at the numbers x (6,)."""
        return np.where(self.free, self.initial + x, 0.0)

    def pose(self, x: np.ndarray) -> np.ndarray:
        """Return the motion (4, 4) by the bias."""
        return motion(self.axis, self.is_prismatic, self.values(x)[self.place])

    def twist_jacobian(self, x: np.ndarray) -> np.ndarray:
        """Return (6, 6): left twist by the numbers; the axis is the same in both frames."""
        result = np.zeros((6, BLOCK_SIZE))
        result[self._part, self.place] = self.axis
        return result

    @property
    def _part(self) -> slice:
        return TRANSLATION if self.is_prismatic else ROTATION
