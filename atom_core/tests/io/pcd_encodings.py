"""Clouds in the encodings of PCD that others write and only the reader knows: text and LZF."""

import struct
from typing import List

import numpy as np

from atom_core.io.pcd import write_pcd
from atom_core.io.pcd_header import ASCII, BINARY, BINARY_COMPRESSED

_MAX_LITERAL = 32
_MAX_DISTANCE = 1 << 13
_MIN_MATCH, _MAX_MATCH = 3, 264


def write_encoded(path, fields, encoding, **size):
    """Write the fields of a cloud in any of the encodings; the header is that of the binary one."""
    write_pcd(path, fields, **size)
    if encoding == BINARY:
        return
    header = path.read_bytes().split(b"DATA binary\n")[0] + f"DATA {encoding}\n".encode()
    fields = getattr(fields, "fields", fields)
    columns = [
        np.asarray(v).reshape(len(v), v.shape[1] if v.ndim > 1 else 1) for v in fields.values()
    ]
    body = {ASCII: _text, BINARY_COMPRESSED: _compressed}[encoding](columns)
    path.write_bytes(header + body)


def _compressed(columns):
    table = b"".join(np.ascontiguousarray(column).tobytes() for column in columns)
    packed = compress(table)
    return struct.pack("<II", len(packed), len(table)) + packed


def _text(columns):
    texts = []
    for column in columns:
        # 9 and 17 digits bring every float32 and float64 back exactly.
        style = {"f4": "%.9g", "f8": "%.17g"}.get(column.dtype.str[1:], "%d")
        texts.extend([style % value for value in values] for values in column.T.tolist())
    return "".join(" ".join(row) + "\n" for row in zip(*texts)).encode("ascii")


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
