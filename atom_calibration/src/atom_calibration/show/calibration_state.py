"""The state of a calibration, as the message that the panel shows."""

from __future__ import annotations

import math
from typing import Collection, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_calibration.msg import CalibrationState, ResidualBar, ResidualSummary, SensorSigma
from atom_calibration.show.estimate import Estimate
from atom_calibration.show.grades import residual_grade
from atom_core.calibration.calibrate import Calibration
from atom_core.calibration.judge.statistics import ResidualStatistics
from atom_core.model.colours import Colour, packed
from atom_core.problem.residuals import ORTHOGONAL, REPROJECTION
from atom_core.report.edge_results import edge_result
from atom_core.report.verdict import SensorVerdict

RUNNING = "running"
JUDGING = "judging"  # solved again; what the answer is worth follows
_BARS = (REPROJECTION, ORTHOGONAL)  # the kind that tells most of a sensor


class Status(NamedTuple):
    """RUNNING, JUDGING, or the status of calibration.json; the grade; the message for the user."""

    name: str
    message: str = ""
    grade: str = ""


def state_message(
    estimate: Estimate,
    first: Estimate,
    status: Status,
    shown: str = "",
    colours: Optional[Mapping[str, Colour]] = None,
    left_out: Collection[Tuple[str, str]] = (),
) -> CalibrationState:
    """Return the state; the header and the sigmas are left to the caller.

    Args:
        estimate: what is shown.
        first: the estimate at the start.
        status: of the calibration.
        shown: the collection whose residuals are told; empty: all of them together.
        colours: by sensor.
        left_out: sensor and collection of what is not used.
    """
    keys = first.used_collections()
    judged = status.name != RUNNING
    return CalibrationState(
        running=status.name == RUNNING,
        status=status.name,
        grade=status.grade,
        message=status.message,
        iteration=estimate.number,
        cost=estimate.cost,
        residuals=_residuals(estimate, first, shown or None, colours or {}, judged),
        bars=_bars(estimate, keys, left_out, judged),
        collections=keys,
        collection=shown,
    )


def sigma_messages(
    calibration: Calibration, verdicts: Optional[Mapping[str, SensorVerdict]] = None
) -> List[SensorSigma]:
    """Return how well each sensor's pose is known, with the usual errors where they are known.

    Args:
        calibration: the answer.
        verdicts: what it is worth, by sensor.
    """
    messages = []
    for sensor in calibration.dataset.sensors.values():
        result = edge_result(calibration, sensor.edge)
        sigma = result.combined_sigma
        messages.append(
            SensorSigma(
                sensor=sensor.name,
                held=result.anchored,
                translation_m=float(np.max(sigma[3:])),
                rotation_rad=float(np.max(sigma[:3])),
            )
        )
        verdict = (verdicts or {}).get(sensor.name)
        if verdict is not None:
            messages[-1].grade, messages[-1].sentence = verdict.grade, verdict.sentence
    return messages


def _grade(kind: str, value: ResidualStatistics, judged: bool) -> str:
    return residual_grade(kind, value.mean) if judged else ""


def _residuals(
    estimate: Estimate,
    first: Estimate,
    shown: Optional[str],
    colours: Mapping[str, Colour],
    judged: bool,
) -> List[ResidualSummary]:
    rows = []
    for (sensor, kind, collection), value in estimate.table.items():
        if collection != shown:
            continue
        began = first.table.get((sensor, kind, shown))
        rows.append(
            ResidualSummary(
                sensor=sensor,
                colour=packed(colours[sensor]) if sensor in colours else 0,
                kind=kind,
                unit=value.unit,
                count=value.count,
                rms=value.rms,
                rms_initial=math.nan if began is None else began.rms,
                grade=_grade(kind, value, judged),
            )
        )
    order = list(estimate.dataset.sensors)
    return sorted(rows, key=lambda row: order.index(row.sensor))


def _bars(
    estimate: Estimate, keys: Sequence[str], left_out: Collection[Tuple[str, str]], judged: bool
) -> List[ResidualBar]:
    """Return what each sensor has in each collection, and what is left out there."""
    made: Dict[Tuple[str, str], ResidualBar] = {}
    for (sensor, kind, collection), value in estimate.table.items():
        if collection is not None and kind in _BARS:
            made[(sensor, collection)] = ResidualBar(
                sensor=sensor,
                collection=collection,
                unit=value.unit,
                count=value.count,
                rms=value.rms,
                grade=_grade(kind, value, judged),
            )
    for sensor, collection in left_out:
        made[(sensor, collection)] = ResidualBar(
            sensor=sensor, collection=collection, rms=math.nan, left_out=True
        )
    sensors = list(estimate.dataset.sensors)
    return [made[(s, key)] for s in sensors for key in keys if (s, key) in made]
