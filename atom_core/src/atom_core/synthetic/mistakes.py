"""What goes wrong when people collect: wrong labels, boards, units, intrinsics, arms.

Each function returns a dataset in which something is otherwise than the dataset says.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Callable, Dict, Iterable, Mapping, NamedTuple, Optional, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.rectangle import Rectangle
from atom_core.model.dataset import Dataset, DataSource
from atom_core.model.labels import RangeLabel, RgbLabel
from atom_core.model.transforms import Edge
from atom_core.synthetic.dataset import SyntheticDataset, make_dataset
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.rig import Rig

TURNED, MIRRORED = "turned", "mirrored"
_KEY = "000"

Change = Callable[[np.ndarray], np.ndarray]


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
class _Changed(DataSource):
    """The same data, but for some sensors'."""

    own: DataSource
    changes: Mapping[str, Change]

    def read(self, collection: str, sensor: str) -> Any:
        data = self.own.read(collection, sensor)
        return self.changes[sensor](data) if sensor in self.changes else data

    def has_data(self, collection: str, sensor: str) -> bool:
        return self.own.has_data(collection, sensor)


# ------------------------------------------------------------------------- data of range sensors


def with_changed_data(dataset: Dataset, changes: Mapping[str, Change]) -> Dataset:
    """Return the dataset in which the data of some sensors, by name, are changed."""
    return replace(dataset, data=_Changed(dataset.data, changes))


def with_long_ranges(dataset: Dataset, sensor: str, offset_m: float) -> Dataset:
    """Return the dataset in which a LiDAR reads all distances too long by an offset."""

    def longer(points: np.ndarray) -> np.ndarray:
        return points * (1.0 + offset_m / np.linalg.norm(points, axis=1, keepdims=True))

    return with_changed_data(dataset, {sensor: longer})


def with_mirrored_points(dataset: Dataset, sensor: str) -> Dataset:
    """Return the dataset in which the points of a LiDAR are mirrored in y."""
    return with_changed_data(dataset, {sensor: lambda points: points * [1.0, -1.0, 1.0]})


def with_turned_rays(
    dataset: Dataset,
    sensor: str,
    *,
    azimuth_scale: float = 0.0,
    elevation_scale: float = 0.0,
    elevation_offset_rad: float = 0.0,
) -> Dataset:
    """Return the dataset in which a LiDAR has all azimuths or elevations too large.

    Args:
        dataset: any.
        sensor: the LiDAR.
        azimuth_scale: by which part, from its x axis.
        elevation_scale: likewise, above the plane across its z axis.
        elevation_offset_rad: and by how much.
    """

    def turned(points: np.ndarray) -> np.ndarray:
        x, y, z = points.T
        azimuth = (1.0 + azimuth_scale) * np.arctan2(y, x)
        elevation = np.arctan2(z, np.hypot(x, y)) * (1.0 + elevation_scale) + elevation_offset_rad
        flat = np.linalg.norm(points, axis=1) * np.cos(elevation)
        sine = np.linalg.norm(points, axis=1) * np.sin(elevation)
        return np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), sine])

    return with_changed_data(dataset, {sensor: turned})


def with_longer_depths(dataset: Dataset, sensor: str, offset_m: float) -> Dataset:
    """Return the dataset in which the depths of a camera are too far by an offset."""
    return with_changed_data(dataset, {sensor: lambda image: image + offset_m})


def with_scaled_depths(dataset: Dataset, sensor: str, factor: float) -> Dataset:
    """Return the dataset in which the depths of a camera are too far by a factor."""
    return with_changed_data(dataset, {sensor: lambda image: factor * image})


def with_depths_in_steps(dataset: Dataset, sensor: str, step_per_m: float) -> Dataset:
    """Return the dataset in which a depth camera knows 1 / z in steps only [1/m]."""

    def rounded(image: np.ndarray) -> np.ndarray:
        return 1.0 / (step_per_m * np.maximum(np.round(1.0 / (step_per_m * image)), 1.0))

    return with_changed_data(dataset, {sensor: rounded})


# ------------------------------------------------------------- what the configuration has wrong


def with_scaled_boards(dataset: Dataset, factor: float) -> Dataset:
    """Return the dataset whose configuration has the boards too large by a factor."""
    patterns = {}
    for name, pattern in dataset.patterns.items():
        centre, half = factor * pattern.border.centre, factor * pattern.border.half_size
        patterns[name] = replace(
            pattern,
            square_m=factor * pattern.square_m,
            corners_by_id=factor * pattern.corners_by_id,
            border=Rectangle(*(centre - half), *(centre + half)),
        )
    return replace(dataset, patterns=patterns)


def with_longer_prints(dataset: Dataset, share: float) -> Dataset:
    """Return the dataset whose boards' prints are longer in x than its configuration has them."""
    patterns = {
        name: replace(p, corners_by_id=p.corners_by_id / [1.0 + share, 1.0])
        for name, p in dataset.patterns.items()
    }
    return replace(dataset, patterns=patterns)


def with_shifted_prints(dataset: Dataset, shift_m: Tuple[float, float]) -> Dataset:
    """Return the dataset whose configuration has the prints beside their place by (x, y)."""
    patterns = {
        name: replace(p, corners_by_id=p.corners_by_id + np.array(shift_m))
        for name, p in dataset.patterns.items()
    }
    return replace(dataset, patterns=patterns)


