"""From a rig and board poses to a dataset in memory, with its truth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Dict, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.config import CalibrationConfig, PatternConfig, SensorConfig
from atom_core.model.dataset import MULTIPLE, Collection, Dataset
from atom_core.model.labels import Label
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import Sensor
from atom_core.model.transforms import Edge, Transforms
from atom_core.model.truth import Truth
from atom_core.synthetic.board import charuco
from atom_core.synthetic.memory import MemoryDataSource, Sampling
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.planted import Planted
from atom_core.synthetic.rig import Rig, jittered
from atom_core.synthetic.sensing import View, simulation_of

Disturbance = Tuple[float, float]
Motion = Sequence[Mapping[Edge, np.ndarray]]
Poses = Mapping[str, np.ndarray]
BoardPoses = Mapping[str, Sequence[Optional[np.ndarray]]]


@dataclass(frozen=True)
class SyntheticDataset:
    """A dataset and what a calibration of it must find.

    ``planted`` holds the systematic errors that the dataset does not know of.
    """

    dataset: Dataset
    truth: Truth
    planted: Planted = Planted()


def make_dataset(
    rig: Rig,
    board_poses: BoardPoses,
    noise: Noise,
    rng: np.random.Generator,
    *,
    patterns: Optional[Mapping[str, PatternConfig]] = None,
    motion: Motion = (),
    sampling: Optional[Sampling] = None,
    name: str = "synthetic",
    planted: Planted = Planted(),  # noqa: B008 (frozen)
) -> SyntheticDataset:
    """Simulate all sensors of a rig in one collection for each pose of the boards.

    Args:
        rig: sensors at their true poses.
        board_poses: by pattern, true ``parent_T_pattern`` (4, 4) for each collection, None where
            the pattern is away.
        noise: how wrong the measurements are.
        rng: source of all randomness.
        patterns: by name; default one ChArUco, "pattern_1".
        motion: for each collection, edges that move; empty for a rig that stands still.
        sampling: density of clouds and labels.
        name: the dataset's name.
        planted: systematic errors of the sensors, boards and moving transforms (`planted_in`).

    Returns:
        The dataset with the true transforms (``disturbed`` moves them), and the truth.
        Intrinsics, patterns and moving transforms are those that a user has.
    """
    config = _config(rig, patterns or {"pattern_1": charuco()}, name)
    observer = _Observer(rig, config, noise, rng, sampling or Sampling(), planted)
    count = len(next(iter(board_poses.values())))
    collections, boards, true_moving = {}, {}, {}
    for index in range(count):
        key, moving = f"{index:03d}", (motion[index] if motion else {})
        present = {n: pose for n, p in board_poses.items() if (pose := p[index]) is not None}
        labels = observer.observe(key, present, moving)
        told = observer.as_told(moving)
        collections[key] = Collection(key, labels, {**rig.transforms, **told})
        boards.update({(pattern, key): pose for pattern, pose in present.items()})
        true_moving.update({(edge, key): moving[edge] for edge in moving})
    types = dict.fromkeys(rig.transforms, "fixed")
    types.update({edge: MULTIPLE for moving in motion for edge in moving})
    typed = {n: pattern_from_config(n, c) for n, c in config.calibration_patterns.items()}
    dataset = Dataset(Path(name), config, rig.sensors, typed, collections, types, observer.data)
    truth = Truth({edge: rig.transforms[edge] for edge in rig.calibrated_edges}, boards)
    return SyntheticDataset(dataset, truth, replace(planted, moving=true_moving))


class _Observer:
    """Lets every sensor of a rig, as it truly is, look at the boards of a collection."""

    def __init__(
        self,
        rig: Rig,
        config: CalibrationConfig,
        noise: Noise,
        rng: np.random.Generator,
        sampling: Sampling,
        planted: Planted,
    ):
        sensors = {name: planted.of(name).true_sensor(s) for name, s in rig.sensors.items()}
        self.rig, self.planted = replace(rig, sensors=sensors), planted
        made = {
            name: (
                planted.of_board(name).true_pattern(name, c),
                planted.of_board(name).true_config(c),
            )
            for name, c in config.calibration_patterns.items()
        }
        self.patterns = {name: pattern for name, (pattern, _) in made.items()}
        self.noise, self.rng, self.sampling = noise, rng, sampling
        bits: Any = rng.bit_generator
        self.errors_rng = np.random.Generator(bits.jumped())  # what rng draws stays the same
        self.data = MemoryDataSource(made)
        self.prepared: Dict[str, Any] = {}

    def as_told(self, moving: Transforms) -> Dict[Edge, np.ndarray]:
        """Return moving edges as the dataset has them."""
        sigmas = (self.planted.moving_edge_sigma_m, self.planted.moving_edge_sigma_rad)
        if sigmas == (0.0, 0.0):
            return dict(moving)
        return {e: jittered(pose, *sigmas, self.errors_rng) for e, pose in moving.items()}

    def observe(self, key: str, present: Poses, moving: Transforms) -> Dict[Tuple[str, str], Label]:
        """Return the labels of a collection and keep its data."""
        world_T_patterns = {
            name: self.rig.pose(self.patterns[name].parent_frame, moving) @ pose
            for name, pose in present.items()
        }
        labels: Dict[Tuple[str, str], Label] = {}
        for sensor in self.rig.sensors.values():
            view = self._view(key, sensor, world_T_patterns, moving)
            for pattern, label in simulation_of(sensor).observe(view).items():
                labels[(sensor.name, pattern)] = label
        return labels

    def _view(self, key: str, sensor: Sensor, world_T_patterns: Poses, moving: Transforms) -> View:
        world_T_sensor = self.rig.pose(sensor.frame, moving)
        sensor_T_world = se3.inverse(world_T_sensor)
        return View(
            collection=key,
            sensor=sensor,
            sensor_T_patterns={n: sensor_T_world @ pose for n, pose in world_T_patterns.items()},
            world_T_sensor=world_T_sensor,
            rig=self.rig,
            patterns=self.patterns,
            noise=self.noise.of(sensor.name),
            errors=self.planted.of(sensor.name),
            rng=self.rng,
            errors_rng=self.errors_rng,
            sampling=self.sampling,
            data=self.data,
            prepared=self.prepared,
        )


def disturbed(
    synthetic: SyntheticDataset,
    disturbance: Disturbance,
    rng: np.random.Generator,
) -> SyntheticDataset:
    """Return the same measurements with transforms that are wrong by a known amount.

    Each calibrated edge but the anchored sensor's is moved by exactly ``disturbance[0]`` metres
    in an isotropic direction and turned by ``disturbance[1]`` radians about an isotropic axis.
    """
    dataset = synthetic.dataset
    anchored = dataset.config.anchored_sensor
    held = dataset.sensors[anchored].edge if anchored else None
    moved = disturbed_edges(synthetic.truth.edges, held, disturbance, rng)
    return replace(
        synthetic, dataset=dataset.with_transforms(dict.fromkeys(dataset.collections, moved))
    )


def disturbed_edges(
    edges: Mapping[Edge, np.ndarray],
    held: Optional[Edge],
    disturbance: Disturbance,
    rng: np.random.Generator,
) -> Dict[Edge, np.ndarray]:
    """Return the edges (4, 4) that are moved, all but ``held``, as ``disturbed`` moves them."""
    metres, radians = disturbance
    moved = {}
    for edge, parent_T_child in edges.items():
        move = se3.random_move(metres, radians, rng)
        if edge != held and (metres or radians):
            moved[edge] = se3.moved(parent_T_child, move)
    return moved


def _config(rig: Rig, patterns: Mapping[str, PatternConfig], name: str) -> CalibrationConfig:
    return CalibrationConfig(
        world_link=rig.world,
        sensors={
            sensor.name: SensorConfig(
                link=sensor.frame,
                parent_link=sensor.edge.parent,
                child_link=sensor.edge.child,
                topic_name=sensor.topic,
                modality=sensor.modality,
            )
            for sensor in rig.sensors.values()
        },
        calibration_patterns=patterns,
        anchored_sensor=rig.anchored,
        package_name=f"{name}_calibration",
    )
