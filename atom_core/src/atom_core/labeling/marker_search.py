"""Where a ChArUco's markers are in an image, and which further searches are worth their time.

Finding markers means following the outline of every speck of a picture. So places without contrast
are smoothed first: there is no marker, only noise, whose specks cost ten times as much as all else.
Squares that no marker is read from tell what else there may be: markers with black and white
exchanged, mirrored ones, or small ones that come out in an enlarged image.
"""

from __future__ import annotations

from typing import NamedTuple, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.aruco import find_squares, marker_bits

_UPSCALE, _UPSCALE_BELOW = 2.0, 12
_BLOCK_PX, _AROUND_BLOCKS, _BEYOND_BLOCKS = 4, 7, 5
_SMOOTHING_PX = 7
_NOISE_ROWS, _NOISE_SHARE = 8, 0.3  # every so many rows; of the steps between neighbours
_STEP_OF_NOISE = 0.545  # of which that share lies below: two normal numbers, in their sigmas
_QUIET = 2.0  # grey values; less noise makes no specks
_LEAST_CONTRAST, _MOST_CONTRAST, _CONTRAST_SIGMAS = 6.0, 24.0, 2.2  # grey values; sigmas of a pixel
_CELL_PX = 4
_MOST_WRONG_BORDER = 0.35  # share, of what looks like a marker
_MOST_WRONG_BITS, _MOST_WRONG_MIRRORED = 0.3, 0.17  # shares; no label hangs on mirrored ones
_FLATTEST = 5.0  # grey values between a marker's cells


class Likenesses(NamedTuple):
    """How many squares look like markers of each kind, some of their bits wrong."""

    plain: int
    negative: int
    mirrored: int
    mirrored_negative: int


class FoundSquares(NamedTuple):
    """Squares in an image.

    Attributes:
        ids: (n,) of the markers.
        outlines: (n, 4, 2) of the markers [px].
        alike: what other squares look like; none where there are many markers.
        twice: how many markers are seen more than once, and so are not among them.
        unread: (m, 4, 2) of squares that no marker is read from [px].
    """

    ids: np.ndarray
    outlines: np.ndarray
    alike: Likenesses
    twice: int
    unread: np.ndarray


