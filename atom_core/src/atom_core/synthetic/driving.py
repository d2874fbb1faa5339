"""Rigs that are carried about: two cameras on a vehicle or an arm, before boards of all kinds."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, List, Optional

import numpy as np

from atom_core.geometry import se3
from atom_core.model.config import EdgeConfig
from atom_core.model.pattern import pattern_from_config
from atom_core.model.transforms import Edge
from atom_core.synthetic.board import charuco, held_before
from atom_core.synthetic.dataset import SyntheticDataset, make_dataset
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.rig import (
    COLOUR_CAMERA,
    Room,
    assemble,
    camera_mount,
    jittered,
    looking_at,
)

ODOMETRY = Edge("world", "base")
_ROOM = Room((-50.0, -50.0, 0.0), (50.0, 50.0, 3.5))
_BORDER = pattern_from_config("", charuco()).border


def vehicle_with_its_board(
    seed: int = 0, *, board_parent: str = "base", jitter: Optional[float] = None, **options: Any
) -> SyntheticDataset:
    """Simulate a vehicle that drives about, and a board that is carried before it.

    Args:
        seed: of all that is drawn.
        board_parent: parent_link of the board, "base" or "world".
        jitter: [m, rad] of the vehicle where it stands still instead, as an encoder's noise is.
        options: of the rig, see `_two_cameras`.
    """
    rng = np.random.default_rng([seed, 778])
    rig = _two_cameras(rng, **options)
    motion, boards = [], []
    for _ in range(10):
        place = np.array([*rng.uniform(-3.0, 3.0, 2), 0.0])
        world_T_base = se3.from_rpy(place, np.array([0.0, 0.0, rng.uniform(-3.0, 3.0)]))
        if jitter is not None:
            world_T_base = jittered(np.eye(4), jitter, jitter, rng)
        middle = np.array([2.0, 0.0, 1.0]) + rng.uniform(-0.4, 0.4, 3)
        base_T_board = held_before(np.array([0.2, 0.0, 0.9]), middle, _BORDER, rng, tilt_rad=0.5)
        motion.append({ODOMETRY: world_T_base})
        boards.append(base_T_board if board_parent == "base" else world_T_base @ base_T_board)
    patterns = {"pattern_1": charuco(parent_link=board_parent)}
    return make_dataset(
        rig, {"pattern_1": boards}, Noise(), rng, patterns=patterns, motion=motion, name="vehicle"
    )


def vehicle_before_a_board(
    seed: int = 0, *, anchored: Optional[str] = "rgb_1", odometry: bool = False, off: float = 0.0
) -> SyntheticDataset:
    """Simulate a vehicle that drives about before a board that stands in the world.

    Args:
        seed: of all that is drawn.
        anchored: a sensor.
        odometry: True to have the vehicle's place estimated in each collection.
        off: [m, rad] standard deviation of what the odometry says, if it is estimated.
    """
    rng = np.random.default_rng([seed, 777])
    rig = _two_cameras(rng, anchored=anchored)
    middle = np.array([0.0, 0.0, 1.0])
    board = held_before(np.array([0.0, 2.0, 1.2]), middle, _BORDER, rng, tilt_rad=0.2)
    places = []
    for _ in range(12):
        bearing, away_m = rng.uniform(-0.5, 0.5), rng.uniform(1.5, 2.2)
        eye = away_m * np.array([np.sin(bearing), np.cos(bearing), 0.0])
        places.append(looking_at(eye, np.append(rng.uniform(-0.2, 0.2, 2), 0.0)))
    scene = make_dataset(
        rig,
        {"pattern_1": [board] * len(places)},
        Noise(),
        rng,
        patterns={"pattern_1": charuco(fixed=True)},
        motion=[{ODOMETRY: world_T_base} for world_T_base in places],
        name="odometry",
    )
    if not odometry:
        return scene
    entry = EdgeConfig(parent_link=ODOMETRY.parent, child_link=ODOMETRY.child)
    said = {
        key: {ODOMETRY: jittered(collection.transforms[ODOMETRY], off, off, rng)}
        for key, collection in scene.dataset.collections.items()
    }
    config = replace(scene.dataset.config, additional_tfs={"odom": entry})
    dataset = replace(scene.dataset.with_transforms(said), config=config)
    return replace(scene, dataset=dataset)


def arm_between_boards(seed: int = 0, *, moving: bool = True) -> SyntheticDataset:
    """Simulate two cameras back to back on a flange, each before a fixed board of its own.

    Args:
        seed: of all that is drawn.
        moving: False for a flange that stands still.
    """
    rng = np.random.default_rng([seed, 779])
    mounts, boards = [], {}
    for name, board, turned in (("rgb_1", "front", 0.05), ("rgb_2", "rear", np.pi - 0.05)):
        ahead = np.array([np.cos(turned), np.sin(turned), 0.0])
        beam_T_base = se3.from_rpy(0.1 * ahead, np.array([0.0, 0.0, turned]))
        mounts.append(camera_mount(name, "rgb", "flange", beam_T_base, COLOUR_CAMERA))
        middle = np.array([0.0, 0.0, 1.0])
        boards[board] = held_before(middle, middle + 2.0 * ahead, _BORDER, rng, tilt_rad=0.2)
    rig = assemble("world", {}, mounts, room=Room((-7.0, -7.0, 0.0), (7.0, 7.0, 3.5)))
    motion = []
    for _ in range(12):
        place, turn = rng.uniform(-0.2, 0.2, 3), rng.uniform(-0.25, 0.25, 3)
        pose = se3.from_rpy(np.array([0.0, 0.0, 1.0]) + moving * place, moving * turn)
        motion.append({Edge("world", "flange"): pose})
    patterns = {name: charuco(link=f"{name}_link", fixed=True) for name in boards}
    poses: Any = {name: [pose] * len(motion) for name, pose in boards.items()}
    return make_dataset(
        rig, poses, Noise(), rng, patterns=patterns, motion=motion, name="between_boards"
    )


def _two_cameras(rng: np.random.Generator, *, anchored: Optional[str] = None) -> Any:
    mounts: List[Any] = []
    for name, side_m in (("rgb_1", 0.25), ("rgb_2", -0.25)):
        place = np.array([0.2, side_m, 0.9])
        beam_T_base = se3.from_rpy(place, rng.uniform(-0.2, 0.2, 3))
        mounts.append(camera_mount(name, "rgb", "base", beam_T_base, COLOUR_CAMERA))
    return assemble("world", {}, mounts, anchored=anchored, room=_ROOM)
