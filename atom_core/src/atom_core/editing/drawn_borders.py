"""Borders drawn while a dataset is gone through: those of all its cameras, saved at once.

They stand in the files that the annotation tool writes (io/annotations.py), and the keys are its
own (border_annotation.py).
"""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path
from typing import Dict, List, NamedTuple, Tuple

import numpy as np

from atom_core.editing.border_annotation import HELP, BorderAnnotation
from atom_core.errors import LabelingError
from atom_core.io.annotations import annotation_path, read_lines, write_annotations
from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey

_POINT_SIZE_PX = 9
_Drawn = Tuple[str, str]  # sensor and pattern


class Press(NamedTuple):
    """What a key has done.

    Attributes:
        words: for the user.
        collection: to be shown now.
    """

    words: str
    collection: str


class DrawnBorders:
    """What is drawn of every camera and board; the file of a camera is read when it is needed."""

    def __init__(self, dataset: Dataset):
        """Draw nothing yet."""
        self._dataset = dataset
        self._drawn: Dict[_Drawn, BorderAnnotation] = {}

    def click(self, place: DetectionKey, pixel: np.ndarray) -> str:
        """Add a point (2,) [px] to the side that is drawn, and save.

        Raises:
            LabelingError: the camera has no image there, or the point is outside it.
            DatasetError: the file that is there is none, or was drawn in images of another size.
            OutputError: it cannot be written.
        """
        drawn, camera = self._at(place), self._dataset.sensors[place.sensor].camera
        assert camera is not None
        if not (-0.5 <= pixel[0] <= camera.width - 0.5 and -0.5 <= pixel[1] <= camera.height - 0.5):
            x, y = pixel
            raise LabelingError(f"({x:.0f}, {y:.0f}) is outside the image of {place.sensor}")
        drawn.click(float(pixel[0]), float(pixel[1]))
        return self._saved(place, drawn)

    def press(self, place: DetectionKey, key: str) -> Press:
        """Do what a key of the annotation tool does, and save what it has changed.

        ``h`` tells the keys; ``q`` leaves the picture without the border. Errors are those of
        `click`.
        """
        drawn = self._at(place)
        before = deepcopy(drawn.lines)
        outcome = drawn.press(key)
        if outcome.help:
            words = f"{self._where(place, drawn)}. {'; '.join(HELP)}"
        elif outcome.end and not outcome.save:
            del self._drawn[place.sensor, place.pattern]
            words = f"{place.sensor}: the border is no longer shown; the file has it"
        elif outcome.save or drawn.lines != before:
            words = self._saved(place, drawn)
        else:
            words = self._where(place, drawn)
        return Press(words, drawn.collection)

    def draw(self, place: DetectionKey, picture: np.ndarray) -> None:
        """Draw a border into the picture (height, width, 3) of its image, once it is drawn on."""
        drawn = self._drawn.get((place.sensor, place.pattern))
        if drawn is not None and place.collection in self._keys(place.sensor):
            drawn.show(place.collection)
            drawn.draw(picture)

    def _at(self, place: DetectionKey) -> BorderAnnotation:
        """Return the points of a camera and board, at a collection."""
        keys = self._keys(place.sensor)
        if place.collection not in keys:
            raise LabelingError(f"{place.sensor} has no image in collection {place.collection}")
        if (place.sensor, place.pattern) not in self._drawn:
            camera = self._dataset.sensors[place.sensor].camera
            lines = read_lines(self._path(place), self._dataset.patterns, place.pattern, camera)
            made = BorderAnnotation(keys, lines, _POINT_SIZE_PX)
            self._drawn[place.sensor, place.pattern] = made
        drawn = self._drawn[place.sensor, place.pattern]
        drawn.show(place.collection)
        return drawn

    def _keys(self, sensor: str) -> List[str]:
        data = self._dataset.data
        if self._dataset.sensors[sensor].camera is None:
            return []
        return [key for key in self._dataset.collections if data.has_data(key, sensor)]

    def _path(self, place: DetectionKey) -> Path:
        return annotation_path(self._dataset.source.parent, place.sensor)

    def _where(self, place: DetectionKey, drawn: BorderAnnotation) -> str:
        points = len(drawn.lines[drawn.collection][drawn.side])
        where = f"{place.sensor}, border in collection {drawn.collection}"
        return f"{where}: {drawn.side} side, {points} point{'s' * (points != 1)}"

    def _saved(self, place: DetectionKey, drawn: BorderAnnotation) -> str:
        several = len(self._dataset.patterns) > 1
        write_annotations(
            self._path(place),
            drawn.lines,
            pattern=place.pattern if several else "",
            camera=self._dataset.sensors[place.sensor].camera,
        )
        return f"{self._where(place, drawn)}; saved to {self._path(place).name}"
