"""Which dictionary a picture's markers are of, where the one that is asked for has none there."""

from __future__ import annotations

import numpy as np

from atom_core.aruco import marker_bits
from atom_core.labeling.marker_search import square_bits

_BITS, _SIZES = (4, 5, 6, 7), (50, 100, 250, 1000)  # small ones are the beginning of large ones
_FAMILIES = tuple(f"DICT_{n}X{n}" for n in _BITS)  # a configuration may name no others
_MOST_SQUARES = 80  # the largest ones are looked at
_LEAST_MARKERS = 5  # whose every bit is as it should be


def dictionary_seen(grey: np.ndarray, outlines: np.ndarray, markers: int) -> str:
    """Return the name of the dictionary that most squares have a marker of, '' if none has.

    Args:
        grey: (height, width) uint8.
        outlines: (n, 4, 2) of squares [px].
        markers: how many the board has: of the dictionaries of a kind the smallest with as many.
    """
    if len(outlines) < _LEAST_MARKERS:
        return ""
    sides_px = np.linalg.norm(outlines - np.roll(outlines, 1, axis=1), axis=2).sum(axis=1)
    chosen = outlines[np.argsort(-sides_px)[:_MOST_SQUARES]]
    best, most = "", _LEAST_MARKERS - 1
    for family in _FAMILIES:
        known = marker_bits(f"{family}_{_SIZES[-1]}")
        numbers = _read(square_bits(grey, chosen, known.shape[1]), known)
        count = int(np.sum(numbers < markers))
        if count > most:
            size = next(size for size in _SIZES if size >= min(markers, _SIZES[-1]))
            best, most = f"{family}_{size}", count
    return best


def _read(bits: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return the numbers of the markers (k, s, s) that (n, s, s) bits are, in any turn."""
    codes = {marker.tobytes(): number for number, marker in enumerate(known)}
    turned = (np.rot90(one, turns) for one in bits for turns in range(4))
    found = {codes.get(np.ascontiguousarray(one).tobytes(), -1) for one in turned} - {-1}
    return np.array(sorted(found), dtype=int)
