"""Older ATOM datasets to version 3: one board without a name becomes ``pattern_1``."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Dict, Mapping

from atom_core.errors import DatasetError, OutputError
from atom_core.io.atomic import prepare_output_folder
from atom_core.io.data_files import data_path
from atom_core.io.dataset_json import dataset_from_document, read_document
from atom_core.io.dataset_writer import write_with_copies
from atom_core.io.earliest_layout import completed, in_layout_of_version_3, is_before_version_2


def migrated_document(document: Mapping[str, Any], source: Path) -> Dict[str, Any]:
    """Return the document in the layout of version 3; nothing is dropped.

    Raises:
        DatasetError: it is from before version 2, and lacks what cannot be derived.
    """
    if is_before_version_2(document):
        return completed(document, str(source))[0]
    return in_layout_of_version_3(document)


def migrate_dataset(source: Path, folder: Path, overwrite: bool) -> Path:
    """Write a migrated copy of a dataset with its data files; return the new JSON.

    Raises:
        DatasetError: the dataset cannot be read even after migration, or two data files have one
            name.
        OutputError: the folder is occupied, or is the dataset's own.
    """
    document = migrated_document(read_document(source), source)
    try:
        dataset_from_document(document, source)
    except DatasetError as error:
        raise DatasetError(f"cannot be migrated: {error}") from None
    if folder.resolve() == source.parent.resolve():
        raise OutputError(f"{folder}: holds the dataset itself; choose another folder")
    files = _data_files(document, source.parent)
    prepare_output_folder(folder, overwrite)
    return write_with_copies(folder, document, files)


def _data_files(document: Mapping[str, Any], folder: Path) -> Dict[str, Path]:
    """Return what a document of a folder names as data, by file name; absent files are left out."""
    files: Dict[str, Path] = {}
    for collection in document["collections"].values():
        for entry in (collection.get("data") or {}).values():
            named = isinstance(entry, dict) and entry.get("data_file")
            file = data_path(folder, entry) if named else None
            if file is not None and files.setdefault(file.name, file) != file:
                raise DatasetError(
                    f"{files[file.name]} and {file} have one name; the data files of a dataset lie "
                    f"in one folder: give each a name of its own"
                )
    return files
