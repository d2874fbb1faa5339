"""Point clouds in PCD files (versions 0.5 to 0.7); read in every encoding, written in binary."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple, Union

import numpy as np

from atom_core.errors import DatasetError
from atom_core.io import lzf
from atom_core.io.atomic import PathLike, write_bytes_atomically
from atom_core.io.paths import unread

ASCII, BINARY, BINARY_COMPRESSED = "ascii", "binary", "binary_compressed"
ENCODINGS = (ASCII, BINARY, BINARY_COMPRESSED)
PADDING = "_"  # the name of fields that only fill gaps; there may be several
_IDENTITY_VIEWPOINT = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
_KEYS = (
    *("VERSION", "FIELDS", "COLUMNS", "SIZE", "TYPE", "COUNT"),
    *("WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA"),
)
_MAX_HEADER_LINES = 64
_DTYPES = {
    **{("F", size): np.dtype(f"<f{size}") for size in (4, 8)},
    **{("I", size): np.dtype(f"<i{size}") for size in (1, 2, 4, 8)},
    **{("U", size): np.dtype(f"<u{size}") for size in (1, 2, 4, 8)},
}
_TYPES = {dtype: type_and_size for type_and_size, dtype in _DTYPES.items()}


@dataclass(frozen=True, eq=False)
class PointCloud:
    """A cloud as a table of fields; point i of an organised cloud is row i // width.

    Attributes:
        fields: name -> (n,) array, or (n, count) where a point has several values; without
            padding.
        width, height: points per row and number of rows; n = width * height.
        viewpoint: (7,) pose of the sensor, tx ty tz [m] qw qx qy qz; PCD's order, not ours.
        source: what to call the cloud in messages.
    """

    fields: Mapping[str, np.ndarray]
    width: int
    height: int
    viewpoint: Tuple[float, ...] = _IDENTITY_VIEWPOINT
    source: str = field(default="the cloud")

    def __post_init__(self) -> None:
        if self.width < 0 or self.height < 0:
            raise ValueError(f"a cloud of {self.width} x {self.height} points cannot be")
        for name, values in self.fields.items():
            if len(values) != len(self):
                raise ValueError(
                    f"field '{name}' has {len(values)} values, the cloud {len(self)} points"
                )
        if len(self.viewpoint) != 7:
            raise ValueError(f"a viewpoint has 7 numbers, not {len(self.viewpoint)}")

    def __len__(self) -> int:
        return self.width * self.height

    @property
    def xyz(self) -> np.ndarray:
        """(n, 3) positions [m] in the sensor's data frame, float64, row by row.

        Invalid points stay where they are (NaN, or zeros if so written), so that indices into
        the cloud keep their meaning.

        Raises:
            DatasetError: x, y or z is absent.
        """
        absent = [axis for axis in "xyz" if axis not in self.fields]
        if absent:
            raise DatasetError(
                f"{self.source}: no field '{absent[0]}' (it has {', '.join(self.fields)}); a "
                f"cloud needs x, y and z"
            )
        return np.stack([np.asarray(self.fields[a], dtype=np.float64) for a in "xyz"], axis=-1)


@dataclass(frozen=True)
class _Field:
    name: str
    dtype: np.dtype
    count: int

    @property
    def bytes_per_point(self) -> int:
        return self.dtype.itemsize * self.count

    def shaped(self, values: np.ndarray) -> np.ndarray:
        """Give values of all points the shape (n,) or (n, count), in a memory of their own."""
        values = np.array(values, dtype=self.dtype.newbyteorder("="))
        return values.reshape(-1) if self.count == 1 else values.reshape(-1, self.count)


@dataclass(frozen=True)
class _Header:
    fields: Tuple[_Field, ...]
    width: int
    height: int
    viewpoint: Tuple[float, ...]
    encoding: str
    lines: int

    @property
    def points(self) -> int:
        return self.width * self.height

    @property
    def bytes_per_point(self) -> int:
        return sum(f.bytes_per_point for f in self.fields)


def read_pcd(path: PathLike) -> PointCloud:
    """Read a cloud.

    Any layout is read: types of 1 to 8 bytes, several values per field, padding fields ``_``,
    organised clouds, and bytes after the last point (PCL fills the last page of a file).

    Args:
        path: the file.

    Returns:
        The cloud, with every field but the padding.

    Raises:
        DatasetError: it cannot be opened, or header or body is damaged; the message names the
            line or the number of bytes missing.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise DatasetError(f"{path}: the cloud cannot be read ({unread(path, error)})") from error
    try:
        header, body = _parse_header(data)
        read_body = {ASCII: _read_ascii, BINARY: _read_binary}.get(header.encoding, _read_lzf)
        fields = read_body(header, body)
    except _DamagedError as error:
        raise DatasetError(f"{path}{error}") from error
    kept = {f.name: fields[i] for i, f in enumerate(header.fields) if f.name != PADDING}
    return PointCloud(kept, header.width, header.height, header.viewpoint, str(path))


