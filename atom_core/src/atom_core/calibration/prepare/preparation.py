"""From a dataset and options to what is to be solved: measurements, what is free, what is held."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Dict, List, Mapping, Sequence, Set, Tuple

import numpy as np

from atom_core.calibration.options import AUTO, CalibrationOptions
from atom_core.calibration.prepare.connectivity import check_connected
from atom_core.calibration.prepare.fixed_boards import check_fixed_boards
from atom_core.calibration.prepare.floating import floating_parts, holding, only_by_priors
from atom_core.calibration.prepare.frozen_sensors import frozen_sensors
from atom_core.calibration.prepare.joints import (
    check_joints,
    configured_joints,
    with_joint_transforms,
)
from atom_core.calibration.prepare.memory import check_memory
from atom_core.calibration.prepare.moving_mounts import check_mounts
from atom_core.calibration.prepare.moving_parts import Sigmas, check_told, moving_parts
from atom_core.calibration.prepare.parts_left_out import (
    remarks_on_those_of_others,
    without_those_of_others,
)
from atom_core.calibration.prepare.priors import priors
from atom_core.calibration.prepare.same_labels import check_same_labels, copies
from atom_core.calibration.prepare.unseen_rows import unseen_rows
from atom_core.errors import CalibrationError
from atom_core.geometry.camera import Camera
from atom_core.geometry.intrinsics import intrinsics_names
from atom_core.model.dataset import Dataset, is_complete
from atom_core.model.joints import JointSelection
from atom_core.model.labels import DetectionKey
from atom_core.model.transforms import Edge
from atom_core.problem.builder import FreeEdges, check_edges
from atom_core.problem.camera_blocks import ExpectedCamera
from atom_core.problem.measurements import Measured, Measurement, read_measurements
from atom_core.problem.range_measurement import RangeMeasurement
from atom_core.solvers.base import ATOM, SIGMA
from atom_core.solvers.choice import default_solver

INCOMPLETE = "incomplete (--complete_only)"
_OTHER_UNIT = 3.0  # labels so many times as large as the board are no bad labels
_FEW = 2  # detections that may be wrong by themselves


@dataclass(frozen=True)
class Prepared:
    """What a calibration works on.

    Attributes:
        dataset: as it was given, with the edges of free joints as their positions say.
        measurements: the detections that can tie something.
        free: what is estimated and what is held; something is, or motion ties the rig to world.
        moving: edges of moving parts that are off, with their standard deviations [m, rad].
        unused: why a collection was left out, by key.
        remarks: what the user should know.
    """

    dataset: Dataset
    measurements: Sequence[Measurement]
    free: FreeEdges
    moving: Mapping[Edge, Sigmas]
    unused: Mapping[str, str]
    remarks: Tuple[str, ...]


def prepare(
    dataset: Dataset,
    options: CalibrationOptions,
    read_before: Mapping[DetectionKey, Measured] = MappingProxyType({}),
) -> Prepared:
    """Check a dataset and read its measurements.

    Args:
        dataset: already reduced to what is selected.
        options: what to hold, how to solve.
        read_before: what was read of detections that are the same still.

    Raises:
        AtomError: the calibration cannot be posed; one sentence says why and what to do.
    """
    check_model_errors(dataset, options)
    check_data_present(dataset)
    free = free_edges(dataset, options)
    check_edges(dataset, free)
    check_joints(dataset, free)
    moving = moving_parts(dataset, options, free)
    dataset, joint_remarks = with_joint_transforms(dataset, free)
    known, prior_remarks = priors(dataset, options, free)
    free = replace(free, priors=known)
    check_memory(dataset, options.solver_name or default_solver())
    measurements, remarks = read_measurements(dataset, read_before)
    check_units(measurements)
    check_same_labels(measurements)
    remarks += [*remarks_on_parts(dataset, options, free), *joint_remarks, *prior_remarks]
    if options.solver.weights == ATOM:
        measurements = [m.with_atom_residuals() for m in measurements]
    measurements, unused = usable(dataset, measurements, options)
    check_connected(dataset, measurements, free)
    remarks += only_by_priors(dataset, measurements, free)
    check_not_alone(dataset, measurements, free)
    free, held_remarks = holding(dataset, measurements, free)
    remarks += held_remarks + check_mounts(dataset, measurements, free)
    check_fixed_boards(dataset, measurements)
    check_told(dataset, measurements, free, moving)
    dataset = dataset.with_caveats([*frozen_sensors(dataset, measurements), *unseen_rows(dataset)])
    return Prepared(dataset, measurements, free, moving, unused, tuple(remarks))


def check_units(measurements: Sequence[Measurement]) -> None:
    """Refuse a range sensor whose labels are much larger than the board, most of them."""
    times: Dict[str, List[float]] = {}
    for m in measurements:
        if isinstance(m, RangeMeasurement):
            times.setdefault(m.key.sensor, []).append(m.extent_m / m.diagonal_m)
    for sensor, values in times.items():
        middle = float(np.median(values))
        if len(values) >= _FEW and middle > _OTHER_UNIT:
            raise CalibrationError(
                f"the labels of sensor '{sensor}' are {middle:.3g} times as large as the board (in "
                f"the middle of {len(values)}): its distances are in another unit, or the board's "
                f"are; mend the data, or calibrate without it: -ssf '!{sensor}'"
            )


def camera_of(dataset: Dataset, sensor: str) -> Camera:
    """Return a camera's intrinsics."""
    camera = dataset.sensors[sensor].camera
    assert camera is not None
    return camera


