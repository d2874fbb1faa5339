"""Simulated scenes that leave something open, each in one way; what, the scene's docstring says.

A calibration must find, name and report it (status ``rank_deficient``), or fix it by itself in
the one case where nothing is lost (``unanchored``).
"""

from __future__ import annotations

from dataclasses import replace
from typing import List, Mapping, Optional, Sequence

import numpy as np

from atom_core.geometry import se3
from atom_core.model.config import EdgeConfig
from atom_core.model.labels import RangeLabel
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import LIDAR3D, RGB
from atom_core.model.transforms import Edge
from atom_core.synthetic.arm import camera_on_arm
from atom_core.synthetic.board import charuco, held_before
from atom_core.synthetic.dataset import Disturbance, SyntheticDataset, disturbed, make_dataset
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.rig import COLOUR_CAMERA, Rig, Room, assemble, camera_mount, looking_at
from atom_core.synthetic.scenes import random_rig

_ROOM = Room((-7.0, -7.0, 0.0), (7.0, 7.0, 3.5))
_CENTRE = (0.0, 0.0, 1.0)
_BORDER = pattern_from_config("", charuco()).border
_BASE = "robot_base"


def planar_motion(
    seed: int = 0,
    *,
    collections: int = 14,
    noise: Noise = Noise(),  # noqa: B008 (frozen)
    disturbance: Disturbance = (0.0, 0.0),
) -> SyntheticDataset:
    """Simulate two cameras on a robot that drives on a plane before a board that stands still.

    Open: the height of the cameras and the board together, along the axis of all turns.
    """
    rng = np.random.default_rng([seed, 200])
    mounts = []
    for name, side_m in (("rgb_1", 0.25), ("rgb_2", -0.25)):
        base_T_link = se3.from_rpy(np.array([0.2, side_m, 0.9]), rng.uniform(-0.2, 0.2, 3))
        mounts.append(camera_mount(name, RGB, _BASE, base_T_link, COLOUR_CAMERA))
    rig = assemble("world", {}, mounts, room=_ROOM)
    board = held_before(np.array([0.0, 2.0, 1.2]), np.array(_CENTRE), _BORDER, rng, tilt_rad=0.2)
    motion: List[Mapping[Edge, np.ndarray]] = []
    for _ in range(collections):
        bearing, metres = rng.uniform(-0.5, 0.5), rng.uniform(1.5, 2.2)
        place = metres * np.array([np.sin(bearing), np.cos(bearing), 0.0])
        aim = np.append(rng.uniform(-0.2, 0.2, 2), 0.0)
        motion.append({Edge("world", _BASE): looking_at(place, aim)})
    return _simulated(
        "planar_motion",
        rig,
        [board] * collections,
        noise,
        disturbance,
        rng,
        motion=motion,
        fixed=True,
    )


def translating_arm(
    seed: int = 0,
    *,
    collections: int = 12,
    noise: Noise = Noise(),  # noqa: B008 (frozen)
    disturbance: Disturbance = (0.0, 0.0),
) -> SyntheticDataset:
    """Simulate a camera on an arm that only translates before a board that stands still.

    Open: the camera's place in the hand, which the board's place imitates.
    """
    rng = np.random.default_rng([seed, 204])
    hand_T_link = se3.from_rpy(np.array([0.05, 0.02, 0.08]), rng.uniform(-0.2, 0.2, 3))
    mount = camera_mount("rgb_1", RGB, _BASE, hand_T_link, COLOUR_CAMERA)
    rig = assemble("world", {}, [mount], room=_ROOM)
    board = held_before(np.array([0.0, 2.0, 1.2]), np.array(_CENTRE), _BORDER, rng, tilt_rad=0.2)
    middle = looking_at(np.array([0.0, 1.8, 1.1]), np.array(_CENTRE)) @ se3.inverse(hand_T_link)
    motion: List[Mapping[Edge, np.ndarray]] = [
        {Edge("world", _BASE): se3.transform(middle[:3, :3], middle[:3, 3] + shift)}
        for shift in rng.uniform(-0.3, 0.3, (collections, 3))
    ]
    boards = [board] * collections
    name = "translating_arm"
    return _simulated(name, rig, boards, noise, disturbance, rng, motion=motion, fixed=True)


def parallel_boards(
    seed: int = 0,
    *,
    one_plane: bool = False,
    collections: int = 10,
    noise: Noise = Noise(),  # noqa: B008 (frozen)
    disturbance: Disturbance = (0.0, 0.0),
) -> SyntheticDataset:
    """Simulate two cameras and a LiDAR before boards that are all parallel.

    Of the LiDAR only points inside the boards are labeled, as where boards reach out of its
    layers. Open: its shifts along the boards, and its turn about their normal.

    Args:
        seed: of everything random.
        one_plane: True to slide the board on a wall, so that the LiDAR sees one plane only.
        collections: number of collections.
        noise: of the measurements.
        disturbance: of the free edges at the start.
    """
    rng = np.random.default_rng([seed, 201])
    rig = random_rig(rng, 2, 0, 1)
    first = held_before(np.array([0.0, 2.2, 1.4]), np.array(_CENTRE), _BORDER, rng, tilt_rad=0.1)
    poses = []
    for _ in range(collections):
        shift = rng.uniform(-0.35, 0.35, 3) * [1.0, 1.0, 0.0 if one_plane else 1.0]
        poses.append(first @ se3.transform(np.eye(3), shift))
    name = "single_plane" if one_plane else "parallel_boards"
    return _without_limits(_simulated(name, rig, poses, noise, disturbance, rng))


