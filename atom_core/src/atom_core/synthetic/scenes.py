"""Small simulated scenes, each with one property that a test needs; a second or less each.

Every scene takes the seed and, by keyword, the number of collections, the noise, the disturbance
of the free edges (metres, radians), the density of labels and the systematic errors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.geometry.rectangle import Rectangle
from atom_core.model.config import PatternConfig
from atom_core.model.modality import modality_named
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import DEPTH, LIDAR3D, RGB, Sensor
from atom_core.model.transforms import Edge
from atom_core.synthetic.board import charuco, chessboard, held_before
from atom_core.synthetic.dataset import (
    BoardPoses,
    Disturbance,
    Motion,
    SyntheticDataset,
    disturbed,
    make_dataset,
)
from atom_core.synthetic.lidar_models import LidarModel
from atom_core.synthetic.memory import Sampling
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.realism import PLAIN, Realism
from atom_core.synthetic.rig import (
    COLOUR_CAMERA,
    DEPTH_CAMERA,
    Mount,
    Rig,
    Room,
    assemble,
    camera_mount,
    jittered,
    looking_at,
)
from atom_core.synthetic.sensing import planted_in

_BASE, _ROOM = "rig_base", Room((-7.0, -7.0, 0.0), (7.0, 7.0, 3.5))
_FLANGE = "flange"
_ERRORS = 110  # stream of random numbers of one seed
_KEPT = 8  # scenes, some MB each


@dataclass(frozen=True)
class SceneOptions:
    """What every scene has in common; the systematic errors are drawn from the seed."""

    collections: int = 10
    noise: Noise = Noise()
    disturbance: Disturbance = (0.0, 0.0)
    sampling: Sampling = Sampling()
    realism: Realism = PLAIN
    seed: int = 0


# ---------------------------------------------------------------------------------- rigs


def random_rig(
    rng: np.random.Generator,
    rgb: int = 2,
    depth: int = 1,
    lidar3d: int = 1,
    *,
    centre: Tuple[float, float, float] = (0.0, 0.0, 1.0),
    colour_camera: Camera = COLOUR_CAMERA,
    anchored: Optional[str] = "first",
) -> Rig:
    """Return sensors on an arc around a working volume, looking at it.

    Args:
        rng: places the sensors.
        rgb: number of cameras, rgb_1 and so on.
        depth: number of depth cameras.
        lidar3d: number of LiDARs.
        centre: middle of the volume in world [m].
        colour_camera: intrinsics of the cameras.
        anchored: a sensor's name, "first", or None.
    """
    names: List[Tuple[str, str, Any]] = [(f"rgb_{i + 1}", RGB, colour_camera) for i in range(rgb)]
    names += [(f"depth_{i + 1}", DEPTH, None) for i in range(depth)]
    names += [(f"lidar_{i + 1}", LIDAR3D, None) for i in range(lidar3d)]
    structure, mounts = _base(rng), []
    widest = min(1.0, 0.3 * len(names))
    bearings = rng.permutation(np.linspace(-widest, widest, len(names)))
    for (name, modality, model), bearing in zip(names, bearings):
        eye = _around(centre, bearing, rng)
        mounts.append(_mounted(name, modality, eye, centre, structure, rng, model))
    held = (names[0][0] if names else None) if anchored == "first" else anchored
    return assemble("world", structure, mounts, anchored=held, room=_ROOM, centre=centre)


def _base(rng: np.random.Generator) -> Dict[Edge, np.ndarray]:
    return {Edge("world", _BASE): jittered(np.eye(4), 0.5, 0.3, rng)}


def _around(
    centre: Sequence[float], bearing_rad: float, rng: np.random.Generator, metres: float = 2.2
) -> np.ndarray:
    """Return a place (3,) around a centre; bearing 0 is +y of the world."""
    distance, height = metres + rng.uniform(-0.3, 0.3), rng.uniform(0.1, 1.0)
    away = distance * np.array([np.sin(bearing_rad), np.cos(bearing_rad), 0.0])
    return np.asarray(centre) + away + [0.0, 0.0, height]


def _mounted(
    name: str,
    modality: str,
    eye: np.ndarray,
    target: Sequence[float],
    structure: Dict[Edge, np.ndarray],
    rng: np.random.Generator,
    model: Any = None,
) -> Mount:
    """Mount a sensor at ``eye`` on a post of its own, which is added to the structure.

    ``model`` are its optics or beams; None: the usual ones of its modality.
    """
    world_T_link = looking_at(eye, target, rng.uniform(-0.2, 0.2))
    world_T_post = jittered(world_T_link, 0.15, 0.3, rng)
    world_T_base = structure[Edge("world", _BASE)]
    structure[Edge(_BASE, f"{name}_post")] = se3.inverse(world_T_base) @ world_T_post
    post_T_link = se3.inverse(world_T_post) @ world_T_link
    simulation = modality_named(modality).synthetic
    assert simulation is not None
    return simulation.mount(name, f"{name}_post", post_T_link, model)


# -------------------------------------------------------------------------------- scenes


@lru_cache(maxsize=_KEPT)
def random_scene(
    seed: int = 0, *, rgb: int = 2, depth: int = 1, lidar3d: int = 1, **options: Any
) -> SyntheticDataset:
    """Simulate a random rig of the given sensors, one ChArUco, the first sensor anchored.

    Datasets are never changed, so the last ones are kept.
    """
    rng = np.random.default_rng([seed, 100])
    rig = random_rig(rng, rgb, depth, lidar3d)
    return _simulate("random_scene", rig, rng, SceneOptions(seed=seed, **options))


def two_cameras(
    seed: int = 0, *, camera: Camera = COLOUR_CAMERA, **options: Any
) -> SyntheticDataset:
    """Simulate two cameras of any model, the first one anchored."""
    rng = np.random.default_rng([seed, 101])
    rig = random_rig(rng, 2, 0, 0, colour_camera=camera)
    return _simulate("two_cameras", rig, rng, SceneOptions(seed=seed, **options))


def without_ids(
    seed: int = 0, *, rgb: int = 2, lidar3d: int = 0, **options: Any
) -> SyntheticDataset:
    """Simulate cameras (and LiDARs) before a chessboard that looks the same after half a turn."""
    rng = np.random.default_rng([seed, 500])
    chosen = SceneOptions(seed=seed, **{"collections": 14, **options})
    rig, config = random_rig(rng, rgb, 0, lidar3d), chessboard(dimension=(8, 6))
    middles = rig.centre + rng.uniform(-0.3, 0.3, (chosen.collections, 3))
    eye = rig.centre + np.array([0.0, 2.0, 0.5])
    poses = {"pattern_1": [held_before(eye, middle, _border(config), rng) for middle in middles]}
    return _finish("without_ids", rig, poses, rng, chosen, patterns={"pattern_1": config})


def off_centre_board(
    seed: int = 0, *, rgb: int = 1, depth: int = 1, lidar3d: int = 1, **options: Any
) -> SyntheticDataset:
    """Simulate sensors before a ChArUco that is printed near one corner of its plate."""
    rng = np.random.default_rng([seed, 109])
    chosen = SceneOptions(seed=seed, **options)
    config = replace(charuco(), border_size=(0.0, 0.0), border=(0.01, 0.09, 0.08, 0.02))
    rig = random_rig(rng, rgb, depth, lidar3d)
    border = _border(config)
    poses = [_before(rig.centre, rng, border=border) for _ in range(chosen.collections)]
    patterns = {"pattern_1": config}
    return _finish("off_centre_board", rig, {"pattern_1": poses}, rng, chosen, patterns=patterns)


def other_lens(
    seed: int = 0, *, lens: Camera, lidar3d: int = 1, **options: Any
) -> SyntheticDataset:
    """Simulate two cameras of which the second one has another lens, and LiDARs."""
    rng = np.random.default_rng([seed, 108])
    rig = random_rig(rng, 2, 0, lidar3d)
    second = replace(rig.sensors["rgb_2"], camera=lens)
    rig = replace(rig, sensors={**rig.sensors, "rgb_2": second})
    return _simulate("other_lens", rig, rng, SceneOptions(seed=seed, **options))


def from_behind(
    seed: int = 0, *, modality: str = LIDAR3D, bearing_rad: float = np.pi, **options: Any
) -> SyntheticDataset:
    """Simulate two cameras before the boards' prints, and a range sensor elsewhere around them.

    Args:
        seed: of everything random.
        modality: of the range sensor.
        bearing_rad: where it stands, seen from the cameras' side; pi: it sees the backs alone, from
            about pi / 2 the backs of some boards and the prints of others.
        options: of ``SceneOptions``.
    """
    rng, centre = np.random.default_rng([seed, 111]), (0.0, 0.0, 1.0)
    structure, mounts = _base(rng), []
    sensors = (("rgb_1", RGB, -0.3), ("rgb_2", RGB, 0.3), (f"{modality}_1", modality, bearing_rad))
    for name, kind, bearing in sensors:
        place = _around(centre, bearing, rng)
        mounts.append(_mounted(name, kind, place, centre, structure, rng))
    rig = assemble("world", structure, mounts, anchored="rgb_1", room=_ROOM, centre=centre)
    return _simulate("from_behind", rig, rng, SceneOptions(seed=seed, **options))


def lidar_only(seed: int = 0, *, lidar3d: int = 3, **options: Any) -> SyntheticDataset:
    """Simulate LiDARs without any camera, the first one anchored."""
    rng = np.random.default_rng([seed, 102])
    rig = random_rig(rng, 0, 0, lidar3d)
    return _simulate("lidar_only", rig, rng, SceneOptions(seed=seed, **options))


def shared_edge(seed: int = 0, **options: Any) -> SyntheticDataset:
    """Simulate rgb_2 and depth_1 in one device below one calibrated edge; rgb_1 anchored."""
    rng = np.random.default_rng([seed, 103])
    centre, structure = (0.0, 0.0, 1.0), _base(rng)
    first = _mounted("rgb_1", RGB, _around(centre, -0.5, rng), centre, structure, rng)
    device = _mounted("rgb_2", RGB, _around(centre, 0.5, rng), centre, structure, rng)
    edge = device.sensor.edge
    lens = camera_mount("depth_1", DEPTH, edge.parent, np.eye(4), DEPTH_CAMERA, lens_y_m=0.02)
    frame = Edge("depth_1_link", "depth_1_frame")
    edges = {Edge(edge.child, "depth_1_frame"): lens.edges[frame]}
    edges.update({e: m for e, m in lens.edges.items() if e.parent == frame.child})
    depth = Sensor("depth_1", DEPTH, lens.sensor.frame, edge, DEPTH_CAMERA, lens.sensor.topic)
    mounts = [first, device, Mount(depth, edges)]
    rig = assemble("world", structure, mounts, anchored="rgb_1", room=_ROOM, centre=centre)
    return _simulate("shared_edge", rig, rng, SceneOptions(seed=seed, **options))


def disconnected(seed: int = 0, **options: Any) -> SyntheticDataset:
    """Simulate two groups of sensors that never see the same board.

    rgb_1 (anchored) and rgb_2 see it in even collections, rgb_3 and lidar_1 in odd ones.
    """
    rng, chosen = np.random.default_rng([seed, 104]), SceneOptions(seed=seed, **options)
    structure, mounts = _base(rng), []
    short = LidarModel(range_m=(0.3, 4.0))  # it looks all around, but not as far
    groups: Dict[Tuple[float, float, float], List[Tuple[str, str, Any]]] = {
        (-3.0, 0.0, 1.0): [("rgb_1", RGB, None), ("rgb_2", RGB, None)],
        (3.0, 0.0, 1.0): [("rgb_3", RGB, None), ("lidar_1", LIDAR3D, short)],
    }
    for centre, sensors in groups.items():
        for (name, modality, model), bearing in zip(sensors, (-0.3, 0.3)):
            eye = _around(centre, bearing, rng)
            mounts.append(_mounted(name, modality, eye, centre, structure, rng, model))
    rig = assemble("world", structure, mounts, anchored="rgb_1", room=_ROOM)
    centres = list(groups)
    poses = [_before(centres[i % 2], rng, bearings=(-0.3, 0.3)) for i in range(chosen.collections)]
    return _finish("disconnected", rig, {"pattern_1": poses}, rng, chosen)


def two_patterns(seed: int = 0, **options: Any) -> SyntheticDataset:
    """Simulate two patterns side by side; rgb_2 (anchored) sees both.

    rgb_1 sees only "left", a ChArUco, and depth_1 only "right", a chessboard.
    """
    rng, chosen = np.random.default_rng([seed, 105]), SceneOptions(seed=seed, **options)
    left, right, structure = (-0.75, 0.0, 1.0), (0.75, 0.0, 1.0), _base(rng)
    mounts = [
        _mounted("rgb_1", RGB, np.array([-1.2, 1.5, 1.3]), (-0.9, 0.0, 1.0), structure, rng),
        _mounted("rgb_2", RGB, np.array([0.0, 2.6, 1.5]), (0.0, 0.0, 1.0), structure, rng),
        _mounted("depth_1", DEPTH, np.array([1.2, 1.5, 1.3]), (1.0, 0.0, 1.0), structure, rng),
    ]
    rig = assemble("world", structure, mounts, anchored="rgb_2", room=_ROOM)
    patterns = {
        "left": charuco(link="left_link", dimension=(6, 5)),
        "right": chessboard(link="right_link", dimension=(6, 5)),
    }
    poses = {
        name: [
            _before(
                centre, rng, bearings=(-0.2, 0.2), spread_m=0.12, border=_border(patterns[name])
            )
            for _ in range(chosen.collections)
        ]
        for name, centre in (("left", left), ("right", right))
    }
    return _finish("two_patterns", rig, poses, rng, chosen, patterns=patterns)


def hand_eye(seed: int = 0, *, aim_m: float = 0.1, **options: Any) -> SyntheticDataset:
    """Simulate a camera on a moving flange before a board that stands still; nothing anchored.

    Args:
        seed: of everything random.
        aim_m: how far beside the board's place the camera aims, along each axis; from some 0.4 on
            boards are seen in part.
        options: of ``SceneOptions``.
    """
    rng, chosen = np.random.default_rng([seed, 106]), SceneOptions(seed=seed, **options)
    flange_T_link = jittered(se3.from_rpy(np.array([0.05, 0.0, 0.08]), np.zeros(3)), 0.02, 0.2, rng)
    mount = camera_mount("rgb_1", RGB, _FLANGE, flange_T_link, COLOUR_CAMERA)
    rig = assemble("world", _base(rng), [mount], room=_ROOM)
    centre = np.array([0.0, 0.0, 1.0])
    board = _before((0.0, 0.0, 1.0), rng, bearings=(0.0, 0.0), spread_m=0.0)
    moving: List[Dict[Edge, np.ndarray]] = []
    for _ in range(chosen.collections):
        eye = _around((0.0, 0.0, 0.6), rng.uniform(-0.7, 0.7), rng, metres=1.6)
        target = centre + rng.uniform(-aim_m, aim_m, 3)
        world_T_link = looking_at(eye, target, rng.uniform(-1.0, 1.0))
        moving.append(_flange_at(rig, world_T_link @ se3.inverse(flange_T_link)))
    poses = {"pattern_1": [board] * chosen.collections}
    patterns = {"pattern_1": charuco(fixed=True)}
    return _finish("hand_eye", rig, poses, rng, chosen, patterns=patterns, motion=moving)


def hand_beside_others(seed: int = 0, **options: Any) -> SyntheticDataset:
    """Simulate a camera on a flange, a camera and a LiDAR on the base; the board is carried about.

    Nothing is anchored: the arm's motion ties all of them to the base.
    """
    rng, chosen = np.random.default_rng([seed, 109]), SceneOptions(seed=seed, **options)
    flange_T_link = jittered(se3.from_rpy(np.array([0.05, 0.0, 0.08]), np.zeros(3)), 0.02, 0.2, rng)
    structure, centre = _base(rng), (0.0, 0.0, 1.0)
    mounts = [camera_mount("rgb_1", RGB, _FLANGE, flange_T_link, COLOUR_CAMERA)]
    for name, modality, bearing in (("rgb_2", RGB, -0.5), ("lidar_1", LIDAR3D, 0.4)):
        eye = _around(centre, bearing, rng)
        mounts.append(_mounted(name, modality, eye, centre, structure, rng))
    rig = assemble("world", structure, mounts, room=_ROOM)
    boards: List[np.ndarray] = []
    moving: List[Dict[Edge, np.ndarray]] = []
    for _ in range(chosen.collections):
        boards.append(_before(centre, rng, bearings=(-0.3, 0.3), spread_m=0.2))
        eye = _around((0.0, 0.0, 0.6), rng.uniform(-0.5, 0.5), rng, metres=1.6)
        world_T_link = looking_at(eye, boards[-1][:3, 3], rng.uniform(-1.0, 1.0))
        moving.append(_flange_at(rig, world_T_link @ se3.inverse(flange_T_link)))
    poses = {"pattern_1": boards}
    return _finish("hand_beside_others", rig, poses, rng, chosen, motion=moving)


def board_on_arm(
    seed: int = 0, *, modality: str = RGB, sensors: int = 1, spread_m: float = 0.2, **options: Any
) -> SyntheticDataset:
    """Simulate a board on a moving flange before sensors that stand still; nothing anchored.

    Args:
        seed: of everything random.
        modality: of the sensors.
        sensors: how many, side by side.
        spread_m: how far the board is moved, along each axis; from some 0.5 on it is seen in part.
        options: of ``SceneOptions``.
    """
    rng, chosen = np.random.default_rng([seed, 107]), SceneOptions(seed=seed, **options)
    centre, structure = (0.0, 0.0, 1.0), _base(rng)
    mounts = []
    for i in range(sensors):
        place = _around(centre, 0.3 * i, rng)
        mounts.append(_mounted(f"{modality}_{i + 1}", modality, place, centre, structure, rng))
    rig = assemble("world", structure, mounts, room=_ROOM)
    flange_T_pattern = jittered(
        se3.from_rpy(np.array([0.1, 0.05, 0.2]), np.zeros(3)), 0.05, 0.3, rng
    )
    moving = []
    for _ in range(chosen.collections):
        world_T_pattern = _before(centre, rng, bearings=(-0.5, 0.5), spread_m=spread_m)
        moving.append(_flange_at(rig, world_T_pattern @ se3.inverse(flange_T_pattern)))
    poses = {"pattern_1": [flange_T_pattern] * chosen.collections}
    patterns = {"pattern_1": charuco(parent_link=_FLANGE, fixed=True)}
    return _finish("board_on_arm", rig, poses, rng, chosen, patterns=patterns, motion=moving)


# --------------------------------------------------------------------------------- parts


def _flange_at(rig: Rig, world_T_flange: np.ndarray) -> Dict[Edge, np.ndarray]:
    return {Edge(_BASE, _FLANGE): se3.inverse(rig.pose(_BASE)) @ world_T_flange}


def _border(pattern: PatternConfig) -> Rectangle:
    return pattern_from_config("", pattern).border


def _before(
    centre: Sequence[float],
    rng: np.random.Generator,
    *,
    bearings: Tuple[float, float] = (-0.6, 0.6),
    spread_m: float = 0.35,
    border: Optional[Rectangle] = None,
) -> np.ndarray:
    """Return ``world_T_pattern`` of a board near a centre, held towards the sensors' arc."""
    eye = _around(centre, rng.uniform(*bearings), rng)
    place = np.asarray(centre) + rng.uniform(-spread_m, spread_m, 3)
    return held_before(eye, place, border or _border(charuco()), rng)


def _simulate(
    name: str, rig: Rig, rng: np.random.Generator, options: SceneOptions
) -> SyntheticDataset:
    poses = [_before(rig.centre, rng) for _ in range(options.collections)]
    return _finish(name, rig, {"pattern_1": poses}, rng, options)


def _finish(
    name: str,
    rig: Rig,
    poses: BoardPoses,
    rng: np.random.Generator,
    options: SceneOptions,
    *,
    patterns: Optional[Mapping[str, PatternConfig]] = None,
    motion: Motion = (),
) -> SyntheticDataset:
    exact = make_dataset(
        rig,
        poses,
        options.noise,
        rng,
        patterns=patterns,
        motion=motion,
        sampling=options.sampling,
        name=name,
        planted=planted_in(rig, poses, options.realism, [options.seed, _ERRORS]),
    )
    return disturbed(exact, options.disturbance, rng)
