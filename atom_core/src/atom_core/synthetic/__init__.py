"""Simulated rigs, boards, measurements and their truth; seeded, in memory, fast.

Everything goes ``rig -> board poses -> make_dataset -> disturbed``; ``cell`` holds the paper's
cell, ``scenes`` small ones for tests.
"""

from atom_core.synthetic.cell import paper_cell, statistics
from atom_core.synthetic.dataset import Sampling, SyntheticDataset, disturbed, make_dataset
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.rig import LidarModel, Rig, Room

__all__ = [
    "LidarModel",
    "Noise",
    "Rig",
    "Room",
    "Sampling",
    "SyntheticDataset",
    "disturbed",
    "make_dataset",
    "paper_cell",
    "statistics",
]
