"""Boards before each LiDAR model, with the systematic errors of the rough profile, and truth.

A rig of two colour cameras and one LiDAR of a model looks at a board that is held somewhere before
it, among a person, a box and a table. Every second scene has a wall close behind the board.
"""

from dataclasses import replace
from typing import Any, Dict, List, NamedTuple

import numpy as np
from cloud_scenes import things_about
from lidar_scenes import Cloud, Scene, board_facing, scan

from atom_core.geometry import se3
from atom_core.geometry.rectangle import Rectangle
from atom_core.labeling.lidar3d import Cloud as LabelerCloud
from atom_core.model.pattern import Pattern
from atom_core.synthetic import ROUGH, Noise, charuco, make_dataset
from atom_core.synthetic.board import BentPattern, is_dark
from atom_core.synthetic.dataset import SyntheticDataset
from atom_core.synthetic.lidar_models import LIDAR_MODELS
from atom_core.synthetic.rig import (
    LIDAR_HEIGHT_M,
    Room,
    assemble,
    camera_mount,
    lidar_mount,
    looking_at,
    pinhole,
)
from atom_core.synthetic.sensing import planted_in

PATTERN, LIDAR = "pattern_1", "lidar_1"
EYE = (0.0, 0.0, 1.2)  # of the LiDAR
HALL = Room((-4.0, -4.0, 0.0), (7.0, 4.0, 3.2))
DROPOUT = 0.02
LEAST_LAYERS = 6  # a board that is searched for without a seed
SPARSEST = 1.0 / 8.0  # spacing of points without layers, of the board's shorter side
MOST_INCIDENCE_DEG = 65.0
FREE_DEG = 1.5  # so much of the field of view is free around a board
_SCENES = 61  # a stream of random numbers


class Board(NamedTuple):
    """A board before the LiDAR in one collection, and its cloud."""

    collection: str
    scene: Scene
    cloud: Cloud
    pattern: Pattern

    @property
    def lidar_T_pattern(self):
        """Its true pose (4, 4)."""
        return se3.inverse(self.scene.world_T_lidar) @ self.scene.world_T_board

    @property
    def data(self) -> LabelerCloud:
        """The cloud as a driver sends it: rings where there are layers."""
        layered = self.scene.model.has_layers
        return LabelerCloud(self.cloud.points, self.cloud.ring if layered else None)


class ModelCell(NamedTuple):
    """What a seed gives of a model: the dataset as its cameras have it, and the boards."""

    model: Any
    synthetic: SyntheticDataset
    boards: List[Board]


def model_cell(name: str, seed: int, collections: int = 12, shared: bool = False) -> ModelCell:
    """Simulate a rig with one LiDAR of a model; the LiDAR's labels are left to a labeler.

    Args:
        name: of the model.
        seed: of rig, boards and noise.
        collections: number of boards, one after the other.
        shared: take boards alone that a camera has in view as a whole; others tell nothing of
            where the LiDAR is.
    """
    model, rng = LIDAR_MODELS[name], np.random.default_rng([seed, _SCENES])
    rig = _rig(model)
    planted = planted_in(rig, [PATTERN], ROUGH, [seed, _SCENES])
    made = planted.of_board(PATTERN).true_pattern(PATTERN, charuco())
    world_T_lidar = rig.pose(LIDAR)
    cameras = _cameras(rig) if shared else []
    poses = [_board(model, made, world_T_lidar, k, rng, cameras) for k in range(collections)]
    noise = Noise(lidar_m=model.sigma_m)
    synthetic = make_dataset(
        rig,
        {PATTERN: [world_T_board for world_T_board, _, _ in poses]},
        noise,
        rng,
        planted=planted,
    )
    boards, errors = [], planted.of(LIDAR)
    for k, (world_T_board, things, room) in enumerate(poses):
        scene = Scene(world_T_lidar, world_T_board, things, room, model)
        cloud = rough_scan(scene, made, errors, 1000 * seed + k)
        boards.append(Board(f"{k:03d}", scene, cloud, made))
    return ModelCell(model, synthetic, boards)


def labeled(cell: ModelCell, labels: Dict[str, Any]) -> SyntheticDataset:
    """Return the dataset with the LiDAR's clouds and a labeler's labels, by collection."""
    dataset, collections = cell.synthetic.dataset, {}
    for board in cell.boards:
        dataset.data.add(board.collection, LIDAR, board.cloud.points)
        collection = dataset.collections[board.collection]
        others = {place: v for place, v in collection.labels.items() if place[0] != LIDAR}
        if board.collection in labels:
            others[(LIDAR, PATTERN)] = labels[board.collection]
        collections[board.collection] = replace(collection, labels=others)
    return replace(cell.synthetic, dataset=replace(dataset, collections=collections))


