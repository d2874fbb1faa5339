"""Labeled frames in, collections on the disk out; offline and live alike."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, Mapping, Optional, Protocol, Tuple

import numpy as np

from atom_calibration.collect.joint_positions import joint_documents
from atom_calibration.collect.selection import (
    Moment,
    RecentFrames,
    check_still,
    choose_frames,
    same_place,
)
from atom_calibration.errors import CollectionError, TransformError
from atom_calibration.labels.frame_labeler import camera_T_pattern
from atom_calibration.labels.frames import Frame
from atom_calibration.messages.conversions import cloud_xyz
from atom_calibration.show.pictures import labeled_picture
from atom_calibration.sources.transform_tree import TransformTree, edges_at
from atom_core.io.atomic import prepare_output_folder
from atom_core.io.collections import CollectionStore, StoredCollection
from atom_core.io.dataset_json import transform_document
from atom_core.io.dataset_writer import data_file_name, new_document
from atom_core.io.images import MAX_DEPTH_M, write_depth_png, write_image
from atom_core.io.pcd import write_pcd
from atom_core.io.seeds import SEEDS_FILE, Seed, write_seeds
from atom_core.model.config import CalibrationConfig
from atom_core.model.dataset import Collection, Dataset, board_edge
from atom_core.model.labels import RangeLabel
from atom_core.model.pattern import Pattern
from atom_core.model.robot import Joint
from atom_core.model.sensor import DEPTH, LIDAR3D, RGB, Sensor
from atom_core.model.transforms import Edge, FrameGraph, chain_transform

PICTURES_FOLDER = "pictures"
_FLOAT32 = 7  # sensor_msgs/PointField


class Moments(Protocol):
    """Decides when a collection is taken; see ``selection``."""

    memory_s: float

    def add(self, frame: Frame) -> Iterator[Moment]:
        """Take note of a frame; yield moments that have become certain."""

    def finish(self) -> Iterator[Moment]:
        """Yield those that only the end makes certain."""


@dataclass(frozen=True)
class Setup:
    """What is collected, and where to.

    Attributes:
        config: the calibration.
        sensors, patterns: by name.
        transforms: returns the tree around a time [s].
        store: where collections go.
        name: of the dataset.
        pictures: write a picture of each labeled frame.
        at_stops: moments come from stops, where two in a row at one place are one.
        warn: is told, in one line, what the user should know.
        joints: of the description, whose positions are recorded, by name.
    """

    config: CalibrationConfig
    sensors: Mapping[str, Sensor]
    patterns: Mapping[str, Pattern]
    transforms: Callable[[float], TransformTree]
    store: CollectionStore
    name: str = "dataset"
    pictures: bool = False
    at_stops: bool = True
    warn: Callable[[str], None] = field(default=lambda _text: None)
    joints: Mapping[str, Joint] = field(default_factory=dict)


class Collector:
    """Takes collections out of a stream of labeled frames.

    Attributes:
        taken: number of detections by sensor, in the collections taken.
        refused: why moments became no collection.
    """

    def __init__(self, setup: Setup, moments: Moments):
        """Start; nothing is written before the first collection."""
        self._setup, self._moments = setup, moments
        skew = setup.config.max_duration_between_msgs_s
        self._recent = RecentFrames(moments.memory_s + 2 * skew)
        self._last: Tuple[str, Mapping[str, Frame]] = ("", {})  # key and frames
        self._seeds: Dict[str, List[Seed]] = {}  # by collection
        self._detected: Dict[str, List[str]] = {}  # sensors by collection
        self.taken: Counter = Counter(dict.fromkeys(setup.sensors, 0))
        self.reasons: Dict[str, Counter] = {name: Counter() for name in setup.sensors}
        self.refused: List[str] = []

    def add(self, frame: Frame) -> List[str]:
        """Take note of a labeled frame; return the keys of collections that were written."""
        for labeled in frame.labels.values():
            if not labeled.detected:
                self.reasons[frame.sensor.name][labeled.reason] += 1
        self._recent.add(frame)
        return [key for m in self._moments.add(frame) for key in self._take_or_refuse(m)]

    def label_again(self, frame: Frame) -> None:
        """Take a sensor's newest frame with other labels: a seed was moved.

        What was labeled before, from another seed, is not collected any more.
        """
        self._recent.label_again(frame)

    def begin_anew(self, moments: Moments) -> None:
        """Forget the data of the last seconds: time went back. Collections stay."""
        self._moments = moments
        self._recent.clear()

    def finish(self) -> List[str]:
        """Write what only the end of the stream makes certain; return the keys."""
        return [key for m in self._moments.finish() for key in self._take_or_refuse(m)]

    def take(self, moment: Moment, asked: bool = False) -> Optional[str]:
        """Write a collection; None if it was no stop, or at the place of the last collection.

        Args:
            moment: when.
            asked: somebody wants this one: it is taken at the place of the last one too, and if
                the board moved that is an error.

        Raises:
            CollectionError: nothing was detected, or the board moved.
            TransformError: the transforms of that time are not known.
            OutputError: it cannot be written; those before it are whole.
        """
        setup, skew = self._setup, self._setup.config.max_duration_between_msgs_s
        frames = self._recent.between(moment.start_s, moment.end_s)
        chosen = choose_frames(frames, moment, skew)
        if not any(frame.detections for frame in chosen.values()):
            raise CollectionError(
                f"time {moment.start_s:.3f}: no sensor sees the board; choose another time"
            )
        try:
            check_still(chosen, self._recent, moment)
        except CollectionError:
            if setup.at_stops and not asked:  # to some sensor it only looked like a stop
                return None
            raise
        if setup.at_stops and not asked and same_place(chosen, self._last[1]):
            return None
        key = write_collection(setup, chosen)
        self._last = (key, chosen)
        self._remember(key, chosen)
        return key

    def delete(self, key: str) -> None:
        """Remove a collection; the place of the last one may then be taken again.

        Raises:
            DatasetError: there is none of that key.
        """
        self._setup.store.delete(key)
        self.taken.subtract(self._detected.pop(key, []))
        if self._last[0] == key:
            self._last = ("", {})
        self._seeds.pop(key, None)
        self._write_seeds()

    def _take_or_refuse(self, moment: Moment) -> Iterator[str]:
        try:
            key = self.take(moment)
        except (CollectionError, TransformError) as error:
            self.refused.append(str(error))
            self._setup.warn(f"no collection is taken: {error}")
            return
        if key is not None:
            yield key

    def _remember(self, key: str, chosen: Mapping[str, Frame]) -> None:
        self._detected[key] = [name for name, frame in chosen.items() if frame.detections]
        self.taken.update(self._detected[key])
        self._seeds[key] = [
            Seed(name, seed, f.stamp_s) for name, f in chosen.items() for seed in f.seeds.values()
        ]
        self._write_seeds()

    def _write_seeds(self) -> None:
        seeds = [seed for of_one in self._seeds.values() for seed in of_one]
        write_seeds(self._setup.store.folder / SEEDS_FILE, seeds, self._setup.sensors)


# --- one collection to files ------------------------------------------------------------------


def write_collection(setup: Setup, frames: Mapping[str, Frame]) -> str:
    """Write the data files of a collection, then the collection; return its key.

    Args:
        setup: the sensors, and where to.
        frames: one of each sensor, by its name; sensors without one have no data and no label.

    Raises:
        TransformError: the transforms of that time are not known.
        OutputError: it cannot be written.
    """
    store, key = setup.store, setup.store.next_key
    stamps = {f.sensor.frame: f.stamp_s for f in frames.values()}
    tree = setup.transforms(min(stamps.values()))
    transforms = edges_at(tree, setup.config.world_link, stamps)
    data = {n: _write_data(store.folder, key, frame, setup.warn) for n, frame in frames.items()}
    document = {
        "data": data,
        "labels": _labels(setup, frames),
        "transforms": {str(e): transform_document(e, matrix) for e, matrix in transforms.items()},
        "joints": joint_documents(setup.joints, transforms),
        "additional_data": {},
    }
    if not store.has_header:
        store.write_header(_header(setup, key, transforms))
    if setup.pictures:
        folder = prepare_output_folder(store.folder / PICTURES_FOLDER, overwrite=True)
        for name, frame in frames.items():
            write_image(folder / f"{key}_{name}.jpg", labeled_picture(frame))
    store.save(StoredCollection(key, document, _initial_boards(setup, frames, transforms)))
    return key


def _header(setup: Setup, key: str, transforms: Mapping[Edge, np.ndarray]) -> Mapping[str, Any]:
    """Return a dataset's document with what holds for all collections."""
    config = replace(
        setup.config,
        sensors={
            name: replace(entry, modality=setup.sensors[name].modality)
            if name in setup.sensors
            else entry
            for name, entry in setup.config.sensors.items()
        },
    )
    dataset = Dataset(
        Path(setup.name),
        config,
        setup.sensors,
        setup.patterns,
        {key: Collection(key, {}, transforms)},
    )
    return new_document(dataset, name=setup.name, time_s=float(int(time.time())))