def write_pcd(
    path: PathLike,
    fields_or_xyz: Union[PointCloud, Mapping[str, np.ndarray], np.ndarray],
    *,
    width: Optional[int] = None,
    height: Optional[int] = None,
) -> None:
    """Write a cloud in binary; ``write_pcd(path, xyz)`` writes it as ATOM does (float32, height 1).

    Args:
        path: the file.
        fields_or_xyz: (n, 3) or (height, width, 3) positions [m], written as float32; or name ->
            (n,) or (n, count) array, written in its own type; or a cloud.
        width: points per row, or None.
        height: number of rows, or None; one row if neither is given.

    Raises:
        OutputError: the file cannot be written.
        ValueError: the arrays do not make a cloud.
    """
    cloud = _as_cloud(fields_or_xyz, width, height)
    columns = {name: _column(name, values) for name, values in cloud.fields.items()}
    header = _header_text(cloud, columns).encode("ascii")
    write_bytes_atomically(path, header + _binary_body(columns, len(cloud)))


# --- header ---------------------------------------------------------------------------------


class _DamagedError(Exception):
    """What is wrong, beginning with its place in the file (': ...' or ':line: ...')."""


def _damaged(message: str, line: Optional[int] = None) -> _DamagedError:
    return _DamagedError(f": {message}" if line is None else f":{line}: {message}")


def _parse_header(data: bytes) -> Tuple[_Header, bytes]:
    """Return the header and the bytes after it."""
    entries: Dict[str, Tuple[int, List[str]]] = {}
    position, number = 0, 0
    while "DATA" not in entries:
        number += 1
        end = data.find(b"\n", position)
        if end < 0 or number > _MAX_HEADER_LINES:
            what = "the header ends early" if entries else "this is not a PCD file"
            raise _damaged(f"{what}: no line 'DATA ...' found; copy or record the file again")
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
        raise _damaged("the header is not text; this is not a PCD file", number) from error
    if words and words[0] not in _KEYS:
        if number == 1:  # of any file: what stands in it is nobody's business
            raise _damaged("this is not a PCD file, whose header has other words", number)
        raise _damaged(f"'{words[0][:40]}' is not a word of a PCD header", number)
    return words


def _header_from(entries: Mapping[str, Tuple[int, List[str]]], lines: int) -> _Header:
    for key in ("FIELDS", "SIZE", "TYPE"):
        if key not in entries:
            raise _damaged(f"the header has no line '{key}'")
    fields = _parse_fields(entries)
    line, words = entries["DATA"]
    if len(words) != 1 or words[0].lower() not in ENCODINGS:
        raise _damaged(f"DATA is '{' '.join(words)}'; known are {', '.join(ENCODINGS)}", line)
    width, height = _parse_size(entries)
    return _Header(fields, width, height, _parse_viewpoint(entries), words[0].lower(), lines)


def _parse_fields(entries: Mapping[str, Tuple[int, List[str]]]) -> Tuple[_Field, ...]:
    line, names = entries["FIELDS"]
    if not names:
        raise _damaged("FIELDS names no field", line)
    twice = [n for n in names if n != PADDING and names.count(n) > 1]
    if twice:
        raise _damaged(f"FIELDS names '{twice[0]}' twice", line)
    sizes = _integers(entries, "SIZE", len(names))
    counts = _integers(entries, "COUNT", len(names)) if "COUNT" in entries else [1] * len(names)
    line, types = entries["TYPE"]
    if len(types) != len(names):
        raise _damaged(f"TYPE has {len(types)} entries for {len(names)} fields", line)
    fields = []
    for name, size, kind, count in zip(names, sizes, types, counts):
        dtype = _DTYPES.get((kind.upper(), size))
        if dtype is None:
            raise _damaged(f"field '{name}' has type {kind} of {size} bytes, which is none", line)
        if count < 1:
            raise _damaged(f"field '{name}' has COUNT {count}", entries["COUNT"][0])
        fields.append(_Field(name, dtype, count))
    return tuple(fields)