def _rig(model):
    camera = pinhole(1280, 800, 900.0, (-0.05, 0.01, 0.0005, -0.0005, 0.0))
    structure = {}
    target = (2.2, 0.0, 1.2)
    mounts = []
    for name, eye in (("rgb_1", (0.1, 0.5, 1.35)), ("rgb_2", (0.3, -0.9, 1.5))):
        mounts.append(camera_mount(name, "rgb", "world", looking_at(eye, target), camera))
    base = se3.transform(np.eye(3), np.array([0.0, 0.0, EYE[2] - LIDAR_HEIGHT_M]))
    mounts.append(lidar_mount(LIDAR, "world", base, model))
    return assemble("world", structure, mounts, anchored="rgb_1", room=HALL, centre=target)


def _cameras(rig):
    """Return ``camera_T_world`` (4, 4) and intrinsics of each camera."""
    cameras = [sensor for sensor in rig.sensors.values() if sensor.camera is not None]
    return [(se3.inverse(rig.pose(sensor.frame)), sensor.camera) for sensor in cameras]


def _sees_all(camera_T_board: np.ndarray, camera, border: Rectangle) -> bool:
    """Tell whether a board is in a camera's image as a whole, and not seen too flat."""
    outline = np.column_stack([border_points(border), np.zeros(160)])
    points = se3.apply(camera_T_board, outline)
    middle = points.mean(axis=0)
    cosine = abs(camera_T_board[:3, 2] @ middle) / np.linalg.norm(middle)
    in_image = np.all(points[:, 2] > 0.3) and np.all(camera.in_image(points))
    return bool(in_image and cosine > np.cos(np.radians(MOST_INCIDENCE_DEG)))


def _board(model, pattern, world_T_lidar, number, rng, cameras=()):
    """Return ``world_T_board``, the things around it and the room, where geometry allows it.

    One of the cameras, if any are given, has it in view.
    """
    for _ in range(2000):
        away, bearing = rng.uniform(1.3, 3.8), np.radians(rng.uniform(-30.0, 30.0))
        height = rng.uniform(-0.14, 0.14) * away
        centre = np.array([away * np.cos(bearing), away * np.sin(bearing), EYE[2] + height])
        direction, off = rng.uniform(0.0, 2.0 * np.pi), 60.0 * np.sqrt(rng.uniform())
        turn, tilt = off * np.cos(direction), off * np.sin(direction)
        roll = rng.uniform(0.0, 180.0)
        world_T_board = board_facing(EYE, centre, roll, turn, tilt, border=pattern.border)
        if not is_allowed(model, se3.inverse(world_T_lidar) @ world_T_board, pattern.border):
            continue
        seen = [_sees_all(T @ world_T_board, camera, pattern.border) for T, camera in cameras]
        if seen and not any(seen):
            continue
        room = HALL
        if number % 2:
            farthest = (world_T_board @ _corners(pattern.border).T)[0].max()
            room = Room(HALL.low, (farthest + rng.uniform(0.3, 0.6), 4.0, 3.2))
        things = things_about(rng, away, -np.sign(bearing) or 1.0)
        scene = Scene(world_T_lidar, world_T_board, things, room, model)
        if not _is_hidden(scene, pattern.border):
            return world_T_board, things, room
    raise AssertionError("the model sees no board")


def _corners(border: Rectangle) -> np.ndarray:
    corners = border.centre + border.half_size * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return np.column_stack([corners, np.zeros(4), np.ones(4)])


def border_points(border: Rectangle, count: int = 40) -> np.ndarray:
    """Return points (4 * count, 2) along a border [m]."""
    corners = _corners(border)[:, :2]
    share = np.linspace(0.0, 1.0, count, endpoint=False)[:, None]
    return np.vstack([corners[k] + share * (corners[(k + 1) % 4] - corners[k]) for k in range(4)])


