"""Parameter blocks of moving parts: an arm, a pan-tilt, odometry.

The dataset says where such a part is in each collection. It is there but for six numbers of the
collection's own, which are expected to be near zero (a random effect): turns and shifts about and
along the axes of the child, each with the same standard deviation.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import FrozenSet, Mapping, Tuple

import numpy as np

from atom_core.problem.blocks import ExpectedPoseBlock

MOVING = "moving_part"
FAR = 100.0  # times the standard deviations: as good as free


@dataclass(frozen=True)
class MovingPart:
    """How far a moving part is off from where the dataset has it.

    Attributes:
        sigma_m, sigma_rad: standard deviations along and about each axis of the child.
        given: (4, 4) ``parent_T_child`` as the dataset says, by collection.
        is_estimated: whether the standard deviations were, too.
        far: collections in which it is far beyond them; nothing is expected there.
    """

    sigma_m: float
    sigma_rad: float
    given: Mapping[str, np.ndarray] = field(compare=False, repr=False)
    is_estimated: bool = False
    far: FrozenSet[str] = frozenset()

    def __post_init__(self) -> None:
        if not (0.0 < self.sigma_m < np.inf and 0.0 < self.sigma_rad < np.inf):
            raise ValueError("sigma_m and sigma_rad must be larger than 0, and finite")

    def sigmas(self, collection: str) -> Tuple[float, float]:
        """Return the standard deviations [m, rad] in a collection."""
        factor = FAR if collection in self.far else 1.0
        return factor * self.sigma_m, factor * self.sigma_rad


@dataclass(frozen=True)
class MovingBlock(ExpectedPoseBlock):
    """The pose of a moving part in one collection, expected where the dataset says."""
