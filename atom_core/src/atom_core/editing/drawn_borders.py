"""Borders drawn while a dataset is gone through: those of all its cameras, saved at once.

They stand in the files that the annotation tool writes (io/annotations.py), and the keys are its
own (border_annotation.py), but for those that end it: everything is saved already.
"""

from __future__ import annotations

from typing import Dict, NamedTuple, Tuple

import numpy as np

from atom_core.editing.border_annotation import CHANGING_KEYS, BorderAnnotation
from atom_core.editing.border_drawing import BorderDrawing, keys_with_image
from atom_core.errors import AtomError, LabelingError
from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey

HELP = f"Left click: a point. {'. '.join(CHANGING_KEYS)}. Every change is saved at once"
LEAVE = "q"
_POINT_SIZE_PX = 9


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
        self._drawn: Dict[Tuple[str, str], BorderDrawing] = {}  # by sensor and pattern

    def click(self, place: DetectionKey, pixel: np.ndarray) -> str:
        """Add a point (2,) [px] to the side that is drawn, and save.

        Raises:
            LabelingError: the camera has no image there, or the point is outside it.
            DatasetError: the file holds no annotations, or those of images of another size.
            OutputError: it cannot be written; the point is not drawn.
        """
        drawing, camera = self._at(place), self._dataset.sensors[place.sensor].camera
        assert camera is not None
        if not (-0.5 <= pixel[0] <= camera.width - 0.5 and -0.5 <= pixel[1] <= camera.height - 0.5):
            x, y = pixel
            raise LabelingError(f"({x:.0f}, {y:.0f}) is outside the image of {place.sensor}")
        drawing.annotation.click(float(pixel[0]), float(pixel[1]))
        _save(drawing)
        return f"{_where(place, drawing.annotation)}; saved to {drawing.path.name}"

    def press(self, place: DetectionKey, key: str) -> Press:
        """Do what a key of the annotation tool does, and save what it has changed.

        ``h`` tells the keys; `LEAVE` leaves the picture without the border. Errors are those of
        `click`.
        """
        if key == LEAVE:
            self._drawn = {names: d for names, d in self._drawn.items() if names[0] != place.sensor}
            return Press(f"{place.sensor}: the border is no longer shown", place.collection)
        drawing = self._at(place)
        outcome = drawing.annotation.press(key)
        _save(drawing)
        where = _where(place, drawing.annotation)
        return Press(f"{where}. {HELP}" if outcome.help else where, drawing.annotation.collection)

    def draw(self, place: DetectionKey, picture: np.ndarray) -> None:
        """Draw a border into the picture (height, width, 3) of its image, once it is drawn on."""
        drawing = self._drawn.get((place.sensor, place.pattern))
        if drawing is not None and place.collection in drawing.keys:
            drawing.annotation.show(place.collection)
            drawing.annotation.draw(picture)

    def _at(self, place: DetectionKey) -> BorderDrawing:
        """Return the drawing of a camera and board, at a collection."""
        names = (place.sensor, place.pattern)
        drawing = self._drawn.get(names)
        keys = drawing.keys if drawing else keys_with_image(self._dataset, place.sensor)
        if place.collection not in keys:
            raise LabelingError(f"{place.sensor} has no image in collection {place.collection}")
        if drawing is None:
            drawing = BorderDrawing(self._dataset, *names, list(keys), _POINT_SIZE_PX)
            self._drawn[names] = drawing
        drawing.refresh()
        drawing.annotation.show(place.collection)
        return drawing


def _save(drawing: BorderDrawing) -> None:
    """Save; what could not be saved is not drawn either."""
    try:
        drawing.save()
    except AtomError:
        drawing.annotation.press("u")
        raise


def _where(place: DetectionKey, drawn: BorderAnnotation) -> str:
    points = len(drawn.lines[drawn.collection][drawn.side])
    where = f"{place.sensor}, border in collection {drawn.collection}"
    return f"{where}: {drawn.side} side, {points} point{'s' * (points != 1)}"
