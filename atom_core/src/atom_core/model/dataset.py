"""A dataset: the sensors, the patterns, and the collections with their labels and transforms."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import (
    Any,
    Container,
    Dict,
    Iterator,
    Mapping,
    NamedTuple,
    Optional,
    Tuple,
    TypeVar,
    Union,
)

import numpy as np

from atom_core.errors import DatasetError
from atom_core.model.config import CalibrationConfig
from atom_core.model.joints import JointState
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import LIDAR3D, Sensor
from atom_core.model.transforms import Edge, FrameGraph, chain_transform

_Value = TypeVar("_Value")

MULTIPLE = "multiple"  # type of an edge that has a value of its own in each collection


@dataclass(frozen=True)
class RgbLabel:
    """Corners of a pattern found in an image.

    Attributes:
        ids: (n,) corner ids.
        pixels: (n, 2) x right, y down [px], in the raw (distorted) image.
    """

    ids: np.ndarray
    pixels: np.ndarray

    @property
    def detected(self) -> bool:
        """Tell whether anything was found."""
        return len(self.ids) > 0


@dataclass(frozen=True)
class RangeLabel:
    """Returns of a range sensor on the board.

    Attributes:
        indices: (n,) points of the flattened cloud, or pixels ``column + row * width``.
        limit_indices: (m,) those on the board's physical border.
    """

    indices: np.ndarray
    limit_indices: np.ndarray

    @property
    def detected(self) -> bool:
        """Tell whether anything was found."""
        return len(self.indices) > 0


Label = Union[RgbLabel, RangeLabel]


class DetectionKey(NamedTuple):
    """Which sensor saw which pattern in which collection."""

    collection: str
    sensor: str
    pattern: str


class RangePoints(NamedTuple):
    """Labeled points of a range sensor.

    Attributes:
        inside: (n, 3) on the board, in the sensor's frame [m].
        limit: (m, 3) on its border [m].
        inside_indices: (n,) which points of the cloud or pixels of the image they are.
        limit_indices: (m,) likewise.
        dropped: so many labeled pixels had no valid depth.
    """

    inside: np.ndarray
    limit: np.ndarray
    inside_indices: np.ndarray
    limit_indices: np.ndarray
    dropped: int


@dataclass(frozen=True)
class Collection:
    """One instant: labels of all sensors and all transforms.

    Attributes:
        labels: by (sensor, pattern); only what was detected.
        transforms: ``parent_T_child`` (4, 4) by edge.
        joints: the joints whose position is known, by name.
    """

    key: str
    labels: Mapping[Tuple[str, str], Label]
    transforms: Mapping[Edge, np.ndarray]
    joints: Mapping[str, JointState] = field(default_factory=dict)


class DataSource:
    """Where the raw data of a dataset come from; they are read when a label needs them."""

    def cloud(self, collection: str, sensor: str) -> np.ndarray:
        """Return the cloud (n, 3) [m] in the sensor's frame, invalid points kept as NaN."""
        raise DatasetError(f"collection {collection} has no cloud of sensor '{sensor}'")

    def depth_image(self, collection: str, sensor: str) -> np.ndarray:
        """Return the depth image (height, width) [m], NaN where there is none."""
        raise DatasetError(f"collection {collection} has no depth image of sensor '{sensor}'")

    def colour_image(self, collection: str, sensor: str) -> np.ndarray:
        """Return the image (height, width, 3), blue green red."""
        raise DatasetError(f"collection {collection} has no image of sensor '{sensor}'")

    def has_data(self, collection: str, sensor: str) -> bool:
        """Tell whether the data can be read, without reading them."""
        return False


