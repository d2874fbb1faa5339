"""What the numbers of a block mean when it holds the intrinsics of a camera.

A camera has up to twelve numbers (``geometry/intrinsics.py``), in one or two blocks of six. They do
not move the pose of a detection; its rows depend on them beside the twist, by columns of their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Tuple

import numpy as np

from atom_core.geometry.camera import Camera
from atom_core.geometry.intrinsics import COUNT, intrinsics_names, number_scales

TWIST = 6  # the columns before those of a camera
LOCAL = TWIST + COUNT


@dataclass(frozen=True)
class CameraNumbers:
    """Six of a camera's twelve numbers.

    Attributes:
        camera: to which they are relative.
        first: 0 or 6, which of the twelve is the first.
        estimated: names of those that are estimated.
    """

    camera: Camera
    first: int
    estimated: Tuple[str, ...]

    @property
    def names(self) -> Tuple[str, ...]:
        """Six names, empty where the model has no more."""
        names = intrinsics_names(self.camera)[self.first : self.first + 6]
        return names + ("",) * (6 - len(names))

    @property
    def free(self) -> np.ndarray:
        """(6,) bool."""
        return np.array([name in self.estimated for name in self.names])

    @property
    def scales(self) -> np.ndarray:
        """(6,): by how much a value changes with its number, at the camera to start from."""
        scales = number_scales(self.camera)[self.first : self.first + 6]
        return np.concatenate([scales, np.zeros(6 - len(scales))])

    @property
    def units(self) -> Tuple[str, ...]:
        """Six units: px, and 1 for coefficients."""
        return tuple("px" if name in ("fx", "fy", "cx", "cy") else "1" for name in self.names)

    def pose(self, numbers: np.ndarray) -> np.ndarray:
        """Return the identity (4, 4)."""
        return np.eye(4)

    def twist(self, numbers: np.ndarray) -> np.ndarray:
        """Return (6, 6): the local columns from ``TWIST + first`` on, by the numbers."""
        return np.diag(self.free.astype(float))


def camera_numbers(camera: Camera, estimated: Tuple[str, ...]) -> Tuple[CameraNumbers, ...]:
    """Return the parts that hold what is estimated of a camera."""
    parts = [CameraNumbers(camera, first, estimated) for first in (0, 6)]
    return tuple(part for part in parts if np.any(part.free))