def _labels(setup: Setup, frames: Mapping[str, Frame]) -> Dict[str, Any]:
    labels: Dict[str, Any] = {}
    for pattern in setup.patterns:
        labels[pattern] = {}
        for name, sensor in setup.sensors.items():
            labeled = frames[name].labels.get(pattern) if name in frames else None
            form = sensor.kind.labels
            label = form.empty if labeled is None or not labeled.detected else labeled.label
            labels[pattern][name] = form.document(label)
    return labels


def _initial_boards(
    setup: Setup, frames: Mapping[str, Frame], transforms: Mapping[Edge, np.ndarray]
) -> Dict[str, Any]:
    """Return the pose of each board by the first camera that saw it, as ATOM has it."""
    graph = FrameGraph(transforms)
    initial: Dict[str, Any] = {}
    for name, pattern in setup.patterns.items():
        initial[name] = {"detected": False}
        for frame in frames.values():
            if frame.sensor.modality != RGB or name not in frame.labels:
                continue
            pose = camera_T_pattern(frame.sensor, pattern, frame.labels[name])
            if pose is None:
                continue
            chain = graph.chain(pattern.parent_frame, frame.sensor.frame)
            parent_T_pattern = chain_transform(chain, transforms) @ pose
            document = transform_document(board_edge(pattern), parent_T_pattern)
            initial[name] = {"detected": True, "sensor": frame.sensor.name, **document}
            break
    return initial


