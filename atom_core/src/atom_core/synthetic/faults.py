"""Faults that a calibration must not be confidently wrong about: scenes with one planted each.

What breaks an assumption in practice: sensors that read long, wrong boards and intrinsics, labels
of other collections, arms that are not where they say. All start beside the truth. Tests hold the
verdicts, `make bench ARGS="--only trust"` shows the figures.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Callable, Dict

import numpy as np

from atom_core.model.dataset import Dataset
from atom_core.synthetic import mistakes, scenes
from atom_core.synthetic.cell import paper_cell
from atom_core.synthetic.dataset import SyntheticDataset
from atom_core.synthetic.memory import Sampling
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.realism import PLAIN
from atom_core.synthetic.rig import pinhole

DISTURBANCE = (0.1, 0.1)
LIDARS = ("lidar_1", "lidar_2", "lidar_3")
_STREAM = 77
_KINECT_PER_M = 0.0028  # steps of 1 / z of a structured-light camera: 3 mm at 1 m
_DEPTH_NOISE = Noise(sensors={"depth_1": Noise(dropout=0.05)})
_SOFT = Noise(corner_px=0.5, lidar_m=0.02)

Plant = Callable[[Dataset, np.random.Generator], Dataset]
Make = Callable[[int], SyntheticDataset]


def cell(seed: int) -> SyntheticDataset:
    """Return the paper's cell."""
    return paper_cell(seed, disturbance=DISTURBANCE)


def arm(seed: int) -> SyntheticDataset:
    """Return a camera on an arm."""
    return scenes.hand_eye(seed, collections=20, disturbance=DISTURBANCE)


def _soft_cell(seed: int) -> SyntheticDataset:
    """Return the cell with blurred corners, LiDARs that scatter and read long, and depth waves."""
    parts = replace(PLAIN, lidar_offset_m=0.02, depth_wave_m=0.004, depth_wave_share=0.003)
    return paper_cell(seed, noise=_SOFT, disturbance=DISTURBANCE, realism=parts)


def _wavy_cell(seed: int) -> SyntheticDataset:
    waves = replace(PLAIN, depth_wave_m=0.010)
    return paper_cell(seed, noise=_DEPTH_NOISE, disturbance=DISTURBANCE, realism=waves)


def _whole_clouds(seed: int) -> SyntheticDataset:
    return paper_cell(seed, disturbance=DISTURBANCE, sampling=Sampling(background_step=1))


def _two_cameras_without_ids(seed: int) -> SyntheticDataset:
    return scenes.without_ids(seed, disturbance=(0.05, 0.05))


def _camera_and_depth(seed: int) -> SyntheticDataset:
    return _random(seed, rgb=1, depth=1, lidar3d=0)


def _camera_and_lidar(seed: int) -> SyntheticDataset:
    return _random(seed, rgb=1, depth=0, lidar3d=1)


def _two_cameras_and_lidar(seed: int) -> SyntheticDataset:
    return _random(seed, rgb=2, depth=0, lidar3d=1)


def _random(seed: int, **sensors: int) -> SyntheticDataset:
    return scenes.random_scene(seed, collections=20, disturbance=DISTURBANCE, **sensors)


def _two_lenses(seed: int) -> SyntheticDataset:
    lens = pinhole(1280, 800, 820.0, (-0.05, 0.01, 0.0005, -0.0005, 0.0))
    return scenes.other_lens(seed, lens=lens, collections=20, disturbance=DISTURBANCE)


def with_fault(scene: Make, plant: Plant) -> Make:
    """Return what makes a scene of a seed and plants a fault into its dataset."""

    def make(seed: int) -> SyntheticDataset:
        made = scene(seed)
        return replace(made, dataset=plant(made.dataset, np.random.default_rng([seed, _STREAM])))

    return make


def exchanged(sensor: str, share: float) -> Plant:
    """Return what exchanges a sensor's labels and data among some of its collections."""

    def plant(dataset: Dataset, rng: np.random.Generator) -> Dataset:
        taken_from = mistakes.exchange(dataset, sensor, share, rng)
        return mistakes.with_exchanged_data(dataset, sensor, taken_from)

    return plant


def _foreign_labels(dataset: Dataset, rng: np.random.Generator) -> Dataset:
    taken_from = mistakes.exchange(dataset, "lidar_1", 0.4, rng)
    return mistakes.with_exchanged_labels(dataset, "lidar_1", taken_from)


