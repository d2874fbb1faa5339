"""LZF, the compression of PCD files (format of liblzf 3), in plain Python and numpy.

A stream is a sequence of literals (control byte c < 32: c + 1 bytes follow) and back references
(control byte: length - 2 in the upper three bits, 7 meaning that one more byte is added; then 13
bits of distance - 1).
"""

from __future__ import annotations

from typing import List

import numpy as np

_MAX_LITERAL = 32
_MAX_DISTANCE = 1 << 13
_MIN_MATCH, _MAX_MATCH = 3, 264


def decompress(data: bytes, size: int) -> bytes:
    """Return the uncompressed bytes.

    Args:
        data: one LZF stream.
        size: number of uncompressed bytes.

    Raises:
        ValueError: the stream is damaged: it refers to before its start, ends early, or gives
            another number of bytes.
    """
    out = bytearray()
    position, end = 0, len(data)
    try:
        while position < end and len(out) <= size:
            control = data[position]
            position += 1
            if control < _MAX_LITERAL:
                out += data[position : position + control + 1]
                position += control + 1
                continue
            length = (control >> 5) + 2
            if length == 9:
                length += data[position]
                position += 1
            distance = ((control & 31) << 8) + data[position] + 1
            position += 1
            _repeat(out, distance, length)
    except IndexError:
        position = end + 1
    if position > end:
        raise ValueError("the compressed data end in the middle of a token")
    if len(out) != size:
        raise ValueError(f"the compressed data give {len(out)} bytes instead of {size}")
    return bytes(out)


def compress(data: bytes) -> bytes:
    """Return an LZF stream of the bytes.

    Greedy: at each position the last occurrence of the same three bytes within reach is taken.
    Data that cannot be compressed grow by one part in 32; every decoder reads them all the same.
    """
    previous = _previous_occurrence(data)
    matches: List[int] = np.flatnonzero(previous >= 0).tolist()
    source: List[int] = previous.tolist()
    out = bytearray()
    literal_start = 0
    for position in matches:
        if position < literal_start:  # inside the match before
            continue
        length = _match_length(data, source[position], position)
        _append_literals(out, data[literal_start:position])
        _append_reference(out, position - source[position], length)
        literal_start = position + length
    _append_literals(out, data[literal_start:])
    return bytes(out)


def _repeat(out: bytearray, distance: int, length: int) -> None:
    """Append `length` bytes from `distance` back; they may overlap what is appended."""
    start = len(out) - distance
    if start < 0:
        raise ValueError("the compressed data refer to bytes before their start")
    if distance >= length:
        out += out[start : start + length]
    else:
        out += (out[start:] * (length // distance + 1))[:length]


def _previous_occurrence(data: bytes) -> np.ndarray:
    """Return for each position that of the last equal three bytes within reach, or -1."""
    values = np.frombuffer(data, dtype=np.uint8).astype(np.int32)
    previous = np.full(len(values), -1)
    if len(values) <= _MIN_MATCH:
        return previous
    triples = (values[:-2] << 16) | (values[1:-1] << 8) | values[2:]
    order = np.argsort(triples, kind="stable")
    same = triples[order[1:]] == triples[order[:-1]]
    later, earlier = order[1:][same], order[:-1][same]
    near = later - earlier <= _MAX_DISTANCE
    previous[later[near]] = earlier[near]
    return previous


def _match_length(data: bytes, source: int, position: int) -> int:
    """Return how many bytes from `source` equal those from `position` (at least three)."""
    limit = min(_MAX_MATCH, len(data) - position)
    length = _MIN_MATCH
    while length + 8 <= limit and (
        data[source + length : source + length + 8]
        == data[position + length : position + length + 8]
    ):
        length += 8
    while length < limit and data[source + length] == data[position + length]:
        length += 1
    return length


def _append_literals(out: bytearray, data: bytes) -> None:
    for start in range(0, len(data), _MAX_LITERAL):
        chunk = data[start : start + _MAX_LITERAL]
        out.append(len(chunk) - 1)
        out += chunk


def _append_reference(out: bytearray, distance: int, length: int) -> None:
    distance -= 1
    code = length - 2
    if code < 7:
        out.append((code << 5) | (distance >> 8))
    else:
        out.append((7 << 5) | (distance >> 8))
        out.append(code - 7)
    out.append(distance & 0xFF)
