"""Pictures of labeled data, to be looked at by eye."""

from __future__ import annotations

from typing import Sequence

import cv2
import numpy as np

from atom_calibration.labels.frames import Frame
from atom_calibration.messages.conversions import cloud_xyz
from atom_core.model.labels import RangeLabel, RgbLabel
from atom_core.model.sensor import DEPTH, RGB

_GREEN, _RED, _GREY = (60, 220, 60), (40, 40, 255), (120, 120, 120)
_CLOUD_SIZE, _MARGIN = 640, 1.2


def labeled_picture(frame: Frame) -> np.ndarray:
    """Return the data with the labels drawn in (height, width, 3): inside green, border red."""
    if frame.sensor.modality == RGB:
        return _corners(frame)
    return _depth(frame) if frame.sensor.modality == DEPTH else _cloud(frame)


def _corners(frame: Frame) -> np.ndarray:
    picture = frame.data.copy()
    for labeled in frame.labels.values():
        label = labeled.label
        assert isinstance(label, RgbLabel)
        for number, (x, y) in zip(label.ids, label.pixels):
            centre = (int(round(16 * x)), int(round(16 * y)))
            cv2.circle(picture, centre, 5 * 16, _GREEN, 1, cv2.LINE_AA, 4)
            place = (int(x) + 6, int(y) - 4)
            cv2.putText(picture, str(number), place, cv2.FONT_HERSHEY_PLAIN, 0.7, _RED, 1)
    return picture


def _depth(frame: Frame) -> np.ndarray:
    picture = depth_picture(frame.data)
    for label in _range_labels(frame):
        for indices, colour in ((label.indices, _GREEN), (label.limit_indices, _RED)):
            row, column = np.divmod(indices, picture.shape[1])
            picture[row, column] = colour
    return picture


def depth_picture(depth_m: np.ndarray) -> np.ndarray:
    """Return a depth image (height, width) [m] in grey (height, width, 3): near is bright."""
    near, far = np.nanpercentile(depth_m, [1, 99]) if np.any(np.isfinite(depth_m)) else (0.0, 1.0)
    scaled = np.nan_to_num((depth_m - near) / max(far - near, 1e-6), nan=0.0)
    grey = (255 - 215 * np.clip(scaled, 0, 1)).astype(np.uint8)
    black_without = np.where(np.isfinite(depth_m), grey, 0).astype(np.uint8)
    return cv2.cvtColor(black_without, cv2.COLOR_GRAY2BGR)


def _cloud(frame: Frame) -> np.ndarray:
    return cloud_picture(cloud_xyz(frame.data), _range_labels(frame), _CLOUD_SIZE)


def cloud_picture(points: np.ndarray, labels: Sequence[RangeLabel], size_px: int) -> np.ndarray:
    """Return the board's neighbourhood, seen along the board's normal (size, size, 3).

    Args:
        points: (n, 3) the cloud.
        labels: on it; the first one says where the board is. Without one the picture is black.
        size_px: of the picture.
    """
    picture = np.zeros((size_px, size_px, 3), np.uint8)
    if not labels:
        return picture
    board = points[labels[0].indices]
    centre = board.mean(axis=0)
    _, _, axes = np.linalg.svd(board - centre, full_matrices=False)
    flat = (points - centre) @ axes.T
    extent = _MARGIN * np.abs(flat[labels[0].indices, :2]).max()
    near = np.flatnonzero(np.all(np.abs(flat) <= extent, axis=1))
    radius = max(size_px // 320, 1)
    _dots(picture, flat[near], extent, _GREY, radius)
    for label in labels:
        _dots(picture, flat[label.indices], extent, _GREEN, radius)
    for label in labels:
        _dots(picture, flat[label.limit_indices], extent, _RED, radius + 1)
    return picture


def _dots(picture: np.ndarray, flat: np.ndarray, extent: float, colour: tuple, radius: int) -> None:
    pixels = (0.5 + 0.5 * flat[:, :2] / extent) * (len(picture) - 1)
    for x, y in pixels.astype(int):
        cv2.circle(picture, (int(x), int(y)), radius, colour, -1)


def _range_labels(frame: Frame) -> list:
    found = [labeled.label for labeled in frame.labels.values() if labeled.detected]
    return [label for label in found if isinstance(label, RangeLabel)]
