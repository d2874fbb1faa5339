"""The paper's cell with two 2D LiDARs beside its seven sensors."""

from __future__ import annotations

from functools import lru_cache
from typing import Dict, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.modality import modality_named
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import LIDAR2D
from atom_core.model.transforms import Edge
from atom_core.synthetic.board import charuco
from atom_core.synthetic.cell import SCENARIOS, Accept, cell_rig, plan_board_poses
from atom_core.synthetic.dataset import Disturbance, SyntheticDataset, disturbed, make_dataset
from atom_core.synthetic.memory import Sampling
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.realism import PLAIN, Realism
from atom_core.synthetic.rig import Mount, Rig, assemble, jittered, looking_at
from atom_core.synthetic.sensing import planted_in, simulation_of

_CENTRE = (0.0, -0.6)
_PLACES = {  # where they stand, and the heights that they look to in the middle of the cell
    "scanner_1": ((-2.3, 1.1, 0.95), 1.05),
    "scanner_2": ((2.3, 0.9, 1.2), 1.0),
}
_PLACED = 0.05, 0.03  # how far a real mount is from the drawing [m, rad]
_RIG, _POSES, _NOISE, _DISTURBANCE, _ERRORS = (
    31,
    32,
    33,
    34,
    35,
)  # streams of random numbers of one seed


def cell_with_scanners_rig(seed: int) -> Rig:
    """Return the paper's cell of a seed with two 2D LiDARs of 0.25 deg on posts of their own."""
    cell, rng = cell_rig(seed), np.random.default_rng([seed, _RIG])
    mounts = [Mount(sensor, {}, cell.lidars.get(name)) for name, sensor in cell.sensors.items()]
    simulation = modality_named(LIDAR2D).synthetic
    assert simulation is not None
    structure: Dict[Edge, np.ndarray] = dict(cell.transforms)
    for name, (place, height) in _PLACES.items():
        world_T_base = jittered(looking_at(place, (*_CENTRE, height)), *_PLACED, rng)
        world_T_post = se3.transform(np.eye(3), np.array([place[0], place[1], 0.0]))
        structure[Edge("world", f"{name}_post")] = world_T_post
        post_T_base = se3.inverse(world_T_post) @ world_T_base
        mounts.append(simulation.mount(name, f"{name}_post", post_T_base, None))
    return assemble(
        cell.world, structure, mounts, anchored=cell.anchored, room=cell.room, centre=cell.centre
    )


def cell_with_scanners(
    seed: int,
    scenario: str = "train",
    noise: Noise = Noise(),  # noqa: B008 (frozen)
    disturbance: Disturbance = (0.0, 0.0),
    *,
    sampling: Sampling = Sampling(),  # noqa: B008 (frozen)
    realism: Realism = PLAIN,
) -> SyntheticDataset:
    """Simulate the paper's cell with two 2D LiDARs; arguments as of `paper_cell`.

    The boards are held at any roll and lean, so that all six numbers of a 2D LiDAR's pose are
    determined (docs/lidar2d.md).
    """
    wanted, rig = SCENARIOS[scenario], cell_with_scanners_rig(seed)
    exact = make_dataset(
        rig,
        {"pattern_1": _poses_of(seed, scenario)},
        noise,
        np.random.default_rng([seed, wanted.stream, _NOISE]),
        sampling=sampling,
        name=f"cell_with_scanners_{scenario}_{seed}",
        planted=planted_in(rig, ["pattern_1"], realism, [seed, _ERRORS]),
    )
    return disturbed(exact, disturbance, np.random.default_rng([seed, _DISTURBANCE]))


@lru_cache(maxsize=256)
def _poses_of(seed: int, scenario: str) -> Tuple[np.ndarray, ...]:
    """Return the board poses (4, 4) of a seed, which noise and errors leave alone."""
    wanted, rig = SCENARIOS[scenario], cell_with_scanners_rig(seed)
    rng = np.random.default_rng([seed, wanted.stream, _POSES])
    poses = plan_board_poses(cell_rig(seed), wanted, rng, _is_cut(rig))
    for pose in poses:
        pose.flags.writeable = False
    return tuple(poses)


def _is_cut(rig: Rig) -> Accept:
    """Return what accepts the boards that one of the 2D LiDARs sees."""
    pattern = pattern_from_config("pattern_1", charuco())
    scanners = [sensor for sensor in rig.sensors.values() if sensor.modality == LIDAR2D]
    sensor_T_world = {s.name: se3.inverse(rig.pose(s.frame)) for s in scanners}

    def accept(world_T_pattern: np.ndarray, _: Sequence[str]) -> bool:
        return any(
            simulation_of(s).outlook(rig, s, sensor_T_world[s.name] @ world_T_pattern, pattern).seen
            for s in scanners
        )

    return accept
