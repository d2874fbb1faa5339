"""The data files beside a dataset's JSON, read when they are asked for and not before."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Callable, Dict, Mapping, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.io.images import read_depth_png, read_image
from atom_core.io.pcd import read_pcd
from atom_core.model.dataset import DataSource


class FileDataSource(DataSource):
    """Clouds and images of a dataset on disk."""

    def __init__(self, folder: Path, document: Mapping[str, Any]):
        """Remember where the files are.

        Args:
            folder: the folder that the dataset's file names are relative to.
            document: the dataset's JSON document.
        """
        self._folder = Path(folder)
        self._document = document

    def has_data(self, collection: str, sensor: str) -> bool:
        """Tell whether the data file exists."""
        entry = self._entry(collection, sensor)
        return "data_file" in entry and (self._folder / entry["data_file"]).is_file()

    def cloud(self, collection: str, sensor: str) -> np.ndarray:
        """Return the cloud (n, 3) [m], flattened row by row, invalid points as NaN."""
        entry = self._entry(collection, sensor)
        points = read_pcd(self._path(entry, collection, sensor)).xyz
        expected = entry.get("width", len(points)) * entry.get("height", 1)
        if expected != len(points):
            raise DatasetError(
                f"{self._folder / entry['data_file']}: {len(points)} points, the dataset says "
                f"{expected}; the file does not belong to this dataset"
            )
        return points

    def depth_image(self, collection: str, sensor: str) -> np.ndarray:
        """Return the depth image (height, width) [m], NaN where there is none."""
        entry = self._entry(collection, sensor)
        image = read_depth_png(self._path(entry, collection, sensor))
        self._check_size(image.shape[:2], entry)
        return image

    def colour_image(self, collection: str, sensor: str) -> np.ndarray:
        """Return the image (height, width, 3), blue green red."""
        entry = self._entry(collection, sensor)
        image = read_image(self._path(entry, collection, sensor))
        self._check_size(image.shape[:2], entry)
        return image

    def _entry(self, collection: str, sensor: str) -> Mapping[str, Any]:
        return self._document["collections"][collection].get("data", {}).get(sensor) or {}

    def _path(self, entry: Mapping[str, Any], collection: str, sensor: str) -> Path:
        if "data_file" not in entry:
            raise DatasetError(
                f"collection {collection} names no data_file of sensor '{sensor}'; leave the "
                f"sensor out with -ssf or collect again"
            )
        path = self._folder / entry["data_file"]
        if not path.is_file():
            raise DatasetError(
                f"{path}: the data file of sensor '{sensor}', collection {collection}, is absent; "
                f"put it beside the dataset, or leave the sensor out with -ssf"
            )
        return path

    def _check_size(self, shape: Tuple[int, ...], entry: Mapping[str, Any]) -> None:
        expected = (entry.get("height", shape[0]), entry.get("width", shape[1]))
        if tuple(shape) != tuple(expected):
            raise DatasetError(
                f"{self._folder / entry['data_file']}: the image is {shape[1]} x {shape[0]}, the "
                f"dataset says {expected[1]} x {expected[0]}"
            )


class RecentData(DataSource):
    """Another source, whose data of one collection stay in memory: the last that was asked for."""

    def __init__(self, source: DataSource):
        """Take the source that is read."""
        self._source, self._collection = source, ""
        self._kept: Dict[Tuple[str, str], np.ndarray] = {}

    def has_data(self, collection: str, sensor: str) -> bool:
        """Tell whether the data can be read, without reading them."""
        return self._source.has_data(collection, sensor)

    def cloud(self, collection: str, sensor: str) -> np.ndarray:
        """Return the cloud (n, 3) [m]; not to be changed, as the others."""
        return self._data("cloud", self._source.cloud, collection, sensor)

    def depth_image(self, collection: str, sensor: str) -> np.ndarray:
        """Return the depth image (height, width) [m]."""
        return self._data("depth", self._source.depth_image, collection, sensor)

    def colour_image(self, collection: str, sensor: str) -> np.ndarray:
        """Return the image (height, width, 3), blue green red."""
        return self._data("colour", self._source.colour_image, collection, sensor)

    def _data(
        self, kind: str, read: Callable[[str, str], np.ndarray], collection: str, sensor: str
    ) -> np.ndarray:
        if collection != self._collection:
            self._collection, self._kept = collection, {}
        if (kind, sensor) not in self._kept:
            self._kept[(kind, sensor)] = read(collection, sensor)
        return self._kept[(kind, sensor)]
