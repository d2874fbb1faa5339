"""Simulated rigs, boards, measurements and their truth; seeded, in memory, fast.

Everything goes ``rig -> board poses -> make_dataset -> disturbed``; ``cell`` holds the paper's
cell, ``scenes`` small ones for tests, ``degenerate`` such that leave something open, ``realism``
what goes wrong beyond noise.
"""

from atom_core.synthetic.board import charuco, chessboard
from atom_core.synthetic.cell import paper_cell, statistics
from atom_core.synthetic.dataset import SyntheticDataset, disturbed, make_dataset
from atom_core.synthetic.memory import Sampling
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.planted import Planted
from atom_core.synthetic.realism import PLAIN, ROUGH, SLIGHT, Realism
from atom_core.synthetic.rig import LidarModel, Rig, Room
from atom_core.synthetic.scenes import (
    board_on_arm,
    disconnected,
    hand_eye,
    lidar_only,
    random_rig,
    random_scene,
    shared_edge,
    two_cameras,
    two_patterns,
)

__all__ = [
    "PLAIN",
    "ROUGH",
    "SLIGHT",
    "LidarModel",
    "Noise",
    "Planted",
    "Realism",
    "Rig",
    "Room",
    "Sampling",
    "SyntheticDataset",
    "board_on_arm",
    "charuco",
    "chessboard",
    "disconnected",
    "disturbed",
    "hand_eye",
    "lidar_only",
    "make_dataset",
    "paper_cell",
    "random_rig",
    "random_scene",
    "shared_edge",
    "statistics",
    "two_cameras",
    "two_patterns",
]
