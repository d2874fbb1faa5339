"""Clouds with truth for the tests of the LiDAR labeler: a room, boxes, cylinders, a board."""

from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.rectangle import Rectangle
from atom_core.synthetic.board import hits
from atom_core.synthetic.lidar_models import LidarModel
from atom_core.synthetic.rig import Room

BORDER = Rectangle(-0.04, -0.03, 0.76, 0.57)  # the paper's 800 x 600 mm board
MODEL = LidarModel(azimuth_steps=1800)
MIXED_WITHIN_RAD = 0.0015


class Box(NamedTuple):
    """An axis-aligned box in the world [m]."""

    low: Tuple[float, float, float]
    high: Tuple[float, float, float]

    def distance(self, origin, directions):
        with np.errstate(divide="ignore", invalid="ignore"):
            a = (np.array(self.low) - origin) / directions
            b = (np.array(self.high) - origin) / directions
        near, far = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
        return np.where((near <= far) & (near > 0), near, np.inf)


class Cylinder(NamedTuple):
    """An upright cylinder in the world [m]: a trunk, an arm of a person, a pole."""

    x: float
    y: float
    radius: float
    low: float
    high: float

    def distance(self, origin, directions):
        offset = origin[:2] - np.array([self.x, self.y])
        a = np.sum(directions[:, :2] ** 2, axis=1)
        b = directions[:, :2] @ offset
        root = b**2 - a * (offset @ offset - self.radius**2)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (-b - np.sqrt(np.where(root > 0, root, np.nan))) / a
        z = origin[2] + t * directions[:, 2]
        return np.where((t > 0) & (z > self.low) & (z < self.high), t, np.inf)


class Scene(NamedTuple):
    """A LiDAR, a board or none, and what stands around."""

    world_T_lidar: np.ndarray
    world_T_board: Optional[np.ndarray]
    things: Sequence = ()
    room: Room = Room()
    model: LidarModel = MODEL


class Cloud(NamedTuple):
    """A cloud and what is true of it.

    ``on_board`` (n,): the beam's middle hits the board; ``mixed`` (n,): it passes its edge so near
    that the range may lie between.
    """

    points: np.ndarray
    ring: np.ndarray
    on_board: np.ndarray
    mixed: np.ndarray

    @property
    def seed(self):
        return self.points[self.on_board].mean(axis=0)


def pose(position, rpy=(0.0, 0.0, 0.0)):
    return se3.from_rpy(np.array(position, dtype=float), np.array(rpy, dtype=float))


def board_facing(
    lidar_xyz, centre, roll_deg=30.0, turn_deg=0.0, tilt_deg=0.0, border=BORDER
) -> np.ndarray:
    """Return world_T_board of a board whose print looks at the LiDAR, turned away from there."""
    centre = np.array(centre, dtype=float)
    z = centre - np.array(lidar_xyz, dtype=float)
    z /= np.linalg.norm(z)
    x = np.cross([0.0, 0.0, 1.0], z)
    x /= np.linalg.norm(x)
    upright = np.column_stack([x, np.cross(z, x), z])
    turned = upright @ se3.rotation_from_rpy(np.radians([tilt_deg, turn_deg, 0.0]))
    rotation = turned @ se3.rotation_from_rpy(np.radians([0.0, 0.0, roll_deg]))
    return se3.transform(rotation, centre - rotation @ np.append(border.centre, 0.0))


def ranges_of(scene: Scene, directions: np.ndarray, border: Rectangle):
    """Return ranges and whether the board was hit, of beams in the LiDAR's frame."""
    origin = scene.world_T_lidar[:3, 3]
    in_world = directions @ scene.world_T_lidar[:3, :3].T
    nearest = scene.room.distance(origin, in_world)
    for thing in scene.things:
        nearest = np.minimum(nearest, thing.distance(origin, in_world))
    if scene.world_T_board is None:
        return nearest, np.zeros(len(directions), dtype=bool)
    lidar_T_board = se3.inverse(scene.world_T_lidar) @ scene.world_T_board
    board, _ = hits(lidar_T_board, border, directions)
    return np.minimum(nearest, board), board < nearest


def scan(
    scene: Scene,
    seed: int = 0,
    noise_m: float = 0.008,
    dropout: float = 0.02,
    border: Rectangle = BORDER,
    mixed_within_rad: float = MIXED_WITHIN_RAD,
) -> Cloud:
    """Scan a scene: noise along the beam, lost returns, mixed returns at edges."""
    rng = np.random.default_rng(seed)
    beams = scene.model.directions
    ranges, on_board = ranges_of(scene, beams, border)
    mixed = np.zeros(len(beams), dtype=bool)
    other = ranges.copy()
    for axis in _across(beams):
        for sign in (-1.0, 1.0):
            beside = beams + sign * mixed_within_rad * axis
            beside /= np.linalg.norm(beside, axis=1)[:, None]
            there, hit = ranges_of(scene, beside, border)
            jump = np.abs(there - ranges) > np.maximum(0.03, np.abs(other - ranges))
            other[jump] = there[jump]
            mixed |= hit != on_board
    ranges = ranges + rng.random(len(beams)) * (other - ranges)
    ranges += noise_m * rng.standard_normal(len(beams))
    kept = rng.random(len(beams)) >= dropout
    points = (beams * ranges[:, None]).astype(np.float32).astype(float)
    ring = np.arange(len(beams)) // scene.model.azimuth_steps
    return Cloud(points[kept], ring[kept], on_board[kept], mixed[kept])


def _across(directions):
    horizontal = np.cross([0.0, 0.0, 1.0], directions)
    horizontal /= np.linalg.norm(horizontal, axis=1)[:, None]
    return [horizontal, np.cross(directions, horizontal)]


def shares(labels: np.ndarray, cloud: Cloud) -> Tuple[float, float]:
    """Return precision and recall of labeled indices; mixed returns count for neither."""
    labeled = np.zeros(len(cloud.points), dtype=bool)
    labeled[labels] = True
    clear = ~cloud.mixed
    right = np.sum(labeled & cloud.on_board & clear)
    return right / max(np.sum(labeled & clear), 1), right / max(np.sum(cloud.on_board & clear), 1)


def many_scenes(count: int, seed: int, tilted: bool = False) -> List[Scene]:
    """Return boards 1.5 to 3.2 m away, in all rolls, up to 60 degrees off."""
    rng = np.random.default_rng(seed)
    scenes = []
    while len(scenes) < count:
        lidar_xyz = np.array([rng.uniform(-1, 1), rng.uniform(-1, 1), 1.5])
        away, azimuth = rng.uniform(1.5, 3.2), rng.uniform(-np.pi, np.pi)
        centre = lidar_xyz + [
            away * np.cos(azimuth),
            away * np.sin(azimuth),
            rng.uniform(-0.3, 0.3),
        ]
        if np.any(np.abs(centre[:2]) > 3.4):
            continue
        board = board_facing(
            lidar_xyz, centre, rng.uniform(0, 180), rng.uniform(-60, 60), rng.uniform(-25, 25)
        )
        rpy = rng.uniform(-0.15, 0.15, 3) if tilted else np.zeros(3)
        scenes.append(Scene(pose(lidar_xyz, rpy), board))
    return scenes


def person(x, y):
    """Return a person who stands at a place of the floor [m]."""
    return [
        Cylinder(x, y, 0.18, 0.8, 1.55),
        Cylinder(x, y, 0.10, 1.55, 1.8),
        Cylinder(x, y - 0.1, 0.08, 0.0, 0.8),
        Cylinder(x, y + 0.1, 0.08, 0.0, 0.8),
    ]
