"""Rigs of any size with their datasets in memory: what `make bench` measures growth with."""

from __future__ import annotations

from dataclasses import replace
from typing import Dict, List, Tuple

import numpy as np

from atom_core.model.dataset import Dataset
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import LIDAR3D
from atom_core.synthetic import Noise
from atom_core.synthetic.board import charuco, held_before
from atom_core.synthetic.cell import SCENARIOS, cell_rig, paper_cell, plan_board_poses
from atom_core.synthetic.dataset import disturbed, make_dataset
from atom_core.synthetic.lidar_models import LidarModel
from atom_core.synthetic.memory import Sampling
from atom_core.synthetic.realism import PLAIN, Realism
from atom_core.synthetic.rig import Rig
from atom_core.synthetic.scenes import random_rig
from atom_core.synthetic.sensing import planted_in

DISTURBANCE = (0.1, 0.1)
PAPER_CELL = 7
# of the other rigs: cameras, depth cameras, LiDARs
_MIXTURES: Dict[int, Tuple[int, int, int]] = {20: (12, 2, 6), 50: (34, 4, 12)}
_PLANNED_AT_ONCE = 50
_ALL_OF_THE_ROOM = 10**9  # step: nothing of it stays in the clouds


def rig_dataset(sensors: int, collections: int, seed: int = 0, realism: Realism = PLAIN) -> Dataset:
    """Return a dataset of a rig with so many sensors, its start disturbed by 0.1 m and 0.1 rad.

    Args:
        sensors: 7 for the paper's cell with the paper's labels, or 20 or 50, thinner labels.
        collections: how many boards.
        seed: of all randomness.
        realism: systematic errors.
    """
    rng = np.random.default_rng([seed, sensors, collections])
    if (sensors, collections) == (PAPER_CELL, SCENARIOS["train"].collections):
        sampling = Sampling(_ALL_OF_THE_ROOM, labeled_only=True)
        cell = paper_cell(seed, "train", Noise(), DISTURBANCE, sampling=sampling, realism=realism)
        return cell.dataset
    if sensors == PAPER_CELL:
        rig, pattern, step = cell_rig(seed), charuco(), 4
        poses = _planned(rig, collections, rng)
    else:
        rig, pattern, step = _thin_rig(sensors, rng), charuco(dimension=(8, 5)), 16
        poses = [_pose(rig, rng) for _ in range(collections)]
    sampling = Sampling(_ALL_OF_THE_ROOM, depth_step=step, labeled_only=True)
    exact = make_dataset(
        rig,
        {"pattern_1": poses},
        Noise(),
        rng,
        patterns={"pattern_1": pattern},
        sampling=sampling,
        name=f"rig_{sensors}x{collections}",
        planted=planted_in(rig, ["pattern_1"], realism, [seed, sensors]),
    )
    return disturbed(exact, DISTURBANCE, rng).dataset


def _planned(rig: Rig, collections: int, rng: np.random.Generator) -> List[np.ndarray]:
    """Return board poses with the paper's share of complete and of partial detections."""
    poses: List[np.ndarray] = []
    while len(poses) < collections:
        count = min(_PLANNED_AT_ONCE, collections - len(poses))
        poses += plan_board_poses(rig, SCENARIOS["train"].of_size(count), rng)
    return poses


def _thin_rig(sensors: int, rng: np.random.Generator) -> Rig:
    rig = random_rig(rng, *_MIXTURES[sensors])
    thin = LidarModel(azimuth_steps=300)
    lidars = {s.name: thin for s in rig.sensors.values() if s.modality == LIDAR3D}
    return replace(rig, lidars=lidars)


def _pose(rig: Rig, rng: np.random.Generator) -> np.ndarray:
    """Return ``world_T_pattern`` of a board in the middle, held towards the sensors' arc."""
    centre, bearing = np.array(rig.centre), rng.uniform(-0.6, 0.6)
    eye = centre + [2.2 * np.sin(bearing), 2.2 * np.cos(bearing), rng.uniform(0.1, 1.0)]
    border = pattern_from_config("pattern_1", charuco(dimension=(8, 5))).border
    return held_before(eye, centre + rng.uniform(-0.35, 0.35, 3), border, rng)
