"""A small dataset on the disk whose labels are corrected: two cameras, a depth camera, a LiDAR."""

from pathlib import Path

import numpy as np

from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes
from atom_core.synthetic.memory import Sampling

CAMERA, DEPTH, LIDAR = "rgb_1", "depth_1", "lidar_1"
PATTERN = "pattern_1"
FIRST, SECOND, THIRD, FOURTH = "000", "001", "002", "003"  # the cameras see nothing in the first


def write_scene(folder):
    """Write the dataset; return the path of its JSON."""
    scene = scenes.random_scene(
        2, rgb=2, depth=1, lidar3d=1, collections=4, sampling=Sampling(background_step=1)
    )
    return write_dataset_folder(scene.dataset, Path(folder), name="scene")


def around(label, width, factor=1.15):
    """Return a polygon (4, 2) [px] around the pixels of a depth label: their rectangle, grown."""
    row, column = np.divmod(label.indices, width)
    low, high = np.array([column.min(), row.min()]), np.array([column.max(), row.max()])
    middle, half = 0.5 * (low + high), 0.5 * factor * (high - low)
    return middle + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
