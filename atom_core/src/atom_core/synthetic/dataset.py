"""From a rig and board poses to a dataset in memory, with its truth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Dict, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.config import CalibrationConfig, PatternConfig, SensorConfig
from atom_core.model.dataset import MULTIPLE, Collection, Dataset, DataSource, Label
from atom_core.model.pattern import Pattern, pattern_from_config
from atom_core.model.sensor import DEPTH, LIDAR3D, RGB, Sensor
from atom_core.model.transforms import Edge, Transforms
from atom_core.model.truth import Truth
from atom_core.synthetic import depth, lidar, rgb
from atom_core.synthetic.board import charuco
from atom_core.synthetic.board_image import render
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.rig import Rig, camera_of

Disturbance = Tuple[float, float]
Motion = Sequence[Mapping[Edge, np.ndarray]]
Poses = Mapping[str, np.ndarray]
Labels = Mapping[str, Label]
BoardPoses = Mapping[str, Sequence[Optional[np.ndarray]]]


@dataclass(frozen=True)
class SyntheticDataset:
    """A dataset and what a calibration of it must find."""

    dataset: Dataset
    truth: Truth


@dataclass(frozen=True)
class Sampling:
    """How densely range data are kept.

    Attributes:
        background_step: of the returns from the room every n-th stays in a cloud; 1 keeps all.
        depth_step: grid of the labeled depth pixels [px].
        exact_border: move LiDAR limit points onto the true border, and label no depth limit
            pixels (they lie up to a pixel inside), so that border residuals vanish too.
        labeled_only: keep only what is labeled of a depth image, for large datasets.
    """

    background_step: int = 16
    depth_step: int = 4
    exact_border: bool = False
    labeled_only: bool = False


class MemoryDataSource(DataSource):
    """Clouds and depth images held in memory; pictures are rendered when asked for."""

    def __init__(self, patterns: Mapping[str, Tuple[Pattern, PatternConfig]]):
        """Start empty.

        Args:
            patterns: each pattern with its part of the configuration (for its texture).
        """
        self._patterns = patterns
        self._arrays: Dict[Tuple[str, str], np.ndarray] = {}
        self._pixels: Dict[Tuple[str, str], Tuple[Tuple[int, ...], np.ndarray, np.ndarray]] = {}
        self._views: Dict[Tuple[str, str], Tuple[Sensor, Mapping[str, np.ndarray]]] = {}

    def add_array(self, collection: str, sensor: str, array: np.ndarray) -> None:
        """Keep a cloud or a depth image."""
        self._arrays[(collection, sensor)] = array

    def add_pixels(
        self, collection: str, sensor: str, image: np.ndarray, indices: np.ndarray
    ) -> None:
        """Keep some pixels (n,) of a depth image; the others will be NaN."""
        self._pixels[(collection, sensor)] = (image.shape, indices, image.ravel()[indices])

    def add_view(
        self, collection: str, sensor: Sensor, camera_T_patterns: Mapping[str, np.ndarray]
    ) -> None:
        """Keep what a camera looks at, to render it later."""
        self._views[(collection, sensor.name)] = (sensor, camera_T_patterns)

    def has_data(self, collection: str, sensor: str) -> bool:
        """Tell whether there are data of a sensor in a collection."""
        kept: Sequence[Mapping[Tuple[str, str], object]]
        kept = (self._arrays, self._pixels, self._views)
        return any((collection, sensor) in those for those in kept)

    def cloud(self, collection: str, sensor: str) -> np.ndarray:
        """Return the cloud (n, 3) [m] in the sensor's frame."""
        array = self._arrays.get((collection, sensor))
        return super().cloud(collection, sensor) if array is None else array

    def depth_image(self, collection: str, sensor: str) -> np.ndarray:
        """Return the depth image (height, width) [m], NaN where there is none."""
        if (collection, sensor) in self._pixels:
            shape, indices, depths = self._pixels[(collection, sensor)]
            image = np.full(shape, np.nan)
            image.ravel()[indices] = depths
            return image
        array = self._arrays.get((collection, sensor))
        return super().depth_image(collection, sensor) if array is None else array

    def colour_image(self, collection: str, sensor: str) -> np.ndarray:
        """Render the picture (height, width, 3), blue green red, of the boards before grey."""
        if (collection, sensor) not in self._views:
            return super().colour_image(collection, sensor)
        viewer, camera_T_patterns = self._views[(collection, sensor)]
        assert viewer.camera is not None
        boards = [(self._patterns[n], pose) for n, pose in camera_T_patterns.items()]
        return render(viewer.camera, boards)


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

    Returns:
        The dataset with the true transforms (``disturbed`` moves them), and the truth.
    """
    config = _config(rig, patterns or {"pattern_1": charuco()}, name)
    typed = {n: pattern_from_config(n, c) for n, c in config.calibration_patterns.items()}
    data = MemoryDataSource({n: (typed[n], c) for n, c in config.calibration_patterns.items()})
    observer = _Observer(rig, typed, noise, rng, sampling or Sampling(), data)
    count = len(next(iter(board_poses.values())))
    collections, boards = {}, {}
    for index in range(count):
        key, moving = f"{index:03d}", (motion[index] if motion else {})
        present = {n: pose for n, p in board_poses.items() if (pose := p[index]) is not None}
        labels = observer.observe(key, present, moving)
        collections[key] = Collection(key, labels, {**rig.transforms, **moving})
        boards.update({(pattern, key): pose for pattern, pose in present.items()})
    types = dict.fromkeys(rig.transforms, "fixed")
    types.update({edge: MULTIPLE for moving in motion for edge in moving})
    dataset = Dataset(Path(name), config, rig.sensors, typed, collections, types, data)
    return SyntheticDataset(
        dataset, Truth({edge: rig.transforms[edge] for edge in rig.calibrated_edges}, boards)
    )


class _Observer:
    """Lets every sensor of a rig look at the boards of a collection."""

    def __init__(
        self,
        rig: Rig,
        patterns: Mapping[str, Pattern],
        noise: Noise,
        rng: np.random.Generator,
        sampling: Sampling,
        data: MemoryDataSource,
    ):
        self.rig, self.patterns, self.noise, self.rng = rig, patterns, noise, rng
        self.sampling, self.data = sampling, data
        self.devices = {
            name: depth.DepthCamera(camera_of(sensor), rig.room)
            for name, sensor in rig.sensors.items()
            if sensor.modality == DEPTH
        }

    def observe(self, key: str, present: Poses, moving: Transforms) -> Dict[Tuple[str, str], Label]:
        """Return the labels of a collection and keep its data."""
        world_T_patterns = {
            name: self.rig.pose(self.patterns[name].parent_frame, moving) @ pose
            for name, pose in present.items()
        }
        see = {RGB: self._rgb, DEPTH: self._depth, LIDAR3D: self._lidar}
        labels: Dict[Tuple[str, str], Label] = {}
        for sensor in self.rig.sensors.values():
            world_T_sensor = self.rig.pose(sensor.frame, moving)
            sensor_T_world = se3.inverse(world_T_sensor)
            poses = {n: sensor_T_world @ pose for n, pose in world_T_patterns.items()}
            for pattern, label in see[sensor.modality](key, sensor, poses, world_T_sensor).items():
                labels[(sensor.name, pattern)] = label
        return labels

    def _rgb(self, key: str, sensor: Sensor, poses: Poses, _: np.ndarray) -> Labels:
        self.data.add_view(key, sensor, poses)
        labels = {
            name: rgb.label_corners(
                camera_of(sensor), pose, self.patterns[name], self.noise.of(sensor.name), self.rng
            )
            for name, pose in poses.items()
        }
        return {name: label for name, label in labels.items() if label is not None}

    def _lidar(self, key: str, sensor: Sensor, poses: Poses, world_T_sensor: np.ndarray) -> Labels:
        cloud, labels = lidar.scan(
            self.rig.lidars[sensor.name],
            poses,
            self.patterns,
            world_T_sensor,
            self.rig.room,
            self.noise.of(sensor.name),
            self.rng,
            self.sampling.background_step,
            self.sampling.exact_border,
        )
        self.data.add_array(key, sensor.name, cloud)
        return labels

    def _depth(self, key: str, sensor: Sensor, poses: Poses, world_T_sensor: np.ndarray) -> Labels:
        image, labels = depth.capture(
            self.devices[sensor.name],
            poses,
            self.patterns,
            world_T_sensor,
            self.noise.of(sensor.name),
            self.rng,
            self.sampling.depth_step,
        )
        if self.sampling.labeled_only:
            labeled = [i for label in labels.values() for i in (label.indices, label.limit_indices)]
            kept = np.unique(np.concatenate(labeled)) if labeled else np.zeros(0, dtype=int)
            self.data.add_pixels(key, sensor.name, image, kept)
        else:
            self.data.add_array(key, sensor.name, image)
        if self.sampling.exact_border:
            none = np.zeros(0, dtype=int)
            labels = {n: replace(label, limit_indices=none) for n, label in labels.items()}
        return labels


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
