"""Labels of a dataset that a person corrects, collection by collection, with undo; knows no ROS.

What a correction does to one label stands in ``atom_core.labeling.corrections``.
"""

from __future__ import annotations

import contextlib
from dataclasses import replace
from pathlib import Path
from typing import Dict, Iterator, List, Mapping, NamedTuple, Optional, Tuple

import numpy as np

from atom_core.errors import LabelingError, SelectionError
from atom_core.io.data_files import RecentData
from atom_core.io.dataset_json import write_dataset
from atom_core.labeling import corrections
from atom_core.labeling.base import Labeled, Labeler, labeler_for
from atom_core.labeling.depth import DepthLabeler
from atom_core.labeling.polygon import polygon_mask
from atom_core.model.dataset import Dataset, DetectionKey, Label, RangeLabel, RgbLabel
from atom_core.model.sensor import DEPTH, LIDAR3D, RGB, Sensor

_MOST_STEPS = 500  # that can be undone
REACH_PX = 10.0  # a click means a corner that is so near
_OTHER_PX = 3.0  # while a corner is chosen, a click so near another one means that one

Changes = Mapping[str, Optional[Label]]  # by pattern


class ChosenCorner(NamedTuple):
    """The corner that the next click moves."""

    sensor: str
    pattern: str
    corner: int


class _Step(NamedTuple):
    """A correction: of which collection, what was done, and the datasets before and after."""

    collection: str
    words: str
    before: Dataset
    after: Dataset


