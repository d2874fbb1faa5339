"""A sensor of the rig: what it measures, where its data live, which edge is calibrated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional

from atom_core.geometry.camera import Camera
from atom_core.model.modality import Modality, modality_named
from atom_core.model.transforms import Edge

RGB, DEPTH, LIDAR3D, LIDAR2D = "rgb", "depth", "lidar3d", "lidar2d"

WIDEST_BEAM_RAD = 0.03  # full angle; what is wider is no beam


@dataclass(frozen=True)
class Sensor:
    """One sensor.

    Attributes:
        name: its key in config and dataset.
        modality: the name of a registered modality (`atom_core.model.modality`).
        frame: the frame its data are in (the optical frame of a camera).
        edge: the edge of the tree that is calibrated for it.
        camera: intrinsics where its modality has them, else None.
        topic: where its data came from.
        beam_width_rad: full angle of a 3D LiDAR's beams, as configured; 0: they are points.
    """

    name: str
    modality: str
    frame: str
    edge: Edge
    camera: Optional[Camera] = None
    topic: str = ""
    beam_width_rad: float = 0.0

    def __post_init__(self) -> None:
        if self.kind.has_camera_info and self.camera is None:
            raise ValueError(f"a sensor of modality {self.modality} needs camera_info")

    @property
    def kind(self) -> Modality:
        """All that its modality does in its own way."""
        return modality_named(self.modality)
