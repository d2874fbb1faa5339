"""How many points a LiDAR can be expected to have on the board, said before it is too late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, Set

import numpy as np

from atom_calibration.collect.collector import Setup
from atom_calibration.errors import TransformError
from atom_calibration.labels.frame_labeler import camera_T_pattern
from atom_calibration.labels.frames import Frame
from atom_calibration.messages.conversions import cloud_xyz
from atom_core.geometry import se3
from atom_core.labeling.lidar3d import expected_points
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import LIDAR3D, RGB

LEAST_POINTS, LEAST_LAYERS = 60, 4
_ELEVATION_BIN_RAD = np.deg2rad(0.1)


@dataclass(frozen=True)
class BeamSpacing:
    """Angles between neighbouring beams of a LiDAR [rad]."""

    elevation: float
    azimuth: float


def beam_spacing(points: np.ndarray) -> BeamSpacing:
    """Return the spacing of the beams of a structured cloud (n,).

    Layers are told by the field ``ring``, else by how elevations gather.

    Raises:
        ValueError: the cloud has too few points.
    """
    xyz = cloud_xyz(points).astype(float)
    valid = np.all(np.isfinite(xyz), axis=1) & np.any(xyz != 0, axis=1)
    if np.sum(valid) < 100:
        raise ValueError("too few points to tell the spacing of the beams")
    x, y, z = xyz[valid].T
    elevation = np.arctan2(z, np.hypot(x, y))
    if "ring" in (points.dtype.names or ()):
        layer = points["ring"][valid].astype(int)
    else:
        layer = np.round(elevation / _ELEVATION_BIN_RAD).astype(int)
    layers, counts = np.unique(layer, return_counts=True)
    largest = layers[np.argmax(counts)]
    layers = layers[counts > 0.1 * counts.max()]
    middle = np.sort([np.median(elevation[layer == number]) for number in layers])
    step = float(np.median(np.diff(middle))) if len(middle) > 1 else np.pi
    azimuth = np.sort(np.arctan2(y, x)[layer == largest])
    return BeamSpacing(step, float(np.median(np.diff(azimuth))))


class PointExpectation:
    """Warns once for each LiDAR that can hardly see the board where it stands at first."""

    def __init__(self, setup: Setup):
        """Start; nothing is known yet."""
        self._setup = setup
        self._spacing: Dict[str, BeamSpacing] = {}
        self._lidars = {s.name for s in setup.sensors.values() if s.modality == LIDAR3D}
        self._done: Set[str] = set()

    def add(self, frame: Frame) -> None:
        """Look at a frame: a cloud for its beams, an image for where the board is."""
        name = frame.sensor.name
        if name in self._lidars and name not in self._spacing:
            try:
                self._spacing[name] = beam_spacing(frame.data)
            except ValueError as error:
                self._setup.warn(f"{frame.place}: {error}")
                self._lidars.discard(name)
        elif frame.sensor.modality == RGB and frame.detections and self._lidars - self._done:
            self._judge(frame)

    def _judge(self, frame: Frame) -> None:
        tree = self._setup.transforms(frame.stamp_s)
        for pattern in self._setup.patterns.values():
            pose = camera_T_pattern(frame.sensor, pattern, frame.labels[pattern.name])
            if pose is None:
                continue
            centre = se3.apply(pose, np.append(pattern.border.centre, 0.0)[None])
            for name in (self._lidars & set(self._spacing)) - self._done:
                lidar = self._setup.sensors[name]
                try:
                    lidar_T_camera = tree.lookup(lidar.frame, frame.sensor.frame, frame.stamp_s)
                except TransformError:
                    continue
                self._done.add(name)
                distance = float(np.linalg.norm(se3.apply(lidar_T_camera, centre)))
                self._tell(name, pattern, distance)

    def _tell(self, name: str, pattern: Pattern, distance_m: float) -> None:
        spacing = self._spacing[name]
        points, layers = expected_points(
            pattern.border, distance_m, spacing.azimuth, spacing.elevation
        )
        if points < LEAST_POINTS or layers < LEAST_LAYERS:
            self._setup.warn(
                f"sensor '{name}': only about {points} points in {layers} layers are expected on "
                f"pattern '{pattern.name}' at {distance_m:.1f} m (beams every "
                f"{np.rad2deg(spacing.elevation):.2f} x {np.rad2deg(spacing.azimuth):.2f} deg); "
                f"show the board nearer, or use a larger one"
            )
