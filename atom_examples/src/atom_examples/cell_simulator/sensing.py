"""From the settings of a sensor to what captures the scene."""

from __future__ import annotations

from typing import Any, Type, TypeVar

from atom_core.geometry.camera import Camera
from atom_core.synthetic.planted import CameraErrors, DepthErrors, RangeErrors, SensorErrors
from atom_examples.cell_simulator.camera import ColourCamera, pinhole_view
from atom_examples.cell_simulator.depth import DepthCamera
from atom_examples.cell_simulator.lidar import Lidar
from atom_examples.cell_simulator.scene_model import View
from atom_examples.cell_simulator.settings import (
    AnySettings,
    ColourSettings,
    DepthSettings,
)

_Errors = TypeVar("_Errors", bound=SensorErrors)


def view_of(settings: AnySettings, camera: Camera) -> View:
    """Return what is drawn for a camera, given its true intrinsics."""
    if isinstance(settings, ColourSettings):
        return pinhole_view(settings.name, settings.frame, camera)
    return View(settings.name, settings.frame, camera)


def colour_camera(s: ColourSettings, camera: Camera, errors: Any = None) -> ColourCamera:
    """Return a colour camera with its true intrinsics and errors (`CameraErrors`, if any)."""
    return ColourCamera(s.name, camera, s.noise_grey, _of(errors, CameraErrors))


def depth_camera(s: DepthSettings, camera: Camera, errors: Any = None) -> DepthCamera:
    """Return a depth camera with its true intrinsics and errors (`DepthErrors`, if any)."""
    return DepthCamera(s.name, s.frame, camera, s.range_m, s.noise, _of(errors, DepthErrors))


def lidar_of(s: Any, errors: Any = None) -> Lidar:
    """Return a 3D or 2D LiDAR with its errors (`RangeErrors`, if any)."""
    return Lidar(s.name, s.frame, s.model, s.noise, _of(errors, RangeErrors))


def _of(errors: Any, kind: Type[_Errors]) -> _Errors:
    """Return the errors, or none at all where a sensor has none of its kind."""
    return errors if isinstance(errors, kind) else kind()
