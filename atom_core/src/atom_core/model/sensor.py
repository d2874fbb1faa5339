"""A sensor of the rig: what it measures, where its data live, which edge is calibrated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional

import numpy as np

from atom_core.geometry.camera import Camera
from atom_core.model.transforms import Edge

RGB, DEPTH, LIDAR3D, LIDAR2D = "rgb", "depth", "lidar3d", "lidar2d"
MODALITIES = (RGB, DEPTH, LIDAR3D, LIDAR2D)
RANGE_MODALITIES = (DEPTH, LIDAR3D)


@dataclass(frozen=True)
class Sensor:
    """One sensor.

    Attributes:
        name: its key in config and dataset.
        modality: rgb, depth, lidar3d or lidar2d.
        frame: the frame its data are in (the optical frame of a camera).
        edge: the edge of the tree that is calibrated for it.
        camera: intrinsics of rgb and depth sensors, else None.
        topic: where its data came from.
    """

    name: str
    modality: str
    frame: str
    edge: Edge
    camera: Optional[Camera] = None
    topic: str = ""

    def __post_init__(self) -> None:
        if self.modality not in MODALITIES:
            raise ValueError(f"modality '{self.modality}' is unknown; use {', '.join(MODALITIES)}")
        if self.modality in (RGB, DEPTH) and self.camera is None:
            raise ValueError(f"a sensor of modality {self.modality} needs camera_info")

    @property
    def is_range(self) -> bool:
        """Tell whether it measures points in space (depth, lidar3d)."""
        return self.modality in RANGE_MODALITIES


def depth_sigma_m(z_m: np.ndarray) -> np.ndarray:
    """Return the standard deviation (n,) [m] of structured-light z-depths (n,) [m].

    Source: Nguyen, Izadi, Lovell, "Modeling Kinect sensor noise for improved 3D reconstruction
    and tracking" (3DIMPVT 2012), axial noise.
    """
    return 0.0012 + 0.0019 * (z_m - 0.4) ** 2