def _write_data(folder: Path, key: str, frame: Frame, warn: Callable[[str], None]) -> Any:
    """Write the data file of a frame; return the message without its data."""
    sensor, data = frame.sensor, frame.data
    name = data_file_name(sensor, key)
    document: Dict[str, Any] = {"header": {**frame.header, "frame_id": sensor.frame}}
    document["data_file"] = name
    if sensor.modality == LIDAR3D:
        points = cloud_xyz(data)
        write_pcd(folder / name, points)
        fields = [
            {"name": axis, "offset": 4 * i, "datatype": _FLOAT32, "count": 1}
            for i, axis in enumerate("xyz")
        ]
        size = {"height": 1, "width": len(points), "point_step": 12, "row_step": 12 * len(points)}
        dense = bool(np.all(np.isfinite(points)))
        return {**document, **size, "fields": fields, "is_bigendian": False, "is_dense": dense}
    height, width = data.shape[:2]
    size = {"height": height, "width": width, "is_bigendian": 0}
    if sensor.modality == DEPTH:
        report = write_depth_png(folder / name, data)
        if report.warning and _labels_lost(frame):
            warn(f"{frame.place}: {report.warning}")
        return {**document, **size, "encoding": "32FC1", "step": 4 * width}
    write_image(folder / name, data)
    return {**document, **size, "encoding": "bgr8", "step": 3 * width}


def _labels_lost(frame: Frame) -> bool:
    """Tell whether labeled depths are farther than a file can hold."""
    labels = [labeled.label for labeled in frame.labels.values()]
    depths = [frame.data.ravel()[x.indices] for x in labels if isinstance(x, RangeLabel)]
    return any(bool(np.any(z > MAX_DEPTH_M)) for z in depths)
