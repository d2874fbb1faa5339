"""The cell's sensors as devices: what they see of the scene, in the messages of their topics."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Dict, List, NamedTuple, Optional, Type

import numpy as np
from sensor_msgs.msg import CameraInfo, Image, LaserScan, PointCloud2
from std_msgs.msg import Header

from atom_core.geometry.camera import Camera
from atom_examples.cell_simulator import messages
from atom_examples.cell_simulator.camera import ColourCamera
from atom_examples.cell_simulator.lidar import Lidar, Scan
from atom_examples.cell_simulator.scene import Scene
from atom_examples.cell_simulator.settings import (
    AnySettings,
    ColourSettings,
    DepthSettings,
    LidarSettings,
    ScannerSettings,
)
from atom_examples.cell_simulator.world import World


class Packing(NamedTuple):
    """How images are sent.

    Attributes:
        depth_encoding: 16UC1 or 32FC1.
        compressed: as CompressedImage; depth only if it is 16UC1.
    """

    depth_encoding: str = "16UC1"
    compressed: bool = False


class Device(ABC):
    """A sensor of the cell.

    Attributes:
        message: type of its messages where they are not compressed.
        draws_pictures: of colours, which takes long.
        settings: of the sensor.
        info_topic: of its intrinsics; None: it has none.
    """

    message: ClassVar[type]
    draws_pictures: ClassVar[bool] = False
    info_topic: Optional[str] = None

    def __init__(self, settings: AnySettings, sensor: Any):
        """Take the settings and what captures the scene."""
        self.settings, self.sensor = settings, sensor

    def topic(self, packing: Packing) -> str:
        """Return where its messages go."""
        return self.settings.topic

    def capture(self, scene: Scene, rng: Optional[np.random.Generator]) -> Any:
        """Return what it sees; without rng exactly."""
        return self.sensor.capture(scene, rng)

    @abstractmethod
    def pack(self, seen: Any, head: Header, packing: Packing) -> Any:
        """Return the message of what it saw."""

    def on_plate(self, seen: Any) -> Optional[np.ndarray]:
        """Return the indices (n,) into the message's data that truly hit the board.

        None where they are no part of what was seen.
        """
        return None


class CameraDevice(Device):
    """A device that sends images and their intrinsics."""

    message = Image

    def __init__(self, settings: AnySettings, sensor: Any):
        """Take the settings of a camera."""
        super().__init__(settings, sensor)
        assert isinstance(settings, (ColourSettings, DepthSettings))
        self.camera: Camera = settings.camera
        self.info_topic = settings.info_topic

    def topic(self, packing: Packing) -> str:
        """Return where its images go."""
        return self.settings.topic + "/compressed" * self._is_compressed(packing)

    def info(self, head: Header) -> CameraInfo:
        """Return the intrinsics."""
        return messages.camera_info(self.camera, head)

    def _is_compressed(self, packing: Packing) -> bool:
        return packing.compressed


class ColourDevice(CameraDevice):
    """A colour camera."""

    draws_pictures = True
    sensor: ColourCamera

    def pack(self, seen: np.ndarray, head: Header, packing: Packing) -> Any:
        """Return a picture, red green blue, as rgb8 or JPEG."""
        if self._is_compressed(packing):
            return messages.jpeg_image(seen, head)
        return messages.colour_image(seen, head)


class DepthDevice(CameraDevice):
    """A depth camera."""

    def pack(self, seen: np.ndarray, head: Header, packing: Packing) -> Any:
        """Return depths [m] in the encoding wanted, or as PNG."""
        if self._is_compressed(packing):
            return messages.png_depth_image(seen, head)
        return messages.depth_image(seen, packing.depth_encoding, head)

    def _is_compressed(self, packing: Packing) -> bool:
        return packing.compressed and packing.depth_encoding == "16UC1"


class LidarDevice(Device):
    """A 3D LiDAR."""

    message = PointCloud2
    sensor: Lidar

    def pack(self, seen: Scan, head: Header, packing: Packing) -> PointCloud2:
        """Return the returns as a cloud."""
        return messages.point_cloud(seen, self.sensor.ring(seen.beam), head)

    def on_plate(self, seen: Scan) -> np.ndarray:
        """Return which points hit the board."""
        return np.flatnonzero(seen.on_plate)


class ScannerDevice(Device):
    """A 2D LiDAR."""

    message = LaserScan

    def pack(self, seen: Scan, head: Header, packing: Packing) -> LaserScan:
        """Return the ranges of all beams."""
        assert isinstance(self.settings, ScannerSettings)
        return messages.laser_scan(seen, self.settings.model, 1.0 / self.settings.rate_hz, head)

    def on_plate(self, seen: Scan) -> np.ndarray:
        """Return which ranges hit the board."""
        return seen.beam[seen.on_plate]


_KINDS: Dict[type, Type[Device]] = {
    ColourSettings: ColourDevice,
    DepthSettings: DepthDevice,
    LidarSettings: LidarDevice,
    ScannerSettings: ScannerDevice,
}


def devices_of(world: World) -> List[Device]:
    """Return the devices of a cell, in the order of the settings."""
    sensors: Dict[str, Any] = {**world.colours, **world.depths, **world.lidars}
    return [device_of(s, sensors[s.name]) for s in world.settings.all]


def device_of(settings: AnySettings, sensor: Any) -> Device:
    """Return the device of a sensor; ``sensor`` captures the scene."""
    return _KINDS[type(settings)](settings, sensor)