@dataclass(frozen=True)
class Dataset:
    """Everything a calibration starts from.

    Attributes:
        source: the file it was read from (or a name for a dataset in memory).
        config: the calibration's configuration.
        sensors, patterns, collections: by name, in the order of the configuration.
        edge_types: URDF joint type or ``multiple`` of edges; absent means fixed.
        data: access to clouds and depth images.
        document: the JSON document as it was read, so that nothing is lost on writing.
        warnings: what the reader had to tolerate.
    """

    source: Path
    config: CalibrationConfig
    sensors: Mapping[str, Sensor]
    patterns: Mapping[str, Pattern]
    collections: Mapping[str, Collection]
    edge_types: Mapping[Edge, str] = field(default_factory=dict)
    data: DataSource = field(default_factory=DataSource)
    document: Mapping[str, Any] = field(default_factory=dict, repr=False)
    warnings: Tuple[str, ...] = ()

    @property
    def world(self) -> str:
        """The root frame."""
        return self.config.world_link

    @property
    def graph(self) -> FrameGraph:
        """The frames of all collections, and the patterns below their parents."""
        edges = {edge: None for c in self.collections.values() for edge in c.transforms}
        for pattern in self.patterns.values():
            edges[board_edge(pattern)] = None
        return FrameGraph(edges)

    def detections(self) -> Iterator[Tuple[DetectionKey, Label]]:
        """Yield every detection, by collection, then sensor, then pattern."""
        for collection in self.collections.values():
            for sensor in self.sensors:
                for pattern in self.patterns:
                    label = collection.labels.get((sensor, pattern))
                    if label is not None and label.detected:
                        yield DetectionKey(collection.key, sensor, pattern), label

    def label(self, key: DetectionKey) -> Optional[Label]:
        """Return the label of a detection, or None."""
        return self.collections[key.collection].labels.get((key.sensor, key.pattern))

    def with_transforms(self, changes: Mapping[str, Mapping[Edge, np.ndarray]]) -> Dataset:
        """Return a copy with edges replaced or added, by collection."""
        collections = dict(self.collections)
        for key, edges in changes.items():
            merged: Dict[Edge, np.ndarray] = {**collections[key].transforms, **edges}
            collections[key] = replace(collections[key], transforms=merged)
        return replace(self, collections=collections)

    def with_joint_parameters(self, changes: Mapping[str, Mapping[str, float]]) -> Dataset:
        """Return a copy with other parameters [m, rad] of some joints, in all collections.

        The transforms of these joints are computed anew, also where ``changes`` names none.
        """
        collections = dict(self.collections)
        for key, collection in self.collections.items():
            moved = {
                name: collection.joints[name].with_parameters(values)
                for name, values in changes.items()
                if name in collection.joints
            }
            if moved:
                edges = {joint.edge: joint.parent_T_child for joint in moved.values()}
                collections[key] = replace(
                    collection,
                    joints={**collection.joints, **moved},
                    transforms={**collection.transforms, **edges},
                )
        return replace(self, collections=collections)

    def joint(self, name: str) -> JointState:
        """Return a joint as it stands in the first collection that has it.

        Raises:
            DatasetError: no collection has it.
        """
        for collection in self.collections.values():
            if name in collection.joints:
                return collection.joints[name]
        raise DatasetError(f"{self.source}: joint '{name}' is in no collection's joints")

    def with_labels(self, key: str, changes: Mapping[Tuple[str, str], Optional[Label]]) -> Dataset:
        """Return a copy with labels of a collection replaced, by (sensor, pattern); None: none."""
        collection = self.collections[key]
        merged = {**collection.labels, **changes}
        labels = {place: label for place, label in merged.items() if label is not None}
        return replace(
            self, collections={**self.collections, key: replace(collection, labels=labels)}
        )

    def first_value(self, edge: Edge) -> np.ndarray:
        """Return ``parent_T_child`` (4, 4) in the first collection that has the edge.

        Raises:
            DatasetError: no collection has it.
        """
        for collection in self.collections.values():
            if edge in collection.transforms:
                return collection.transforms[edge]
        raise DatasetError(f"{self.source}: edge '{edge}' is in no collection's transforms")

    def selected(
        self,
        sensors: Optional[Container[str]] = None,
        collections: Optional[Container[str]] = None,
        patterns: Optional[Container[str]] = None,
    ) -> Dataset:
        """Return a copy with only the named sensors, collections and patterns (None: all)."""
        return replace(
            self,
            sensors=_only(self.sensors, sensors),
            collections=_only(self.collections, collections),
            patterns=_only(self.patterns, patterns),
        )


