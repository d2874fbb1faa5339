"""Collections as files of their own, and the dataset that is assembled from them.

A collector writes each collection when it is taken: first its data files, then
``collections/NNN.json``, which appears under its name only when it is whole. ``dataset.json`` is
assembled from these files, at the end or, after a crash, by ``recover``. What holds for all
collections (sensors, patterns, configuration) stands in ``collections/header.json``. The dataset
that a new one shall replace is kept in ``previous/`` until the new one is whole.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, Iterator, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_core.errors import DatasetError, OutputError
from atom_core.io import earlier_run
from atom_core.io.atomic import prepare_output_folder
from atom_core.io.caveats import document_with_caveats
from atom_core.io.dataset_json import write_document
from atom_core.io.dataset_version import CURRENT_VERSION
from atom_core.io.dataset_writer import DATASET_FILE
from atom_core.io.json_text import load_json
from atom_core.model.caveats import Caveat
from atom_core.model.dataset import MULTIPLE

FOLDER, HEADER_FILE = "collections", "header.json"
_FIXED = "fixed"
_SAME_POSE = 1e-6  # metres and quaternion elements; what interpolation may change of a still edge


@dataclass(frozen=True)
class StoredCollection:
    """One collection as it lies on the disk.

    Attributes:
        key: "000", "001", ...
        document: its part of a dataset: data, labels, transforms.
        initial_boards: its part of ``patterns.<name>.transforms_initial``, by pattern.
    """

    key: str
    document: Mapping[str, Any]
    initial_boards: Mapping[str, Any]


class CollectionStore:
    """The folder of a dataset while its collections are taken."""

    def __init__(self, folder: Path):
        """Use a folder that exists; see `create`."""
        self.folder = Path(folder)
        self._inside = self.folder / FOLDER

    @classmethod
    def create(
        cls, folder: Path, overwrite: bool = False, beside: Sequence[str] = ()
    ) -> CollectionStore:
        """Make the folder ready for the first collection.

        Args:
            folder: where; made when absent.
            overwrite: accept a folder that holds something. A dataset in it is kept in
                ``previous/`` until `keep`; what a later run left that was interrupted is removed.
            beside: names of further files and folders that a run writes.

        Raises:
            OutputError: the folder is not empty or cannot be written to.
        """
        store = cls(prepare_output_folder(folder, overwrite))
        earlier_run.undo_partial(store.folder)
        if earlier_run.has_earlier_run(store.folder) and not store.is_assembled:
            store.begin_anew()
        else:
            earlier_run.set_aside(store.folder, store._files(beside))
        prepare_output_folder(store._inside, overwrite=True)
        return store

    @property
    def is_assembled(self) -> bool:
        """Tell whether the dataset is there."""
        return (self.folder / DATASET_FILE).is_file()

    def begin_anew(self) -> None:
        """Remove what this run has collected so far.

        What names data goes before the data, so whoever pulls the plug leaves no collection
        without its data.
        """
        for path in reversed(list(self._files())):
            if path.is_file():
                path.unlink()

    def keep(self) -> None:
        """Say that the new dataset is what was wanted: the one before it is removed."""
        earlier_run.forget(self.folder)

    def give_up_if_empty(self) -> bool:
        """Bring back the dataset that was there before, if this run has collected nothing.

        Returns:
            True if it is back.

        Raises:
            OutputError: it cannot be moved.
        """
        if self.keys or self.is_assembled or not earlier_run.has_earlier_run(self.folder):
            return False
        earlier_run.put_back(self.folder)
        return True

    def bring_back(self) -> Path:
        """Remove what this run has collected and bring back the dataset that was there before.

        Raises:
            DatasetError: there was none.
            OutputError: it cannot be moved.
        """
        if earlier_run.undo_partial(self.folder) and self.is_assembled:
            return self.folder / DATASET_FILE  # the run was interrupted before its first collection
        if not earlier_run.has_earlier_run(self.folder):
            kept = self.folder / earlier_run.PREVIOUS_FOLDER
            raise DatasetError(f"{kept}: absent; no earlier dataset is kept here")
        self.begin_anew()
        earlier_run.put_back(self.folder)
        return self.folder / DATASET_FILE

    def _files(self, beside: Sequence[str] = ()) -> Iterator[Path]:
        """Yield the files of a run: data, others named, header, collections, dataset."""
        for key in self.keys:
            with suppress(DatasetError):  # damaged: its data cannot be told from others' files
                yield from self._data_files(self.load(key)).values()
        with suppress(DatasetError):
            yield from self._assembled_data_files()
        for name in beside:
            yield self.folder / name
            yield from (self.folder / name).rglob("*")
        header = self._inside / HEADER_FILE
        yield header
        yield from (path for path in self._inside.glob("*.json") if path != header)
        yield self.folder / DATASET_FILE

    def _assembled_data_files(self) -> Iterator[Path]:
        if not self.is_assembled:
            return
        collections = _read(self.folder / DATASET_FILE).get("collections")
        for collection in collections.values() if isinstance(collections, dict) else ():
            if isinstance(collection, dict):
                yield from self._data_files(StoredCollection("", collection, {})).values()

    @property
    def keys(self) -> List[str]:
        """The collections that are there, in order."""
        names = [path.stem for path in self._inside.glob("*.json") if path.name != HEADER_FILE]
        return sorted(names, key=lambda name: (int(name) if name.isdigit() else np.inf, name))

    @property
    def next_key(self) -> str:
        """A key that is free: one more than the last."""
        numbers = [int(key) for key in self.keys if key.isdigit()]
        return f"{max(numbers) + 1 if numbers else 0:03d}"

    @property
    def has_header(self) -> bool:
        """Tell whether the header is there."""
        return (self._inside / HEADER_FILE).is_file()

    def write_header(self, document: Mapping[str, Any]) -> None:
        """Write what holds for all collections.

        Args:
            document: a dataset's document; its collections and transforms are left out.

        Raises:
            OutputError: the file cannot be written.
        """
        left_out = ("collections", "transforms")
        header = {key: value for key, value in document.items() if key not in left_out}
        write_document(self._inside / HEADER_FILE, header)

    def keep_caveats(self, caveats: Sequence[Caveat]) -> None:
        """Put what is in doubt into the header that is there.

        Raises:
            OutputError: the file cannot be written.
        """
        self.write_header(document_with_caveats(_read(self._inside / HEADER_FILE), caveats))

    def save(self, collection: StoredCollection) -> None:
        """Write a collection whose data files are there already.

        Raises:
            OutputError: the file cannot be written; all others are as they were.
        """
        document = {
            "version": CURRENT_VERSION,
            "collection": collection.document,
            "transforms_initial": collection.initial_boards,
        }
        write_document(self._inside / f"{collection.key}.json", document)

    def delete(self, key: str) -> None:
        """Remove a collection and its data files.

        Raises:
            DatasetError: there is none of that key.
        """
        if key not in self.keys:
            known = ", ".join(self.keys) or "none"
            raise DatasetError(f"{self.folder}: there is no collection {key}; there are: {known}")
        stored = self.load(key)
        (self._inside / f"{key}.json").unlink()
        for path in self._data_files(stored).values():
            if path.is_file():
                path.unlink()

    def load(self, key: str) -> StoredCollection:
        """Read a collection.

        Raises:
            DatasetError: the file is damaged.
        """
        document = _read(self._inside / f"{key}.json")
        if not isinstance(document.get("collection"), dict):
            raise DatasetError(
                f"{self._inside / key}.json: this is no collection; move it away and try again"
            )
        return StoredCollection(key, document["collection"], document.get("transforms_initial", {}))

    def assemble(self) -> Tuple[Path, List[str]]:
        """Write ``dataset.json`` from the collections that are there.

        Returns:
            Its path, and warnings: collections that were left out, and why.

        Raises:
            DatasetError: there is no whole collection, or a file is damaged.
            OutputError: the file cannot be written.
        """
        document, warnings = self.document()
        path = self.folder / DATASET_FILE
        write_document(path, document)
        return path, warnings

    def document(self) -> Tuple[Dict[str, Any], List[str]]:
        """Return the dataset's document of the collections that are there, and warnings.

        Raises:
            DatasetError: there is no whole collection, or a file is damaged.
        """
        if not self.has_header:
            raise DatasetError(
                f"{self._inside / HEADER_FILE}: absent, so no collection was finished here; "
                f"collect again"
            )
        whole, warnings = self._whole_collections()
        if not whole:
            raise DatasetError(f"{self.folder}: holds no whole collection; collect again")
        return assembled_document(_read(self._inside / HEADER_FILE), whole), warnings

    def _whole_collections(self) -> Tuple[List[StoredCollection], List[str]]:
        whole, warnings = [], []
        for key in self.keys:
            stored = self.load(key)
            absent = [s for s, path in self._data_files(stored).items() if not path.is_file()]
            if absent:
                warnings.append(
                    f"collection {key} is left out: the data of {', '.join(absent)} are absent"
                )
            else:
                whole.append(stored)
        return whole, warnings

    def _data_files(self, stored: StoredCollection) -> Dict[str, Path]:
        """Return by sensor the files of this folder that a collection names, and no others."""
        data = stored.document.get("data")
        named = {
            sensor: entry["data_file"]
            for sensor, entry in (data if isinstance(data, dict) else {}).items()
            if isinstance(entry, dict) and isinstance(entry.get("data_file"), str)
        }
        return {s: self.folder / name for s, name in named.items() if Path(name).name == name}


def recover_dataset(folder: Path, overwrite: bool = False) -> Tuple[Path, List[str]]:
    """Assemble the dataset of a folder that an interrupted collector left.

    Args:
        folder: where the collector wrote to.
        overwrite: replace a dataset that is there.

    Returns:
        The path of ``dataset.json``, and warnings.

    Raises:
        DatasetError: nothing to assemble.
        OutputError: a dataset is there already, or it cannot be written.
    """
    store = CollectionStore(folder)
    earlier_run.undo_partial(store.folder)
    if not (store.folder / FOLDER).is_dir():
        raise DatasetError(
            f"{folder}: there is no folder '{FOLDER}' in it; name the folder that was the "
            f"collector's --output"
        )
    if store.is_assembled and not overwrite:
        raise OutputError(
            f"{store.folder / DATASET_FILE}: is there already; add --overwrite to assemble it anew"
        )
    return store.assemble()


def assembled_document(
    header: Mapping[str, Any], collections: List[StoredCollection]
) -> Dict[str, Any]:
    """Return a dataset's document.

    An edge whose pose differs between collections is of type ``multiple``, any other ``fixed``;
    so is that of a sensor whose guess was improved between collections, since it is estimated as
    one. An anchored sensor's edge is held, and may move.
    """
    patterns = {
        name: {
            **entry,
            "transforms_initial": {
                c.key: c.initial_boards.get(name, {"detected": False}) for c in collections
            },
        }
        for name, entry in header["patterns"].items()
    }
    return {
        **header,
        "collections": {c.key: c.document for c in collections},
        "transforms": _edges(header, collections),
        "patterns": patterns,
    }


def _edges(header: Mapping[str, Any], collections: List[StoredCollection]) -> Dict[str, Any]:
    ends_of = {
        sensor: (s["calibration_parent"], s["calibration_child"])
        for sensor, s in header["sensors"].items()
    }
    calibrated = set(ends_of.values())
    held = ends_of.get((header.get("calibration_config") or {}).get("anchored_sensor"))
    poses: Dict[str, List[np.ndarray]] = {}
    ends: Dict[str, Tuple[str, str]] = {}
    for collection in collections:
        for name, entry in collection.document["transforms"].items():
            ends[name] = (entry["parent"], entry["child"])
            poses.setdefault(name, []).append(np.array(entry["trans"] + entry["quat"]))
    return {
        name: {
            "parent": edge[0],
            "child": edge[1],
            "type": _FIXED if edge in calibrated - {held} or _is_still(poses[name]) else MULTIPLE,
            "is_transformation_calibrated": edge in calibrated,
        }
        for name, edge in ends.items()
    }


def _is_still(poses: Sequence[np.ndarray]) -> bool:
    return bool(np.ptp(poses, axis=0).max() < _SAME_POSE)


def _read(path: Path) -> Dict[str, Any]:
    problem: Optional[str] = None
    try:
        document = load_json(path.read_text(encoding="utf-8"))
        if isinstance(document, dict):
            return document
        problem = "no map"
    except OSError as error:
        problem = (error.strerror or str(error)).lower()
    except ValueError as error:
        problem = f"not valid JSON, {error}"
    raise DatasetError(f"{path}: the collection is damaged ({problem}); move it away and try again")