def _parse_size(entries: Mapping[str, Tuple[int, List[str]]]) -> Tuple[int, int]:
    points = _integers(entries, "POINTS", 1)[0] if "POINTS" in entries else None
    if "WIDTH" not in entries and points is None:
        raise _damaged("the header has neither WIDTH nor POINTS")
    width = _integers(entries, "WIDTH", 1)[0] if "WIDTH" in entries else points
    height = _integers(entries, "HEIGHT", 1)[0] if "HEIGHT" in entries else 1
    assert width is not None
    for key, number in (("WIDTH", width), ("HEIGHT", height)):
        if number < 0:
            raise _damaged(f"{key} is {number}", entries[key][0] if key in entries else None)
    if points is not None and points != width * height:
        raise _damaged(
            f"POINTS is {points}, but WIDTH x HEIGHT is {width} x {height} = {width * height}",
            entries["POINTS"][0],
        )
    return width, height


def _parse_viewpoint(entries: Mapping[str, Tuple[int, List[str]]]) -> Tuple[float, ...]:
    if "VIEWPOINT" not in entries:
        return _IDENTITY_VIEWPOINT
    line, words = entries["VIEWPOINT"]
    try:
        numbers = tuple(float(word) for word in words)
    except ValueError:
        numbers = ()
    if len(numbers) != 7:
        raise _damaged(f"VIEWPOINT is '{' '.join(words)}', not 7 numbers", line)
    return numbers


def _integers(entries: Mapping[str, Tuple[int, List[str]]], key: str, expected: int) -> List[int]:
    line, words = entries[key]
    try:
        numbers = [int(word) for word in words]
    except ValueError as error:
        raise _damaged(f"{key} is '{' '.join(words)}', not whole numbers", line) from error
    if len(numbers) != expected:
        raise _damaged(f"{key} has {len(numbers)} entries instead of {expected}", line)
    return numbers


# --- bodies: one array per field, padding included ---------------------------------------------


def _read_binary(header: _Header, body: bytes) -> List[np.ndarray]:
    needed = header.points * header.bytes_per_point
    _check_length(header, len(body), needed)
    # Names by position: there may be several fields '_'.
    record = np.dtype(
        [(f"f{i}", f.dtype, (f.count,)) for i, f in enumerate(header.fields)], align=False
    )
    table = np.frombuffer(body[:needed], dtype=record)
    return [f.shaped(table[f"f{i}"]) for i, f in enumerate(header.fields)]


def _read_lzf(header: _Header, body: bytes) -> List[np.ndarray]:
    if len(body) < 8:
        _check_length(header, len(body), 8)
    packed_size, size = struct.unpack_from("<II", body)
    _check_length(header, len(body), 8 + packed_size)
    needed = header.points * header.bytes_per_point
    if size != needed:
        raise _damaged(
            f"the compressed body holds {size} bytes, but {header.points} points of "
            f"{header.bytes_per_point} bytes need {needed}"
        )
    try:
        table = lzf.decompress(body[8 : 8 + packed_size], size)
    except ValueError as error:
        raise _damaged(str(error)) from error
    columns, start = [], 0
    for f in header.fields:  # field after field, unlike the plain binary encoding
        end = start + header.points * f.bytes_per_point
        columns.append(f.shaped(np.frombuffer(table[start:end], dtype=f.dtype)))
        start = end
    return columns


def _check_length(header: _Header, there: int, needed: int) -> None:
    if there < needed:
        raise _damaged(
            f"the file is cut off: {needed - there} of {needed} bytes after the header are "
            f"missing ({header.points} points); copy or record it again"
        )


def _read_ascii(header: _Header, body: bytes) -> List[np.ndarray]:
    try:
        lines = body.decode("ascii").split("\n")
    except UnicodeDecodeError as error:
        line = header.lines + 1 + body[: error.start].count(b"\n")
        raise _damaged("the body of an ascii file holds other bytes", line) from error
    rows = [(header.lines + 1 + i, words) for i, words in enumerate(map(str.split, lines)) if words]
    expected = sum(f.count for f in header.fields)
    for line, words in rows:
        if len(words) != expected:
            raise _damaged(f"{len(words)} values instead of {expected}", line)
    if len(rows) != header.points:
        raise _damaged(f"{len(rows)} points, but the header says {header.points}")
    columns, start = [], 0
    for f in header.fields:
        parsed = [_parse_column(f, rows, start + i) for i in range(f.count)]
        columns.append(f.shaped(np.stack(parsed, axis=-1)))
        start += f.count
    return columns


