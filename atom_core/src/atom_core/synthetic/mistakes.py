"""What goes wrong when people collect: labels on the wrong thing, boards and sensors that move.

Single detections of a dataset are replaced by those of another one, in which something is
otherwise than the dataset says.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Dict, Mapping, NamedTuple, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, DataSource
from atom_core.model.labels import RgbLabel
from atom_core.synthetic.dataset import SyntheticDataset, make_dataset
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.rig import Rig

TURNED, MIRRORED = "turned", "mirrored"
_KEY = "000"


class Origin(NamedTuple):
    """Where a detection is taken from."""

    dataset: Dataset
    collection: str


# by (collection, sensor)
Origins = Mapping[Tuple[str, str], Origin]


def with_detections_from(dataset: Dataset, origins: Origins) -> Dataset:
    """Return the dataset with some sensors' labels and data in some collections replaced."""
    collections = dict(dataset.collections)
    for (key, sensor), origin in origins.items():
        labels = {k: v for k, v in collections[key].labels.items() if k[0] != sensor}
        theirs = origin.dataset.collections[origin.collection].labels
        labels.update({k: v for k, v in theirs.items() if k[0] == sensor})
        collections[key] = replace(collections[key], labels=labels)
    return replace(dataset, collections=collections, data=_Spliced(dataset.data, origins))


@dataclass(frozen=True)
class _Spliced(DataSource):
    """Data of one source, some of them replaced by another's."""

    own: DataSource
    origins: Origins

    def _of(self, collection: str, sensor: str) -> Tuple[DataSource, str]:
        origin = self.origins.get((collection, sensor))
        return (
            (self.own, collection) if origin is None else (origin.dataset.data, origin.collection)
        )

    def read(self, collection: str, sensor: str) -> Any:
        source, key = self._of(collection, sensor)
        return source.read(key, sensor)

    def has_data(self, collection: str, sensor: str) -> bool:
        source, key = self._of(collection, sensor)
        return source.has_data(key, sensor)


@dataclass(frozen=True)
class _Longer(DataSource):
    """The same data, but for the ranges of one LiDAR."""

    own: DataSource
    sensor: str
    offset_m: float

    def read(self, collection: str, sensor: str) -> Any:
        data = self.own.read(collection, sensor)
        if sensor != self.sensor:
            return data
        ranges = np.linalg.norm(data, axis=1, keepdims=True)
        return data * (1.0 + self.offset_m / ranges)

    def has_data(self, collection: str, sensor: str) -> bool:
        return self.own.has_data(collection, sensor)


def with_long_ranges(dataset: Dataset, sensor: str, offset_m: float) -> Dataset:
    """Return the dataset in which a LiDAR reads all distances too long by an offset."""
    return replace(dataset, data=_Longer(dataset.data, sensor, offset_m))


def with_moved_board(
    scene: SyntheticDataset,
    rig: Rig,
    moves: Mapping[Tuple[str, str], np.ndarray],
    rng: np.random.Generator,
) -> Dataset:
    """Return the dataset in which the board moved before some of the sensors looked at it.

    Args:
        scene: a dataset of the rig with one pattern.
        rig: its sensors at their true poses.
        moves: by (collection, sensor), (4, 4) of the world, about the world's origin.
        rng: of the noise.
    """
    (pattern,) = scene.dataset.patterns
    origins: Dict[Tuple[str, str], Origin] = {}
    for (key, sensor), move in moves.items():
        pose = move @ scene.truth.boards[(pattern, key)]
        other = make_dataset(rig, {pattern: [pose]}, Noise(), rng)
        origins[(key, sensor)] = Origin(other.dataset, _KEY)
    return with_detections_from(scene.dataset, origins)


def move_about(centre: np.ndarray, turn: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Return the motion (4, 4) that turns by a vector [rad] about a centre and then shifts [m]."""
    rotation = se3.rotation_from_rotation_vector(turn)
    return se3.transform(rotation, centre - rotation @ centre + shift)


def with_renumbered_corners(dataset: Dataset, collection: str, sensor: str, how: str) -> Dataset:
    """Return the dataset in which a camera's corners are numbered from another side of the board.

    Args:
        dataset: with whole or partial detections.
        collection: whose label.
        sensor: a camera that sees a pattern in it.
        how: ``turned`` by half a turn, or ``mirrored``.
    """
    labels = dict(dataset.collections[collection].labels)
    for (name, pattern), label in list(labels.items()):
        if name != sensor or not isinstance(label, RgbLabel):
            continue
        columns = dataset.patterns[pattern].columns
        count = dataset.patterns[pattern].corner_count
        row, column = np.divmod(label.ids, columns)
        ids = count - 1 - label.ids if how == TURNED else row * columns + columns - 1 - column
        order = np.argsort(ids)
        labels[(name, pattern)] = RgbLabel(ids[order], label.pixels[order])
    changed = replace(dataset.collections[collection], labels=labels)
    return replace(dataset, collections={**dataset.collections, collection: changed})