def smoothed_where_flat(grey: np.ndarray) -> np.ndarray:
    """Return an image (height, width) uint8, smoothed where there is nothing but noise."""
    height, width = grey.shape
    rows = np.ascontiguousarray(grey[::_NOISE_ROWS])
    counts = np.cumsum(np.bincount(cv2.absdiff(rows[:, 1:], rows[:, :-1]).ravel(), minlength=256))
    sigma = np.searchsorted(counts, _NOISE_SHARE * counts[-1]) / _STEP_OF_NOISE
    if sigma < _QUIET:
        return grey
    least = np.clip(_CONTRAST_SIGMAS * sigma, _LEAST_CONTRAST, _MOST_CONTRAST)
    blocks = (max(width // _BLOCK_PX, 1), max(height // _BLOCK_PX, 1))
    means = cv2.resize(grey, blocks, interpolation=cv2.INTER_AREA)
    around = np.ones((_AROUND_BLOCKS, _AROUND_BLOCKS), np.uint8)
    contrast = cv2.subtract(cv2.dilate(means, around), cv2.erode(means, around))
    beyond = np.ones((_BEYOND_BLOCKS, _BEYOND_BLOCKS), np.uint8)
    kept = cv2.dilate((contrast > least).astype(np.uint8), beyond)
    mask = cv2.resize(kept, (width, height), interpolation=cv2.INTER_NEAREST)
    return cv2.copyTo(grey, mask, cv2.blur(grey, (_SMOOTHING_PX, _SMOOTHING_PX)))


def search_markers(smooth: np.ndarray, dictionary: str) -> FoundSquares:
    """Find the markers of an image, small ones too; each id stands once.

    Args:
        smooth: (height, width) uint8, see `smoothed_where_flat`.
        dictionary: name of the markers.
    """
    ids, outlines, unread = find_squares(smooth, dictionary)
    if len(ids) >= _UPSCALE_BELOW:
        return _found(ids, outlines, Likenesses(0, 0, 0, 0), unread)
    alike = likenesses(smooth, unread, dictionary)
    if len(ids) > 0 or alike.plain > 0:
        larger = cv2.resize(smooth, None, fx=_UPSCALE, fy=_UPSCALE, interpolation=cv2.INTER_LINEAR)
        more, larger_outlines, _ = find_squares(larger, dictionary, _UPSCALE)
        if len(more) > len(ids):
            ids, outlines = more, (larger_outlines + 0.5) / _UPSCALE - 0.5
    return _found(ids, outlines, alike, unread)


def _found(
    ids: np.ndarray, outlines: np.ndarray, alike: Likenesses, unread: np.ndarray
) -> FoundSquares:
    single = once(ids, outlines)
    return FoundSquares(*single, alike, len(np.unique(ids)) - len(single[0]), unread)


def once(ids: np.ndarray, outlines: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return the markers that are seen once; of two alike neither can be trusted."""
    values, counts = np.unique(ids, return_counts=True)
    single = np.isin(ids, values[counts == 1])
    return ids[single], outlines[single]


def likenesses(grey: np.ndarray, outlines: np.ndarray, dictionary: str) -> Likenesses:
    """Return how many squares of an image are about like markers, as they are or otherwise.

    Args:
        grey: (height, width) uint8.
        outlines: (n, 4, 2) of squares [px].
        dictionary: name of the markers.
    """
    known = marker_bits(dictionary)
    bits = square_bits(grey, outlines, known.shape[1])
    counts = []
    for mirrored in (False, True):
        for negative in (False, True):
            seen = bits != negative
            most = _MOST_WRONG_MIRRORED if mirrored else _MOST_WRONG_BITS
            counts.append(_alike(seen[:, :, ::-1] if mirrored else seen, known, most))
    return Likenesses(*counts)


def square_bits(grey: np.ndarray, outlines: np.ndarray, cells: int) -> np.ndarray:
    """Return (m, cells, cells) bool, whether each cell of a square is white; flat squares not."""
    side = cells * _CELL_PX
    to = np.array([[0, 0], [side, 0], [side, side], [0, side]], np.float32) - 0.5
    if not len(outlines):
        return np.zeros((0, cells, cells), bool)
    maps = [cv2.getPerspectiveTransform(outline, to) for outline in outlines.astype(np.float32)]
    seen = np.stack([cv2.warpPerspective(grey, to_side, (side, side)) for to_side in maps])
    seen = seen.reshape(len(seen), cells, _CELL_PX, cells, _CELL_PX)[:, :, 1:-1, :, 1:-1]
    means = seen.astype(np.float32).mean(axis=(2, 4))
    high, low = means.max(axis=(1, 2)), means.min(axis=(1, 2))
    bits = means > (0.5 * (high + low))[:, None, None]
    return bits[high - low >= _FLATTEST]


def _alike(bits: np.ndarray, known: np.ndarray, most_wrong: float) -> int:
    """Return how many of (n, s, s) bits are about those of a marker (k, s, s), in any turn."""
    inner = bits[:, 1:-1, 1:-1]
    border = bits.sum(axis=(1, 2)) - inner.sum(axis=(1, 2))
    inner = inner[border <= _MOST_WRONG_BORDER * 4 * (bits.shape[1] - 1)]
    if not len(inner):
        return 0
    codes = known[:, 1:-1, 1:-1].reshape(len(known), -1).astype(np.float32)
    fewest = np.full(len(inner), np.inf)
    for turns in range(4):
        turned = np.rot90(inner, turns, axes=(1, 2)).reshape(len(inner), -1).astype(np.float32)
        wrong = turned.sum(axis=1)[:, None] + codes.sum(axis=1) - 2.0 * turned @ codes.T
        fewest = np.minimum(fewest, wrong.min(axis=1))
    return int(np.sum(fewest <= most_wrong * codes.shape[1]))
