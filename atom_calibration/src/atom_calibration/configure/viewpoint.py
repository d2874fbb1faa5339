"""From where RViz looks at a rig when it opens: from behind sensors that all look one way."""

from __future__ import annotations

from typing import List, NamedTuple, Optional, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.model.config import CalibrationConfig
from atom_core.model.modality import modality_named
from atom_core.model.transforms import FrameGraph, Transforms, chain_transform

_LEAST_ALIKE = 0.6  # length of the mean of the directions, 1 where they are the same
_BOARD_AHEAD_M = 1.5  # where a board may be
_ASIDE_RAD = 0.5
_DISTANCE_M, _IN_EXTENT = 4.5, 1.5


class Viewpoint(NamedTuple):
    """Where an orbiting view stands.

    Attributes:
        focal_m: (x, y, z) in the world, about which it turns.
        distance_m: from there.
        yaw_rad: of the viewer about z, seen from the focal point.
        pitch_rad: of the viewer above the focal point.
    """

    focal_m: Tuple[float, float, float] = (0.0, 0.0, 1.0)
    distance_m: float = 7.0
    yaw_rad: float = 0.9
    pitch_rad: float = 0.5


def viewpoint(config: CalibrationConfig, transforms: Transforms) -> Viewpoint:
    """Return a view from behind and aside where the cameras look one way, else of the origin.

    Args:
        config: its sensors, with their modalities.
        transforms: of the rig, as far as they are known.
    """
    poses = _poses(config, transforms)
    ahead = [pose[:3, :3] @ axis for pose, axis in poses if axis is not None]
    if not ahead:
        return Viewpoint()
    x, y = np.mean([_level(axis) for axis in ahead], axis=0)
    places = np.array([pose[:3, 3] for pose, _ in poses])
    centre = places.mean(axis=0)
    extent_m = float(np.linalg.norm(places - centre, axis=1).max())
    if np.hypot(x, y) < _LEAST_ALIKE or extent_m > _BOARD_AHEAD_M:  # boards are amid the sensors
        return Viewpoint()
    focal = centre + _BOARD_AHEAD_M * np.array([x, y, 0.0]) / np.hypot(x, y)
    yaw = np.arctan2(-y, -x) + _ASIDE_RAD
    return Viewpoint(
        (round(float(focal[0]), 2), round(float(focal[1]), 2), round(float(focal[2]), 2)),
        round(_DISTANCE_M + _IN_EXTENT * extent_m, 1),
        round(float(np.mod(yaw, 2.0 * np.pi)), 2),
    )


def _poses(
    config: CalibrationConfig, transforms: Transforms
) -> List[Tuple[np.ndarray, Optional[np.ndarray]]]:
    """Return world_T_sensor of each sensor whose place is known, and a camera's optical axis."""
    graph = FrameGraph(transforms)
    found = []
    for entry in config.sensors.values():
        has_lens = entry.modality and modality_named(entry.modality).has_camera_info
        axis = np.array([0.0, 0.0, 1.0]) if has_lens else None
        try:
            pose = chain_transform(graph.chain(config.world_link, entry.link), transforms)
        except DatasetError:
            continue  # its place is known from /tf alone
        found.append((pose, axis))
    return found


def _level(axis: np.ndarray) -> np.ndarray:
    """Return the level part (2,) of a direction, of length 1; 0 where it looks up or down."""
    length = float(np.hypot(axis[0], axis[1]))
    return axis[:2] / length if length > 0.3 else np.zeros(2)
