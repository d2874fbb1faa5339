"""Random rooms for the 2D LiDAR's labeler: walls, boxes, posts, doors, and perhaps a board."""

from typing import List, NamedTuple, Optional, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.labels import RangeLabel
from atom_core.model.laser_scan import LaserScan
from atom_core.model.pattern import pattern_from_config
from atom_core.synthetic.board import charuco, held_before, hits
from atom_core.synthetic.lidar2d import Around, Lidar2dModel, directions, scan
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.rig import Room

PATTERN = pattern_from_config("board", charuco())
BORDER = PATTERN.border
HALL = Room((-5.0, -5.0, 0.0), (5.0, 5.0, 3.0))
SHORTER_M, DIAGONAL_M = 0.6, 1.0
DEGREE = np.pi / 180.0
QUARTER = Lidar2dModel()
HALF_270 = Lidar2dModel(-2.356, 0.5 * DEGREE, 541, (0.05, 20.0))
ONE = Lidar2dModel(-np.pi, 1.0 * DEGREE, 360, (0.15, 12.0))
CLOCKWISE = Lidar2dModel(np.pi, -0.25 * DEGREE, 1440)
MODELS = {"quarter": QUARTER, "half_270": HALF_270, "one": ONE, "clockwise": CLOCKWISE}


class Seen(NamedTuple):
    """A scan with its truth; ``middle`` of the cut, None where the board has no label."""

    scan: LaserScan
    label: Optional[RangeLabel]
    middle: Optional[np.ndarray]
    lidar_T_board: Optional[np.ndarray]
    others: np.ndarray


def segments_met(angles: np.ndarray, segments: np.ndarray) -> np.ndarray:
    """Return distances (n,) along rays from the origin to the nearest of segments (m, 2, 2)."""
    if len(segments) == 0:
        return np.full(len(angles), np.inf)
    direction = np.column_stack([np.cos(angles), np.sin(angles)])[:, None]
    start, along = segments[:, 0][None], (segments[:, 1] - segments[:, 0])[None]

    def cross(a, b):
        return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]

    with np.errstate(divide="ignore", invalid="ignore"):
        t = cross(start, along) / cross(direction, along)
        s = cross(start, direction) / cross(direction, along)
        met = (t > 0) & (s >= 0) & (s <= 1)
    return np.min(np.where(met, t, np.inf), axis=1)


def circles_met(angles: np.ndarray, circles: np.ndarray) -> np.ndarray:
    """Return distances (n,) to the nearest of circles (m, 3): x, y, radius."""
    nearest = np.full(len(angles), np.inf)
    for x, y, radius in circles:
        along = x * np.cos(angles) + y * np.sin(angles)
        under = radius**2 - (x**2 + y**2 - along**2)
        t = along - np.sqrt(np.maximum(under, 0.0))
        nearest = np.where((under > 0) & (t > 0), np.minimum(nearest, t), nearest)
    return nearest


def rectangle(x: float, y: float, turn: float, width: float, depth: float) -> np.ndarray:
    """Return the sides (4, 2, 2) of a rectangle about (x, y)."""
    half = 0.5 * np.array([[-width, -depth], [width, -depth], [width, depth], [-width, depth]])
    c, s = np.cos(turn), np.sin(turn)
    corners = half @ np.array([[c, s], [-s, c]]) + [x, y]
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def shows_one_face(sides: np.ndarray) -> bool:
    """Tell whether the origin sees only one side of a rectangle (4, 2, 2), as of a plate."""
    middles = sides.mean(axis=1)
    outward = middles - middles.mean(axis=0)
    return int(np.sum(np.einsum("ij,ij->i", outward, middles) < -0.02)) < 2


class Furniture(NamedTuple):
    """What stands in a room: segments (m, 2, 2) and circles (k, 3) in the LiDAR's plane."""

    segments: np.ndarray
    circles: np.ndarray

    def met(self, angles: np.ndarray) -> np.ndarray:
        return np.minimum(segments_met(angles, self.segments), circles_met(angles, self.circles))


