"""What a calibration found of sensors and boards beside their poses, to read new boards with.

A LiDAR that reads 30 mm long reads so on new boards as well. Without that they would seem to say
that it has moved.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, Dict, Mapping, NamedTuple, Tuple, Type

import numpy as np

from atom_core.errors import CalibrationError, DatasetError
from atom_core.geometry.camera import Camera
from atom_core.geometry.intrinsics import (
    COUNT,
    intrinsics_names,
    intrinsics_values,
    number_scales,
)
from atom_core.io.calibration_json import StoredCalibration, StoredCamera, StoredError
from atom_core.io.structure import OTHER_KIND
from atom_core.model.dataset import Dataset
from atom_core.problem.board_errors import (
    Bend,
    BoardAspect,
    BoardSize,
    BoardThickness,
    BoardTwist,
    BorderShift,
    BorderSize,
    PrintTurn,
)
from atom_core.problem.direction_errors import (
    AzimuthScale,
    AzimuthWave,
    DepthCentre,
    DepthFocalLength,
    DepthIntrinsics,
    ElevationOffset,
    ElevationScale,
)
from atom_core.problem.model_errors import (
    CameraError,
    DepthOffset,
    DepthScale,
    ErrorPrior,
    ErrorPriors,
    ModelError,
    RangeOffset,
    RangeScale,
)
from atom_core.problem.range_fields import DepthWave, LayerOffset

_TYPES: Mapping[str, Type[ModelError]] = {
    type_.__name__: type_
    for type_ in (
        *(RangeOffset, RangeScale, DepthOffset, DepthScale, LayerOffset, DepthWave),
        *(AzimuthScale, AzimuthWave, ElevationOffset, ElevationScale),
        *(DepthFocalLength, DepthCentre),
        *(BoardSize, BoardAspect, PrintTurn, BorderShift, BorderSize),
        *(Bend, BoardTwist, BoardThickness),
        CameraError,
    )
}
_LEAST_STEPS = 1e-3  # no error is known better than this part of its step
_SAME = 1e-6  # relative difference of intrinsics that are the same


class Known(NamedTuple):
    """What is known before new boards are read.

    Attributes:
        dataset: the new boards, its cameras as the calibration found them.
        errors: of its sensors and boards.
        moving: by the frame of a moving part, how far its poses are off [m, rad].
    """

    dataset: Dataset
    errors: ErrorPriors
    moving: Mapping[str, Tuple[float, float]]


def parameters_of(error: ModelError) -> Dict[str, Any]:
    """Return what tells an error from others of its type and target, for a JSON document."""
    names = [f.name for f in fields(error) if f.compare and f.name != "target"]
    values = {name: getattr(error, name) for name in names}
    return {name: list(v) if isinstance(v, tuple) else v for name, v in values.items()}


def known_of(stored: StoredCalibration, dataset: Dataset) -> Known:
    """Return what a calibration found that holds for new boards of its rig.

    Raises:
        CalibrationError: it does not tell that well enough, or cameras have other intrinsics now.
        DatasetError: its file names an error that there is not.
    """
    sensors = dict(dataset.sensors)
    errors: Dict[ModelError, ErrorPrior] = {}
    for name, camera in stored.cameras.items():
        sensor = sensors.get(name)
        if sensor is not None and sensor.camera is not None:
            found = _camera(stored, name, sensor.camera, camera)
            sensors[name] = replace(sensor, camera=found)
            errors.update(_intrinsics(name, found, camera))
    corrected = replace(dataset, sensors=sensors)
    for error in stored.model_errors:
        if error.target in sensors or error.target in dataset.patterns:
            built = _built(stored, error, corrected)
            sigma = max(error.sigma, _LEAST_STEPS * built.step)
            # Cameras have theirs already.
            mean = 0.0 if isinstance(built, CameraError) else error.value
            errors[built] = ErrorPrior(sigma, mean)
    frames = {edge.child for c in dataset.collections.values() for edge in c.transforms}
    moving = {frame: sigmas for frame, sigmas in stored.moving.items() if frame in frames}
    return Known(corrected, errors, moving)


def _camera(stored: StoredCalibration, name: str, now: Camera, camera: StoredCamera) -> Camera:
    """Return a camera as the calibration found it, whether it has the intrinsics of before or not.

    Raises:
        CalibrationError: it has neither those that were given nor those found.
    """
    if _has(now, camera.found):
        return now
    if not _has(now, camera.given):
        raise CalibrationError(
            f"camera '{name}' has intrinsics now that are neither those that {stored.path} was "
            f"given nor those that it found; whether the rig has moved cannot be told by it: "
            f"calibrate anew"
        )
    names = intrinsics_names(now)
    K = now.K.copy()
    K[[0, 1, 0, 1], [0, 1, 2, 2]] = [camera.found[key] for key in names[:4]]
    return replace(now, K=K, D=np.array([camera.found[key] for key in names[4:]]))


def _has(camera: Camera, values: Mapping[str, float]) -> bool:
    names, own = intrinsics_names(camera), intrinsics_values(camera)
    if set(names) != set(values):
        return False
    stored = np.array([values[name] for name in names])
    return bool(np.all(np.abs(own - stored) <= _SAME * np.maximum(np.abs(stored), 1.0)))


def _intrinsics(name: str, found: Camera, camera: StoredCamera) -> ErrorPriors:
    """Return how exactly estimated intrinsics are known, as errors of the camera."""
    names, scales = intrinsics_names(found), number_scales(found)
    return {
        CameraError(name, key, (names.index(key),), found): ErrorPrior(
            max(sigma / scales[names.index(key)], _LEAST_STEPS * CameraError.step)
        )
        for key, sigma in camera.sigma.items()
        if key in names
    }


def _built(stored: StoredCalibration, error: StoredError, dataset: Dataset) -> ModelError:
    """Return an error as the calibration had it."""
    if error.type is None:
        raise CalibrationError(
            f"{stored.path}: here {error.name} of {error.target} was estimated, too, by a version "
            f"that does not tell all of it; calibrate again with this one, or calibrate the new "
            f"boards with the same options, and compare the results: evaluate --compare OLD NEW"
        )
    type_ = _TYPES.get(error.type)
    if type_ is None:
        raise DatasetError(f"{stored.path}: model error '{error.type}' is unknown")
    values = {k: tuple(v) if isinstance(v, list) else v for k, v in error.parameters.items()}
    try:
        if any(f.name == "camera" for f in fields(type_)):
            values["camera"] = dataset.sensors[error.target].camera
        built = type_(target=error.target, **values)
        if not built.name or not _is_one(built):
            raise ValueError
    except OTHER_KIND:
        raise DatasetError(
            f"{stored.path}: {error.parameters} tell no {error.type} of {error.target}"
        ) from None
    return built


def _is_one(error: ModelError) -> bool:
    """Tell whether an error that a file describes is one that there can be."""
    if isinstance(error, (CameraError, DepthWave, DepthIntrinsics)) and error.camera is None:
        return False
    if isinstance(error, CameraError):
        return all(0 <= number < COUNT for number in error.numbers)
    values = np.array([v for v in parameters_of(error).values() if not isinstance(v, list)])
    return bool(np.all(np.isfinite(values.astype(float))))
