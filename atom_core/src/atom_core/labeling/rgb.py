"""RGB cameras: an image and a pattern in, the pattern's corners out."""

from __future__ import annotations

from typing import Dict, List, Optional

import numpy as np

from atom_core import opencv as cv2
from atom_core.errors import LabelingError
from atom_core.labeling.base import Labeled, nothing
from atom_core.labeling.board_view import off_their_neighbours
from atom_core.labeling.charuco import CharucoFinder
from atom_core.labeling.chessboard import ChessboardFinder, mirror_shows
from atom_core.labeling.likely_lens import likely_lens
from atom_core.model.config import PatternConfig
from atom_core.model.labels import RgbLabel
from atom_core.model.pattern import CHARUCO, Pattern
from atom_core.model.sensor import RGB, Sensor

STARTS_BLACK = "starts_black"  # in the quality of chessboards that differ from their mirror image
LEAST_SHARE = 0.25  # of the corners; ATOM's rule too
_SMALLEST_IMAGE_PX = 16


class RgbLabeler:
    """Finds a chessboard or ChArUco in the images of one camera.

    A configuration may say ``legacy: true`` or ``false`` for a ChArUco with an even number of
    rows of squares, printed as OpenCV before or since 4.6 lays it out; by default (``auto``) the
    layout that fits the markers is taken.
    """

    def __init__(self, sensor: Sensor, pattern: Pattern, config: PatternConfig):
        """Prepare.

        Args:
            sensor: the camera; its intrinsics, if known, say where corners without markers are.
            pattern: the board.
            config: its print.
        """
        self.sensor, self.pattern = sensor, pattern
        self._charuco: Optional[CharucoFinder] = None
        if pattern.kind == CHARUCO:
            assert config.inner_size is not None and config.dictionary is not None
            self._charuco = CharucoFinder(
                pattern.columns,
                pattern.rows,
                config.inner_size / pattern.square_m,
                config.dictionary,
                config.legacy,
            )
        self._chessboard = ChessboardFinder(pattern.columns, pattern.rows)

    def label(self, data: np.ndarray, seed: Optional[np.ndarray] = None) -> Labeled:
        """Find the corners.

        Args:
            data: (height, width[, 1 or 3]) uint8; colour is blue green red, or the reverse.
            seed: not used.

        Returns:
            Corners; at least a quarter of the pattern's, or none.
            ``quality``: ``corners``, ``in_view``, ``dropped``, ``markers``, ``mean_quality``; of
            chessboards that differ from their mirror image ``starts_black``, 1 or 0.

        Raises:
            LabelingError: the array is no image of 8 bits, or not of the camera's size.
        """
        grey = self._grey(data)
        if self._charuco is None:
            return self._label_chessboard(grey)
        return self._label_charuco(grey)

    def _label_charuco(self, grey: np.ndarray) -> Labeled:
        assert self._charuco is not None
        found = self._charuco.find(grey, self.sensor.camera)
        quality = {
            "markers": float(found.markers),
            "corners": float(len(found.ids)),
            "in_view": float(found.in_view),
            "dropped": float(found.dropped),
            "mean_quality": _mean(found.corners.quality),
        }
        if found.reason:
            return nothing(RGB, found.reason, quality)
        least = LEAST_SHARE * self.pattern.corner_count
        if len(found.ids) < least:
            reason = (
                f"{len(found.ids)} of {self.pattern.corner_count} corners are found "
                f"({found.in_view} are in view), {int(np.ceil(least))} are needed"
            )
            return nothing(RGB, reason, quality)
        label = RgbLabel(found.ids, found.corners.pixels)
        return Labeled(label, quality=quality)

    def _label_chessboard(self, grey: np.ndarray) -> Labeled:
        corners, reason, starts_black, exact = self._chessboard.find(grey)
        if corners is None or exact is None:
            return nothing(RGB, reason)
        row, column = np.divmod(np.arange(self.pattern.corner_count), self.pattern.columns)
        board = np.column_stack([column, row]).astype(float)
        size_px = (grey.shape[1], grey.shape[0])
        camera = likely_lens(self.sensor.camera, [(board, corners.pixels)], size_px)
        kept = exact & ~off_their_neighbours(board, corners.pixels, exact, camera)
        ids = np.flatnonzero(kept)
        quality: Dict[str, float] = {
            "corners": float(len(ids)),
            "in_view": float(len(kept)),
            "dropped": float(len(kept) - len(ids)),
            "mean_quality": _mean(corners.quality[kept]),
        }
        if mirror_shows(self.pattern.columns, self.pattern.rows):
            quality[STARTS_BLACK] = float(starts_black)
        warnings: List[str] = []
        if (self.pattern.columns + self.pattern.rows) % 2 == 0:
            alike = self.pattern.columns == self.pattern.rows and self.pattern.columns % 2 == 0
            turn = "a quarter of a turn" if alike else "half a turn"
            warnings.append(
                f"pattern '{self.pattern.name}' looks the same after {turn}; the corners are "
                f"numbered as if it stood upright in the image"
            )
        return Labeled(
            RgbLabel(ids, corners.pixels[kept]),
            quality=quality,
            warnings=tuple(warnings),
        )

    def _grey(self, image: np.ndarray) -> np.ndarray:
        image = np.asarray(image)
        name = f"sensor '{self.sensor.name}'"
        if image.size == 0:
            raise LabelingError(f"{name}: the image is empty; is its driver at work?")
        if image.dtype != np.uint8 or image.ndim not in (2, 3) or image.shape[2:] not in _CHANNELS:
            raise LabelingError(
                f"{name}: an image is (height, width[, 3]) of 8 bits, not {image.shape} of "
                f"{image.dtype.name}; convert it to mono8 or bgr8, or correct the modality"
            )
        camera, (height, width) = self.sensor.camera, image.shape[:2]
        if camera is not None and (height, width) != (camera.height, camera.width):
            raise LabelingError(
                f"{name}: the image is {width} x {height} pixels, its camera_info says "
                f"{camera.width} x {camera.height}; they do not belong together"
            )
        if min(height, width) < _SMALLEST_IMAGE_PX:
            raise LabelingError(f"{name}: an image of {width} x {height} pixels shows no board")
        if image.ndim == 3 and image.shape[2] == 3:
            return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        return np.ascontiguousarray(image.reshape(height, width))


_CHANNELS = ((), (1,), (3,))


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if len(values) else 0.0
