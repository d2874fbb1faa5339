"""Boards that touch something larger, stand on an easel, or whose black squares read longer."""

from dataclasses import replace

import numpy as np
from hard_labels import measured, world_T_sensor
from hard_scenes import KINDS, LARGE, Frame, Kind, Plate, hard_frame
from hard_scenes import _at_board as at_board
from hard_scenes import _in_another_size as in_another_size
from hard_scenes import _start as start
from hard_scenes import _with as with_things
from lidar_scenes import Scene, board_facing, pose

from atom_core.geometry import se3
from atom_core.geometry.rectangle import Rectangle
from atom_core.labeling.lidar3d import Cloud
from atom_core.synthetic.rig import LidarModel, Room

_VLP_32C_DEG = (
    *(-25.0, -15.639, -11.31, -8.843, -7.254, -6.148, -5.333, -4.667, -4.0, -3.667, -3.333),
    *(-3.0, -2.667, -2.333, -2.0, -1.667, -1.333, -1.0, -0.667, -0.333, 0.0, 0.333, 0.667, 1.0),
    *(1.333, 1.667, 2.333, 3.333, 4.667, 7.0, 10.333, 15.0),
)
UNEVEN = "uneven layers"  # a VLP-32C's
KINDS.setdefault(
    UNEVEN, Kind(LidarModel(32, _VLP_32C_DEG, 1800), 0.008, 3.0, 1.0, np.radians(15.0), True)
)


def leaning(number: int, kind: str) -> Frame:
    """Return a board that leans at a wall, its upper side on it, on the floor or on a shelf."""
    rng = np.random.default_rng([9, number])
    away = rng.uniform(1.5, KINDS[kind].farthest_m)
    eye, lean = np.array([0.0, 0.0, rng.uniform(0.3, 0.8)]), np.radians(rng.uniform(5.0, 20.0))
    upright = board_facing((0.0, 0.0, 0.3), (1.0, 0.0, 0.3), 0.0)[:3, :3]
    board = se3.transform(se3.rotation_from_rpy(np.array([0.0, lean, 0.0])) @ upright, np.zeros(3))
    corners = np.column_stack([LARGE.corners, np.zeros(4)])
    place, shelf = se3.apply(board, corners), rng.choice([0.0, eye[2] - 0.3])
    beside, up = -place[:, 1].mean() + rng.uniform(-0.2, 0.2), shelf - place[:, 2].min() + 0.002
    board[:3, 3] = [away - place[:, 0].mean(), beside, up]
    top = se3.apply(board, corners)[:, 0].max()
    room = Room((-3.0, -3.5, 0.0), (top + 0.005, 3.5, 3.0))
    return Frame(Scene(pose(eye), board, [], room), LARGE, kind, int(rng.integers(1 << 30)))


def another_leaning(number: int, kind: str) -> Frame:
    """Return such a frame with a board of another size, by 8 to 45 %, and none of the right one."""
    return in_another_size(np.random.default_rng([19, number]), leaning(number, kind))


def against(number: int, kind: str, gap_m: float) -> Frame:
    """Return a board that hangs upright before a wall, so far in front of it."""
    frame = hard_frame("wall behind", kind, number)
    (wall,), board = frame.scene.things, frame.scene.world_T_board
    normal = board[:3, 2]
    away = (wall.world_T_plate[:3, 3] - board[:3, 3]) @ normal - gap_m
    moved = se3.transform(np.eye(3), -away * normal) @ wall.world_T_plate
    nearer = Plate(moved, Rectangle(-6.0, -6.0, 6.0, 6.0))
    return replace(frame, scene=frame.scene._replace(things=[nearer]), gap_m=gap_m)


def on_an_easel(number: int, kind: str) -> Frame:
    """Return a board on the ledge of an easel, with a leg on either side behind it."""
    rng = np.random.default_rng([9, number])
    frame = start(rng, kind, LARGE, roll_deg=0.0)
    low, high = LARGE.centre - LARGE.half_size, LARGE.centre + LARGE.half_size
    things = []
    for x in (low[0] + 0.1, high[0] - 0.1):
        first = (x - 0.025, low[1] - 0.3 * rng.random(), 0.003)
        things.append(at_board(frame, first, (x + 0.025, 1.9, 0.04)))
    first, last = (low[0] - 0.05, high[1] - 0.005, -0.05), (high[0] + 0.05, high[1] + 0.03, 0.03)
    return with_things(frame, [*things, at_board(frame, first, last)])


def with_longer_black(number: int, kind: str, longer_m: float):
    """Return a frame and what is measured of it where black squares read longer."""
    frame = start(np.random.default_rng([5, number]), kind, LARGE)
    seen = measured(frame)
    board_T_sensor = se3.inverse(frame.scene.world_T_board) @ world_T_sensor(frame)
    square = np.floor(se3.apply(board_T_sensor, seen.points)[:, :2] / 0.06).astype(int)
    inside = np.all((square >= 0) & (square < [12, 9]), axis=1)
    black = seen.on_board & inside & (square.sum(axis=1) % 2 == 0)
    longer = 1.0 + np.where(black, longer_m, 0.0) / np.linalg.norm(seen.points, axis=1)
    points = seen.points * longer[:, None]
    return frame, seen._replace(data=Cloud(points, seen.data.ring), points=points)
