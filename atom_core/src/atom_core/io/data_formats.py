"""How images, depth images and clouds stand in a dataset: their files and their JSON entries."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Dict, Mapping, Optional

import numpy as np

from atom_core.errors import DatasetError
from atom_core.io.images import read_depth_png, read_image, write_depth_png, write_image
from atom_core.io.pcd import read_pcd, write_pcd
from atom_core.model.modality import DataFormat
from atom_core.model.sensor import Sensor

_FLOAT32 = 7  # sensor_msgs/PointField


def _read_cloud(path: Optional[Path], entry: Mapping[str, Any]) -> np.ndarray:
    """Return the cloud (n, 3) [m], flattened row by row, invalid points as NaN."""
    assert path is not None
    points = read_pcd(path).xyz
    expected = entry.get("width", len(points)) * entry.get("height", 1)
    if expected != len(points):
        raise DatasetError(
            f"{path}: {len(points)} points, the dataset says {expected}; the file does not belong "
            f"to this dataset"
        )
    return points


def _read_colour_image(path: Optional[Path], entry: Mapping[str, Any]) -> np.ndarray:
    assert path is not None
    return _of_size(read_image(path), path, entry)


def _read_depth_image(path: Optional[Path], entry: Mapping[str, Any]) -> np.ndarray:
    assert path is not None
    return _of_size(read_depth_png(path), path, entry)


def _of_size(image: np.ndarray, path: Path, entry: Mapping[str, Any]) -> np.ndarray:
    shape = image.shape[:2]
    expected = (entry.get("height", shape[0]), entry.get("width", shape[1]))
    if tuple(shape) != tuple(expected):
        raise DatasetError(
            f"{path}: the image is {shape[1]} x {shape[0]}, the dataset says {expected[1]} x "
            f"{expected[0]}"
        )
    return image


def _cloud_entry(_: Sensor, cloud: np.ndarray) -> Dict[str, Any]:
    fields = [
        {"name": axis, "offset": 4 * i, "datatype": _FLOAT32, "count": 1}
        for i, axis in enumerate("xyz")
    ]
    width = len(cloud)
    return {
        "height": 1,
        "width": width,
        "point_step": 12,
        "row_step": 12 * width,
        "fields": fields,
        "is_bigendian": False,
        "is_dense": bool(np.all(np.isfinite(cloud))),
    }


def _image_entry(image: np.ndarray, encoding: str, bytes_per_pixel: int) -> Dict[str, Any]:
    height, width = image.shape[:2]
    return {
        "height": height,
        "width": width,
        "encoding": encoding,
        "is_bigendian": 0,
        "step": bytes_per_pixel * width,
    }


COLOUR_IMAGES = DataFormat(
    message="Image",
    ending=".jpg",
    read=_read_colour_image,
    write=write_image,
    entry=lambda _, image: _image_entry(image, "bgr8", 3),
)
DEPTH_IMAGES = DataFormat(
    message="Image",
    ending=".png",
    read=_read_depth_image,
    write=write_depth_png,
    entry=lambda _, image: _image_entry(image, "32FC1", 4),
)
CLOUDS = DataFormat(
    message="PointCloud2", ending=".pcd", read=_read_cloud, write=write_pcd, entry=_cloud_entry
)