def _parse_column(f: _Field, rows: Sequence[Tuple[int, List[str]]], column: int) -> np.ndarray:
    """Return one value of every row, in the field's type; out of its range is an error."""
    parse: Any = float if f.dtype.kind == "f" else int
    try:
        numbers = [parse(words[column]) for _, words in rows]
        return _fitting(numbers, f.dtype)
    except (ValueError, OverflowError):
        pass
    for line, words in rows:  # slow, but only to find the culprit
        try:
            _fitting([parse(words[column])], f.dtype)
        except (ValueError, OverflowError):
            raise _damaged(
                f"'{words[column][:40]}' is not a value of field '{f.name}' ({f.dtype.name})", line
            ) from None
    raise AssertionError("unreachable: some row failed above")


def _fitting(numbers: Sequence[Any], dtype: np.dtype) -> np.ndarray:
    if dtype.kind != "f" and len(numbers) > 0:
        limits = np.iinfo(dtype)
        if min(numbers) < limits.min or max(numbers) > limits.max:
            raise OverflowError
    return np.array(numbers, dtype=dtype)


# --- writing ---------------------------------------------------------------------------------


def _as_cloud(
    content: Union[PointCloud, Mapping[str, np.ndarray], np.ndarray],
    width: Optional[int],
    height: Optional[int],
) -> PointCloud:
    if isinstance(content, PointCloud):
        if width is None and height is None:
            return content
        content = content.fields
    if not isinstance(content, Mapping):
        xyz = np.asarray(content, dtype=np.float32)
        if xyz.ndim not in (2, 3) or xyz.shape[-1] != 3:
            raise ValueError(f"positions are (n, 3) or (height, width, 3), not {xyz.shape}")
        if xyz.ndim == 3 and width is None and height is None:
            height, width = xyz.shape[:2]
        content = dict(zip("xyz", xyz.reshape(-1, 3).T))
    if not content:
        raise ValueError("a cloud has at least one field")
    points = len(next(iter(content.values())))
    if height is None:
        height = points // width if width else 1
    if width is None:
        width = points // height if height else 0
    return PointCloud(content, width, height)


def _column(name: str, values: np.ndarray) -> np.ndarray:
    """Return values (n, count) in a type that PCD knows."""
    values = np.asarray(values)
    if values.ndim not in (1, 2) or 0 in values.shape[1:]:
        raise ValueError(f"field '{name}' has shape {values.shape}; use (n,) or (n, count)")
    if values.dtype.newbyteorder("<") not in _TYPES:
        raise ValueError(f"field '{name}' has type {values.dtype}, which PCD does not know")
    if not name or name == PADDING or not name.isascii() or any(c in name for c in " \t\n\r#"):
        raise ValueError(f"'{name}' cannot be the name of a field")
    column = values.astype(values.dtype.newbyteorder("<"))
    return column[:, np.newaxis] if column.ndim == 1 else column


def _header_text(cloud: PointCloud, columns: Mapping[str, np.ndarray]) -> str:
    types = [_TYPES[column.dtype] for column in columns.values()]
    viewpoint = " ".join(f"{number:.17g}" for number in cloud.viewpoint)
    return (
        "# .PCD v0.7 - Point Cloud Data file format\n"
        "VERSION 0.7\n"
        f"FIELDS {' '.join(columns)}\n"
        f"SIZE {' '.join(str(size) for _, size in types)}\n"
        f"TYPE {' '.join(kind for kind, _ in types)}\n"
        f"COUNT {' '.join(str(column.shape[1]) for column in columns.values())}\n"
        f"WIDTH {cloud.width}\n"
        f"HEIGHT {cloud.height}\n"
        f"VIEWPOINT {viewpoint}\n"
        f"POINTS {len(cloud)}\n"
        f"DATA {BINARY}\n"
    )


def _binary_body(columns: Mapping[str, np.ndarray], points: int) -> bytes:
    record = np.dtype([(name, c.dtype, (c.shape[1],)) for name, c in columns.items()])
    table = np.empty(points, dtype=record)
    for name, column in columns.items():
        table[name] = column
    return table.tobytes()
