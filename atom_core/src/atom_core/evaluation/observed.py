"""What the test set's labels say, read once and kept: points, board poses, borders."""

from __future__ import annotations

from dataclasses import replace
from typing import Dict, Mapping, Optional, Tuple

import numpy as np

from atom_core.errors import AtomError
from atom_core.evaluation.board_pose import BoardPose, board_pose, turn_variance
from atom_core.evaluation.borders import clipped_to_image, projected_border
from atom_core.geometry.camera import Camera
from atom_core.model.dataset import Dataset, range_points
from atom_core.model.labels import DetectionKey, RangeLabel, RangePoints, RgbLabel
from atom_core.problem.corner_measurement import CornerMeasurement

Borders = Mapping[Tuple[str, str, str], np.ndarray]  # by collection, sensor, pattern


class NotMeasurableError(AtomError):
    """A detection pair cannot be measured; the message says why."""


class Observed:
    """The measurements of a dataset; no transform of the rig enters."""

    def __init__(self, dataset: Dataset, annotations: Optional[Borders] = None):
        """Remember the dataset; data are read when they are asked for.

        Args:
            dataset: the test set.
            annotations: hand-drawn borders as segments (m, 2, 2) [px].
        """
        self._dataset = dataset
        self._annotations = dict(annotations or {})
        self._points: Dict[DetectionKey, RangePoints] = {}
        self._corners: Dict[DetectionKey, CornerMeasurement] = {}
        self._poses: Dict[DetectionKey, Optional[BoardPose]] = {}
        self._borders: Dict[DetectionKey, np.ndarray] = {}

    def camera(self, sensor: str) -> Camera:
        """Return the intrinsics of a camera or depth camera."""
        camera = self._dataset.sensors[sensor].camera
        assert camera is not None
        return camera

    def points(self, key: DetectionKey) -> RangePoints:
        """Return the labeled points of a range sensor in its frame [m].

        Raises:
            NotMeasurableError: the data file is absent.
            DatasetError: the label does not fit the data.
        """
        if key not in self._points:
            if not self._dataset.data.has_data(key.collection, key.sensor):
                raise NotMeasurableError(f"the data file of '{key.sensor}' is absent")
            self._points[key] = range_points(self._dataset, key)
        return self._points[key]

    def limit_points(self, key: DetectionKey) -> np.ndarray:
        """Return the labeled points (n, 3) of the board's border in the sensor's frame [m].

        Raises:
            NotMeasurableError: the data file is absent, or no limit point has a value.
        """
        limit = self.points(key).limit
        if len(limit) == 0:
            raise NotMeasurableError(f"'{key.sensor}' has no labeled limit points")
        return limit

    def limit_pixels(self, key: DetectionKey) -> np.ndarray:
        """Return the labeled border pixels (n, 2) of a depth image.

        Raises:
            NotMeasurableError: there are none.
        """
        label = self._dataset.label(key)
        assert isinstance(label, RangeLabel)
        indices = np.unique(label.limit_indices)
        if len(indices) == 0:
            raise NotMeasurableError(f"'{key.sensor}' has no labeled limit pixels")
        row, column = np.divmod(indices, self.camera(key.sensor).width)
        return np.column_stack([column, row]).astype(float)

    def corners(self, key: DetectionKey) -> CornerMeasurement:
        """Return the labeled corners of a camera, with intrinsics as ATOM rounds them."""
        if key not in self._corners:
            label = self._dataset.label(key)
            assert isinstance(label, RgbLabel)
            self._corners[key] = CornerMeasurement(
                key,
                _in_single_precision(self.camera(key.sensor)),
                label.ids,
                self._dataset.patterns[key.pattern].corners_of(label.ids),
                label.pixels,
            )
        return self._corners[key]

    def first_corner(self, pattern: str) -> np.ndarray:
        """Return ``pattern_T_corner`` (4, 4): the pattern's axes, placed at its first corner."""
        pattern_T_corner = np.eye(4)
        pattern_T_corner[:2, 3] = self._dataset.patterns[pattern].first_corner
        return pattern_T_corner

    def camera_T_pattern(self, key: DetectionKey) -> np.ndarray:
        """Return the board's pose (4, 4) by the corners of this image alone.

        Raises:
            NotMeasurableError: the corners do not determine it.
        """
        return self._board_pose(key).camera_T_pattern

    def turn_variance(self, key: DetectionKey) -> float:
        """Return the mean squared angle [rad^2] by which noise turns the board in an image.

        Raises:
            NotMeasurableError: the corners do not determine its pose.
        """
        return turn_variance(self.corners(key), self._board_pose(key))

    def _board_pose(self, key: DetectionKey) -> BoardPose:
        if key not in self._poses:
            self._poses[key] = board_pose(self.corners(key))
        found = self._poses[key]
        if found is None:
            raise NotMeasurableError(
                f"the corners of '{key.sensor}' do not determine the board's pose"
            )
        return found

    def has_annotation(self, key: DetectionKey) -> bool:
        """Tell whether someone drew the border in this image."""
        return key in self._annotations

    def border(self, key: DetectionKey) -> np.ndarray:
        """Return the board's border in an image, as segments (m, 2, 2) [px], m >= 1.

        Raises:
            NotMeasurableError: nothing says where it is, or it is out of the image.
        """
        if key not in self._borders:
            self._borders[key] = self._find_border(key)
        if len(self._borders[key]) == 0:
            raise NotMeasurableError(f"the board's border is out of the image of '{key.sensor}'")
        return self._borders[key]

    def _find_border(self, key: DetectionKey) -> np.ndarray:
        camera = self.camera(key.sensor)
        if self.has_annotation(key):
            return clipped_to_image(self._annotations[key], camera)
        pattern = self._dataset.patterns[key.pattern]
        return projected_border(camera, self.camera_T_pattern(key), pattern.border)


def _in_single_precision(camera: Camera) -> Camera:
    # ATOM computes rgb-rgb with K and D in single precision; so its figures agree in all the
    # digits that it prints. The effect is some 1e-5 px.
    K, D = (values.astype(np.float32).astype(float) for values in (camera.K, camera.D))
    return replace(camera, K=K, D=D)
