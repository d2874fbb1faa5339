"""Measures hard scenes, labels them with a seed and by search, and compares with the truth."""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, Optional, Tuple

import numpy as np
from hard_scenes import IMAGES, KINDS, LARGE, Frame, Plate, middle_of
from lidar_scenes import ranges_of, scan

from atom_core.geometry import se3
from atom_core.geometry.expected_noise import depth_sigma_m
from atom_core.labeling.base import Labeled
from atom_core.labeling.depth import DepthLabeler
from atom_core.labeling.lidar3d import Cloud, Lidar3dLabeler
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import DEPTH, LIDAR3D, Sensor
from atom_core.model.transforms import Edge
from atom_core.synthetic.board import charuco
from atom_core.synthetic.rig import pinhole

CAMERA = pinhole(640, 480, 554.0)
OPTICAL = se3.transform(np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), np.zeros(3))
LEAST_LAYERS, LEAST_POINTS, LEAST_PIXELS = 6, 60, 1000  # on a board that a person sees
GAP_SIGMAS = 4.0  # of single points, to a wall behind
SEEN, SEEN_AT_SEED = 0.85, 0.6  # shares of a board in view and not hidden
SIDE_SEEN, SIDES_SEEN = 0.25, 3  # share of a side in view; so many sides place a board
LEAST_PRECISION = 0.95  # of points on the board, or on things as near to it as this
MOST_BEYOND_M, MOST_OFF_PLANE_M = 0.02, 0.015
MOST_OFF_BORDER_M = 0.03
COLUMNS, ROWS = 12, 9  # squares


class Measured(NamedTuple):
    """What a sensor measures of a frame.

    Attributes:
        data: ``Cloud``, or the depth image (height, width) [m].
        points: (n, 3) [m] in the sensor's frame.
        on_board: (n,); of these ``mixed`` ones at edges count for nothing.
        seen: share of the board that is in view and not hidden.
        enough: the board has as many points as a person needs.
        is_placed: what is in view of its sides tells that it is the board, and where it lies.
    """

    data: object
    points: np.ndarray
    on_board: np.ndarray
    mixed: np.ndarray
    seen: float
    enough: bool
    is_placed: bool = True


@dataclass(frozen=True)
class Judged:
    """A label against the truth."""

    labeled: Labeled
    expected: bool  # a person sees the board
    false: bool
    is_placed: bool = True  # as Measured has it

    @property
    def found(self) -> bool:
        return self.labeled.detected and not self.false


def measured(frame: Frame) -> Measured:
    """Return what the frame's sensor measures."""
    if frame.kind not in IMAGES:
        return _cloud(frame)
    image = _image(frame)
    return image if frame.kind == "depth" else image._replace(data=Cloud(image.points))


def judged(frame: Frame, seen: Measured) -> Tuple[Optional[Judged], Judged]:
    """Label a frame with a seed (None where there is no board), and by search."""
    labeler, board = labeler_of(frame), frame.scene.world_T_board
    at_seed = None
    if board is not None or frame.other is not None:
        rng = np.random.default_rng(frame.seed)
        plate = frame.other if board is None else Plate(board, frame.border)
        off = rng.normal(0.0, 0.08 * frame.border.half_size.min(), 3)
        seed = _as_seed(frame, middle_of(*plate) + off)
        if seed is not None:
            at_seed = _judged(frame, seen, labeler.label(seen.data, seed), SEEN_AT_SEED)
    return at_seed, _judged(frame, seen, labeler.label(seen.data), SEEN)


def at_the_other(frame: Frame, seen: Measured) -> Optional[Judged]:
    """Label with a seed on the other board; None where an image cuts it, which hides its size."""
    if frame.other is None:
        return None
    plate = frame.other
    for x, y in plate.border.sample(0.05) if frame.kind in IMAGES else ():
        if _in_image(frame, se3.apply(plate.world_T_plate, np.array([[x, y, 0.0]]))[0]) is None:
            return None
    seed = _as_seed(frame, middle_of(*frame.other))
    if seed is None:
        return None
    return _judged(frame, seen, labeler_of(frame).label(seen.data, seed), np.inf)


def labeler_of(frame: Frame):
    """Return the labeler of a frame's sensor and board."""
    return _labeler(frame.kind == "depth", frame.border is LARGE)


@lru_cache(maxsize=None)
def _labeler(depth_image: bool, large: bool):
    size, borders = (0.06, (0.04, 0.03)) if large else (0.02, (0.015, 0.01))
    config = charuco(size=size, inner_size=0.75 * size, border_size=borders)
    pattern = pattern_from_config("board", config)
    edge = Edge("world", "sensor")
    if depth_image:
        return DepthLabeler(Sensor("sensor", DEPTH, "sensor", edge, CAMERA), pattern)
    return Lidar3dLabeler(Sensor("sensor", LIDAR3D, "sensor", edge), pattern)


