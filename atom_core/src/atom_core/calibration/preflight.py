"""The look before the flight: who sees which board, what hangs together, what is implausible."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Callable, Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_core.calibration.board_sizes import look_at_boards
from atom_core.calibration.judge.statistics import Table, residual_table
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.connectivity import check_connected
from atom_core.calibration.prepare.floating import holding, only_by_priors
from atom_core.calibration.prepare.frozen_sensors import frozen_sensors
from atom_core.calibration.prepare.joints import check_joints, with_joint_transforms
from atom_core.calibration.prepare.motions import open_motion
from atom_core.calibration.prepare.moving_mounts import check_mounts
from atom_core.calibration.prepare.preparation import (
    absent_data,
    check_not_alone,
    free_edges,
    prepare,
    remarks_on_parts,
    stands_in_json,
    usable,
)
from atom_core.calibration.prepare.priors import priors
from atom_core.calibration.prepare.same_labels import copies
from atom_core.calibration.prepare.unseen_rows import unseen_rows
from atom_core.calibration.start.boards import carried_boards
from atom_core.errors import AtomError
from atom_core.labeling.board_size import OTHER_SIZE
from atom_core.model.caveats import Caveat
from atom_core.model.dataset import Dataset, is_complete
from atom_core.model.labels import DetectionKey, place
from atom_core.problem.builder import FreeEdges, build_problem, check_edges
from atom_core.problem.measured_size import MeasuredSide, measured_sides
from atom_core.problem.measurements import Measurement, measured_detections, read_measurements
from atom_core.problem.problem import Problem

_FEW_DETECTIONS = 3


@dataclass(frozen=True)
class Preflight:
    """What is known before a calibration.

    Attributes:
        detections: text for each (sensor, collection, pattern) that was detected.
        complete: collections in which every sensor sees every pattern.
        free_parameters: numbers to estimate, boards included.
        rows: residuals.
        problems: what stands in the way of a calibration.
        warnings: what should be looked at.
        caveats: which of these put a sensor in doubt whatever its labels are.
        residuals: at the poses that the dataset carries; None when it carries none.
        sides: of the boards, as range sensors see them.
        open_motion: what the motions leave open, one of the warnings; else empty.
    """

    detections: Mapping[DetectionKey, str]
    complete: Tuple[str, ...]
    free_parameters: int
    rows: int
    problems: Tuple[str, ...]
    warnings: Tuple[str, ...]
    caveats: Tuple[Caveat, ...]
    residuals: Optional[Table]
    sides: Tuple[MeasuredSide, ...] = ()
    open_motion: str = ""


def preflight(dataset: Dataset) -> Preflight:
    """Examine a dataset; what is wrong is collected rather than raised.

    What `calibrate` refuses before it solves is a problem here, in the same words.
    """
    problems, warnings = _absent(dataset), list(dataset.warnings)
    present = _with_data(dataset)
    read = measured_detections(present)
    measurements, remarks = read_measurements(present, read)
    free = _free_edges(dataset, problems, warnings)
    _collect(lambda: check_edges(dataset, free), problems)
    _collect(lambda: check_joints(dataset, free), problems)
    _collect(lambda: check_connected(present, measurements, free), problems)
    copied = copies(present, measurements)
    warnings += remarks + _implausible(measurements) + _copied(copied)
    tying, _ = usable(present, measurements, CalibrationOptions())
    _collect(lambda: check_not_alone(present, tying, free), problems)
    warnings += holding(present, tying, free)[1]
    if not problems:
        warnings += with_joint_transforms(present, free)[1]
        warnings += only_by_priors(present, measurements, free)
        _collect(lambda: prepare(present, CalibrationOptions(), read), problems)
    if not problems:
        warnings += check_mounts(present, tying, free)
    left_open = "" if problems else open_motion(present, measurements, free)
    warnings += [left_open] if left_open else []
    widths = {sensor.name: sensor.beam_width_rad for sensor in dataset.sensors.values()}
    by_labeler, remarks = look_at_boards(present)
    sides = _unknown(measured_sides(measurements, widths), by_labeler)
    warnings += remarks + _of_another_size(sides)
    in_doubt = frozen_sensors(present, [m for m in measurements if m.key.collection not in copied])
    in_doubt += unseen_rows(present)
    warnings += [caveat.sentence for caveat in in_doubt]
    held = _problem_at_held_boards(present, measurements)
    return Preflight(
        detections=_detections(dataset),
        complete=tuple(key for key in dataset.collections if is_complete(dataset, key)),
        free_parameters=_parameter_count(present, measurements, free),
        rows=sum(m.rows for m in measurements),
        problems=tuple(problems),
        warnings=tuple(warnings),
        caveats=(*dataset.caveats, *in_doubt),
        residuals=residual_table(held, np.zeros(0)) if held else None,
        sides=(*by_labeler, *sides),
        open_motion=left_open,
    )


def _absent(dataset: Dataset) -> List[str]:
    return [
        (
            stands_in_json(dataset, sensor, collections)
            or f"the data files of sensor '{sensor}' are absent ({len(collections)} collections); "
            f"put them beside the dataset"
        )
        + f", or calibrate without it: -ssf '!{sensor}'"
        for sensor, collections in absent_data(dataset).items()
    ]


def _unknown(
    sides: Sequence[MeasuredSide], by_labeler: Sequence[MeasuredSide]
) -> List[MeasuredSide]:
    """Return those of sensors and boards of which no labeler has measured one."""
    known = {(side.sensor, side.pattern) for side in by_labeler}
    return [side for side in sides if (side.sensor, side.pattern) not in known]


def _of_another_size(sides: Sequence[MeasuredSide]) -> List[str]:
    """Return a sentence for each sensor to which a board is not of the configured size."""
    remarks = []
    for sensor, pattern in dict.fromkeys((s.sensor, s.pattern) for s in sides if s.is_off):
        own = [s for s in sides if (s.sensor, s.pattern) == (sensor, pattern)]
        looks, configured = (
            " and ".join(f"{getattr(s, length):.3f} m {('wide', 'high')[s.across]}" for s in own)
            for length in ("measured_m", "configured_m")
        )
        remarks.append(
            f"pattern '{pattern}' looks {looks} to sensor '{sensor}'{OTHER_SIZE}"
            f"{configured}: measure the board, and correct its size and border"
        )
    return remarks


def _collect(check: Callable[[], object], problems: List[str]) -> None:
    try:
        check()
    except AtomError as error:
        problems.append(str(error))


def _free_edges(dataset: Dataset, problems: List[str], warnings: List[str]) -> FreeEdges:
    """Return what will be estimated, and what is known of it beforehand."""
    options, free = CalibrationOptions(), FreeEdges()
    try:
        free = free_edges(dataset, options)
        known, remarks = priors(dataset, options, free)
    except AtomError as error:
        problems.append(str(error))
        return free
    warnings += [*remarks_on_parts(dataset, options, free), *remarks]
    return replace(free, priors=known)


def _with_data(dataset: Dataset) -> Dataset:
    absent = absent_data(dataset)
    return dataset.selected(sensors=[s for s in dataset.sensors if s not in absent])


def _detections(dataset: Dataset) -> Dict[DetectionKey, str]:
    return {
        key: label.summary(dataset.patterns[key.pattern]) for key, label in dataset.detections()
    }


def _parameter_count(dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges) -> int:
    edges = {dataset.sensors[m.key.sensor].edge for m in measurements} - free.held_edges(dataset)
    boards = {dataset.patterns[m.key.pattern].board_key(m.key.collection) for m in measurements}
    poses = 6 * (len(edges) + len(free.additional_tfs) + len(boards))
    return poses + sum(len(parameters) for parameters in free.joints.values())


def _copied(copied: Mapping[str, str]) -> List[str]:
    return [
        f"collection {key} is a copy of {other}, all labels are the same to the last digit: "
        f"calibrate leaves it out"
        for key, other in copied.items()
    ]


def _implausible(measurements: Sequence[Measurement]) -> List[str]:
    remarks = []
    counts: Dict[str, int] = {}
    for m in measurements:
        counts[m.key.sensor] = counts.get(m.key.sensor, 0) + 1
        remarks += [f"{place(m.key)}: {what}" for what in m.implausibilities()]
    for name, count in counts.items():
        if count < _FEW_DETECTIONS:
            remarks.append(f"sensor '{name}' has only {count} detection(s)")
    return remarks


def _problem_at_held_boards(
    dataset: Dataset, measurements: Sequence[Measurement]
) -> Optional[Problem]:
    """Return the problem with every pose as the dataset carries it; None if it carries no board."""
    boards = carried_boards(dataset, measurements)
    placed = [m for m in measurements if (m.key.pattern, m.key.collection) in boards]
    if not placed:
        return None
    everything_held = FreeEdges(tuple(dataset.sensors), {}, anchor_patterns=True)
    return build_problem(dataset, placed, boards, everything_held)
