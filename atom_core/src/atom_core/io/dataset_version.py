"""Which version of ATOM's format a dataset is of, and what older ones need."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Mapping, Optional

from atom_core.errors import DatasetError

CURRENT_VERSION = "3.0"
_UNKNOWN_VERSION = 4.0  # and all above
_MIGRATE = "python3 -m atom_core convert --from atom_v2 --to atom_v3 --dataset {} --output DIR"


def check_version(document: Mapping[str, Any], path: Path) -> None:
    """Refuse a dataset that is older than version 3, and say how to migrate it."""
    version = str((document.get("_metadata") or {}).get("version", ""))
    try:
        number = float(version)
    except ValueError:
        raise DatasetError(
            f"{path}: _metadata.version is '{version}'; it must be {CURRENT_VERSION}. If the "
            f"dataset is older, migrate it: {_MIGRATE.format(path)}"
        ) from None
    if not number >= 3.0:  # also what is no number, NaN
        raise DatasetError(
            f"{path}: dataset version {version} is older than {CURRENT_VERSION}; migrate it "
            f"with: {_MIGRATE.format(path)}"
        )


def newer_version(document: Mapping[str, Any], path: Path) -> Optional[str]:
    """Return what is to be said of a dataset that is newer than this program; None if it is not."""
    version = document["_metadata"]["version"]
    if float(version) < _UNKNOWN_VERSION:
        return None
    return (
        f"{path}: dataset version {version} is newer than this program, which knows "
        f"{CURRENT_VERSION}; what is new in it is not understood"
    )
