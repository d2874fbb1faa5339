"""Parameter blocks: six numbers each, of a pose, a part of a joint or a part of a camera.

The six stand relative to the initial value, so that a problem starts from zero. Where a block has
numbers for angles and for lengths, the angles come first.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Optional, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.transforms import Edge
from atom_core.problem.priors import Prior

SENSOR, ADDITIONAL_TF, PATTERN = "sensor", "additional_tf", "pattern"
JOINT, INTRINSICS = "joint", "intrinsics"

BLOCK_SIZE = 6
ROTATION, TRANSLATION = slice(0, 3), slice(3, 6)  # of a block's numbers, and of a twist
COMPONENTS = ("r1", "r2", "r3", "x", "y", "z")
POSE_UNITS = ("rad",) * 3 + ("m",) * 3


@dataclass(frozen=True)
class ParameterBlock(ABC):
    """Six numbers to estimate, or fewer of them.

    Attributes:
        edge: the edge of the tree that it belongs to; of intrinsics, that of the camera.
        kind: sensor, additional_tf, pattern, joint or intrinsics.
        collection: whose value it is; None when one value holds for all collections.
        names: sensors (or the pattern, the joint or the camera) that it belongs to.
    """

    edge: Edge
    kind: str
    collection: Optional[str]
    names: Tuple[str, ...]

    @property
    def label(self) -> str:
        """A name for messages."""
        within = f" in collection {self.collection}" if self.collection is not None else ""
        return f"{self.kind} {'+'.join(self.names)} ({self.edge}){within}"

    @property
    def title(self) -> str:
        """The name that stands before those of its numbers."""
        return "+".join(self.names)

    @property
    def is_board_of_collection(self) -> bool:
        """Whether it is the pose of a board in one collection."""
        return self.kind == PATTERN and self.collection is not None

    @property
    @abstractmethod
    def components(self) -> Tuple[str, ...]:
        """Names of the six numbers, empty where one has no meaning."""

    @property
    @abstractmethod
    def units(self) -> Tuple[str, ...]:
        """Units of the six values that the numbers stand for."""

    @property
    @abstractmethod
    def free(self) -> np.ndarray:
        """(6,) bool: the numbers that are estimated; the others stay zero."""

    @property
    def free_components(self) -> Tuple[Tuple[int, str], ...]:
        """Place among the six and name of each number that is estimated."""
        names = self.components
        return tuple((int(i), names[i]) for i in np.flatnonzero(self.free))

    @property
    def is_angle(self) -> np.ndarray:
        """(6,) bool: the numbers that are angles; the others are lengths."""
        return np.arange(BLOCK_SIZE) < ROTATION.stop

    @property
    def prior_mean(self) -> np.ndarray:
        """(6,) the numbers that are expected."""
        return np.zeros(BLOCK_SIZE)

    @property
    def prior_weight(self) -> np.ndarray:
        """(6,) one over the variance of the numbers about what is expected; 0: anything goes."""
        return np.zeros(BLOCK_SIZE)

    @property
    def prior(self) -> Optional[Prior]:
        """What the user knows of it beforehand; None: nothing."""
        return None

    def without_prior(self) -> ParameterBlock:
        """Return the block as the data alone tell it."""
        return self


@dataclass(frozen=True)
class TransformBlock(ParameterBlock):
    """A block that is a factor of the chains which pass its edge."""

    @abstractmethod
    def pose(self, x: np.ndarray) -> np.ndarray:
        """Return the factor (4, 4) of the chain at the numbers x (6,)."""

    @abstractmethod
    def twist_jacobian(self, x: np.ndarray) -> np.ndarray:
        """Return (6, 6): the factor's left twist (rotation, move) by the numbers x (6,)."""


