"""What makes boards hard to label: scenes of one difficulty each, for LiDARs and depth cameras.

``hard_frame(difficulty, kind, number)`` returns one; `hard_labels` measures, labels and judges it.
"""

import zlib
from dataclasses import dataclass, replace
from typing import Callable, Dict, NamedTuple, Tuple

import numpy as np
from cloud_scenes import rosette, strewn, tof
from lidar_scenes import Box, Cylinder, Scene, board_facing, person, pose

from atom_core.geometry import se3
from atom_core.geometry.rectangle import Rectangle
from atom_core.synthetic.board import hits
from atom_core.synthetic.rig import LidarModel, Room

LARGE = Rectangle(-0.04, -0.03, 0.76, 0.57)  # 12 x 9 squares of 60 mm
SMALL = Rectangle(-0.015, -0.01, 0.255, 0.19)  # 12 x 9 squares of 20 mm
EYE = np.array([0.0, 0.0, 1.2])


class Plate(NamedTuple):
    """A rectangle that stands around: another board."""

    world_T_plate: np.ndarray
    border: Rectangle

    def distance(self, origin, directions):
        moved = se3.transform(np.eye(3), origin)
        return hits(se3.inverse(moved) @ self.world_T_plate, self.border, directions)[0]


class Block(NamedTuple):
    """A box in axes of its own: a clamp, a hand, a post."""

    world_T_block: np.ndarray
    low: Tuple[float, float, float]
    high: Tuple[float, float, float]

    def distance(self, origin, directions):
        turned = directions @ self.world_T_block[:3, :3]
        start = se3.apply(se3.inverse(self.world_T_block), origin[None])[0]
        return Box(self.low, self.high).distance(start, turned)


@dataclass(frozen=True)
class Kind:
    """A sensor: its beams, and what is usual of it."""

    model: object
    noise_m: float
    farthest_m: float  # at which the large board has enough points
    small_farthest_m: float
    half_height_rad: float  # of the field of view
    layered: bool = False


KINDS: Dict[str, Kind] = {
    "16 layers": Kind(LidarModel(azimuth_steps=1800), 0.008, 2.4, 0.75, np.radians(15.0), True),
    "64 layers": Kind(LidarModel(64, (-22.5, 22.5), 1024), 0.008, 3.0, 1.4, np.radians(22.5), True),
    "rosette": Kind(rosette(), 0.008, 3.5, 2.0, np.radians(19.2)),
    "strewn": Kind(strewn(), 0.008, 3.0, 1.4, np.radians(30.0)),
    "tof": Kind(tof(), 0.005, 3.0, 1.4, np.radians(24.0)),
    "depth": Kind(None, 0.0, 2.6, 1.3, np.radians(23.4)),
    "depth points": Kind(None, 0.0, 2.6, 1.3, np.radians(23.4)),
}
IMAGES = ("depth", "depth points")  # the same camera's images, and its points as a cloud


@dataclass(frozen=True)
class Frame:
    """A scene, how it is measured, and whether a person sees its board.

    Attributes:
        scene: sensor, board or none, what stands around.
        border: of the board that is looked for.
        kind: name of the sensor's kind.
        seed: of the noise.
        rain: share of beams that return from somewhere before what they meet.
        sun: share of depths that are lost; the others are up to three times as noisy.
        dark: share of returns from dark squares that are lost.
        gap_m: between the board and the wall behind it.
        other: another board.
    """

    scene: Scene
    border: Rectangle
    kind: str
    seed: int
    rain: float = 0.0
    sun: float = 0.0
    dark: float = 0.0
    gap_m: float = np.inf
    other: Plate = None


# ---- the scenes


def _start(rng, kind: str, border: Rectangle, most_deg: float = 35.0, roll_deg: float = 180.0):
    small = border is SMALL
    far = KINDS[kind].small_farthest_m if small else KINDS[kind].farthest_m
    away = rng.uniform(0.5 if small else 1.3, far)
    reach = max(away * np.tan(KINDS[kind].half_height_rad) - 0.5 * _diagonal(border), 0.0)
    up = rng.uniform(-0.5, 0.5) * reach
    centre = EYE + [away, rng.uniform(-0.1, 0.1) * away, up]
    turn, tilt = rng.uniform(-most_deg, most_deg, 2) * [1.0, 0.6]
    board = board_facing(EYE, centre, rng.uniform(0.0, roll_deg), turn, tilt, border)
    room = Room((-3.0, -3.5, 0.0), (away + rng.uniform(1.5, 3.0), 3.5, 3.0))
    return Frame(Scene(pose(EYE), board, [], room), border, kind, int(rng.integers(1 << 30)))