def is_allowed(model, lidar_T_board: np.ndarray, border: Rectangle) -> bool:
    """Tell whether geometry lets a model find a board: in view, dense enough, not too flat."""
    middle = se3.apply(lidar_T_board, np.append(border.centre, 0.0)[None])[0]
    cosine = abs(lidar_T_board[:3, 2] @ middle) / np.linalg.norm(middle)
    if cosine < np.cos(np.radians(MOST_INCIDENCE_DEG)):
        return False
    edge = se3.apply(lidar_T_board, np.column_stack([border_points(border), np.zeros(160)]))
    edge /= np.linalg.norm(edge, axis=1)[:, None]
    beams = model.directions
    # Only beams near the board are looked at.
    near = beams[beams @ (middle / np.linalg.norm(middle)) > 0.7]
    if not model.has_layers and np.any((edge @ near.T).max(axis=1) < np.cos(np.radians(FREE_DEG))):
        return False
    ids, in_plane = _on_board(model, lidar_T_board, border)
    if model.has_layers:
        elevation = np.degrees(np.arcsin(edge[:, 2]))
        low, high = model.elevation_deg[0], model.elevation_deg[-1]
        layers = np.unique(ids // model.azimuth_steps)
        return len(layers) >= LEAST_LAYERS and elevation.min() > low and elevation.max() < high
    spacing = np.sqrt(4.0 * np.prod(border.half_size) / max(len(ids), 1))
    return bool(spacing < SPARSEST * 2.0 * border.half_size.min())


def _on_board(model, lidar_T_board, border):
    from atom_core.synthetic.board import hits

    t, in_plane = hits(lidar_T_board, border, model.directions)
    ids = np.flatnonzero(np.isfinite(t))
    return ids, in_plane[ids]


def _is_hidden(scene: Scene, border: Rectangle) -> bool:
    """Tell whether anything stands before the board or touches it."""
    origin = scene.world_T_lidar[:3, 3]
    wider = Rectangle(
        *(border.centre - 1.1 * border.half_size), *(border.centre + 1.1 * border.half_size)
    )
    points = np.vstack([border_points(border), border_points(wider)])
    rays = se3.apply(scene.world_T_board, np.column_stack([points, np.zeros(len(points))])) - origin
    away = np.linalg.norm(rays, axis=1)
    rays /= away[:, None]
    nearest = scene.room.distance(origin, rays)
    for thing in scene.things:
        nearest = np.minimum(nearest, thing.distance(origin, rays))
    return bool(np.any(nearest < away + 0.1))


def rough_scan(scene: Scene, pattern: Pattern, errors, seed: int) -> Cloud:
    """Scan a scene with what a LiDAR and a board have of the rough profile."""
    model = scene.model
    cloud = scan(scene, seed, model.sigma_m, DROPOUT, pattern.border, 0.5 * model.divergence_rad)
    rng = np.random.default_rng([seed, _SCENES])
    ranges = np.linalg.norm(cloud.points, axis=1)
    beams = cloud.points / ranges[:, None]
    lidar_T_board = se3.inverse(scene.world_T_lidar) @ scene.world_T_board
    in_board = se3.apply(se3.inverse(lidar_T_board), cloud.points)[:, :2]
    clear = cloud.on_board & ~cloud.mixed
    dark = clear & is_dark(lidar_T_board, pattern, in_board)
    rings = cloud.ring if model.has_layers else np.zeros(len(ranges), dtype=int)
    longer = errors.error_m(ranges, rings) + errors.dark_offset_m * dark
    if isinstance(pattern, BentPattern):
        along = np.abs(beams @ lidar_T_board[:3, 2])
        longer[clear] += (pattern.height_m(in_board) / np.maximum(along, 0.2))[clear]
    kept = ~(dark & (rng.random(len(ranges)) < errors.dark_lost))
    points = (cloud.points + longer[:, None] * beams).astype(np.float32).astype(float)
    return Cloud(points[kept], cloud.ring[kept], cloud.on_board[kept], cloud.mixed[kept])


def outline_errors_m(board: Board, lidar_T_centre: np.ndarray, nominal: Rectangle) -> np.ndarray:
    """Return how far (n,) a found outline lies outside the true border, as the LiDAR sees it.

    The outline is laid along the beams onto the plane of the true board, so that a LiDAR that
    reads long does not count.
    """
    outline = np.column_stack([border_points(nominal) - nominal.centre, np.zeros(160)])
    pattern_T_lidar = se3.inverse(board.lidar_T_pattern)
    origin, points = pattern_T_lidar[:3, 3], se3.apply(pattern_T_lidar @ lidar_T_centre, outline)
    rays = points - origin
    on_plane = origin + rays * (-origin[2] / rays[:, 2])[:, None]
    return board.pattern.border.signed_distance(on_plane[:, :2])[0]