def check_intrinsics(dataset: Dataset, names: Sequence[str]) -> None:
    """Refuse intrinsics of what is no rgb camera."""
    for name in names:
        sensor = dataset.sensors.get(name)
        if sensor is None or not sensor.kind.can_estimate_intrinsics:
            cameras = [s.name for s in dataset.sensors.values() if s.kind.can_estimate_intrinsics]
            raise CalibrationError(
                f"--optimize_intrinsics {name}: there is no such rgb camera; there are: "
                f"{', '.join(cameras) or 'none'}"
            )


def check_model_errors(dataset: Dataset, options: CalibrationOptions) -> None:
    """Refuse model errors of what cannot have them, and those that no weights can tell."""
    kinds = [(s.name, s.kind) for s in dataset.sensors.values()]
    lidars = [name for name, kind in kinds if kind.can_estimate_range_offset]
    others = [name for name, kind in kinds if kind.measures_range and name not in lidars]
    suited = {
        "range_offset": (lidars, "LiDAR"),
        "range_scale": (lidars, "LiDAR"),
        "depth_offset": (others, "depth camera"),
        "depth_scale": (others, "depth camera"),
        "board_size": (list(dataset.patterns), "pattern"),
        "board_border": (list(dataset.patterns), "pattern"),
        "board_bend": (list(dataset.patterns), "pattern"),
        "board_thickness": (list(dataset.patterns), "pattern"),
    }
    for option, (there, noun) in suited.items():
        for name in getattr(options, option):
            if name not in there:
                raise CalibrationError(
                    f"--{option} {name}: there is no such {noun}; there are: "
                    f"{', '.join(there) or 'none'}"
                )
        if getattr(options, option) and options.solver.weights != SIGMA:
            raise CalibrationError(f"--{option} needs --weights sigma")
    if options.model_errors == AUTO and options.solver.weights != SIGMA:
        raise CalibrationError("--model_errors auto needs --weights sigma")


def absent_data(dataset: Dataset) -> Dict[str, List[str]]:
    """Return, by range sensor, the collections whose labels refer to absent data files."""
    absent: Dict[str, List[str]] = {}
    for key, _ in dataset.detections():
        needs_data = dataset.sensors[key.sensor].kind.measures_range
        if needs_data and not dataset.data.has_data(key.collection, key.sensor):
            absent.setdefault(key.sensor, []).append(key.collection)
    return absent


def stands_in_json(dataset: Dataset, sensor: str, collections: Sequence[str]) -> str:
    """Say that a sensor's data stand in the dataset's JSON, if they do; they are not read there.

    Args:
        dataset: as it was read.
        sensor: whose data files are absent.
        collections: from which.
    """
    stored = dataset.document.get("collections") or {}
    entries = [((stored.get(key) or {}).get("data") or {}).get(sensor) for key in collections]
    if not any(entry and "data" in entry and "data_file" not in entry for entry in entries):
        return ""
    return (
        f"the data of sensor '{sensor}' stand in the JSON itself (as 'data') and are not read from "
        f"there; write them to files, and name these by 'data_file'"
    )


def check_data_present(dataset: Dataset) -> None:
    """Refuse a range sensor whose labels refer to data files that are absent."""
    for sensor, collections in absent_data(dataset).items():
        inline = stands_in_json(dataset, sensor, collections)
        if inline:
            raise CalibrationError(
                f"{dataset.source}: {inline}, or leave the sensor out with -ssf '!{sensor}'"
            )
        raise CalibrationError(
            f"{dataset.source}: the data files of sensor '{sensor}' are absent (collections "
            f"{', '.join(dict.fromkeys(collections))}); put them beside the dataset (a result in a "
            f"folder of its own names them by their way from there: move both together), or leave "
            f"the sensor out with -ssf '!{sensor}'"
        )


