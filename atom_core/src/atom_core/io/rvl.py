"""Depth images packed by RVL, as compressed_depth_image_transport does it besides PNG.

The codec is Wilson's ("Fast Lossless Depth Image Compression", ACM ISS 2017): runs of zeros and of
measured depths take turns, each depth is the difference to the one before, and every number takes
as many nibbles of three bits as it needs. The transport puts width and height before it.
"""

from __future__ import annotations

import struct
from typing import Optional, Tuple

import numpy as np

from atom_core.io.encoded_images import too_many_pixels

_SIZE = struct.Struct("<II")  # width and height [pixels]
_MORE = 0b1000  # of a nibble: the number goes on in the next one
_BITS = 3  # of a number in each nibble
_MOST_NIBBLES = 11  # of a number of 32 bits
_MOST_BYTES = 4  # for a pixel: two lengths of runs and a difference of 17 bits


def rvl_image_size(data: bytes) -> Optional[Tuple[int, int]]:
    """Return (width, height) [pixels] as the header has them; None without one."""
    return _SIZE.unpack_from(data) if len(data) >= _SIZE.size else None


def decode_rvl(data: bytes) -> np.ndarray:
    """Return the image (height, width) uint16.

    Args:
        data: width and height, then what the codec made.

    Raises:
        ValueError: it is empty, cut off, damaged or too large (`too_many_pixels`); a few words that
            can follow the name of a file.
    """
    width, height = rvl_image_size(data) or (0, 0)
    if not width * height:
        raise ValueError("it is empty")
    flaw = too_many_pixels(width, height)
    if flaw:
        raise ValueError(flaw)
    longest = _MOST_BYTES * (width * height + 1)
    numbers = _numbers(data[_SIZE.size : _SIZE.size + longest])
    runs = _runs(numbers, width * height)
    is_depth = _in_turn(np.column_stack([np.full(len(runs), 2), runs[:, 1]]))
    packed = numbers[: len(is_depth)][is_depth]
    differences = (packed >> 1) ^ -(packed & 1)  # they are packed as 0, -1, 1, -2, 2 ...
    pixels = np.zeros(width * height, dtype=np.uint16)
    pixels[_in_turn(runs)] = np.cumsum(differences).astype(np.uint16)
    return pixels.reshape(height, width)


def _numbers(data: bytes) -> np.ndarray:
    """Return the numbers (n,) int64; zeros that fill up the last word are among them."""
    words = np.frombuffer(data[: len(data) // 4 * 4], dtype="<u4")
    in_order = words.astype(">u4").view(np.uint8)  # the first nibble is the word's highest
    nibbles = np.column_stack([in_order >> 4, in_order & 0xF]).ravel().astype(np.int64)
    ends = np.flatnonzero(nibbles < _MORE) + 1
    if not len(ends):
        return np.zeros(0, dtype=np.int64)
    starts = np.concatenate([[0], ends[:-1]])
    lengths = ends - starts
    if np.any(lengths > _MOST_NIBBLES):
        raise ValueError("it is damaged: a number has more than 32 bits")
    place = np.arange(ends[-1]) - np.repeat(starts, lengths)
    digits = (nibbles[: ends[-1]] & (_MORE - 1)) << (_BITS * place)
    return np.add.reduceat(digits, starts)


def _runs(numbers: np.ndarray, pixels: int) -> np.ndarray:
    """Return (n, 2) how many pixels are zero, and how many measured ones follow."""
    values, runs, position, done = numbers.tolist(), [], 0, 0
    while done < pixels and position + 1 < len(values):
        zeros, measured = values[position : position + 2]
        runs.append((zeros, measured))
        done += zeros + measured
        position += 2 + measured
    if done < pixels or position > len(values):
        raise ValueError(f"the depths are cut off after {len(numbers)} numbers")
    if done > pixels:
        raise ValueError(f"it is damaged: more than the {pixels} pixels of its size are packed")
    return np.array(runs)


def _in_turn(counts: np.ndarray) -> np.ndarray:
    """Return bools: of counts (n, 2) so many False, so many True, and so on."""
    return np.repeat(np.tile([False, True], len(counts)), counts.ravel())
