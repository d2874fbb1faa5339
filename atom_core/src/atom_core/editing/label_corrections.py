"""Labels of a dataset that a person corrects, collection by collection, with undo.

What a correction does to one label stands in ``atom_core.labeling.corrections``.
"""

from __future__ import annotations

import contextlib
from typing import Callable, Dict, Iterator, NamedTuple, Optional, Tuple

import numpy as np

from atom_core.editing.label_history import LabelHistory
from atom_core.errors import LabelingError, SelectionError
from atom_core.geometry.camera import Camera
from atom_core.labeling import corrections
from atom_core.labeling.base import Labeled, Labeler, labeler_for
from atom_core.labeling.depth import DepthLabeler
from atom_core.labeling.polygon import polygon_mask
from atom_core.model.dataset import Dataset
from atom_core.model.labels import Label, RangeLabel, RgbLabel
from atom_core.model.modality import Modality, modalities
from atom_core.model.sensor import Sensor

REACH_PX = 10.0  # a click means a corner that is so near
_OTHER_PX = 3.0  # while a corner is chosen, a click so near another one means that one


class ChosenCorner(NamedTuple):
    """The corner that the next click moves."""

    sensor: str
    pattern: str
    corner: int


class LabelCorrections(LabelHistory):
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
        super().__init__(dataset)
        if not dataset.patterns:
            raise SelectionError(f"{dataset.source}: there are no patterns to label")
        self.pattern = next(iter(dataset.patterns))
        self.chosen: Optional[ChosenCorner] = None
        self._labelers: Dict[Tuple[str, str], Labeler] = {}

    # --- what is shown ------------------------------------------------------------------------

    def show(self, key: str) -> str:
        """Go to a collection, as `LabelHistory.show`; no corner is chosen there.

        Raises:
            SelectionError: there is none of that key.
        """
        self.chosen = None
        return super().show(key)

    def select_pattern(self, name: str) -> str:
        """Choose the pattern that points and fills are added to.

        Raises:
            SelectionError: there is none of that name.
        """
        if name not in self.dataset.patterns:
            known = ", ".join(self.dataset.patterns)
            raise SelectionError(f"there is no pattern '{name}'; use one of {known}")
        self.pattern = name
        return f"points and fills are labeled as '{name}'"

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
        return self.apply(sensor, {self.pattern: after}, words)

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
        return self.apply(sensor, changes, f"{count} points of {sensor} removed")

    def delete_label(self, sensor: str, pattern: str = "") -> str:
        """Forget what a sensor saw of a pattern; empty: of all of them.

        Raises:
            SelectionError: there is no such sensor or pattern.
        """
        self._sensor(sensor)
        if pattern and pattern not in self.dataset.patterns:
            raise SelectionError(f"there is no pattern '{pattern}'")
        changes = dict.fromkeys([pattern] if pattern else self.dataset.patterns)
        return self.apply(sensor, changes, f"the label of {sensor} deleted")

    # --- depth images -------------------------------------------------------------------------

    def refill(self, sensor: str, polygon: np.ndarray) -> str:
        """Label a depth image anew inside a polygon (n, 2) [px].

        Raises:
            LabelingError: there is no board inside it, or it is no polygon in the image.
            DatasetError: the data cannot be read.
        """
        labeler = self._labeler(sensor)
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
        labeler = self._labeler(sensor)
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
        return self.apply(sensor, changes, f"{before - after} border pixels of {sensor} removed")

    def _relabel(self, sensor: str, found: Labeled) -> str:
        if not found.detected:
            raise LabelingError(f"{sensor}: nothing is labeled: {found.reason}")
        words = f"{sensor} labeled anew" + "".join(f", though {x}" for x in found.warnings)
        return self.apply(sensor, {self.pattern: found.label}, words)

    # --- corners ------------------------------------------------------------------------------

    def click(self, sensor: str, pixel: np.ndarray) -> str:
        """Choose the corner at a pixel (2,), or move the one that is chosen there.

        Raises:
            LabelingError: there is no corner, or the pixel is outside the image.
        """
        self._check_pixel(sensor, pixel)
        chosen = self._chosen_of(sensor)
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
        return self.apply(sensor, {chosen.pattern: moved}, words)

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
        return self.apply(sensor, {found.pattern: label}, words)

    def remove_corners(self, sensor: str, polygon: np.ndarray) -> str:
        """Take the corners inside a polygon (n, 2) [px] out.

        Raises:
            LabelingError: it is no polygon in the image.
        """
        camera = self._camera(sensor)
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
        return self.apply(sensor, changes, f"{count} corners of {sensor} removed")

    def _chosen_of(self, sensor: str) -> Optional[ChosenCorner]:
        """Return the corner that is chosen if it is of a sensor and still there."""
        chosen = self.chosen
        if chosen is None or chosen.sensor != sensor:
            return None
        label = self.labels(sensor).get(chosen.pattern)
        return chosen if isinstance(label, RgbLabel) and chosen.corner in label.ids else None

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
        camera = self._camera(sensor)
        size = np.array([camera.width, camera.height])
        if not np.all((pixel >= -0.5) & (pixel <= size - 0.5)):
            raise LabelingError(
                f"{sensor}: pixel {np.round(pixel, 1).tolist()} is outside its image of "
                f"{size[0]} x {size[1]}"
            )

    # --- what there is ------------------------------------------------------------------------

    def _sensor(self, name: str, fits: Callable[[Modality], bool] = lambda _: True) -> Sensor:
        """Return a sensor whose modality fits what is to be done."""
        if name not in self.dataset.sensors:
            known = ", ".join(self.dataset.sensors)
            raise SelectionError(f"there is no sensor '{name}'; use one of {known}")
        sensor = self.dataset.sensors[name]
        if not fits(sensor.kind):
            fitting = " or ".join(kind.name for kind in modalities() if fits(kind))
            raise SelectionError(f"{name} is {sensor.modality}, not {fitting}")
        return sensor

    def _camera(self, name: str) -> Camera:
        """Return the intrinsics of a sensor whose labels are corners."""
        camera = self._sensor(name, _has_corners).camera
        assert camera is not None
        return camera

    def _depth(self, sensor: str) -> np.ndarray:
        self._sensor(sensor, _has_depth_images)
        return self.dataset.data.read(self.collection, sensor)

    def _valid(self, name: str) -> np.ndarray:
        """Return which points or pixels (n,) of a sensor were measured."""
        measured = self._sensor(name, lambda kind: kind.measures_range).kind.measured
        assert measured is not None
        return measured(self.dataset.data.read(self.collection, name))

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

    def _labeler(self, name: str) -> Labeler:
        sensor, key = self._sensor(name, _has_depth_images), (name, self.pattern)
        if key not in self._labelers:
            pattern = self.dataset.patterns[self.pattern]
            config = self.dataset.config.calibration_patterns[self.pattern]
            self._labelers[key] = labeler_for(sensor, pattern, config)
        return self._labelers[key]


def _has_corners(kind: Modality) -> bool:
    return kind.has_camera_info and not kind.measures_range


def _has_depth_images(kind: Modality) -> bool:
    return kind.has_camera_info and kind.measures_range


@contextlib.contextmanager
def _of(sensor: str) -> Iterator[None]:
    """Name the sensor in what is said about its data."""
    try:
        yield
    except LabelingError as error:
        raise LabelingError(f"{sensor}: {error}") from None
