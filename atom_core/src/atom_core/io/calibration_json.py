"""What a calibration found, read back from its ``calibration.json``."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Dict, Iterator, List, Mapping, NamedTuple, Optional, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.geometry import se3
from atom_core.io.json_text import load_json
from atom_core.io.paths import sibling
from atom_core.io.structure import OTHER_KIND
from atom_core.model.edge_state import EdgeState, ParameterState
from atom_core.model.transforms import Edge

FILE = "calibration.json"
_AXES = 3


class StoredError(NamedTuple):
    """An error of a sensor or a board that was estimated.

    Attributes:
        name, target: what it is, and of which sensor or board.
        value, sigma: in its unit.
        type: which kind; None: an earlier version wrote it, and does not tell.
        parameters: what else tells it from others.
    """

    name: str
    target: str
    value: float
    sigma: float
    type: Optional[str]
    parameters: Mapping[str, Any]


class StoredCamera(NamedTuple):
    """A camera whose intrinsics were estimated.

    Attributes:
        given, found: fx, fy, cx, cy [px] and its coefficients by name, before and after.
        sigma: standard deviations of those that were estimated one by one.
    """

    given: Mapping[str, float]
    found: Mapping[str, float]
    sigma: Mapping[str, float]


class StoredCalibration(NamedTuple):
    """What a calibration wrote of itself.

    Attributes:
        path: of the file.
        status: converged, or why not.
        message: the same in a sentence.
        edges: the selected ones.
        model_errors: of sensors and boards that were estimated beside the poses.
        cameras: by sensor, those whose intrinsics were.
        moving: by the frame of a moving part, how far its poses were taken to be off [m, rad].
        joints: by joint, its parameters that were estimated.
    """

    path: Path
    status: str
    message: str
    edges: List[EdgeState]
    model_errors: Tuple[StoredError, ...]
    cameras: Mapping[str, StoredCamera]
    moving: Mapping[str, Tuple[float, float]]
    joints: Mapping[str, Tuple[ParameterState, ...]]


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
        moving = document.get("moving_parts", ())
        return StoredCalibration(
            file,
            str(document["status"]),
            str(document.get("message", "")),
            edges,
            tuple(_model_errors(document)),
            {name: _camera(s) for name, s in sensors.items() if "camera" in s},
            {str(part["child"]): _sigmas_of_part(part) for part in moving},
            {name: _joint(name, entry) for name, entry in document.get("joints", {}).items()},
        )
    except OTHER_KIND as error:
        said = f"lacks {error}" if isinstance(error, KeyError) else str(error)
        raise DatasetError(
            f"{file}: is no result of `calibrate` ({said}); give a folder of results"
        ) from None


def _model_errors(document: Dict[str, Any]) -> Iterator[StoredError]:
    for error in document.get("model_errors", ()):
        if error["estimated"]:
            value, sigma = _numbers([error["value"], error["sigma"]], 2)
            type_, parameters = error.get("type"), error.get("parameters", {})
            names = str(error["name"]), str(error["target"])
            yield StoredError(*names, float(value), float(sigma), type_, dict(parameters))
    for name, sensor in document.get("sensors", {}).items():
        if sensor.get("intrinsics") and "camera" not in sensor:
            yield StoredError("intrinsics", name, 0.0, 0.0, None, {})


def _camera(sensor: Dict[str, Any]) -> StoredCamera:
    given, found = (_named(sensor["camera"][which]) for which in ("given", "found"))
    estimated = sensor.get("intrinsics", {})
    return StoredCamera(given, found, _named({k: v["sigma"] for k, v in estimated.items()}))


def _named(values: Mapping[str, Any]) -> Dict[str, float]:
    return dict(zip(values, _numbers(list(values.values()), len(values)).tolist()))


def _sigmas_of_part(part: Mapping[str, Any]) -> Tuple[float, float]:
    shift_m, turn_rad = _numbers([part["sigma_m"], part["sigma_rad"]], 2)
    return float(shift_m), float(turn_rad)


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
    sigmas = sigma, covariance, of_model, combined
    collection = entry.get("sigma_collection")
    return EdgeState(
        *(edge, sensors, anchored, pose, *sigmas, detections, freedom),
        None if collection is None else str(collection),
    )


def _joint(joint: str, entry: Mapping[str, Any]) -> Tuple[ParameterState, ...]:
    found = []
    for name, parameter in entry.items():
        value, sigma = _numbers([parameter["value"], parameter["sigma"]], 2)
        combined = parameter.get("combined_sigma")
        usual = None if combined is None else float(_numbers([combined], 1)[0])
        unit = str(parameter["unit"])
        found.append(ParameterState(joint, str(name), unit, float(value), float(sigma), usual))
    return tuple(found)


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
