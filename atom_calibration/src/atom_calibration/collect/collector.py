"""Labeled frames in, collections on the disk out; offline and live alike."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, Mapping, Optional, Protocol, Tuple

import numpy as np

from atom_calibration.collect.common_motion import CommonMotion
from atom_calibration.collect.joint_positions import joint_states
from atom_calibration.collect.quality import QUALITY_FILE, QualityLog
from atom_calibration.collect.repeated_stops import CollectedStops
from atom_calibration.collect.selection import (
    Moment,
    RecentFrames,
    check_still,
    choose_frames,
    same_place,
    too_far,
)
from atom_calibration.errors import CollectionError, NoDataError, TransformError
from atom_calibration.modalities.frames import Frame
from atom_calibration.sources.contradictions import Contradiction
from atom_calibration.sources.transform_tree import TransformTree, edges_at
from atom_core.errors import AtomError
from atom_core.io.atomic import prepare_output_folder
from atom_core.io.caveats import document_with_caveats
from atom_core.io.collections import CollectionStore, StoredCollection
from atom_core.io.dataset_writer import (
    collection_document,
    data_entry,
    initial_board_document,
    new_document,
    write_data_file,
)
from atom_core.io.images import write_image
from atom_core.io.seeds import SEEDS_FILE, Seed, write_seeds
from atom_core.model.caveats import Caveat
from atom_core.model.config import CalibrationConfig
from atom_core.model.dataset import Collection, Dataset
from atom_core.model.joints import JointState
from atom_core.model.labels import Label
from atom_core.model.pattern import Pattern
from atom_core.model.robot import Joint
from atom_core.model.sensor import Sensor
from atom_core.model.transforms import Edge, FrameGraph, chain_transform

PICTURES_FOLDER = "pictures"
WRITTEN_BESIDE = (SEEDS_FILE, QUALITY_FILE, PICTURES_FOLDER)  # what there is but for the dataset
_AROUND_S = 0.25  # of a time that was asked for: speeds need two sights of the board
_LONGEST_WHOLE_S = 0.5  # around a time that was asked for all data are remembered, no longer
_LEAST_MEMORY_S = 1.0  # so that a message can say how far away data are


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
        caveats: returns what is in doubt by now, to be kept with the dataset.
        contradicted: edges of which messages contradict each other, as far as is known by now.
        see_joints: is told the joints of each collection, and its time [s].
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
    caveats: Callable[[], Tuple[Caveat, ...]] = field(default=lambda: ())
    contradicted: Mapping[Edge, Contradiction] = field(default_factory=dict)
    see_joints: Callable[[float, Mapping[str, JointState]], None] = field(
        default=lambda _time_s, _joints: None
    )


class Collector:
    """Takes collections out of a stream of labeled frames.

    Attributes:
        taken: number of detections by sensor, in the collections taken.
        refused: why moments became no collection.
        repeated: number of moments whose data are those of the collection before.
        between: number of moments that lie between the data, faster than which they follow.
        missed: number of moments that have no data near enough, of those that follow each other.
        stayed: number of stops at the place of the stop before.
        again: number of stops that were collected before the recording was played again.
        deleted: number of collections that somebody had removed.
        max_skew_s: greatest difference of the stamps in a collection.
        quality: how well each sensor sees the board, and advice.
        apart_ms: by sensor that saw the board and is not in a collection, how long all stamps of
            that collection would last with its own.
    """

    def __init__(self, setup: Setup, moments: Moments):
        """Start; nothing is written before the first collection."""
        self._setup, self._moments = setup, moments
        skew = self.max_skew_s = setup.config.max_duration_between_msgs_s
        whole_s = 0.0 if setup.at_stops else min(2 * skew, _LONGEST_WHOLE_S)
        self._recent = RecentFrames(max(moments.memory_s + 2 * skew, _LEAST_MEMORY_S), whole_s)
        self._last: Tuple[str, Mapping[str, Frame]] = ("", {})  # key and frames
        self._seeds: Dict[str, List[Seed]] = {}  # by collection
        self._detected: Dict[str, List[str]] = {}  # sensors by collection
        self._ways: Dict[str, List[Tuple[Edge, float]]] = {}  # edges, with when, by collection
        self.taken: Counter = Counter(dict.fromkeys(setup.sensors, 0))
        self.reasons: Dict[str, Counter] = {name: Counter() for name in setup.sensors}
        self.refused: List[str] = []
        self.repeated, self.between, self.missed, self.stayed, self.again = 0, 0, 0, 0, 0
        self.deleted = 0
        self.apart_ms: Dict[str, List[float]] = {}
        self.quality = QualityLog(setup.config, setup.sensors, setup.patterns, setup.warn)
        self._doubtful: List[Tuple[Moment, str]] = []  # looked like a stop to some sensor
        self._done: List[Moment] = []
        self._stops = CollectedStops()
        self._motion = CommonMotion(setup.patterns)

    @property
    def passed(self) -> List[str]:
        """Why what looked like a stop became no collection, nor others of that time."""
        return [
            why
            for moment, why in self._doubtful
            if not any(
                done.start_s <= moment.end_s and moment.start_s <= done.end_s for done in self._done
            )
        ]

    def add(self, frame: Frame) -> List[str]:
        """Take note of a labeled frame; return the keys of collections that were written."""
        for labeled in frame.labels.values():
            if not labeled.detected:
                self.reasons[frame.sensor.name][labeled.reason] += 1
        self._recent.note(frame)
        keys = [key for m in self._moments.add(frame) for key in self._take_or_refuse(m)]
        self._recent.forget_old(frame.stamp_s)  # after a gap, what was before it is taken first
        return keys

    def label_again(self, frame: Frame) -> None:
        """Take a sensor's newest frame with other labels: a seed was moved.

        What was labeled before, from another seed, is not collected any more.
        """
        self._recent.label_again(frame)

    def begin_anew(self, moments: Moments) -> None:
        """Forget the data of the last seconds: time went back. Collections stay.

        Stops of which there is a collection are not taken once more by themselves.
        """
        self._moments = moments
        self._stops.begin_anew()
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
            raise self._recent.why_nothing(moment, skew)
        try:
            check_still(chosen, self._recent, moment)
        except CollectionError as error:
            if setup.at_stops and not asked:  # to some sensor it only looked like a stop
                self._doubtful.append((moment, str(error)))
                return None
            raise
        if not asked and self._is_known(moment, chosen):
            return None
        key = write_collection(setup, chosen)
        self._done.append(moment)
        self._stops.add(key, moment, chosen)
        for name, apart_s in too_far(frames, chosen).items():
            self.apart_ms.setdefault(name, []).append(1000.0 * apart_s)
        self._last = (key, chosen)
        self._remember(key, chosen)
        is_stop = setup.at_stops and not asked
        around_s = 0.0 if is_stop else _AROUND_S
        speeds = self._recent.speeds(moment.start_s - around_s, moment.end_s + around_s)
        tree = setup.transforms(min(frame.stamp_s for frame in chosen.values()))
        hangs_on = [(frame.sensor.frame, frame.stamp_s) for frame in chosen.values()]
        hangs_on += _board_stamps(setup, chosen).items()
        self._ways[key] = [
            (edge, time_s)
            for frame, time_s in hangs_on
            for edge in tree.path_here(setup.config.world_link, frame)
        ]
        self.quality.add(key, chosen, speeds, tree)
        self._motion.add(key, chosen, tree, is_stop)
        self.quality.write(setup.store.folder)
        setup.caveats()  # which tells what is new
        return key

    def delete(self, key: str) -> None:
        """Remove a collection; the place of the last one may then be taken again.

        Raises:
            DatasetError: there is none of that key.
        """
        self._remove(key)
        self.deleted += 1

    def _remove(self, key: str) -> None:
        self._setup.store.delete(key)
        self.taken.subtract(self._detected.pop(key, []))
        if self._last[0] == key:
            self._last = ("", {})
        self._stops.delete(key)
        self._motion.delete(key)
        self._seeds.pop(key, None)
        self._write_seeds()
        self.quality.delete(key)
        self.quality.write(self._setup.store.folder)

    def withdraw(self) -> None:
        """Remove collections of whose transforms it came out later that nobody knows them.

        Messages have to contradict each other a number of times before that is certain.
        """
        for key in [key for key in self._ways if key in self._setup.store.keys]:
            for edge, time_s in self._ways[key]:
                contradiction = self._setup.contradicted.get(edge)
                if contradiction is not None and contradiction.covers(time_s):
                    self._remove(key)
                    self.refused.append(contradiction.sentence)
                    self._setup.warn(f"collection {key} is removed: {contradiction.sentence}")
                    break

    def _is_known(self, moment: Moment, chosen: Mapping[str, Frame]) -> bool:
        """Tell whether a moment gives the collection before once more."""
        before = self._last[1]
        if self._setup.at_stops:
            if self._stops.has(moment, chosen):
                self.again += 1
                return True
            known = same_place(chosen, before)
            is_later = bool(self._done) and moment.start_s > self._done[-1].end_s
            self.stayed += known and is_later
            self._done += [moment] * known
            return known
        stamps = [{name: f.stamp_s for name, f in of.items()} for of in (chosen, before)]
        self.repeated += stamps[0] == stamps[1]
        return stamps[0] == stamps[1]

    def _take_or_refuse(self, moment: Moment) -> Iterator[str]:
        try:
            key = self.take(moment)
        except (CollectionError, TransformError) as error:
            self._refuse(moment, error)
            return
        if key is not None:
            yield key

    def _refuse(self, moment: Moment, error: AtomError) -> None:
        """Say why a moment is no collection; of moments by the hundred once, and how many."""
        if isinstance(error, NoDataError) and moment.every_s is not None:
            self.between += error.between
            self.missed += not error.between
            if error.between or self.missed > 1:
                return
        self.refused.append(str(error))
        self._setup.warn(f"no collection is taken: {error}")

    def _remember(self, key: str, chosen: Mapping[str, Frame]) -> None:
        self._detected[key] = [name for name, frame in chosen.items() if frame.detections]
        self.taken.update(self._detected[key])
        self._seeds[key] = [
            Seed(name, seed, f.stamp_s) for name, f in chosen.items() for seed in f.seeds.values()
        ]
        self._write_seeds()

    def keep_caveats(self) -> None:
        """Write what has come into doubt since the first collection."""
        of_motion = self._motion.caveats
        for caveat in of_motion:
            self._setup.warn(caveat.sentence)
        self._setup.store.keep_caveats((*self._setup.caveats(), *of_motion))

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
    for frame in frames.values():
        frame.unpack()
    stamps = {f.sensor.frame: f.stamp_s for f in frames.values()}
    tree = setup.transforms(min(stamps.values()))
    boards = _board_stamps(setup, frames)
    transforms = edges_at(tree, setup.config.world_link, stamps, boards)
    data = {n: _write_data(store.folder, key, frame, setup.warn) for n, frame in frames.items()}
    joints = joint_states(setup.joints, transforms)
    setup.see_joints(float(np.mean(list(stamps.values()))), joints)
    collection = Collection(key, _labels(setup, frames), transforms, joints)
    document = collection_document(collection, setup.sensors, setup.patterns, data)
    if not store.has_header:
        store.write_header(_header(setup, key, transforms))
    if setup.pictures:
        folder = prepare_output_folder(store.folder / PICTURES_FOLDER, overwrite=True)
        for name, frame in frames.items():
            write_image(folder / f"{key}_{name}.jpg", frame.ros.draw(frame))
    store.save(StoredCollection(key, document, _initial_boards(setup, frames, transforms)))
    return key


def _board_stamps(setup: Setup, frames: Mapping[str, Frame]) -> Dict[str, float]:
    """Return when boards were seen [s], on the average, by the frame that they hang on."""
    seen: Dict[str, List[float]] = {}
    for sensor, pattern in _labels(setup, frames):
        parent = setup.patterns[pattern].parent_frame
        seen.setdefault(parent, []).append(frames[sensor].stamp_s)
    return {frame: float(np.mean(stamps_s)) for frame, stamps_s in seen.items()}


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
    document = new_document(dataset, name=setup.name, time_s=float(int(time.time())))
    return document_with_caveats(document, setup.caveats())


def _labels(setup: Setup, frames: Mapping[str, Frame]) -> Dict[Tuple[str, str], Label]:
    """Return what was detected, by sensor and pattern."""
    return {
        (name, pattern): labeled.label
        for name, frame in frames.items()
        for pattern, labeled in frame.labels.items()
        if pattern in setup.patterns and labeled.detected
    }


def _initial_boards(
    setup: Setup, frames: Mapping[str, Frame], transforms: Mapping[Edge, np.ndarray]
) -> Dict[str, Any]:
    """Return the pose of each board by the first camera that saw it, as ATOM has it."""
    graph = FrameGraph(transforms)
    initial: Dict[str, Any] = {}
    for name, pattern in setup.patterns.items():
        placed: Optional[Tuple[str, np.ndarray]] = None
        for frame in frames.values():
            pose = frame.board_pose(pattern) if name in frame.labels else None
            if pose is not None:
                chain = graph.chain(pattern.parent_frame, frame.sensor.frame)
                placed = (frame.sensor.name, chain_transform(chain, transforms) @ pose)
                break
        initial[name] = initial_board_document(pattern, placed)
    return initial


def _write_data(folder: Path, key: str, frame: Frame, warn: Callable[[str], None]) -> Any:
    """Write the data file of a frame; return the message without its data."""
    sensor, data = frame.sensor, frame.ros.to_dataset(frame.data)
    report = write_data_file(folder, sensor, key, data)
    lost = "" if frame.ros.lost_in_file is None else frame.ros.lost_in_file(frame, report)
    if lost:
        warn(f"{frame.place}: {lost}")
    return data_entry(sensor, key, data, {**frame.header, "frame_id": sensor.frame})
