"""What sensors see of a board, and whether anything stands in the way."""

from __future__ import annotations

from typing import Any, Callable, Dict, Mapping, NamedTuple, Protocol

import numpy as np

from atom_core.geometry import se3
from atom_core.model.pattern import Pattern
from atom_core.synthetic import lidar, rgb
from atom_examples.cell_simulator.lidar import Lidar
from atom_examples.cell_simulator.scene import Scene
from atom_examples.cell_simulator.settings import (
    AnySettings,
    ColourSettings,
    DepthSettings,
    LidarSettings,
)

_BEHIND_M = 0.005  # a ray that ends nearer to its goal has met something else


class _Settings(Protocol):
    @property
    def sensors(self) -> Mapping[str, AnySettings]:
        """All that are calibrated."""


class Looking(Protocol):
    """A world with sensors."""

    @property
    def scene(self) -> Scene:
        """What there is to be seen."""

    @property
    def lidars(self) -> Mapping[str, Lidar]:
        """LiDARs by name; 2D ones are among them."""

    @property
    def settings(self) -> _Settings:
        """What the sensors are."""


class Sight(NamedTuple):
    """What a sensor sees of a board: where it looks from (3,), and at what (n, 3), in the world."""

    origin: np.ndarray
    goals: np.ndarray


def sight(world: Looking, name: str, world_T_pattern: np.ndarray, pattern: Pattern) -> Sight:
    """Return the lines by which a sensor would detect a board, were it alone in the world.

    A 2D LiDAR has none: what it sees of the scene's board says `cut_length_m`.
    """
    settings = world.settings.sensors[name]
    world_T_sensor = world.scene.pose(settings.frame)
    sensor_T_pattern = se3.inverse(world_T_sensor) @ world_T_pattern
    points = _POINTS_SEEN[type(settings)](settings, sensor_T_pattern, pattern)
    return Sight(world_T_sensor[:3, 3], se3.apply(world_T_pattern, points))


def _corners(settings: ColourSettings, sensor_T_pattern: np.ndarray, on: Pattern) -> np.ndarray:
    """Return the corners (n, 3) that a camera sees, in the board's frame."""
    return on.corners_of(rgb.visible_corners(settings.camera, sensor_T_pattern, on))


def _grid(settings: DepthSettings, sensor_T_pattern: np.ndarray, on: Pattern) -> np.ndarray:
    """Return the points (n, 3) of a grid on the board that are in the depth image."""
    steps = np.linspace(-0.98, 0.98, 11)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    on_board = on.border.centre + grid * on.border.half_size
    points = np.column_stack([on_board, np.zeros(len(on_board))])
    return points[settings.camera.in_image(se3.apply(sensor_T_pattern, points))]


def _returns(settings: LidarSettings, sensor_T_pattern: np.ndarray, on: Pattern) -> np.ndarray:
    """Return where the beams of a LiDAR hit the board (n, 3), in the board's frame."""
    beams, ranges = lidar.beams_on_board(settings.model, sensor_T_pattern, on)
    hit = settings.model.directions[beams] * ranges[:, None]
    return se3.apply(se3.inverse(sensor_T_pattern), hit)


_POINTS_SEEN: Dict[type, Callable[[Any, np.ndarray, Pattern], np.ndarray]] = {
    ColourSettings: _corners,
    DepthSettings: _grid,
    LidarSettings: _returns,
}


def is_open(world: Looking, line: Sight, *, still: bool = True) -> np.ndarray:
    """Return (n,) bool: nothing stands between a sensor and what it looks at.

    Without ``still``, only board, tripod and person are looked at.
    """
    to_goal = line.goals - line.origin
    distance = np.linalg.norm(to_goal, axis=1)
    met = world.scene.cast(line.origin, to_goal / distance[:, None], still=still).distance
    return met > distance - _BEHIND_M


def cut_length_m(world: Looking, name: str) -> float:
    """Return the length [m] of the scene's board that the beams of a 2D LiDAR meet; 0: nothing."""
    lidar = world.lidars[name]
    returns = lidar.exact(world.scene)
    on_plate = lidar.model.directions[returns.beam] * returns.range[:, None]
    points = on_plate[returns.on_plate]
    if len(points) < 2:
        return 0.0
    along = points[np.argmax(np.linalg.norm(points - points[0], axis=1))] - points[0]
    return float(np.ptp(points @ along / np.linalg.norm(along)))
