"""Clouds: PointCloud2 of any layout, and Livox's own messages, to arrays and back."""

from __future__ import annotations

from typing import Any, List

import numpy as np
from sensor_msgs.msg import PointCloud2, PointField

from atom_calibration.errors import MessageError

POINT_CLOUD = "sensor_msgs/PointCloud2"
_POINT_FIELD_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
_DATATYPES = {kind: number for number, kind in _POINT_FIELD_TYPES.items()}
_XYZ = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4")])
# As Livox's driver lays out its PointCloud2.
_LIVOX = np.dtype([*_XYZ.descr, ("intensity", "<f4"), ("tag", "u1"), ("line", "u1")])


def point_cloud(message: Any) -> np.ndarray:
    """Return a PointCloud2 as a structured array (n,), row after row, any layout of the fields.

    Fields keep their names and types; one with a count above 1 has that many columns. Invalid
    points stay, so that indices are those of the message. A CustomMsg of Livox's drivers becomes
    what these would have made of the same points.

    Raises:
        MessageError: x, y or z is absent, the message is cut off, or a field is unknown.
    """
    if not hasattr(message, "fields"):
        return np.array(
            [(p.x, p.y, p.z, p.reflectivity, p.tag, p.line) for p in message.points], _LIVOX
        )
    dtype = _point_dtype(message)
    _check_positions(dtype)
    height, width, step = message.height, message.width, message.point_step
    data = np.frombuffer(message.data, dtype=np.uint8)
    row = width * step
    row_step = max(message.row_step, row) if height > 1 else row
    needed = row_step * (height - 1) + row if height else 0
    if len(data) < needed:
        raise MessageError(
            f"the cloud is cut off: {len(data)} bytes instead of {needed} for {width} x {height} "
            f"points; record it again"
        )
    if not height or not width:
        return np.zeros(0, dtype=dtype)
    rows = np.lib.stride_tricks.as_strided(data, (height, row), (row_step, 1))
    return np.ascontiguousarray(rows).reshape(-1).view(dtype)


def cloud_xyz(points: np.ndarray) -> np.ndarray:
    """Return positions (n, 3) float32 [m] of a structured cloud; what is not finite is NaN."""
    xyz = np.column_stack([points[axis].astype(np.float32) for axis in "xyz"])
    xyz[~np.all(np.isfinite(xyz), axis=1)] = np.nan
    return xyz


def _point_dtype(message: Any) -> np.dtype:
    order = ">" if message.is_bigendian else "<"
    names: List[str] = []
    formats: List[Any] = []
    offsets: List[int] = []
    for field in message.fields:
        if field.datatype not in _POINT_FIELD_TYPES:
            raise MessageError(
                f"field '{field.name}' has the datatype {field.datatype}, which PointField does "
                f"not define"
            )
        if not field.name or field.name in names:
            continue  # padding that some drivers declare
        kind = order + _POINT_FIELD_TYPES[field.datatype]
        # Before numpy looks at it, which counts offsets in 32 bits, and reads anywhere beyond.
        if field.offset + max(field.count, 1) * np.dtype(kind).itemsize > message.point_step:
            raise MessageError(
                f"field '{field.name}' does not fit into a point of {message.point_step} bytes "
                f"(offset {field.offset}, count {field.count}); record the cloud again"
            )
        names.append(field.name)
        formats.append(kind if field.count <= 1 else (kind, (field.count,)))
        offsets.append(field.offset)
    layout: Any = {"names": names, "formats": formats, "offsets": offsets}
    layout["itemsize"] = message.point_step
    try:
        return np.dtype(layout)
    except ValueError as error:
        raise MessageError(
            f"points of {message.point_step} bytes with the fields {', '.join(names)} cannot be "
            f"read ({error}); record the cloud again"
        ) from None


def _check_positions(dtype: np.dtype) -> None:
    names = dtype.names or ()
    absent = [axis for axis in "xyz" if axis not in names]
    if absent:
        raise MessageError(
            f"the cloud has no field {', '.join(absent)} (its fields: {', '.join(names) or 'none'}"
            f"); choose a topic with positions"
        )
    several = [axis for axis in "xyz" if dtype[axis].shape]
    if several:
        raise MessageError(
            f"field {', '.join(several)} has several values in each point (count); a position has "
            f"one of each"
        )


def structured(positions: np.ndarray) -> np.ndarray:
    """Return positions (n, 3) [m] as a structured cloud (n,) with the fields x, y, z."""
    points = np.zeros(len(positions), _XYZ)
    points["x"], points["y"], points["z"] = positions.T
    return points


def cloud_message(points: np.ndarray, is_dense: bool) -> PointCloud2:
    """Return a structured cloud (n,) as a message; the header is left to the caller.

    Args:
        points: its fields, of little-endian scalars, become the fields of the message.
        is_dense: no point is invalid.
    """
    assert points.dtype.names is not None and points.dtype.fields is not None
    fields = []
    for name in points.dtype.names:
        kind, offset = points.dtype.fields[name][:2]
        fields.append(PointField(name, offset, _DATATYPES[kind.str[1:]], 1))
    return PointCloud2(
        height=1,
        width=len(points),
        fields=fields,
        point_step=points.dtype.itemsize,
        row_step=points.nbytes,
        is_dense=is_dense,
        data=points.tobytes(),
    )