def with_scaled_focal_length(dataset: Dataset, sensor: str, factor: float) -> Dataset:
    """Return the dataset that has the focal lengths of a camera too long by a factor."""
    return _with_intrinsics(
        dataset, {sensor: lambda K: K * [[factor, 1.0, 1.0], [1.0, factor, 1.0], [1.0, 1.0, 1.0]]}
    )


def with_shifted_centre(dataset: Dataset, sensor: str, right_px: float) -> Dataset:
    """Return the dataset that has the image centre of a camera too far right."""
    return _with_intrinsics(
        dataset, {sensor: lambda K: K + [[0.0, 0.0, right_px], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]}
    )


def with_swapped_intrinsics(dataset: Dataset, one: str, other: str) -> Dataset:
    """Return the dataset that has the K of two cameras the wrong way round."""
    cameras = {name: dataset.sensors[name].camera for name in (one, other)}
    matrices = {name: camera.K for name, camera in cameras.items() if camera is not None}
    return _with_intrinsics(
        dataset, {one: lambda _: matrices[other], other: lambda _: matrices[one]}
    )


def _with_intrinsics(dataset: Dataset, changes: Mapping[str, Change]) -> Dataset:
    """Return the dataset with the K (3, 3) of some cameras, by sensor, changed."""
    sensors = dict(dataset.sensors)
    for name, change in changes.items():
        camera = sensors[name].camera
        assert camera is not None
        sensors[name] = replace(sensors[name], camera=replace(camera, K=change(camera.K)))
    return replace(dataset, sensors=sensors)


def with_edge_off(
    dataset: Dataset, child: str, metres: float, degrees: float, rng: np.random.Generator
) -> Dataset:
    """Return the dataset whose collections have a frame beside its place, each by another amount.

    Args:
        dataset: in which the frame has one parent.
        child: the frame, say a flange.
        metres: root of the mean squared length of the shift.
        degrees: likewise of the turn.
        rng: of both.
    """
    first = next(iter(dataset.collections.values()))
    edge = next(edge for edge in first.transforms if edge.child == child)
    changes: Dict[str, Dict[Edge, np.ndarray]] = {}
    for key, collection in dataset.collections.items():
        turn, shift = rng.normal(size=(2, 3)) * [[np.radians(degrees)], [metres]] / np.sqrt(3.0)
        off = se3.transform(se3.rotation_from_rotation_vector(turn), shift)
        changes[key] = {edge: collection.transforms[edge] @ off}
    return dataset.with_transforms(changes)


# ------------------------------------------------------------------------- labels of other boards


def exchange(
    dataset: Dataset, sensor: str, share: float, rng: np.random.Generator
) -> Dict[str, str]:
    """Draw which of a sensor's collections are exchanged in a ring: from which each one takes."""
    keys = [key.collection for key, _ in dataset.detections() if key.sensor == sensor]
    chosen = list(rng.choice(keys, max(int(round(share * len(keys))), 2), replace=False))
    return dict(zip(chosen, [*chosen[1:], chosen[0]]))


def with_exchanged_data(dataset: Dataset, sensor: str, taken_from: Mapping[str, str]) -> Dataset:
    """Return the dataset in which a sensor's labels and data are those of other collections."""
    origins = {(key, sensor): Origin(dataset, other) for key, other in taken_from.items()}
    return with_detections_from(dataset, origins)


def with_exchanged_labels(dataset: Dataset, sensor: str, taken_from: Mapping[str, str]) -> Dataset:
    """Return the dataset in which a LiDAR's labels are of other collections, not its clouds.

    Indices beyond the end of a cloud are left out.
    """
    collections = dict(dataset.collections)
    for key, other in taken_from.items():
        labels = {k: v for k, v in collections[key].labels.items() if k[0] != sensor}
        count = len(dataset.data.read(key, sensor))
        for place, label in dataset.collections[other].labels.items():
            if place[0] == sensor and isinstance(label, RangeLabel):
                inside, limit = label.indices, label.limit_indices
                labels[place] = RangeLabel(inside[inside < count], limit[limit < count])
        collections[key] = replace(collections[key], labels=labels)
    return replace(dataset, collections=collections)


# ------------------------------------------------------------------ boards that move or are turned


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


def with_moved_sensor(
    scene: SyntheticDataset,
    rig: Rig,
    sensor: str,
    first: str,
    move: np.ndarray,
    rng: np.random.Generator,
) -> Dataset:
    """Return the dataset in which a sensor was moved before some collection, and stayed there.

    Args:
        scene: a dataset of the rig with one pattern.
        rig: its sensors at their true poses.
        sensor: which.
        first: key of the first collection after it.
        move: (4, 4) of the world, about the world's origin.
        rng: of the noise.
    """
    keys = list(scene.dataset.collections)
    later = keys[keys.index(first) :]
    back = se3.inverse(move)  # to the sensor, the board moved the other way
    return with_moved_board(scene, rig, {(key, sensor): back for key in later}, rng)


def with_displaced_frame(
    dataset: Dataset, child: str, move: np.ndarray, collections: Optional[Iterable[str]] = None
) -> Dataset:
    """Return the dataset in which a frame is not where its transform has it.

    Args:
        dataset: whose transforms are told wrong.
        child: the frame.
        move: (4, 4) of the frame, from where it truly is.
        collections: in which; None: in all of them.
    """
    told = {}
    for key in dataset.collections if collections is None else collections:
        transforms = dataset.collections[key].transforms
        (edge,) = (edge for edge in transforms if edge.child == child)
        told[key] = {edge: transforms[edge] @ move}
    return dataset.with_transforms(told)


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
