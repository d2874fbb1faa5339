"""The data files beside a dataset's JSON, read when they are asked for and not before."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Dict, Mapping, Optional

from atom_core.errors import DatasetError
from atom_core.model.dataset import DataSource
from atom_core.model.modality import DataFormat

_ENDINGS = (".pcd", ".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")


class FileDataSource(DataSource):
    """Clouds and images of a dataset on disk."""

    def __init__(
        self, folder: Path, document: Mapping[str, Any], formats: Mapping[str, DataFormat]
    ):
        """Remember where the files are.

        Args:
            folder: the folder that the dataset's file names are relative to.
            document: the dataset's JSON document.
            formats: how the data of each sensor stand there, by its name.
        """
        self._folder = Path(folder)
        self._document = document
        self._formats = formats

    def has_data(self, collection: str, sensor: str) -> bool:
        """Tell whether the data file exists, or the data stand in the JSON."""
        entry = self._entry(collection, sensor)
        if not self._formats[sensor].ending:
            return bool(entry)
        return "data_file" in entry and data_path(self._folder, entry) is not None

    def read(self, collection: str, sensor: str) -> Any:
        """Return the data of a sensor as its modality reads them."""
        entry = self._entry(collection, sensor)
        data = self._formats[sensor]
        if data.ending:
            return data.read(self._path(entry, collection, sensor), entry)
        try:
            return data.read(None, entry)
        except DatasetError as error:
            raise DatasetError(f"sensor '{sensor}', collection {collection}: {error}") from None

    def _entry(self, collection: str, sensor: str) -> Mapping[str, Any]:
        data = self._document["collections"][collection].get("data") or {}
        return data.get(sensor) or {}

    def _path(self, entry: Mapping[str, Any], collection: str, sensor: str) -> Path:
        if "data_file" not in entry:
            raise DatasetError(
                f"collection {collection} names no data_file of sensor '{sensor}'; leave the "
                f"sensor out with -ssf or collect again"
            )
        path = data_path(self._folder, entry)
        if path is None:
            raise DatasetError(
                f"{self._folder / entry['data_file']}: the data file of sensor '{sensor}', "
                f"collection {collection}, is absent; put it beside the dataset, or leave the "
                f"sensor out with -ssf"
            )
        return path


def data_path(folder: Path, entry: Mapping[str, Any]) -> Optional[Path]:
    """Return where the data file of an entry is: where the dataset says, or beside it; or None.

    A result names the data of its input, which lie in another folder. Elsewhere than beside the
    dataset only files are looked at whose names end as those of data do, since a dataset may come
    from anywhere.
    """
    named = Path(entry["data_file"])
    if "\0" in str(named):
        return None
    beside = folder / named.name
    places = (folder / named, beside) if named.suffix.lower() in _ENDINGS else (beside,)
    return next((path for path in places if path.is_file()), None)


class RecentData(DataSource):
    """Another source, whose data of one collection stay in memory: the last that was asked for."""

    def __init__(self, source: DataSource):
        """Take the source that is read."""
        self._source, self._collection = source, ""
        self._kept: Dict[str, Any] = {}

    def has_data(self, collection: str, sensor: str) -> bool:
        """Tell whether the data can be read, without reading them."""
        return self._source.has_data(collection, sensor)

    def read(self, collection: str, sensor: str) -> Any:
        """Return the data of a sensor; not to be changed."""
        if collection != self._collection:
            self._collection, self._kept = collection, {}
        if sensor not in self._kept:
            self._kept[sensor] = self._source.read(collection, sensor)
        return self._kept[sensor]