def _with(frame: Frame, things=(), **changes) -> Frame:
    scene = frame.scene._replace(things=[*frame.scene.things, *things])
    return replace(frame, scene=scene, **changes)


def middle_of(world_T_board: np.ndarray, border: Rectangle) -> np.ndarray:
    """Return the middle of a board in the world (3,) [m]."""
    return se3.apply(world_T_board, np.append(border.centre, 0.0)[None])[0]


def _diagonal(border: Rectangle) -> float:
    return 2.0 * float(np.hypot(*border.half_size))


def _at_board(frame: Frame, low, high) -> Block:
    """Return a block in the board's axes; z is behind the board."""
    return Block(frame.scene.world_T_board, tuple(low), tuple(high))


def wall_behind(rng, kind, border=LARGE):
    """A board that hangs before a wall, 30 to 120 mm in front of it."""
    away, gap = rng.uniform(1.3, KINDS[kind].farthest_m), rng.uniform(0.03, 0.12)
    yaw = rng.uniform(-30.0, 30.0)
    centre = EYE + [away, rng.uniform(-0.2, 0.2), rng.uniform(-0.1, 0.1)]
    frame = _start(rng, kind, border)
    upright = board_facing(centre - [1.0, 0.0, 0.0], centre, rng.uniform(0.0, 180.0), 0.0, 0.0)
    turned = pose((0, 0, 0), (0, 0, np.radians(yaw)))
    at = pose(centre) @ turned @ pose(-centre)
    normal = (at[:3, :3] @ [1.0, 0.0, 0.0]) * gap
    wall = Plate(
        se3.transform((at @ upright)[:3, :3], centre + normal), Rectangle(-6.0, -6.0, 6.0, 6.0)
    )
    scene = frame.scene._replace(world_T_board=at @ upright)
    return _with(replace(frame, scene=scene, gap_m=gap), [wall])


def posts(rng, kind):
    """A small board on two posts in its plane."""
    frame = _start(rng, kind, SMALL, roll_deg=0.0)
    low, high = SMALL.centre - SMALL.half_size, SMALL.centre + SMALL.half_size
    wide, deep = rng.uniform(0.02, 0.04), rng.uniform(-0.004, 0.004)
    blocks = []
    for x in (low[0] + 0.03, high[0] - 0.03):
        top = (x - wide / 2, high[1] - 0.02, deep + 0.001)
        blocks.append(_at_board(frame, top, (x + wide / 2, 1.5, deep + 0.03)))
    return _with(frame, blocks)


def pole(rng, kind):
    """A small board before a pole, with a person beside."""
    frame = _start(rng, kind, SMALL, roll_deg=30.0)
    middle = middle_of(frame.scene.world_T_board, SMALL)
    trunk = Cylinder(middle[0] + 0.06, middle[1], 0.02, 0.0, middle[2])
    return _with(frame, [trunk, *person(middle[0] + 0.5, middle[1] + rng.choice([-0.7, 0.7]))])


def hand_and_clamp(rng, kind):
    """A hand that holds the board, and a clamp at another edge."""
    frame = _start(rng, kind, LARGE)
    low, high = LARGE.centre - LARGE.half_size, LARGE.centre + LARGE.half_size
    x, y = rng.uniform(low[0] + 0.1, high[0] - 0.1), rng.uniform(low[1] + 0.1, high[1] - 0.1)
    grip, wide = rng.uniform(0.02, 0.06), rng.uniform(0.04, 0.07)
    hand = _at_board(frame, (x - wide, high[1] - grip, -0.03), (x + wide, high[1] + 0.12, 0.03))
    arm = _at_board(frame, (x - 0.04, high[1] + 0.1, -0.03), (x + 0.04, high[1] + 0.6, 0.06))
    clamp = _at_board(frame, (high[0] - 0.03, y - 0.025, -0.02), (high[0] + 0.05, y + 0.025, 0.03))
    return _with(frame, [hand, arm, clamp])


def second_board(rng, kind):
    """Another board in view, 4 to 45 % larger or smaller, beside the one that is looked for."""
    frame = _start(rng, kind, LARGE)
    other = _other_board(rng, frame)
    return _with(frame, [other], other=other)


def only_another(rng, kind):
    """A board of another size, and none of the right one."""
    return _in_another_size(rng, _start(rng, kind, LARGE))


def _in_another_size(rng, frame: Frame) -> Frame:
    factor = 1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(0.08, 0.45)
    half = LARGE.half_size * factor
    border = Rectangle(*(LARGE.centre - half), *(LARGE.centre + half))
    other = Plate(frame.scene.world_T_board, border)
    scene = frame.scene._replace(world_T_board=None)
    return _with(replace(frame, scene=scene), [other], other=other)