def free_edges(dataset: Dataset, options: CalibrationOptions) -> FreeEdges:
    """Return what is estimated and what is held, from configuration and options.

    Raises:
        CalibrationError: an anchored sensor that does not exist.
    """
    anchored = list(options.anchor_sensors)
    configured = dataset.config.anchored_sensor
    if configured and not options.ignore_anchored_sensor and configured in dataset.sensors:
        anchored.append(configured)
    for name in options.anchor_sensors:
        if name not in dataset.sensors:
            raise CalibrationError(
                f"anchored sensor '{name}' is not among the sensors used: "
                f"{', '.join(dataset.sensors)}"
            )
    additional, joints = without_those_of_others(dataset, *_wanted(dataset, options))
    check_intrinsics(dataset, options.intrinsics)
    return FreeEdges(
        tuple(dict.fromkeys(anchored)),
        additional,
        options.anchor_patterns,
        joints,
        {name: intrinsics_names(camera_of(dataset, name)) for name in options.intrinsics},
        _expected_cameras(dataset, options),
    )


def _wanted(
    dataset: Dataset, options: CalibrationOptions
) -> Tuple[Dict[str, Edge], JointSelection]:
    """Return the additional tfs and joints of configuration and options."""
    additional = {
        name: entry.edge
        for name, entry in dataset.config.additional_tfs.items()
        if options.additional_tfs is None or name in options.additional_tfs
    }
    return additional, configured_joints(dataset) if options.joints is None else options.joints


def remarks_on_parts(dataset: Dataset, options: CalibrationOptions, free: FreeEdges) -> List[str]:
    """Return a remark on what would be estimated if a selection had not left out what tells it."""
    additional, joints = _wanted(dataset, options)
    return remarks_on_those_of_others([*additional, *joints], {*free.additional_tfs, *free.joints})


def _expected_cameras(dataset: Dataset, options: CalibrationOptions) -> Dict[str, ExpectedCamera]:
    """Return those near which estimated ones are expected; ATOM's weights leave no room for it."""
    sigma = options.intrinsics_sigma
    if sigma is None or options.solver.weights != SIGMA:
        return {}
    return {name: ExpectedCamera(camera_of(dataset, name), sigma) for name in options.intrinsics}


def usable(
    dataset: Dataset, measurements: Sequence[Measurement], options: CalibrationOptions
) -> Tuple[List[Measurement], Dict[str, str]]:
    """Return the measurements that can tie something, and why collections were left out."""
    alone = options.anchor_patterns or options.only_anchored_sensor
    unused = {
        key: f"it is a copy of collection {other}, all labels are the same to the last digit"
        for key, other in copies(dataset, measurements).items()
    }
    seen_by: Dict[Tuple[str, str], Set[Edge]] = {}
    for m in measurements:
        edge = dataset.sensors[m.key.sensor].edge
        seen_by.setdefault((m.key.collection, m.key.pattern), set()).add(edge)
    keys = dataset.collections
    for key in keys:
        boards = [s for (collection, _), s in seen_by.items() if collection == key]
        if not boards:
            unused[key] = "no sensor detected a pattern"
        elif options.complete_only and not is_complete(dataset, key):
            unused[key] = INCOMPLETE
    unused.update((k, why) for k, why in options.unused_collections.items() if k in keys)

    def ties(m: Measurement) -> bool:
        if dataset.patterns[m.key.pattern].fixed or alone:
            return True
        return len(seen_by[(m.key.collection, m.key.pattern)]) > 1

    kept = [m for m in measurements if m.key.collection not in unused and ties(m)]
    used = {m.key.collection for m in kept}
    for key in keys:
        if key not in used and key not in unused:
            unused[key] = "the board is seen by one sensor only, which ties nothing together"
    return kept, unused


def check_not_alone(dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges) -> None:
    """Refuse a rig that nothing ties to world and of which, a sensor held, nothing is left.

    Raises:
        CalibrationError: naming the sensor.
    """
    floating = [part for part in floating_parts(dataset, measurements, free) if part.sensors]
    edges = dataset.sensor_edges
    if floating and not (len(edges) > 1 or free.additional_tfs or free.joints or free.intrinsics):
        name = floating[0].sensors[0]
        raise CalibrationError(
            f"nothing ties sensor '{name}' to '{dataset.world}': it is alone, and neither "
            f"what carries it nor the board's parent moves before the other between the "
            f"collections; move the arm that carries one of them, or add a second sensor"
        )
