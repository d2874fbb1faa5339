"""Older ATOM datasets to version 3: one board without a name becomes ``pattern_1``."""

from __future__ import annotations

import shutil
from copy import deepcopy
from pathlib import Path
from typing import Any, Dict, Mapping

from atom_core.errors import DatasetError, OutputError
from atom_core.io.atomic import prepare_output_folder, write_text_atomically
from atom_core.io.dataset_json import (
    CURRENT_VERSION,
    dataset_from_document,
    dumps,
    read_document,
)

PATTERN_NAME = "pattern_1"


def migrated_document(document: Mapping[str, Any]) -> Dict[str, Any]:
    """Return the document in the layout of version 3; nothing is dropped.

    Version 2 had one board: ``calibration_pattern`` in the configuration, ``patterns`` with its
    corners directly, and ``labels[sensor]``.
    """
    new = deepcopy(dict(document))
    config = new.setdefault("calibration_config", {})
    if "calibration_pattern" in config:
        config.setdefault("calibration_patterns", {PATTERN_NAME: config.pop("calibration_pattern")})
    config["version"] = float(CURRENT_VERSION)
    name = next(iter(config.get("calibration_patterns") or {PATTERN_NAME: None}))
    if "corners" in (new.get("patterns") or {}):
        new["patterns"] = {name: new["patterns"]}
    for collection in new["collections"].values():
        labels = collection.get("labels") or {}
        if labels and all(key in new["sensors"] for key in labels):
            collection["labels"] = {name: labels}
    new.setdefault("_metadata", {})["version"] = CURRENT_VERSION
    return new


def migrate_dataset(source: Path, folder: Path, overwrite: bool) -> Path:
    """Write a migrated copy of a dataset with its data files; return the new JSON.

    Raises:
        DatasetError: the dataset cannot be read even after migration.
        OutputError: the folder is occupied, or is the dataset's own.
    """
    document = migrated_document(read_document(source))
    try:
        dataset_from_document(document, source)
    except DatasetError as error:
        raise DatasetError(f"cannot be migrated: {error}") from None
    if folder.resolve() == source.parent.resolve():
        raise OutputError(f"{folder}: holds the dataset itself; choose another folder")
    prepare_output_folder(folder, overwrite)
    for collection in document["collections"].values():
        for entry in (collection.get("data") or {}).values():
            file = source.parent / str(entry.get("data_file", ""))
            if file.is_file():
                shutil.copy2(file, folder / file.name)
    target = folder / "dataset.json"
    write_text_atomically(target, dumps(document))
    return target