class LabelCorrections:
    """The labels of a dataset, edited in one collection at a time.

    Every method that corrects returns a sentence for the user, raises an error that says why
    nothing was done, and is one step to undo.

    Attributes:
        dataset: with the corrections made so far; its data of one collection stay in memory.
        collection: the key of the one that is shown.
        pattern: the one that points and fills are added to.
        chosen: the corner that the next click moves, if any.
    """

    def __init__(self, dataset: Dataset):
        """Begin with the first collection.

        Raises:
            SelectionError: there is none, or no pattern.
        """
        if not dataset.collections or not dataset.patterns:
            raise SelectionError(f"{dataset.source}: there are no collections to go through")
        self.dataset = replace(dataset, data=RecentData(dataset.data))
        self._initial = self._saved = self.dataset
        self.keys = list(dataset.collections)
        self.collection, self.pattern = self.keys[0], next(iter(dataset.patterns))
        self.chosen: Optional[ChosenCorner] = None
        self._done: List[_Step] = []
        self._undone: List[_Step] = []
        self._labelers: Dict[Tuple[str, str], Labeler] = {}

    # --- what is shown ------------------------------------------------------------------------

    @property
    def undo_steps(self) -> int:
        """How many corrections can be undone."""
        return len(self._done)

    @property
    def redo_steps(self) -> int:
        """How many can be made again."""
        return len(self._undone)

    @property
    def unsaved(self) -> bool:
        """Tell whether something differs from what was saved last."""
        return self.dataset is not self._saved

    def labels(self, sensor: str) -> Dict[str, Label]:
        """Return the labels of a sensor in the collection that is shown, by pattern."""
        labels = self.dataset.collections[self.collection].labels
        patterns = self.dataset.patterns
        return {name: labels[(sensor, name)] for name in patterns if (sensor, name) in labels}

    def changed(self) -> List[DetectionKey]:
        """Return the labels that differ from the dataset's."""
        return [
            DetectionKey(key, sensor, pattern)
            for key in self.keys
            if self.dataset.collections[key] is not self._initial.collections[key]
            for sensor in self.dataset.sensors
            for pattern in self.dataset.patterns
            if not _same(
                self.dataset.collections[key].labels.get((sensor, pattern)),
                self._initial.collections[key].labels.get((sensor, pattern)),
            )
        ]

    def turn(self, steps: int) -> str:
        """Go so many collections further; return the key."""
        return self.show(self.keys[(self.keys.index(self.collection) + steps) % len(self.keys)])

    def show(self, key: str) -> str:
        """Go to a collection; return its key.

        Raises:
            SelectionError: there is none of that key.
        """
        if key not in self.keys:
            raise SelectionError(
                f"there is no collection '{key}'; use one of {', '.join(self.keys)}"
            )
        self.collection, self.chosen = key, None
        return key

    def select_pattern(self, name: str) -> str:
        """Choose the pattern that points and fills are added to.

        Raises:
            SelectionError: there is none of that name.
        """
        if name not in self.dataset.patterns:
            known = ", ".join(self.dataset.patterns)
            raise SelectionError(f"there is no pattern '{name}'; use one of {known}")
        self.pattern = name
        return f"points and fills are labelled as '{name}'"

    # --- points and pixels of range sensors ---------------------------------------------------

    def add_points(self, sensor: str, indices: np.ndarray, border: bool) -> str:
        """Label points or pixels (n,) as on the board, or on its border.

        Raises:
            LabelingError: indices beyond the data, or no returns among them.
            DatasetError: the data cannot be read.
        """
        with _of(sensor):
            usable = corrections.valid_indices(indices, self._valid(sensor))
        if len(usable) == 0:
            raise LabelingError(f"{sensor}: none of the {len(indices)} chosen points was measured")
        before = self._range_label(sensor, self.pattern)
        after = corrections.with_points(before, usable, border)
        if border:
            count = len(after.limit_indices) - (len(before.limit_indices) if before else 0)
        else:
            count = len(after.indices) - (len(before.indices) if before else 0)
        words = f"{count} points of {sensor} added {'to the border' if border else 'to the board'}"
        return self._apply(sensor, {self.pattern: after}, words)

    def remove_points(self, sensor: str, indices: np.ndarray) -> str:
        """Take points or pixels (n,) out of all labels of a sensor.

        Raises:
            LabelingError: indices beyond the data.
            DatasetError: the data cannot be read.
        """
        valid = self._valid(sensor)
        with _of(sensor):
            usable = corrections.valid_indices(indices, np.ones_like(valid))
        count = 0
        changes: Dict[str, Optional[Label]] = {}
        for name, label in self._range_labels(sensor):
            both = np.union1d(label.indices, label.limit_indices)
            count += int(np.sum(np.isin(both, usable)))
            changes[name] = corrections.without_points(label, usable)
        return self._apply(sensor, changes, f"{count} points of {sensor} removed")

    def delete_label(self, sensor: str, pattern: str = "") -> str:
        """Forget what a sensor saw of a pattern; empty: of all of them.

        Raises:
            SelectionError: there is no such sensor or pattern.
        """
        self._sensor(sensor)
        if pattern and pattern not in self.dataset.patterns:
            raise SelectionError(f"there is no pattern '{pattern}'")
        changes = dict.fromkeys([pattern] if pattern else self.dataset.patterns)
        return self._apply(sensor, changes, f"the label of {sensor} deleted")

    # --- depth images -------------------------------------------------------------------------

    def refill(self, sensor: str, polygon: np.ndarray) -> str:
        """Label a depth image anew inside a polygon (n, 2) [px].

        Raises:
            LabelingError: there is no board inside it, or it is no polygon in the image.
            DatasetError: the data cannot be read.
        """
        labeler = self._labeler(sensor, DEPTH)
        assert isinstance(labeler, DepthLabeler)
        with _of(sensor):
            found = corrections.refilled(labeler, self._depth(sensor), polygon)
        return self._relabel(sensor, found)

    def refill_from(self, sensor: str, pixel: np.ndarray) -> str:
        """Label a depth image anew from a pixel (2,) on the board.

        Raises:
            LabelingError: there is no board, or the pixel is outside the image.
            DatasetError: the data cannot be read.
        """
        labeler = self._labeler(sensor, DEPTH)
        return self._relabel(sensor, labeler.label(self._depth(sensor), pixel))

    def remove_border(self, sensor: str, polygon: np.ndarray) -> str:
        """Take the border pixels inside a polygon (n, 2) [px] out of all labels of a sensor.

        Raises:
            LabelingError: it is no polygon in the image.
        """
        shape = self._depth(sensor).shape
        with _of(sensor):
            polygon_mask(polygon, shape)
        changes: Dict[str, Optional[Label]] = {
            name: corrections.without_border(label, polygon, shape)
            for name, label in self._range_labels(sensor)
        }
        before = sum(len(label.limit_indices) for _, label in self._range_labels(sensor))
        after = sum(len(x.limit_indices) for x in changes.values() if isinstance(x, RangeLabel))
        return self._apply(sensor, changes, f"{before - after} border pixels of {sensor} removed")

    def _relabel(self, sensor: str, found: Labeled) -> str:
        if not found.detected:
            raise LabelingError(f"{sensor}: nothing is labelled: {found.reason}")
        words = f"{sensor} labelled anew" + "".join(f", though {x}" for x in found.warnings)
        return self._apply(sensor, {self.pattern: found.label}, words)

    # --- corners ------------------------------------------------------------------------------

    def click(self, sensor: str, pixel: np.ndarray) -> str:
        """Choose the corner at a pixel (2,), or move the one that is chosen there.

        Raises:
            LabelingError: there is no corner, or the pixel is outside the image.
        """
        self._check_pixel(sensor, pixel)
        chosen = self.chosen if self.chosen is not None and self.chosen.sensor == sensor else None
        found = self._corner_at(sensor, pixel, REACH_PX if chosen is None else _OTHER_PX)
        if found is not None and found != chosen:
            self.chosen = found
            return f"corner {found.corner} is chosen; click where it belongs"
        if chosen is None:
            raise LabelingError(f"{sensor}: there is no corner within {REACH_PX:g} px of the click")
        label = self._rgb_label(sensor, chosen.pattern)
        moved = corrections.with_corner_at(label, chosen.corner, pixel)
        self.chosen = None
        words = f"corner {chosen.corner} of {sensor} moved"
        return self._apply(sensor, {chosen.pattern: moved}, words)

    def remove_corner(self, sensor: str, pixel: np.ndarray) -> str:
        """Take the corner at a pixel (2,) out; where there is none, none is chosen any more.

        Raises:
            LabelingError: there is no corner, or the pixel is outside the image.
        """
        self._check_pixel(sensor, pixel)
        found = self._corner_at(sensor, pixel, REACH_PX)
        was_chosen, self.chosen = self.chosen, None
        if found is None:
            if was_chosen is not None:
                return "no corner is chosen any more"
            raise LabelingError(f"{sensor}: there is no corner within {REACH_PX:g} px of the click")
        label = corrections.without_corners(self._rgb_label(sensor, found.pattern), {found.corner})
        words = f"corner {found.corner} of {sensor} removed"
        return self._apply(sensor, {found.pattern: label}, words)

    def remove_corners(self, sensor: str, polygon: np.ndarray) -> str:
        """Take the corners inside a polygon (n, 2) [px] out.

        Raises:
            LabelingError: it is no polygon in the image.
        """
        camera = self._sensor(sensor, RGB).camera
        assert camera is not None
        with _of(sensor):
            polygon_mask(polygon, (camera.height, camera.width))
        changes: Dict[str, Optional[Label]] = {}
        count = 0
        for name, label in self.labels(sensor).items():
            assert isinstance(label, RgbLabel)
            inside = corrections.corners_in(label, polygon)
            count += len(inside)
            changes[name] = corrections.without_corners(label, set(inside.tolist()))
        self.chosen = None
        return self._apply(sensor, changes, f"{count} corners of {sensor} removed")

    def _corner_at(self, sensor: str, pixel: np.ndarray, reach: float) -> Optional[ChosenCorner]:
        nearest, least_px = None, np.inf
        for name, label in self.labels(sensor).items():
            assert isinstance(label, RgbLabel)
            corner = corrections.nearest_corner(label, pixel, reach)
            if corner is None:
                continue
            away = float(np.linalg.norm(label.pixels[label.ids == corner][0] - pixel))
            if away < least_px:
                nearest, least_px = ChosenCorner(sensor, name, corner), away
        return nearest

    def _check_pixel(self, sensor: str, pixel: np.ndarray) -> None:
        camera = self._sensor(sensor, RGB).camera
        assert camera is not None
        size = np.array([camera.width, camera.height])
        if not np.all((pixel >= -0.5) & (pixel <= size - 0.5)):
            raise LabelingError(
                f"{sensor}: pixel {np.round(pixel, 1).tolist()} is outside its image of "
                f"{size[0]} x {size[1]}"
            )

    # --- steps --------------------------------------------------------------------------------

    def reset(self) -> str:
        """Put the labels of the collection that is shown back to what the dataset had."""
        collections = dict(self.dataset.collections)
        collections[self.collection] = self._initial.collections[self.collection]
        if collections[self.collection] is self.dataset.collections[self.collection]:
            return f"collection {self.collection} is as the dataset has it"
        words = f"collection {self.collection} reset"
        return self._push(replace(self.dataset, collections=collections), words)

    def undo(self) -> str:
        """Take back the last correction, and show its collection."""
        if not self._done:
            return "there is nothing to take back"
        step = self._done.pop()
        self._undone.append(step)
        self.dataset = step.before
        self.show(step.collection)
        return f"taken back: {step.words}"

    def redo(self) -> str:
        """Make the last correction again that was taken back, and show its collection."""
        if not self._undone:
            return "there is nothing to make again"
        step = self._undone.pop()
        self._done.append(step)
        self.dataset = step.after
        self.show(step.collection)
        return f"made again: {step.words}"

    def save(self, path: Path) -> str:
        """Write the corrected dataset; return a sentence for the user.

        Raises:
            OutputError: the file cannot be written; an older one is whole.
        """
        changed = self.changed()
        write_dataset(self.dataset, path, changed)
        self._saved = self.dataset
        collections = len({key.collection for key in changed})
        told = f"{len(changed)} labels of {collections} collections are corrected"
        return f"saved to {path}: {told if changed else 'nothing is changed'}"

    def _apply(self, sensor: str, changes: Changes, words: str) -> str:
        """Replace labels of a sensor in the collection that is shown."""
        now = self.labels(sensor)
        real = {
            (sensor, pattern): label if label is not None and label.detected else None
            for pattern, label in changes.items()
        }
        if all(_same(now.get(pattern), label) for (_, pattern), label in real.items()):
            return f"nothing changes: {words}"
        return self._push(self.dataset.with_labels(self.collection, real), words)

    def _push(self, after: Dataset, words: str) -> str:
        step = _Step(self.collection, words, self.dataset, after)
        self._done = [*self._done, step][-_MOST_STEPS:]
        self._undone = []
        self.dataset = after
        return words

    # --- what there is ------------------------------------------------------------------------

    def _sensor(self, name: str, *modalities: str) -> Sensor:
        if name not in self.dataset.sensors:
            known = ", ".join(self.dataset.sensors)
            raise SelectionError(f"there is no sensor '{name}'; use one of {known}")
        sensor = self.dataset.sensors[name]
        if modalities and sensor.modality not in modalities:
            raise SelectionError(f"{name} is {sensor.modality}, not {' or '.join(modalities)}")
        return sensor

    def _depth(self, sensor: str) -> np.ndarray:
        self._sensor(sensor, DEPTH)
        return self.dataset.data.depth_image(self.collection, sensor)

    def _valid(self, name: str) -> np.ndarray:
        """Return which points or pixels (n,) of a sensor were measured."""
        if self._sensor(name, LIDAR3D, DEPTH).modality == DEPTH:
            return np.isfinite(self._depth(name)).ravel()
        cloud = self.dataset.data.cloud(self.collection, name)
        return np.all(np.isfinite(cloud), axis=1)

    def _range_label(self, sensor: str, pattern: str) -> Optional[RangeLabel]:
        label = self.labels(sensor).get(pattern)
        return label if isinstance(label, RangeLabel) else None

    def _range_labels(self, sensor: str) -> Iterator[Tuple[str, RangeLabel]]:
        for name, label in self.labels(sensor).items():
            assert isinstance(label, RangeLabel)
            yield name, label

    def _rgb_label(self, sensor: str, pattern: str) -> RgbLabel:
        label = self.labels(sensor)[pattern]
        assert isinstance(label, RgbLabel)
        return label

    def _labeler(self, name: str, modality: str) -> Labeler:
        sensor, key = self._sensor(name, modality), (name, self.pattern)
        if key not in self._labelers:
            pattern = self.dataset.patterns[self.pattern]
            config = self.dataset.config.calibration_patterns[self.pattern]
            self._labelers[key] = labeler_for(sensor, pattern, config)
        return self._labelers[key]


@contextlib.contextmanager
def _of(sensor: str) -> Iterator[None]:
    """Name the sensor in what is said about its data."""
    try:
        yield
    except LabelingError as error:
        raise LabelingError(f"{sensor}: {error}") from None


def _same(one: Optional[Label], other: Optional[Label]) -> bool:
    """Tell whether two labels are the same to the last digit, in the same order."""
    if one is None or other is None:
        return one is other
    if isinstance(one, RgbLabel) and isinstance(other, RgbLabel):
        return np.array_equal(one.ids, other.ids) and np.array_equal(one.pixels, other.pixels)
    if isinstance(one, RangeLabel) and isinstance(other, RangeLabel):
        return np.array_equal(one.indices, other.indices) and np.array_equal(
            one.limit_indices, other.limit_indices
        )
    return False