@dataclass(frozen=True)
class PoseBlock(TransformBlock):
    """The pose of an edge: ``parent_T_child = (R0 exp(r), t0 + t)``.

    Its numbers are a rotation vector r [rad] and a translation t [m].

    Attributes:
        initial: (4, 4) ``parent_T_child`` to start from.
    """

    initial: np.ndarray

    @property
    def components(self) -> Tuple[str, ...]:
        """Names of the six numbers."""
        return COMPONENTS

    @property
    def units(self) -> Tuple[str, ...]:
        """Rad of the rotation, m of the translation."""
        return POSE_UNITS

    @property
    def free(self) -> np.ndarray:
        """(6,) bool: all of them."""
        return np.ones(BLOCK_SIZE, dtype=bool)

    def pose(self, x: np.ndarray) -> np.ndarray:
        """Return ``parent_T_child`` (4, 4) at the numbers x (6,)."""
        return pose_at(self.initial, x)

    def twist_jacobian(self, x: np.ndarray) -> np.ndarray:
        """Return (6, 6): the left twist (rotation, move) in the parent by the numbers x (6,)."""
        return pose_twist_jacobian(self.pose(x), x)

    def to_parent_axes(self, x: np.ndarray) -> np.ndarray:
        """Return (6, 6): turns and shifts along the parent's axes by the numbers x (6,)."""
        to_parent = np.eye(BLOCK_SIZE)
        rotation = self.initial[:3, :3] @ se3.rotation_from_rotation_vector(x[ROTATION])
        to_parent[ROTATION, ROTATION] = rotation @ se3.right_jacobian(x[ROTATION])
        return to_parent


@dataclass(frozen=True)
class ExpectedPoseBlock(PoseBlock):
    """The pose of an edge that is expected near a given one.

    Attributes:
        given: (4, 4) ``parent_T_child`` near which.
        sigma_m, sigma_rad: standard deviations along and about each axis of the child.
    """

    given: np.ndarray
    sigma_m: float
    sigma_rad: float

    @property
    def prior_mean(self) -> np.ndarray:
        """(6,) the numbers at which the edge is as given."""
        mean = np.empty(BLOCK_SIZE)
        turn = self.initial[:3, :3].T @ self.given[:3, :3]
        mean[ROTATION] = se3.rotation_vector_from_rotation(turn)
        mean[TRANSLATION] = self.given[:3, 3] - self.initial[:3, 3]
        return mean

    @property
    def prior_weight(self) -> np.ndarray:
        """(6,) one over the variance of the numbers."""
        return prior_weight(self.sigma_m, self.sigma_rad)


@dataclass(frozen=True)
class PriorPoseBlock(ExpectedPoseBlock):
    """The pose of an edge of which the user knows something beforehand.

    Attributes:
        stated: what.
    """

    stated: Prior

    @property
    def prior(self) -> Prior:
        """What the user knows of it beforehand."""
        return self.stated

    def without_prior(self) -> PoseBlock:
        """Return the block as the data alone tell it."""
        return PoseBlock(self.edge, self.kind, self.collection, self.names, self.initial)


def prior_weight(sigma_m: float, sigma_rad: float) -> np.ndarray:
    """Return (6,) one over the variance of three angles and three lengths."""
    return np.array([sigma_rad**-2.0] * 3 + [sigma_m**-2.0] * 3)


def pose_at(initial: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the poses (..., 4, 4) at the numbers x (..., 6) of their blocks."""
    rotation = initial[..., :3, :3] @ se3.rotation_from_rotation_vector(x[..., ROTATION])
    return se3.transform(rotation, initial[..., :3, 3] + x[..., TRANSLATION])


def pose_twist_jacobian(pose: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return (..., 6, 6): the left twist of poses (..., 4, 4) by their numbers x (..., 6)."""
    turn = pose[..., :3, :3] @ se3.right_jacobian(x[..., ROTATION])
    result = np.zeros(pose.shape[:-2] + (6, BLOCK_SIZE))
    result[..., ROTATION, ROTATION] = turn
    result[..., TRANSLATION, ROTATION] = se3.skew(pose[..., :3, 3]) @ turn
    result[..., TRANSLATION, TRANSLATION] = np.eye(3)
    return result
