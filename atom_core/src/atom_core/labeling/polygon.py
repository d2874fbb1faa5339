"""Polygons that a person draws into an image."""

from __future__ import annotations

from typing import Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.errors import LabelingError

_FAR_PX = 2.0**15  # beyond every image; OpenCV's numbers overflow later


def polygon_mask(polygon: np.ndarray, shape: Tuple[int, ...]) -> np.ndarray:
    """Return uint8 (height, width), 1 inside and on the outline.

    Args:
        polygon: (n, 2) corners x, y [px], n >= 3; may reach beyond the image.
        shape: height and width of the image.

    Raises:
        LabelingError: it is no polygon, or no part of it is in the image.
    """
    corners = checked_polygon(polygon)
    mask = np.zeros(shape[:2], dtype=np.uint8)
    outline = np.rint(np.clip(corners, -_FAR_PX, _FAR_PX)).astype(np.int32).reshape(-1, 1, 2)
    cv2.fillPoly(mask, [outline], 1)
    if not mask.any():
        raise LabelingError(
            f"the polygon lies outside the image of {shape[1]} x {shape[0]} pixels; draw it on "
            f"the board"
        )
    return mask


def inside_polygon(polygon: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Return whether pixels (n, 2), with fractions, lie in a polygon or on its outline (n,).

    Raises:
        LabelingError: it is no polygon.
    """
    outline = checked_polygon(polygon).astype(np.float32).reshape(-1, 1, 2)
    tests = [cv2.pointPolygonTest(outline, (float(x), float(y)), False) for x, y in pixels]
    return np.array(tests).reshape(-1) >= 0


def checked_polygon(polygon: np.ndarray) -> np.ndarray:
    """Return the corners (n, 2) of a polygon as numbers.

    Raises:
        LabelingError: fewer than three corners, or numbers that are not finite.
    """
    corners = np.asarray(polygon, dtype=float)
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3:
        raise LabelingError(f"a polygon needs three corners (x, y), not the shape {corners.shape}")
    if not np.all(np.isfinite(corners)):
        raise LabelingError("a corner of the polygon is not a number; draw it again")
    return corners
