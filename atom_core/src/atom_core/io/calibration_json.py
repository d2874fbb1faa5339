"""Edges of a calibration, read back from its ``calibration.json``."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Dict, Iterator, List, NamedTuple, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.geometry import se3
from atom_core.io.json_text import load_json
from atom_core.io.paths import sibling
from atom_core.io.structure import OTHER_KIND
from atom_core.model.edge_state import EdgeState
from atom_core.model.transforms import Edge

FILE = "calibration.json"
_AXES = 3


class StoredCalibration(NamedTuple):
    """What a calibration wrote of itself.

    Attributes:
        path: of the file.
        status: converged, or why not.
        message: the same in a sentence.
        edges: the selected ones.
        corrected: what of sensors and boards was estimated beside the poses, as "range offset of
            lidar_1".
    """

    path: Path
    status: str
    message: str
    edges: List[EdgeState]
    corrected: Tuple[str, ...]


def calibration_file(path: Path) -> Path:
    """Return the ``calibration.json`` of a folder of results, or beside one of its files."""
    if path.is_dir():
        return path / FILE
    return path if path.name == FILE else sibling(path, FILE)


def read_calibration(path: Path) -> StoredCalibration:
    """Read the edges of a calibration.

    Args:
        path: a folder of results, or any file in it.

    Raises:
        DatasetError: it is absent, or no result of `calibrate`.
    """
    file = calibration_file(path)
    try:
        document: Any = load_json(file.read_text(encoding="utf-8"))
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise DatasetError(
            f"{file}: the result of `calibrate` cannot be read ({reason}); give a folder of results"
        ) from None
    except ValueError:
        raise DatasetError(f"{file}: is no JSON; give a folder of results of `calibrate`") from None
    try:
        sensors = document.get("sensors", {})
        freedom = document.get("degrees_of_freedom")
        freedom = np.inf if freedom is None else float(freedom)
        edges = [_edge(entry, sensors, freedom) for entry in document["edges"].values()]
        status, message = str(document["status"]), str(document.get("message", ""))
        return StoredCalibration(file, status, message, edges, tuple(_corrected(document)))
    except OTHER_KIND as error:
        said = f"lacks {error}" if isinstance(error, KeyError) else str(error)
        raise DatasetError(
            f"{file}: is no result of `calibrate` ({said}); give a folder of results"
        ) from None


def _corrected(document: Dict[str, Any]) -> Iterator[str]:
    for error in document.get("model_errors", ()):
        if error["estimated"]:
            yield f"{error['name']} of {error['target']}"
    for name, sensor in document.get("sensors", {}).items():
        if sensor.get("intrinsics"):
            yield f"intrinsics of {name}"


def _edge(entry: Dict[str, Any], by_name: Dict[str, Any], freedom: float) -> EdgeState:
    pose = se3.from_quaternion(
        _numbers(entry["translation_m"], _AXES), _numbers(entry["quaternion_xyzw"], _AXES + 1)
    )
    combined = None
    if "combined_sigma_translation_m" in entry:
        combined = _sigma(entry, "combined_sigma")
    edge = Edge(str(entry["parent"]), str(entry["child"]))
    sensors = tuple(str(name) for name in entry["sensors"])
    sigma, of_model = _sigma(entry, "sigma"), _sigma(entry, "model_sigma")
    covariance = np.diag(sigma**2)  # all that results of before this key tell
    if entry.get("covariance") is not None:
        covariance = np.array([_numbers(row, 2 * _AXES) for row in entry["covariance"]])
    anchored = bool(entry["anchored"])
    detections = sum(int(by_name[name]["detections"]) for name in sensors if name in by_name)
    return EdgeState(
        *(edge, sensors, anchored, pose, sigma, covariance, of_model, combined, detections, freedom)
    )


def _sigma(entry: Dict[str, Any], name: str) -> np.ndarray:
    turns, shifts = (
        _numbers(entry[f"{name}_{k}"], _AXES) for k in ("rotation_rad", "translation_m")
    )
    return np.concatenate([turns, shifts])


def _numbers(values: Any, count: int) -> np.ndarray:
    found = np.array(values, dtype=float)
    if found.shape != (count,) or not np.all(np.isfinite(found)):
        raise ValueError(f"{count} numbers are needed, found {values}")
    return found