def furnished(
    rng: np.random.Generator, boxes: int = 4, posts: int = 4, doors: int = 1, plates: bool = False
) -> Tuple[Room, np.ndarray, Furniture]:
    """Return a room, the LiDAR's pose in it, and what stands there.

    Boxes show two faces, but where ``plates`` is set: one face alone looks like a board's.
    """
    size = rng.uniform(2.5, 6.0, 2)
    room = Room((-size[0], -size[1], 0.0), (size[0], size[1], 3.0))
    turn = rng.uniform(-np.pi, np.pi)
    place = np.append(rng.uniform(-0.5, 0.5, 2) * size, 1.0)
    world_T_lidar = se3.transform(se3.rotation_from_rpy(np.array([0.0, 0.0, turn])), place)
    sides: List[np.ndarray] = []
    for _ in range(boxes):
        while True:
            where, away = rng.uniform(-np.pi, np.pi), rng.uniform(0.9, 4.5)
            box = rectangle(
                away * np.cos(where),
                away * np.sin(where),
                rng.uniform(0.0, np.pi),
                rng.uniform(0.25, 1.2),
                rng.uniform(0.25, 1.2),
            )
            if plates or not shows_one_face(box):
                break
        sides += list(box)
    for _ in range(doors):
        sides += list(_door(rng, room, world_T_lidar))
    circles = []
    for _ in range(posts):
        where, away = rng.uniform(-np.pi, np.pi), rng.uniform(0.6, 4.5)
        radius = rng.choice([0.015, 0.03, 0.06, 0.15, 0.25])
        circles.append([away * np.cos(where), away * np.sin(where), radius])
    return room, world_T_lidar, Furniture(np.array(sides), np.array(circles).reshape(-1, 3))


def _door(rng: np.random.Generator, room: Room, world_T_lidar: np.ndarray) -> np.ndarray:
    """Return a door's leaf (1, 2, 2) as long as the board, on hinges at a wall, ajar."""
    along, ajar, length = rng.uniform(-0.7, 0.7), rng.uniform(0.1, 1.6), rng.uniform(0.6, 1.0)
    axis, side = int(rng.integers(2)), float(rng.choice([-1.0, 1.0]))
    hinge = np.zeros(2)
    hinge[axis], hinge[1 - axis] = side * room.high[axis], along * room.high[1 - axis]
    inward, beside = np.zeros(2), np.zeros(2)
    inward[axis], beside[1 - axis] = -side, rng.choice([-1.0, 1.0])
    tip = hinge + length * (np.cos(ajar) * beside + np.sin(ajar) * inward)
    in_world = np.column_stack([np.stack([hinge, tip]), [1.0, 1.0]])
    return se3.apply(se3.inverse(world_T_lidar), in_world)[None, :, :2]


def board_pose(
    rng: np.random.Generator, away: Tuple[float, float] = (0.7, 4.0), tilt: float = 0.35
) -> np.ndarray:
    """Return the pose of a board held before the LiDAR, its middle near the scan's plane."""
    where, distance = rng.uniform(-np.pi, np.pi), rng.uniform(*away)
    centre = np.array([distance * np.cos(where), distance * np.sin(where), rng.uniform(-0.4, 0.4)])
    return held_before(np.zeros(3), centre, BORDER, rng, tilt)


def clear_pose(
    rng: np.random.Generator, furniture: Furniture, room: Room, world_T_lidar: np.ndarray
) -> np.ndarray:
    """Return a pose at which nothing hides the board's cut or is within 0.35 m behind it."""
    fan = directions(np.radians(np.arange(-180.0, 180.0, 0.5)))
    angles = np.arctan2(fan[:, 1], fan[:, 0])
    walls = room.distance(world_T_lidar[:3, 3], fan @ world_T_lidar[:3, :3].T)
    nearest = np.minimum(furniture.met(angles), walls)
    while True:
        pose = board_pose(rng)
        t, _ = hits(pose, BORDER, fan)
        on_board = np.isfinite(t)
        near = on_board | np.roll(on_board, 10) | np.roll(on_board, -10)
        farthest = np.max(t[on_board], initial=0.0)
        if np.all(nearest[near] > farthest + 0.35):
            return pose


def seen(
    rng: np.random.Generator,
    model: Lidar2dModel = QUARTER,
    lidar_T_board: Optional[np.ndarray] = None,
    furniture: Optional[Furniture] = None,
    room: Room = HALL,
    world_T_lidar: Optional[np.ndarray] = None,
    noise: Optional[Noise] = None,
) -> Seen:
    """Return a scan of a room, with or without a board."""
    if world_T_lidar is None:
        world_T_lidar = se3.transform(np.eye(3), np.array([0.0, 0.0, 1.0]))
    if noise is None:
        noise = Noise(lidar_m=0.010, dropout=0.02)
    others = np.full(model.beams, np.inf)
    if furniture is not None:
        others = furniture.met(model.angles)
    boards = {} if lidar_T_board is None else {"board": (lidar_T_board, PATTERN)}
    made, labels = scan(model, boards, Around(world_T_lidar, room, others), noise, rng)
    label = labels.get("board")
    middle = None
    if label is not None:
        points = made.points[label.indices]
        away = np.linalg.norm(points[:, None] - points[None], axis=2)
        first, last = np.unravel_index(np.argmax(away), away.shape)
        middle = 0.5 * (points[first] + points[last])
    return Seen(made, label, middle, lidar_T_board, others)


def shares(found: np.ndarray, truth: np.ndarray) -> Tuple[float, float]:
    """Return precision and recall of indices."""
    common = len(np.intersect1d(found, truth))
    return common / max(len(found), 1), common / max(len(truth), 1)
