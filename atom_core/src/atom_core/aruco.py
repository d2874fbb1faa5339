"""OpenCV's markers and ChArUco prints: the only place that calls ``cv2.aruco``.

OpenCV renamed everything at 4.7. Only detecting and drawing of markers is left to it; where the
corners of a ChArUco lie between its markers does not depend on OpenCV's version here.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Tuple

import numpy as np

from atom_core import opencv as cv2

_WHITE = 255
_LEAST_PERIMETER = 0.03  # of a marker, as a share of the image's longer side: OpenCV's own
_LEAST_OF_PX = 1280  # sides that are longer count as this: 9.6 px suffice in an image of any size


def detect_markers(grey: np.ndarray, dictionary: str) -> Tuple[np.ndarray, np.ndarray]:
    """Find the markers of a dictionary.

    Args:
        grey: (height, width) uint8.
        dictionary: its name, ``DICT_5X5_100``.

    Returns:
        ids (n,) and corners (n, 4, 2) [px], clockwise from the marker's top left. They are those
        of the outline, neither refined nor exact to better than about half a pixel.
    """
    ids, outlines, _ = find_squares(grey, dictionary)
    return ids, outlines


def find_squares(
    grey: np.ndarray, dictionary: str, enlarged: float = 1.0
) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the markers of a dictionary, and the squares that none is read from.

    Args:
        grey: (height, width) uint8.
        dictionary: its name.
        enlarged: how many times larger than the picture that was taken; smaller squares than in
            that picture are not looked for.

    Returns:
        ids (n,) and corners (n, 4, 2) as of `detect_markers`; corners (m, 4, 2) [px] of the others.
    """
    aruco = cv2.aruco
    share = _LEAST_PERIMETER * min(1.0, enlarged * _LEAST_OF_PX / max(grey.shape))
    if hasattr(aruco, "ArucoDetector"):
        corners, ids, others = _detector(dictionary, share).detectMarkers(grey)
    else:
        parameters = aruco.DetectorParameters_create()
        parameters.minMarkerPerimeterRate = share
        corners, ids, others = aruco.detectMarkers(
            grey, _markers(dictionary), parameters=parameters
        )
    unread = np.array(others, dtype=float).reshape(-1, 4, 2)
    if ids is None or len(ids) == 0:
        return np.zeros(0, dtype=int), np.zeros((0, 4, 2)), unread
    outlines = np.array(corners, dtype=float).reshape(-1, 4, 2)
    return np.asarray(ids).ravel().astype(int), outlines, unread


@lru_cache(maxsize=16)
def marker_bits(dictionary: str) -> np.ndarray:
    """Return the cells (n, s, s) bool of a dictionary's markers, True is white; rims are black."""
    markers = _markers(dictionary)
    side = markers.markerSize + 2
    prints = [_marker(dictionary, number, side) for number in range(len(markers.bytesList))]
    bits = np.array(prints) > _WHITE // 2
    bits.setflags(write=False)
    return bits


@lru_cache(maxsize=8)
def charuco_print(
    squares: Tuple[int, int],
    marker_share: float,
    dictionary: str,
    pixels_per_square: int,
    legacy: bool = False,
) -> np.ndarray:
    """Return the print of a ChArUco (height, width), grey values.

    Args:
        squares: columns and rows of squares.
        marker_share: side of a marker over the side of a square.
        dictionary: its name.
        pixels_per_square: of the print.
        legacy: the layout before OpenCV 4.6, see `marker_squares`.
    """
    white = marker_squares(*squares, legacy)
    fields = np.zeros((squares[1], squares[0]), dtype=np.uint8)
    fields[white[:, 1], white[:, 0]] = _WHITE
    picture = np.kron(fields, np.ones((pixels_per_square, pixels_per_square), dtype=np.uint8))
    side = int(round(marker_share * pixels_per_square))
    start = (pixels_per_square - side) // 2
    for number, (column, row) in enumerate(white):
        top, left = row * pixels_per_square + start, column * pixels_per_square + start
        picture[top : top + side, left : left + side] = _marker(dictionary, number, side)
    picture.setflags(write=False)
    return picture


def marker_squares(columns: int, rows: int, legacy: bool) -> np.ndarray:
    """Return the square (column, row), from the top left, of each marker of a ChArUco (n, 2).

    The markers fill the white squares row by row. The top left square is black, but where an even
    number of rows was laid out by OpenCV before 4.6, which counted from below ("legacy").

    Args:
        columns: number of squares along x.
        rows: number of squares along y.
        legacy: whether in the layout before 4.6.
    """
    row, column = np.mgrid[0:rows, 0:columns]
    white = (row + column) % 2 == (0 if legacy and rows % 2 == 0 else 1)
    return np.column_stack([column[white], row[white]])


def _marker(dictionary: str, number: int, side_px: int) -> np.ndarray:
    aruco, markers = cv2.aruco, _markers(dictionary)
    if hasattr(aruco, "drawMarker"):
        return aruco.drawMarker(markers, number, side_px)
    return aruco.generateImageMarker(markers, number, side_px)


@lru_cache(maxsize=16)
def _markers(dictionary: str) -> Any:
    aruco = cv2.aruco
    number = getattr(aruco, dictionary)
    if hasattr(aruco, "Dictionary_get"):
        return aruco.Dictionary_get(number)
    return aruco.getPredefinedDictionary(number)


@lru_cache(maxsize=32)
def _detector(dictionary: str, least_perimeter: float) -> Any:
    parameters = cv2.aruco.DetectorParameters()
    parameters.minMarkerPerimeterRate = least_perimeter
    return cv2.aruco.ArucoDetector(_markers(dictionary), parameters)
