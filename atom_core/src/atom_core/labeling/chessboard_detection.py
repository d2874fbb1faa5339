"""Where the corners of a chessboard are about: OpenCV's two detectors, at several scales.

The sector based detector comes first (Duda, Frese, "Accurate detection and localization of
checkerboard corners for calibration", BMVC 2018): it stands noise and blur. It misses small
squares, and now and then a board that every eye sees; then it is tried with other settings and in
an enlarged image, and after it the classic one, which follows the outlines of the black squares.
Only the first attempt looks at the whole image. The others look where saddles are, if they are
enough, so that an image without a board costs little more than one attempt.
"""

from __future__ import annotations

from typing import Callable, Iterable, NamedTuple, Optional, Tuple

import numpy as np

from atom_core import opencv as cv2

_LEAST_SADDLES, _AROUND_PX = 0.8, 40
_STEEP, _SHARE_OF_STEEPEST = 60.0, 0.04  # steepness goes with the square of the contrast
_LARGE_PX = 1_500_000  # of an image that is looked at in half its size first
_LARGEST_FOR_OUTLINES_PX = 600_000
_SMOOTH_PX = 1.0
_MARGIN_SQUARES = 0.3  # around the outer squares
_LIKE_THE_FIRST = 0.05  # steepness of a second board's saddles: a quarter of the contrast

Size = Tuple[int, int]
Detector = Callable[[np.ndarray, Size], Tuple[bool, np.ndarray]]


class _Attempt(NamedTuple):
    detector: Detector
    scale: float
    largest_px: int = 4_500_000  # of the scaled picture; a larger one takes too long


# OpenCV's own refinement (CALIB_CB_ACCURACY) takes five times as long, and ours follows.
def _sectors(grey: np.ndarray, size: Size) -> Tuple[bool, np.ndarray]:
    return cv2.findChessboardCornersSB(grey, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)


def _plain_sectors(grey: np.ndarray, size: Size) -> Tuple[bool, np.ndarray]:
    return cv2.findChessboardCornersSB(grey, size, flags=0)


def _outlines(grey: np.ndarray, size: Size) -> Tuple[bool, np.ndarray]:
    # in noise every speck is an outline to it, hence smoothed
    smooth = cv2.GaussianBlur(grey, (0, 0), _SMOOTH_PX)
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    return cv2.findChessboardCorners(smooth, size, flags=flags)


_BY_OUTLINES = (
    _Attempt(_outlines, 0.5, _LARGEST_FOR_OUTLINES_PX),
    _Attempt(_outlines, 1.0, _LARGEST_FOR_OUTLINES_PX),
)
_FURTHER = (
    _Attempt(_plain_sectors, 1.0),
    _Attempt(_sectors, 1.5),
    _Attempt(_sectors, 2.0),
    *_BY_OUTLINES,
)


def detect(grey: np.ndarray, size: Size) -> Optional[np.ndarray]:
    """Return corners (columns * rows, 2) [px], row by row from whichever end, or None.

    Args:
        grey: (height, width) uint8.
        size: columns and rows of inner corners.
    """
    large = grey.size > _LARGE_PX
    found = _try(grey, size, _Attempt(_sectors, 0.5 if large else 1.0))
    if found is None and large:
        found = _try(grey, size, _Attempt(_plain_sectors, 0.5))
    if found is not None:
        return found
    part, corner = _part_with_saddles(grey, size)
    if part is None:
        return None
    found = _first_found(part, size, (_Attempt(_sectors, 1.0), *_FURTHER) if large else _FURTHER)
    return None if found is None else found + corner


