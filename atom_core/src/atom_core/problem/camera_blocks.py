"""Parameter blocks of the intrinsics of a camera.

A camera has up to twelve numbers (``geometry/intrinsics.py``), in one or two blocks of six. They do
not move the pose of a detection and stand in no chain; the rows of a detection depend on them
beside the twist of its pose, by columns of their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, Tuple

import numpy as np

from atom_core.geometry.camera import Camera
from atom_core.geometry.intrinsics import COUNT, intrinsics_names, number_scales
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import BLOCK_SIZE, INTRINSICS, ParameterBlock

TWIST_SIZE = 6  # the columns of a detection's rows before those of its camera
STATE_SIZE = TWIST_SIZE + COUNT
PINHOLE = ("fx", "fy", "cx", "cy")


@dataclass(frozen=True)
class CameraBlock(ParameterBlock):
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
    name: str, edge: Edge, camera: Camera, estimated: Tuple[str, ...]
) -> Tuple[CameraBlock, ...]:
    """Return the blocks that hold what is estimated of a camera."""
    blocks = [
        CameraBlock(edge, INTRINSICS, None, (name,), camera, first, estimated)
        for first in range(0, COUNT, BLOCK_SIZE)
    ]
    return tuple(block for block in blocks if np.any(block.free))
