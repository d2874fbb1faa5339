"""What the user knows beforehand of an edge or a joint: a Gaussian about the described value."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Mapping

import numpy as np


@dataclass(frozen=True)
class Prior:
    """A Gaussian about what the description says, the same for each length and for each angle.

    Attributes:
        name: the sensor, additional tf, joint or edge, as the user calls it.
        sigma_m, sigma_rad: standard deviations along and about each axis of an edge's child, or of
            a joint's parameters.
        poses: (4, 4) ``parent_T_child`` as described, by collection; none of a joint.
        parameters: of a joint, as described [m, rad].

    Raises:
        ValueError: a standard deviation is not above zero, or not finite.
    """

    name: str
    sigma_m: float
    sigma_rad: float
    poses: Mapping[str, np.ndarray] = field(default_factory=dict, compare=False, repr=False)
    parameters: Mapping[str, float] = field(default_factory=dict, compare=False, repr=False)

    def sigma(self, unit: str) -> float:
        """Return the standard deviation of a length (m) or an angle (rad)."""
        return self.sigma_m if unit == "m" else self.sigma_rad

    def __post_init__(self) -> None:
        if not (0.0 < self.sigma_m < np.inf and 0.0 < self.sigma_rad < np.inf):
            raise ValueError("sigma_m and sigma_rad must be larger than 0, and finite")
