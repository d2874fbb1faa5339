"""Reads LZF, the compression of PCD files (format of liblzf 3).

A stream is a sequence of literals (control byte c < 32: c + 1 bytes follow) and back references
(control byte: length - 2 in the upper three bits, 7 meaning that one more byte is added; then 13
bits of distance - 1).
"""

from __future__ import annotations

_MAX_LITERAL = 32


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


def _repeat(out: bytearray, distance: int, length: int) -> None:
    """Append `length` bytes from `distance` back; they may overlap what is appended."""
    start = len(out) - distance
    if start < 0:
        raise ValueError("the compressed data refer to bytes before their start")
    if distance >= length:
        out += out[start : start + length]
    else:
        out += (out[start:] * (length // distance + 1))[:length]