def _other_board(rng, frame: Frame):
    factor = 1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(0.08, 0.45, 2)
    size = 2.0 * LARGE.half_size * factor
    border = Rectangle(0.0, 0.0, *size)
    board = frame.scene.world_T_board
    middle = middle_of(board, LARGE)
    side = rng.choice([-1.0, 1.0])
    centre = middle + [rng.uniform(-0.1, 0.4), side * (0.55 + size[0] / 2 + 0.1), 0.0]
    turned = board_facing(
        EYE, centre, rng.uniform(0, 180), rng.uniform(-30, 30), rng.uniform(-15, 15), border
    )
    return Plate(turned, border)


def on_the_floor(rng, kind):
    """A board that stands on the floor and leans back."""
    away = rng.uniform(1.6, KINDS[kind].farthest_m)
    lean = rng.uniform(np.radians(5.0), np.radians(20.0))
    eye = np.array([0.0, 0.0, rng.uniform(0.3, 0.6)])
    turn = rng.uniform(-25.0, 25.0)
    upright = board_facing((0.0, 0.0, 0.3), (1.0, 0.0, 0.3), 0.0)[:3, :3]
    rotation = se3.rotation_from_rpy(np.array([0.0, lean, np.radians(turn)])) @ upright
    board = se3.transform(rotation, np.zeros(3))
    low, high = LARGE.centre - LARGE.half_size, LARGE.centre + LARGE.half_size
    corners = np.array([[x, y, 0.0] for x in (low[0], high[0]) for y in (low[1], high[1])])
    place = se3.apply(board, corners)
    board[:3, 3] = [away - place[:, 0].mean(), -place[:, 1].mean(), -place[:, 2].min() + 0.002]
    room = Room((-3.0, -3.5, 0.0), (away + rng.uniform(1.5, 3.0), 3.5, 3.0))
    frame = Frame(Scene(pose(eye), board, [], room), LARGE, kind, int(rng.integers(1 << 30)))
    return frame


def rain(rng, kind):
    """Single returns from anywhere before things: 1 to 5 % of the beams."""
    return _with(_start(rng, kind, LARGE), rain=rng.uniform(0.01, 0.05))


def sun(rng, kind):
    """Sunlight: 5 to 25 % of the depths are lost, the rest two to three times as noisy."""
    return _with(_start(rng, kind, LARGE), sun=rng.uniform(0.05, 0.25))


def dark_squares(rng, kind):
    """Dark squares that return nothing, or little."""
    return _with(_start(rng, kind, LARGE), dark=rng.uniform(0.6, 1.0))


def cut_off(rng, kind):
    """A board that reaches out of the field of view, by up to half."""
    frame = _start(rng, kind, LARGE, roll_deg=180.0)
    board = frame.scene.world_T_board
    middle = middle_of(board, LARGE)
    away = middle[0]
    edge = away * np.tan(KINDS[kind].half_height_rad)
    shift = np.array([0.0, 0.0, EYE[2] - middle[2] + rng.choice([-1.0, 1.0]) * edge])
    shift[2] -= np.sign(shift[2] - EYE[2] + middle[2]) * rng.uniform(0.0, 0.35)
    moved = board.copy()
    moved[:3, 3] += shift
    return _with(replace(frame, scene=frame.scene._replace(world_T_board=moved)))


def another_cut_off(rng, kind):
    """A board of another size that reaches out of the field of view, and none of the right one."""
    frame, ratio = cut_off(rng, kind), float(np.divide(*LARGE.half_size))
    while True:  # nothing tells a board from one with a side as long as one of the board's
        drawn = _in_another_size(rng, frame)
        factor = float(np.mean(drawn.other.border.half_size / LARGE.half_size))
        if min(abs(factor / ratio - 1.0), abs(factor * ratio - 1.0)) > 0.08:
            return drawn


DIFFICULTIES: Dict[str, Callable] = {
    "wall behind": wall_behind,
    "small on posts": posts,
    "small on a pole": pole,
    "hand and clamp": hand_and_clamp,
    "second board": second_board,
    "only another board": only_another,
    "on the floor": on_the_floor,
    "rain": rain,
    "sun": sun,
    "dark squares": dark_squares,
    "cut by the view": cut_off,
    "another one, cut": another_cut_off,
}


def hard_frame(difficulty: str, kind: str, number: int) -> Frame:
    """Return a frame of a difficulty for a kind of sensor."""
    rng = np.random.default_rng([zlib.crc32(f"{difficulty} {kind}".encode()), number])
    return DIFFICULTIES[difficulty](rng, kind)
