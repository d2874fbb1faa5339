"""The header of a PCD file: which fields a cloud has, how many points, in which encoding."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, List, Mapping, Optional, Tuple

import numpy as np

ASCII, BINARY, BINARY_COMPRESSED = "ascii", "binary", "binary_compressed"
ENCODINGS = (ASCII, BINARY, BINARY_COMPRESSED)
PADDING = "_"  # the name of fields that only fill gaps; there may be several
IDENTITY_VIEWPOINT = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
_KEYS = (
    *("VERSION", "FIELDS", "COLUMNS", "SIZE", "TYPE", "COUNT"),
    *("WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA"),
)
_MAX_HEADER_LINES = 64
DTYPES = {
    **{("F", size): np.dtype(f"<f{size}") for size in (4, 8)},
    **{("I", size): np.dtype(f"<i{size}") for size in (1, 2, 4, 8)},
    **{("U", size): np.dtype(f"<u{size}") for size in (1, 2, 4, 8)},
}


@dataclass(frozen=True)
class Field:
    """What a point has: ``count`` values of one type under one name."""

    name: str
    dtype: np.dtype
    count: int

    @property
    def bytes_per_point(self) -> int:
        """Its values of one point."""
        return self.dtype.itemsize * self.count

    def shaped(self, values: np.ndarray) -> np.ndarray:
        """Give values of all points the shape (n,) or (n, count), in a memory of their own."""
        values = np.array(values, dtype=self.dtype.newbyteorder("="))
        return values.reshape(-1) if self.count == 1 else values.reshape(-1, self.count)


@dataclass(frozen=True)
class Header:
    """What a header says; ``lines`` is how many it has."""

    fields: Tuple[Field, ...]
    width: int
    height: int
    viewpoint: Tuple[float, ...]
    encoding: str
    lines: int

    @property
    def points(self) -> int:
        """How many there are."""
        return self.width * self.height

    @property
    def bytes_per_point(self) -> int:
        """All fields of one point, padding included."""
        return sum(f.bytes_per_point for f in self.fields)


class DamagedError(Exception):
    """What is wrong, beginning with its place in the file (': ...' or ':line: ...')."""


def damaged(message: str, line: Optional[int] = None) -> DamagedError:
    """Return what to raise where a file is damaged, at a line of it."""
    return DamagedError(f": {message}" if line is None else f":{line}: {message}")


def parse_header(data: bytes) -> Tuple[Header, bytes]:
    """Return the header and the bytes after it."""
    entries: Dict[str, Tuple[int, List[str]]] = {}
    position, number = 0, 0
    while "DATA" not in entries:
        number += 1
        end = data.find(b"\n", position)
        if end < 0 or number > _MAX_HEADER_LINES:
            what = "the header ends early" if entries else "this is not a PCD file"
            raise damaged(f"{what}: no line 'DATA ...' found; copy or record the file again")
        words = _header_words(data[position:end], number)
        position = end + 1
        if words:
            entries["FIELDS" if words[0] == "COLUMNS" else words[0]] = (number, words[1:])
    return _header_from(entries, number), data[position:]


def _header_words(line: bytes, number: int) -> List[str]:
    """Return a line's words, none for a comment or an empty line."""
    try:
        words = line.split(b"#", 1)[0].decode("ascii").split()
    except UnicodeDecodeError as error:
        raise damaged("the header is not text; this is not a PCD file", number) from error
    if words and words[0] not in _KEYS:
        if number == 1:  # of any file: what stands in it is nobody's business
            raise damaged("this is not a PCD file, whose header has other words", number)
        raise damaged(f"'{words[0][:40]}' is not a word of a PCD header", number)
    return words


def _header_from(entries: Mapping[str, Tuple[int, List[str]]], lines: int) -> Header:
    for key in ("FIELDS", "SIZE", "TYPE"):
        if key not in entries:
            raise damaged(f"the header has no line '{key}'")
    fields = _parse_fields(entries)
    line, words = entries["DATA"]
    if len(words) != 1 or words[0].lower() not in ENCODINGS:
        raise damaged(f"DATA is '{' '.join(words)}'; known are {', '.join(ENCODINGS)}", line)
    width, height = _parse_size(entries)
    return Header(fields, width, height, _parse_viewpoint(entries), words[0].lower(), lines)


def _parse_fields(entries: Mapping[str, Tuple[int, List[str]]]) -> Tuple[Field, ...]:
    line, names = entries["FIELDS"]
    if not names:
        raise damaged("FIELDS names no field", line)
    twice = [n for n in names if n != PADDING and names.count(n) > 1]
    if twice:
        raise damaged(f"FIELDS names '{twice[0]}' twice", line)
    sizes = _integers(entries, "SIZE", len(names))
    counts = _integers(entries, "COUNT", len(names)) if "COUNT" in entries else [1] * len(names)
    line, types = entries["TYPE"]
    if len(types) != len(names):
        raise damaged(f"TYPE has {len(types)} entries for {len(names)} fields", line)
    fields = []
    for name, size, kind, count in zip(names, sizes, types, counts):
        dtype = DTYPES.get((kind.upper(), size))
        if dtype is None:
            raise damaged(f"field '{name}' has type {kind} of {size} bytes, which is none", line)
        if count < 1:
            raise damaged(f"field '{name}' has COUNT {count}", entries["COUNT"][0])
        fields.append(Field(name, dtype, count))
    return tuple(fields)


def _parse_size(entries: Mapping[str, Tuple[int, List[str]]]) -> Tuple[int, int]:
    points = _integers(entries, "POINTS", 1)[0] if "POINTS" in entries else None
    if "WIDTH" not in entries and points is None:
        raise damaged("the header has neither WIDTH nor POINTS")
    width = _integers(entries, "WIDTH", 1)[0] if "WIDTH" in entries else points
    height = _integers(entries, "HEIGHT", 1)[0] if "HEIGHT" in entries else 1
    assert width is not None
    for key, number in (("WIDTH", width), ("HEIGHT", height)):
        if number < 0:
            raise damaged(f"{key} is {number}", entries[key][0] if key in entries else None)
    if points is not None and points != width * height:
        raise damaged(
            f"POINTS is {points}, but WIDTH x HEIGHT is {width} x {height} = {width * height}",
            entries["POINTS"][0],
        )
    return width, height


def _parse_viewpoint(entries: Mapping[str, Tuple[int, List[str]]]) -> Tuple[float, ...]:
    if "VIEWPOINT" not in entries:
        return IDENTITY_VIEWPOINT
    line, words = entries["VIEWPOINT"]
    try:
        numbers = tuple(float(word) for word in words)
    except ValueError:
        numbers = ()
    if len(numbers) != 7:
        raise damaged(f"VIEWPOINT is '{' '.join(words)}', not 7 numbers", line)
    return numbers


def _integers(entries: Mapping[str, Tuple[int, List[str]]], key: str, expected: int) -> List[int]:
    line, words = entries[key]
    try:
        numbers = [int(word) for word in words]
    except ValueError as error:
        raise damaged(f"{key} is '{' '.join(words)}', not whole numbers", line) from error
    if len(numbers) != expected:
        raise damaged(f"{key} has {len(numbers)} entries instead of {expected}", line)
    return numbers
