"""The border of one board in the images of one camera: what is drawn, and its file."""

from __future__ import annotations

from copy import deepcopy
from typing import Dict, List, Optional, Tuple

from atom_core.editing.border_annotation import BorderAnnotation, Lines
from atom_core.io.annotations import annotation_path, read_lines, write_annotations
from atom_core.model.dataset import Dataset


def keys_with_image(dataset: Dataset, sensor: str) -> List[str]:
    """Return the collections in which a sensor has an image to draw in."""
    if dataset.sensors[sensor].camera is None:
        return []
    return [key for key in dataset.collections if dataset.data.has_data(key, sensor)]


class BorderDrawing:
    """Points, what keys do to them, and the file that they are saved to.

    Attributes:
        keys: the collections that can be drawn in.
        annotation: the points.
        path: the file.
    """

    def __init__(
        self,
        dataset: Dataset,
        sensor: str,
        pattern: str,
        keys: List[str],
        point_size: int,
        points_per_pixel: float = 1.0,
    ):
        """Read what was drawn before.

        Args:
            dataset: whose images; the file stands beside it.
            sensor: a camera or depth camera.
            pattern: the board.
            keys: collections to draw in; one at least.
            point_size: of the drawn points [px].
            points_per_pixel: how densely lines are sampled for ATOM.

        Raises:
            DatasetError: the file is malformed, or was drawn in images of another size.
        """
        self.keys = frozenset(keys)
        self.path = annotation_path(dataset.source.parent, sensor)
        self._pattern, self._patterns = pattern, list(dataset.config.calibration_patterns)
        self._camera, self._points_per_pixel = dataset.sensors[sensor].camera, points_per_pixel
        self._stamp = self._now()
        self.annotation = BorderAnnotation(keys, self._read(), point_size)
        self._saved = deepcopy(self.annotation.lines)

    def refresh(self) -> None:
        """Take what others wrote to the file since, or that it has gone."""
        if self._now() != self._stamp:
            self._stamp = self._now()
            self.annotation.replace(self._read())
            self._saved = deepcopy(self.annotation.lines)

    def save(self) -> None:
        """Write the collections that have changed.

        Raises:
            DatasetError: the file that is there is no such file.
            OutputError: it cannot be written.
        """
        lines = self.annotation.lines
        changed = {key: lines[key] for key in lines if lines[key] != self._saved[key]}
        if not changed:
            return
        write_annotations(
            self.path,
            changed,
            patterns=self._patterns,
            pattern=self._pattern,
            points_per_pixel=self._points_per_pixel,
            camera=self._camera,
        )
        self._saved, self._stamp = deepcopy(lines), self._now()

    def _read(self) -> Dict[str, Lines]:
        return read_lines(self.path, self._patterns, self._pattern, self._camera)

    def _now(self) -> Optional[Tuple[int, int]]:
        try:
            found = self.path.stat()
        except OSError:
            return None
        return found.st_mtime_ns, found.st_size