def world_T_sensor(frame: Frame) -> np.ndarray:
    """Return the sensor's pose."""
    return frame.scene.world_T_lidar @ (OPTICAL if frame.kind in IMAGES else np.eye(4))


def _cloud(frame: Frame) -> Measured:
    kind, rng = KINDS[frame.kind], np.random.default_rng(frame.seed)
    scene = frame.scene._replace(model=kind.model)
    cloud = scan(scene, frame.seed, kind.noise_m, 0.02, frame.border)
    points, on_board, kept = cloud.points, cloud.on_board.copy(), np.ones(len(cloud.points), bool)
    if frame.rain > 0.0:
        wet = rng.random(len(points)) < frame.rain
        points = np.where(wet[:, None], points * rng.uniform(0.1, 1.0, (len(points), 1)), points)
        on_board &= ~wet
    if frame.dark > 0.0:
        kept &= ~(on_board & _in_dark(frame, points) & (rng.random(len(points)) < frame.dark))
    ring = cloud.ring[kept] if kind.layered else None
    if not kind.layered:
        kept = np.flatnonzero(kept)[np.random.default_rng(frame.seed).permutation(int(kept.sum()))]
    on_board, mixed = on_board[kept], cloud.mixed[kept]
    layers = len(np.unique(ring[on_board])) if kind.layered else LEAST_LAYERS
    enough = np.sum(on_board) >= LEAST_POINTS and layers >= LEAST_LAYERS
    enough = enough and frame.gap_m >= GAP_SIGMAS * kind.noise_m
    return Measured(
        Cloud(points[kept], ring),
        points[kept],
        *(on_board, mixed, _share_seen(frame), bool(enough), _is_placed(frame)),
    )


def _in_dark(frame: Frame, points: np.ndarray) -> np.ndarray:
    """Tell which points on the board are on a black square, the first of which is black."""
    board_T_sensor = se3.inverse(frame.scene.world_T_board) @ world_T_sensor(frame)
    size = 0.06 if frame.border is LARGE else 0.02
    in_board = np.nan_to_num(se3.apply(board_T_sensor, points)[:, :2], nan=-1.0)
    cell = np.floor(np.clip(in_board / size, -1, 100)).astype(int)
    inside = np.all((cell >= 0) & (cell < [COLUMNS, ROWS]), axis=1)
    return inside & (cell.sum(axis=1) % 2 == 0)


def _image(frame: Frame) -> Measured:
    rng, shape = np.random.default_rng(frame.seed), (CAMERA.height, CAMERA.width)
    rays = _rays()
    scene = frame.scene._replace(world_T_lidar=world_T_sensor(frame))
    z, on_board = ranges_of(scene, rays, frame.border)
    z = z.reshape(shape)
    padded = np.pad(z, 1, mode="edge")
    around = [padded[:-2, 1:-1], padded[2:, 1:-1], padded[1:-1, :-2], padded[1:-1, 2:]]
    nearest = np.minimum.reduce(around)
    bleeding = z - nearest > 0.05
    z = np.where(bleeding, z - rng.random(shape) * (z - nearest), z)
    noise = depth_sigma_m(np.minimum(z, 8.0)) * (1.0 + 8.0 * frame.sun)
    z = z + noise * rng.standard_normal(shape)
    if frame.rain > 0.0:
        z = np.where(rng.random(shape) < frame.rain, z * rng.uniform(0.1, 1.0, shape), z)
    z[rng.random(shape) < 0.01 + frame.sun] = np.nan
    points = rays * z.reshape(-1, 1)
    if frame.dark > 0.0:
        lost = on_board & _in_dark(frame, points) & (rng.random(z.size) < frame.dark)
        z[lost.reshape(shape)] = np.nan
    at_edge = np.zeros(shape, bool)
    inside = on_board.reshape(shape)
    at_edge[1:-1, 1:-1] = (
        (inside[1:-1, 1:-1] != inside[:-2, 1:-1]) | (inside[1:-1, 1:-1] != inside[2:, 1:-1])
    ) | ((inside[1:-1, 1:-1] != inside[1:-1, :-2]) | (inside[1:-1, 1:-1] != inside[1:-1, 2:]))
    sigma = float(np.median(noise[inside])) if inside.any() else np.inf
    enough = inside.sum() >= LEAST_PIXELS and frame.gap_m >= GAP_SIGMAS * sigma
    seen = z.astype(np.float32)
    share, is_placed = _share_seen(frame), _is_placed(frame)
    return Measured(seen, points, on_board, at_edge.ravel(), share, bool(enough), is_placed)


@lru_cache(maxsize=None)
def _rays() -> np.ndarray:
    row, column = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    rays = CAMERA.normalise(np.column_stack([column.ravel(), row.ravel()]))
    return np.column_stack([rays, np.ones(len(rays))])