def detect_another(grey: np.ndarray, grid: np.ndarray) -> Tuple[np.ndarray, Optional[np.ndarray]]:
    """Look for a second board of the same size where saddles are enough for one, by all detectors.

    By their outlines squares are found in some hundredths of a second.

    Args:
        grey: (height, width) uint8.
        grid: (rows, columns, 2) corners [px] of the first board.

    Returns:
        The image without the first board, and what `detect` returns for it.
    """
    rows, columns = grid.shape[:2]
    rest = _without_board(grey, grid)
    column, row = np.rint(grid.reshape(-1, 2)).astype(int).T
    usual = float(np.median(_steepness(grey)[row, column]))
    part, corner = _part_with_saddles(rest, (columns, rows), _LIKE_THE_FIRST * usual)
    if part is None:
        return rest, None
    scale = 0.5 if part.size > _LARGE_PX else 1.0
    found = _first_found(
        part, (columns, rows), (_Attempt(_sectors, scale, part.size), *_BY_OUTLINES)
    )
    return rest, None if found is None else found + corner


def _without_board(grey: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Return the image with grey in the place of a board's squares."""
    rows, columns = grid.shape[:2]
    places = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    homography, _ = cv2.findHomography(places.astype(float), grid.reshape(-1, 2))
    low, right, bottom = -1.0 - _MARGIN_SQUARES, columns + _MARGIN_SQUARES, rows + _MARGIN_SQUARES
    outline = np.array([[[low, low], [right, low], [right, bottom], [low, bottom]]])
    polygon = np.rint(cv2.perspectiveTransform(outline, homography)).astype(np.int32)
    return cv2.fillConvexPoly(grey.copy(), polygon, int(np.mean(grey)))


def _part_with_saddles(
    grey: np.ndarray, size: Size, steep: float = _STEEP
) -> Tuple[Optional[np.ndarray], np.ndarray]:
    """Return the part of the image with saddles in it, None if they are too few, and its corner."""
    least = int(np.ceil(_LEAST_SADDLES * size[0] * size[1]))
    saddles = _saddles(grey, least, steep)
    if len(saddles) < least:
        return None, np.zeros(2)
    low = np.maximum(saddles.min(axis=0) - _AROUND_PX, 0)
    high = saddles.max(axis=0) + _AROUND_PX + 1
    return np.ascontiguousarray(grey[low[1] : high[1], low[0] : high[0]]), low


def _saddles(grey: np.ndarray, count: int, steep: float) -> np.ndarray:
    """Return pixels (n, 2) where the grey values form a steep saddle, as squares' corners do.

    Left out is what has less than a fifth of the contrast of the ``count`` clearest ones.
    """
    steepness = _steepness(grey)
    highest = cv2.dilate(steepness, np.ones((7, 7), np.uint8))
    rows, columns = np.nonzero((steepness == highest) & (steepness > steep))
    values = steepness[rows, columns]
    if len(values) > count:  # noise has many weak ones
        clear = values > _SHARE_OF_STEEPEST * np.partition(values, -count)[-count]
        rows, columns = rows[clear], columns[clear]
    return np.column_stack([columns, rows])


def _steepness(grey: np.ndarray) -> np.ndarray:
    """Return for each pixel minus the determinant of the Hessian: high where there is a saddle."""
    smooth = cv2.GaussianBlur(grey, (0, 0), 1.5).astype(np.float32)
    xx, yy = (cv2.Sobel(smooth, cv2.CV_32F, *order, ksize=3) for order in ((2, 0), (0, 2)))
    xy = cv2.Sobel(smooth, cv2.CV_32F, 1, 1, ksize=3)
    return xy * xy - xx * yy


def _first_found(
    grey: np.ndarray, size: Size, attempts: Iterable[_Attempt]
) -> Optional[np.ndarray]:
    """Return corners (n, 2) [px] by the first attempt that finds any, of those that are quick."""
    for attempt in attempts:
        if grey.size * attempt.scale**2 <= attempt.largest_px:
            found = _try(grey, size, attempt)
            if found is not None:
                return found
    return None


def _try(grey: np.ndarray, size: Size, attempt: _Attempt) -> Optional[np.ndarray]:
    """Return corners (n, 2) [px] of the image as it is."""
    picture, scale = grey, attempt.scale
    if scale != 1.0:
        how = cv2.INTER_CUBIC if scale > 1.0 else cv2.INTER_AREA
        picture = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=how)
    found, corners = attempt.detector(picture, size)
    if not found:
        return None
    return (corners.reshape(-1, 2).astype(float) + 0.5) / scale - 0.5