def _only(mapping: Mapping[str, _Value], names: Optional[Container[str]]) -> Mapping[str, _Value]:
    return mapping if names is None else {k: v for k, v in mapping.items() if k in names}


def board_edge(pattern: Pattern) -> Edge:
    """Return the edge that carries a pattern's pose."""
    return Edge(pattern.parent_frame, pattern.frame)


def range_points(dataset: Dataset, key: DetectionKey) -> RangePoints:
    """Return the labeled points of a range sensor in its frame.

    A depth pixel becomes a point along its ray, with the distortion undone; pixels without a
    valid depth are dropped and counted. A LiDAR label that names an invalid point is an error.

    Raises:
        DatasetError: an index outside the data, or a labeled point that is not finite.
    """
    sensor, label = dataset.sensors[key.sensor], dataset.label(key)
    assert isinstance(label, RangeLabel)
    inside, limit = np.unique(label.indices), np.unique(label.limit_indices)
    if sensor.modality == LIDAR3D:
        cloud = dataset.data.cloud(key.collection, key.sensor)
        return RangePoints(_pick(cloud, inside, key), _pick(cloud, limit, key), inside, limit, 0)
    image = dataset.data.depth_image(key.collection, key.sensor)
    points_inside, kept_inside = _depth_points(image, inside, sensor, key)
    points_limit, kept_limit = _depth_points(image, limit, sensor, key)
    dropped = len(inside) + len(limit) - len(kept_inside) - len(kept_limit)
    return RangePoints(points_inside, points_limit, kept_inside, kept_limit, dropped)


def place(key: DetectionKey) -> str:
    """Return the words that name a detection in a message."""
    return f"sensor '{key.sensor}', collection {key.collection}, pattern '{key.pattern}'"


def _pick(cloud: np.ndarray, indices: np.ndarray, key: DetectionKey) -> np.ndarray:
    _check_indices(indices, len(cloud), key)
    points = cloud[indices]
    bad = ~np.all(np.isfinite(points), axis=1)
    if np.any(bad):
        raise DatasetError(
            f"{place(key)}: labeled point {indices[bad][0]} is not finite ({int(bad.sum())} such "
            f"points); correct the label, or leave the collection out with -csf"
        )
    return points


def _depth_points(
    image: np.ndarray, indices: np.ndarray, sensor: Sensor, key: DetectionKey
) -> Tuple[np.ndarray, np.ndarray]:
    """Return points (n, 3) [m] of the pixels that have a depth, and the pixels' indices (n,)."""
    _check_indices(indices, image.size, key)
    row, column = np.divmod(indices, image.shape[1])
    depth = image[row, column].astype(float)
    valid = np.isfinite(depth) & (depth > 0)
    pixels = np.column_stack([column, row])[valid].astype(float)
    assert sensor.camera is not None
    return sensor.camera.ray_points(pixels, depth[valid]), indices[valid]


def _check_indices(indices: np.ndarray, size: int, key: DetectionKey) -> None:
    if len(indices) and (indices[0] < 0 or indices[-1] >= size):
        wrong = indices[0] if indices[0] < 0 else indices[-1]
        raise DatasetError(
            f"{place(key)}: label index {wrong} is outside the data ({size} points); "
            f"the data file does not belong to this label"
        )


def is_complete(dataset: Dataset, collection: str) -> bool:
    """Tell whether every sensor detected every pattern in the collection."""
    labels = dataset.collections[collection].labels
    return all(
        (sensor, pattern) in labels and labels[(sensor, pattern)].detected
        for sensor in dataset.sensors
        for pattern in dataset.patterns
    )


def pose(collection: Collection, graph: FrameGraph, target: str, source: str) -> np.ndarray:
    """Return ``target_T_source`` (4, 4) in a collection."""
    return chain_transform(graph.chain(target, source), collection.transforms)
