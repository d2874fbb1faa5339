"""Point clouds in PCD files (versions 0.5 to 0.7); read in every encoding, written in binary."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, List, Mapping, Optional, Sequence, Tuple, Union

import numpy as np

from atom_core.errors import DatasetError
from atom_core.io import lzf
from atom_core.io.atomic import PathLike, write_bytes_atomically
from atom_core.io.paths import unread
from atom_core.io.pcd_header import (
    ASCII,
    BINARY,
    DTYPES,
    IDENTITY_VIEWPOINT,
    PADDING,
    DamagedError,
    Field,
    Header,
    damaged,
    parse_header,
)

_TYPES = {dtype: type_and_size for type_and_size, dtype in DTYPES.items()}


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
    viewpoint: Tuple[float, ...] = IDENTITY_VIEWPOINT
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
        header, body = parse_header(data)
        read_body = {ASCII: _read_ascii, BINARY: _read_binary}.get(header.encoding, _read_lzf)
        fields = read_body(header, body)
    except DamagedError as error:
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


# --- bodies: one array per field, padding included ---------------------------------------------


def _read_binary(header: Header, body: bytes) -> List[np.ndarray]:
    needed = header.points * header.bytes_per_point
    _check_length(header, len(body), needed)
    # Names by position: there may be several fields '_'.
    record = np.dtype(
        [(f"f{i}", f.dtype, (f.count,)) for i, f in enumerate(header.fields)], align=False
    )
    table = np.frombuffer(body[:needed], dtype=record)
    return [f.shaped(table[f"f{i}"]) for i, f in enumerate(header.fields)]


def _read_lzf(header: Header, body: bytes) -> List[np.ndarray]:
    if len(body) < 8:
        _check_length(header, len(body), 8)
    packed_size, size = struct.unpack_from("<II", body)
    _check_length(header, len(body), 8 + packed_size)
    needed = header.points * header.bytes_per_point
    if size != needed:
        raise damaged(
            f"the compressed body holds {size} bytes, but {header.points} points of "
            f"{header.bytes_per_point} bytes need {needed}"
        )
    try:
        table = lzf.decompress(body[8 : 8 + packed_size], size)
    except ValueError as error:
        raise damaged(str(error)) from error
    columns, start = [], 0
    for f in header.fields:  # field after field, unlike the plain binary encoding
        end = start + header.points * f.bytes_per_point
        columns.append(f.shaped(np.frombuffer(table[start:end], dtype=f.dtype)))
        start = end
    return columns


def _check_length(header: Header, there: int, needed: int) -> None:
    if there < needed:
        raise damaged(
            f"the file is cut off: {needed - there} of {needed} bytes after the header are "
            f"missing ({header.points} points); copy or record it again"
        )


def _read_ascii(header: Header, body: bytes) -> List[np.ndarray]:
    return _ascii_columns(header, body) or _read_ascii_by_line(header, body)


def _ascii_columns(header: Header, body: bytes) -> Optional[List[np.ndarray]]:
    """Return the columns of a sound body; None where something is wrong with it, or odd."""
    expected, words = sum(f.count for f in header.fields), []
    for line in body.split(b"\n"):
        there = line.split()
        if there and len(there) != expected:
            return None
        words += there
    if len(words) != header.points * expected:
        return None
    columns, start = [], 0
    try:
        for f in header.fields:
            parse: Any = float if f.dtype.kind == "f" else int
            of_each = [words[start + i :: expected] for i in range(f.count)]
            parsed = [_fitting(list(map(parse, texts)), f.dtype) for texts in of_each]
            columns.append(f.shaped(np.stack(parsed, axis=-1)))
            start += f.count
    except (ValueError, OverflowError):
        return None
    return columns


def _read_ascii_by_line(header: Header, body: bytes) -> List[np.ndarray]:
    """Read a body slowly, with the line of what is wrong with it."""
    try:
        lines = body.decode("ascii").split("\n")
    except UnicodeDecodeError as error:
        line = header.lines + 1 + body[: error.start].count(b"\n")
        raise damaged("the body of an ascii file holds other bytes", line) from error
    rows = [(header.lines + 1 + i, words) for i, words in enumerate(map(str.split, lines)) if words]
    expected = sum(f.count for f in header.fields)
    for line, words in rows:
        if len(words) != expected:
            raise damaged(f"{len(words)} values instead of {expected}", line)
    if len(rows) != header.points:
        raise damaged(f"{len(rows)} points, but the header says {header.points}")
    columns, start = [], 0
    for f in header.fields:
        parsed = [_parse_column(f, rows, start + i) for i in range(f.count)]
        columns.append(f.shaped(np.stack(parsed, axis=-1)))
        start += f.count
    return columns


def _parse_column(f: Field, rows: Sequence[Tuple[int, List[str]]], column: int) -> np.ndarray:
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
            raise damaged(
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