def redundant_edge(
    seed: int = 0,
    *,
    collections: int = 10,
    noise: Noise = Noise(),  # noqa: B008 (frozen)
    disturbance: Disturbance = (0.0, 0.0),
) -> SyntheticDataset:
    """Simulate a rig whose configuration frees the post of rgb_2 beside rgb_2 itself.

    Open: what the post moves, rgb_2 can undo; only their product is seen.
    """
    rng = np.random.default_rng([seed, 202])
    rig = random_rig(rng, 2, 1, 0)
    simulated = _simulated(
        "redundant_edge", rig, _boards(collections, rng), noise, disturbance, rng
    )
    post = rig.sensors["rgb_2"].edge.parent
    (edge,) = [e for e in rig.transforms if e.child == post]
    entry = EdgeConfig(parent_link=edge.parent, child_link=edge.child)
    config = replace(simulated.dataset.config, additional_tfs={"post": entry})
    return replace(simulated, dataset=replace(simulated.dataset, config=config))


def redundant_joint(
    seed: int = 0,
    *,
    which: str = "last",
    collections: int = 14,
    noise: Noise = Noise(),  # noqa: B008 (frozen)
    disturbance: Disturbance = (0.0, 0.0),
) -> SyntheticDataset:
    """Simulate a camera on an arm of which one joint parameter too much is free.

    Open: ``last``: the last joint's bias, since the pose of rgb_1 in the flange is free; ``first``:
    the first joint's, since the pose of the board is; ``own``: the elbow's bias, since its
    origin_pitch, about the same axis, is free too.
    """
    parameters = {
        "last": {"wrist_3": {"position_bias": 0.01}},
        "first": {"shoulder_pan": {"position_bias": 0.01}},
        "own": {"elbow": {"position_bias": 0.01, "origin_pitch": 0.0}},
    }
    return camera_on_arm(
        seed,
        errors=parameters[which],
        collections=collections,
        noise=noise,
        disturbance=disturbance,
    )


def unanchored(
    seed: int = 0,
    *,
    collections: int = 10,
    noise: Noise = Noise(),  # noqa: B008 (frozen)
    disturbance: Disturbance = (0.0, 0.0),
) -> SyntheticDataset:
    """Simulate a rig that nothing ties to the world.

    Open: the motion of the whole rig, which a calibration fixes by holding its first sensor.
    """
    rng = np.random.default_rng([seed, 203])
    rig = random_rig(rng, 2, 0, 1, anchored=None)
    return _simulated("unanchored", rig, _boards(collections, rng), noise, disturbance, rng)


def _boards(count: int, rng: np.random.Generator) -> List[np.ndarray]:
    poses = []
    for _ in range(count):
        bearing = rng.uniform(-0.6, 0.6)
        eye = np.array(_CENTRE) + 2.2 * np.array([np.sin(bearing), np.cos(bearing), 0.2])
        place = np.array(_CENTRE) + rng.uniform(-0.35, 0.35, 3)
        poses.append(held_before(eye, place, _BORDER, rng))
    return poses


def _simulated(
    name: str,
    rig: Rig,
    poses: Sequence[Optional[np.ndarray]],
    noise: Noise,
    disturbance: Disturbance,
    rng: np.random.Generator,
    *,
    motion: Sequence[Mapping[Edge, np.ndarray]] = (),
    fixed: bool = False,
) -> SyntheticDataset:
    patterns = {"pattern_1": charuco(fixed=fixed)}
    exact = make_dataset(
        rig, {"pattern_1": poses}, noise, rng, patterns=patterns, motion=motion, name=name
    )
    return disturbed(exact, disturbance, rng)


def _without_limits(simulated: SyntheticDataset) -> SyntheticDataset:
    """Return the scene with no limit points in the LiDARs' labels."""
    dataset, none = simulated.dataset, np.zeros(0, dtype=int)
    collections = {}
    for key, collection in dataset.collections.items():
        labels = {
            (sensor, pattern): replace(label, limit_indices=none)
            if isinstance(label, RangeLabel) and dataset.sensors[sensor].modality == LIDAR3D
            else label
            for (sensor, pattern), label in collection.labels.items()
        }
        collections[key] = replace(collection, labels=labels)
    return replace(simulated, dataset=replace(dataset, collections=collections))