def _share_seen(frame: Frame) -> float:
    """Return the share of the board that is in the field of view and behind nothing."""
    board = frame.scene.world_T_board
    if board is None:
        return 0.0
    low, high = frame.border.centre - frame.border.half_size, frame.border.half_size
    grid = np.stack(np.meshgrid(np.linspace(0.01, 1.99, 40), np.linspace(0.01, 1.99, 30)), axis=-1)
    return float(np.mean(_free(frame, low + grid.reshape(-1, 2) * high)))


def _is_placed(frame: Frame) -> bool:
    """Tell whether a quarter of each of three sides is in view, and all is above the floor.

    Two opposite sides tell that it is the board, the third one where it lies along them. What
    sinks into the floor looks like a smaller board that stands on it.
    """
    board = frame.scene.world_T_board
    if board is None:
        return False
    corners = np.column_stack([frame.border.corners, np.zeros(4)])
    if np.any(se3.apply(board, corners)[:, 2] < frame.scene.room.low[2]):
        return False
    centre, half = frame.border.centre, frame.border.half_size * 0.998
    along, seen = np.linspace(-1.0, 1.0, 41), 0
    for axis in (0, 1):
        for end in (-1.0, 1.0):
            side = np.full((len(along), 2), end)
            side[:, 1 - axis] = along
            seen += np.mean(_free(frame, centre + side * half)) >= SIDE_SEEN
    return bool(seen >= SIDES_SEEN)


def _free(frame: Frame, on_board: np.ndarray) -> np.ndarray:
    """Tell which points of a board (n, 2) are in the field of view and behind nothing."""
    sensor_T_board = se3.inverse(world_T_sensor(frame)) @ frame.scene.world_T_board
    points = se3.apply(sensor_T_board, np.column_stack([on_board, np.zeros(len(on_board))]))
    scene = frame.scene._replace(world_T_lidar=world_T_sensor(frame))
    _, free = ranges_of(scene, points, frame.border)
    if frame.kind in IMAGES:
        pixels = CAMERA.project(points)
        free &= np.all((pixels >= 0) & (pixels < [CAMERA.width, CAMERA.height]), axis=1)
    else:
        reach = KINDS[frame.kind].half_height_rad
        flat = np.hypot(points[:, 0], points[:, 1])
        if frame.kind == "rosette":  # a round field of view
            free &= np.hypot(points[:, 1], points[:, 2]) < np.tan(reach) * points[:, 0]
        elif frame.kind == "tof":
            free &= np.abs(points[:, 2]) < np.tan(reach) * points[:, 0]
        else:
            free &= np.abs(points[:, 2]) < np.tan(reach) * flat
    return free


def _as_seed(frame: Frame, in_world: np.ndarray) -> Optional[np.ndarray]:
    """Return a point as a seed of the sensor; None where it is out of an image."""
    if frame.kind not in IMAGES:
        return se3.apply(se3.inverse(world_T_sensor(frame)), in_world[None])[0]
    seen = _in_image(frame, in_world)
    return None if seen is None else seen[0 if frame.kind == "depth" else 1]


def _in_image(frame: Frame, in_world: np.ndarray) -> Optional[Tuple[np.ndarray, np.ndarray]]:
    """Return the pixel of a point and the point in the camera's frame; None out of the image."""
    point = se3.apply(se3.inverse(world_T_sensor(frame)), in_world[None])
    pixel = CAMERA.project(point)[0]
    inside = np.all((pixel >= 0) & (pixel <= [CAMERA.width - 1, CAMERA.height - 1]))
    return (pixel, point[0]) if inside and point[0, 2] > 0.1 else None


def _judged(frame: Frame, seen: Measured, labeled: Labeled, least: float) -> Judged:
    expected = seen.enough and seen.seen >= least
    false = labeled.detected and not _is_true(frame, seen, labeled)
    return Judged(labeled, expected, false, seen.is_placed)


def _is_true(frame: Frame, seen: Measured, labeled: Labeled) -> bool:
    """Tell whether labeled points are on the board and limit points on its border."""
    if frame.scene.world_T_board is None:
        return False
    indices = np.union1d(labeled.label.indices, labeled.label.limit_indices)
    clear = indices[~seen.mixed[indices]]
    board_T_sensor = se3.inverse(frame.scene.world_T_board) @ world_T_sensor(frame)
    in_board = se3.apply(board_T_sensor, seen.points[clear])
    beyond, _ = frame.border.signed_distance(in_board[:, :2])
    near = (beyond < MOST_BEYOND_M) & (np.abs(in_board[:, 2]) < MOST_OFF_PLANE_M)
    if len(clear) == 0 or np.mean(seen.on_board[clear] | near) < LEAST_PRECISION:
        return False
    limits = labeled.label.limit_indices
    if len(limits) == 0:
        return True
    beyond, _ = frame.border.signed_distance(se3.apply(board_T_sensor, seen.points[limits])[:, :2])
    step = np.median(np.linalg.norm(seen.points[limits], axis=1)) * 2.0 * np.pi / 1800
    return bool(np.median(np.abs(beyond)) < MOST_OFF_BORDER_M + step)
