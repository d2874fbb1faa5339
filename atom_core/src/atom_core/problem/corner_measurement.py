"""Corners of a board in one image: its poses by planar PnP, and the reprojection residuals."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import List, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.geometry.expected_noise import CORNER_SIGMA_PX
from atom_core.geometry.pose_solvers import planar_poses
from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey, RgbLabel
from atom_core.model.sensor import Sensor
from atom_core.problem.measurements import Measurement, repeated
from atom_core.problem.residuals import ReprojectionBlock, ResidualBlock

M_PER_PX = 0.1 / 30.0  # how metres and pixels are weighed against each other
_MIN_CORNERS = 6
NO_POSE = "the corners fit no board pose"
NO_PLACE = "too few or collinear corners to place the board"
_PNP_LIMIT_PX = 3.0  # RMS of one board's corners about its own pose
# A second solution of PnP is no candidate when it is that much worse than the first.
_WORSE_FACTOR, _WORSE_PX = 3.0, 0.5


@dataclass(frozen=True)
class CornerMeasurement(Measurement):
    """Corners of a pattern in one image.

    Attributes:
        camera: intrinsics.
        ids: (n,) corner ids.
        corners_in_pattern: (n, 3) [m].
        pixels: (n, 2) [px].
    """

    camera: Camera
    ids: np.ndarray
    corners_in_pattern: np.ndarray
    pixels: np.ndarray

    identifies_board = True

    @property
    def information(self) -> int:
        """The number of corners."""
        return len(self.ids)

    @property
    def rows(self) -> int:
        """Two for each corner."""
        return 2 * len(self.ids)

    def candidates(self) -> List[np.ndarray]:
        """Return the solutions of planar PnP, the better one first; none if the corners are few."""
        return list(self._poses)

    @cached_property
    def _poses(self) -> List[np.ndarray]:
        corners = self.corners_in_pattern
        if len(corners) < _MIN_CORNERS or _on_a_line(corners[:, :2]):
            return []
        poses = planar_poses(corners, self.camera.normalise(self.pixels))
        return [
            pose
            for pose in poses
            if np.all(np.isfinite(pose)) and np.all(se3.apply(pose, corners)[:, 2] > 0)
        ]

    def likely_candidates(self) -> List[np.ndarray]:
        """Return the solutions of PnP without a second one that fits much worse."""
        candidates = self.candidates()
        if len(candidates) < 2:
            return candidates
        errors = [self._rms_px(pose) for pose in candidates]
        limit = _WORSE_FACTOR * min(errors) + _WORSE_PX
        return [candidates[i] for i in np.argsort(errors) if errors[i] <= limit]

    def errors_m(self, sensor_T_pattern: np.ndarray) -> np.ndarray:
        """Return (..., n) reprojection errors [m] of all corners, at poses (..., 4, 4)."""
        points = se3.apply_each(sensor_T_pattern, self.corners_in_pattern)
        pixels = self.camera.project(points.reshape(-1, 3)).reshape(*points.shape[:-1], 2)
        return np.linalg.norm(pixels - self.pixels, axis=-1) * M_PER_PX

    def implausibilities(self) -> List[str]:
        """Return what is wrong with the corners: no pose of the board explains them."""
        candidates = self.candidates()
        if not candidates:
            return [NO_PLACE]
        rms = self._rms_px(candidates[0])
        if rms > _PNP_LIMIT_PX:
            return [
                f"{NO_POSE} (RMS {rms:.1f} px); look at the label, the "
                f"board's dimension and size, and the intrinsics"
            ]
        return []

    def _rms_px(self, camera_T_pattern: np.ndarray) -> float:
        pixels = self.camera.project(se3.apply(camera_T_pattern, self.corners_in_pattern))
        squares = np.sum((pixels - self.pixels) ** 2, axis=1)
        return float(np.sqrt(np.mean(squares)))


def measured_corners(dataset: Dataset, key: DetectionKey) -> Tuple[Measurement, List[str]]:
    """Return the measurement of a label of corners, and warnings."""
    sensor, label = dataset.sensors[key.sensor], dataset.label(key)
    assert sensor.camera is not None and isinstance(label, RgbLabel)
    corners = dataset.patterns[key.pattern].corners_of(label.ids)
    return CornerMeasurement(key, sensor.camera, label.ids, corners, label.pixels), []


def corner_blocks(
    sensor: Sensor, items: Sequence[Tuple[int, CornerMeasurement]]
) -> List[ResidualBlock]:
    """Return the residuals of a camera, from its measurements with their detections' indices."""
    assert sensor.camera is not None
    detection = repeated([(i, len(m.ids)) for i, m in items])
    return [
        ReprojectionBlock(
            sensor=sensor.name,
            modality=sensor.modality,
            detection=detection,
            sigma=np.full(len(detection), CORNER_SIGMA_PX),
            ids=np.concatenate([m.ids for _, m in items]),
            camera=sensor.camera,
            corners_in_pattern=np.concatenate([m.corners_in_pattern for _, m in items]),
            pixels=np.concatenate([m.pixels for _, m in items]),
        )
    ]


def _on_a_line(points: np.ndarray) -> bool:
    singular = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(singular[1] < 1e-6 * max(singular[0], 1e-12))