def _foreign_and_mirrored(dataset: Dataset, rng: np.random.Generator) -> Dataset:
    return mistakes.with_mirrored_points(_foreign_labels(dataset, rng), "lidar_1")


def _all_long(dataset: Dataset, _: np.random.Generator) -> Dataset:
    for sensor in LIDARS:
        dataset = mistakes.with_long_ranges(dataset, sensor, 0.03)
    return dataset


def _on_its_head(dataset: Dataset, _: np.random.Generator) -> Dataset:
    for key in dataset.collections:
        dataset = mistakes.with_renumbered_corners(dataset, key, "rgb_2", mistakes.TURNED)
    return dataset


def _board(factor: float) -> Plant:
    return lambda dataset, _: mistakes.with_scaled_boards(dataset, factor)


def _focal_length(factor: float) -> Plant:
    return lambda dataset, _: mistakes.with_scaled_focal_length(dataset, "rgb_1", factor)


def _depth(factor: float) -> Plant:
    return lambda dataset, _: mistakes.with_scaled_depths(dataset, "depth_1", factor)


def _print_off(dataset: Dataset, _: np.random.Generator) -> Dataset:
    return mistakes.with_shifted_prints(dataset, (0.02, 0.0))


def _arm_off(dataset: Dataset, rng: np.random.Generator) -> Dataset:
    return mistakes.with_edge_off(dataset, "flange", 0.005, 1.0, rng)


FAULTS: Dict[str, Make] = {
    "none": cell,
    "every LiDAR reads 30 mm long": with_fault(cell, _all_long),
    "blur, LiDARs noisy and 20 mm long, depth ripples": _soft_cell,
    "depth in steps, 5 % holes, waves of 10 mm": with_fault(
        _wavy_cell,
        lambda dataset, _: mistakes.with_depths_in_steps(dataset, "depth_1", _KINECT_PER_M),
    ),
    "no ids, rgb_2 upside down": with_fault(_two_cameras_without_ids, _on_its_head),
    "print 20 mm off centre, camera and depth": with_fault(_camera_and_depth, _print_off),
    "print 20 mm off centre": with_fault(cell, _print_off),
    "board 3 % large, camera and LiDAR": with_fault(_camera_and_lidar, _board(1.03)),
    "board 10 % large, two cameras and LiDAR": with_fault(_two_cameras_and_lidar, _board(1.10)),
    "board 0.5 % large": with_fault(cell, _board(1.005)),
    "board 5 % large": with_fault(cell, _board(1.05)),
    "lidar_1: labels of others in 40 %": with_fault(_whole_clouds, _foreign_labels),
    "lidar_1: labels of others in 40 %, and mirrored": with_fault(
        _whole_clouds, _foreign_and_mirrored
    ),
    "lidar_1: mirrored in y": with_fault(
        cell, lambda dataset, _: mistakes.with_mirrored_points(dataset, "lidar_1")
    ),
    "lidar_1: exchanged in 20 %": with_fault(cell, exchanged("lidar_1", 0.2)),
    "lidar_1: exchanged in 30 %": with_fault(cell, exchanged("lidar_1", 0.3)),
    "lidar_1: exchanged in 40 %": with_fault(cell, exchanged("lidar_1", 0.4)),
    "rgb_1: exchanged in 30 %": with_fault(cell, exchanged("rgb_1", 0.3)),
    "depth ten times too far": with_fault(cell, _depth(10.0)),
    "depth 1 % too far": with_fault(cell, _depth(1.01)),
    "K of two cameras swapped": with_fault(
        _two_lenses,
        lambda dataset, _: mistakes.with_swapped_intrinsics(dataset, "rgb_1", "rgb_2"),
    ),
    "rgb_1: image centre 20 px off": with_fault(
        cell, lambda dataset, _: mistakes.with_shifted_centre(dataset, "rgb_1", 20.0)
    ),
    "rgb_1: focal length 2 % long": with_fault(cell, _focal_length(1.02)),
    "rgb_1: focal length 10 % long": with_fault(cell, _focal_length(1.10)),
    "camera on an arm, none": arm,
    "camera on an arm, arm 5 mm and 1 deg off": with_fault(arm, _arm_off),
}
