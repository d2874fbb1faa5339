"""The state of a calibration, as the message that the panel shows."""

from __future__ import annotations

import math
from typing import List, NamedTuple

from atom_calibration.msg import CalibrationState, ResidualSummary
from atom_calibration.show.estimate import Estimate

RUNNING = "running"


class Status(NamedTuple):
    """RUNNING, or the status of calibration.json, with the message for the user."""

    name: str
    message: str = ""


def state_message(estimate: Estimate, first: Estimate, status: Status) -> CalibrationState:
    """Return the state; the header is left to the caller.

    Args:
        estimate: what is shown.
        first: the estimate at the start.
        status: of the calibration.
    """
    return CalibrationState(
        running=status.name == RUNNING,
        status=status.name,
        message=status.message,
        iteration=estimate.number,
        cost=estimate.cost,
        residuals=_residuals(estimate, first),
    )


def _residuals(estimate: Estimate, first: Estimate) -> List[ResidualSummary]:
    rows = []
    for (sensor, kind, collection), value in estimate.table.items():
        if collection is not None:
            continue
        began = first.table.get((sensor, kind, None))
        rows.append(
            ResidualSummary(
                sensor=sensor,
                kind=kind,
                unit=value.unit,
                count=value.count,
                rms=value.rms,
                rms_initial=math.nan if began is None else began.rms,
            )
        )
    order = list(estimate.dataset.sensors)
    return sorted(rows, key=lambda row: order.index(row.sensor))
