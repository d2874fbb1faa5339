"""A dataset: the sensors, the patterns, and the collections with their labels and transforms."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Container, Dict, Iterable, Iterator, Mapping, Optional, Tuple, TypeVar

import numpy as np

from atom_core.errors import DatasetError
from atom_core.model.caveats import Caveat
from atom_core.model.config import CalibrationConfig
from atom_core.model.joints import JointState
from atom_core.model.labels import DetectionKey, Label, RangePoints, place
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import Sensor
from atom_core.model.transforms import Edge, FrameGraph, chain_transform

_Value = TypeVar("_Value")

MULTIPLE = "multiple"  # type of an edge that has a value of its own in each collection


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

    def read(self, collection: str, sensor: str) -> Any:
        """Return the data of a sensor as its modality has them; not to be changed.

        Images (height, width, 3) blue green red; depth images (height, width) [m], NaN where
        there is none; clouds (n, 3) [m] in the sensor's frame, invalid points kept as NaN.

        Raises:
            DatasetError: they are absent or damaged.
        """
        raise DatasetError(f"collection {collection} has no data of sensor '{sensor}'")

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
        warnings: what the reader had to tolerate, and the caveats' sentences.
        caveats: what puts sensors in doubt whatever their labels are.
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
    caveats: Tuple[Caveat, ...] = ()

    @property
    def world(self) -> str:
        """The root frame."""
        return self.config.world_link

    @cached_property
    def graph(self) -> FrameGraph:
        """The frames of all collections, and the patterns below their parents."""
        edges = {edge: None for c in self.collections.values() for edge in c.transforms}
        for pattern in self.patterns.values():
            edges[board_edge(pattern)] = None
        return FrameGraph(edges)

    @property
    def sensor_edges(self) -> Tuple[Edge, ...]:
        """The sensors' edges, each once, in the order of the sensors."""
        return tuple(dict.fromkeys(sensor.edge for sensor in self.sensors.values()))

    @property
    def calibrated_edges(self) -> Tuple[Edge, ...]:
        """The sensors' edges, and behind them those of the additional tfs, each once."""
        additional = (entry.edge for entry in self.config.additional_tfs.values())
        return tuple(dict.fromkeys([*self.sensor_edges, *additional]))

    def sensors_on(self, edge: Edge) -> Tuple[str, ...]:
        """Return the names of the sensors whose edge is this one."""
        return tuple(name for name, sensor in self.sensors.items() if sensor.edge == edge)

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

    def with_caveats(self, caveats: Iterable[Caveat]) -> Dataset:
        """Return a copy with further caveats, told among its warnings, too."""
        new = [caveat for caveat in caveats if caveat not in self.caveats]
        told = (*self.warnings, *(caveat.sentence for caveat in new))
        return replace(self, caveats=(*self.caveats, *new), warnings=told)

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

    @cached_property
    def joints(self) -> Mapping[str, JointState]:
        """All joints by name, each as it stands in the first collection that has it."""
        found: Dict[str, JointState] = {}
        for collection in self.collections.values():
            found = {**collection.joints, **found}
        return found

    def joint(self, name: str) -> JointState:
        """Return a joint as it stands in the first collection that has it.

        Raises:
            DatasetError: no collection has it.
        """
        if name not in self.joints:
            raise DatasetError(f"{self.source}: joint '{name}' is in no collection's joints")
        return self.joints[name]

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

    Raises:
        DatasetError: an index outside the data, or a labeled point that is not finite.
    """
    modality = dataset.sensors[key.sensor].kind
    if modality.points is None:
        raise DatasetError(f"{place(key)}: a {modality.noun} measures no points in space")
    return modality.points(dataset, key)


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
