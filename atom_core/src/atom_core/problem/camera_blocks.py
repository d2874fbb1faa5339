"""Parameter blocks of the intrinsics of a camera.

A camera has up to twelve numbers (``geometry/intrinsics.py``), in one or two blocks of six. They do
not move the pose of a detection and stand in no chain; the rows of a detection depend on them
beside the twist of its pose, by columns of their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, NamedTuple, Optional, Tuple

import numpy as np

from atom_core.geometry.camera import Camera
from atom_core.geometry.intrinsics import (
    COUNT,
    intrinsics_names,
    number_scales,
    numbers_between,
)
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import BLOCK_SIZE, INTRINSICS, ParameterBlock

TWIST_SIZE = 6  # the columns of a detection's rows before those of its camera
STATE_SIZE = TWIST_SIZE + COUNT
PINHOLE = ("fx", "fy", "cx", "cy")
_COEFFICIENTS = 10.0  # are expected so much farther off, in displacements of the image's corner


class ExpectedCamera(NamedTuple):
    """The camera near which an estimated one is expected.

    Attributes:
        camera: it.
        sigma: of focal lengths and centre, in parts of the focal length.
    """

    camera: Camera
    sigma: float


@dataclass(frozen=True)
class CameraBlock(ParameterBlock):
    """Six of a camera's twelve numbers.

    Attributes:
        camera: to which they are relative.
        first: 0 or 6, which of the twelve is the first.
        estimated: names of those that are estimated.
        expected: near which camera; None: anywhere.
    """

    camera: Camera
    first: int
    estimated: Tuple[str, ...]
    expected: Optional[ExpectedCamera] = None

    @property
    def sensor(self) -> str:
        """The camera's name."""
        return self.names[0]

    @property
    def columns(self) -> slice:
        """Where its numbers stand among the columns of a detection's rows."""
        return slice(TWIST_SIZE + self.first, TWIST_SIZE + self.first + BLOCK_SIZE)

    @property
    def components(self) -> Tuple[str, ...]:
        """Six names, empty where the model has no more."""
        names = intrinsics_names(self.camera)[self.first : self.first + BLOCK_SIZE]
        return names + ("",) * (BLOCK_SIZE - len(names))

    @property
    def units(self) -> Tuple[str, ...]:
        """Six units: px, and 1 for coefficients."""
        return tuple("px" if name in PINHOLE else "1" for name in self.components)

    @property
    def free(self) -> np.ndarray:
        """(6,) bool."""
        return np.array([name in self.estimated for name in self.components])

    @property
    def is_angle(self) -> np.ndarray:
        """(6,) bool: a number is a displacement in the image, seen as an angle."""
        return np.ones(BLOCK_SIZE, dtype=bool)

    @property
    def scales(self) -> np.ndarray:
        """(6,): by how much a value changes with its number, at the camera to start from."""
        scales = number_scales(self.camera)[self.first : self.first + BLOCK_SIZE]
        return np.concatenate([scales, np.zeros(BLOCK_SIZE - len(scales))])

    @property
    def prior_mean(self) -> np.ndarray:
        """(6,) the numbers that are expected."""
        if self.expected is None:
            return np.zeros(BLOCK_SIZE)
        numbers = numbers_between(self.camera, self.expected.camera)
        return numbers[self.first : self.first + BLOCK_SIZE]

    @property
    def prior_weight(self) -> np.ndarray:
        """(6,) one over the variance of the numbers about what is expected; 0: anything goes."""
        if self.expected is None:
            return np.zeros(BLOCK_SIZE)
        factors = np.array([1.0 if c in PINHOLE else _COEFFICIENTS for c in self.components])
        return np.where(self.free, (factors * self.expected.sigma) ** -2.0, 0.0)

    def sigmas(self, variance: np.ndarray, camera: Camera) -> Dict[str, float]:
        """Return the standard deviations of the estimated values, by name.

        Args:
            variance: (6,) of the numbers.
            camera: at the solution.
        """
        focal_px = {"fx": float(camera.focal_px[0]), "fy": float(camera.focal_px[1])}
        return {  # the number of a focal length is a logarithm
            name: focal_px.get(name, float(self.scales[i])) * float(np.sqrt(variance[i]))
            for i, name in self.free_components
        }


def camera_blocks(
    name: str,
    edge: Edge,
    camera: Camera,
    estimated: Tuple[str, ...],
    expected: Optional[ExpectedCamera] = None,
) -> Tuple[CameraBlock, ...]:
    """Return the blocks that hold what is estimated of a camera."""
    blocks = [
        CameraBlock(edge, INTRINSICS, None, (name,), camera, first, estimated, expected)
        for first in range(0, COUNT, BLOCK_SIZE)
    ]
    return tuple(block for block in blocks if np.any(block.free))
