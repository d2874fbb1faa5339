"""How a calibration stands, as the message that the panel shows."""

from __future__ import annotations

import math
from typing import List, NamedTuple

from atom_calibration.msg import CalibrationState, ResidualSummary
from atom_calibration.show.standing import Standing

RUNNING = "running"


class Words(NamedTuple):
    """What the user is told: RUNNING, or the status of calibration.json with its message."""

    status: str
    message: str = ""


def state_message(standing: Standing, first: Standing, words: Words) -> CalibrationState:
    """Return the state; the header is left to the caller.

    Args:
        standing: where the calibration stands.
        first: where it began.
        words: for the user.
    """
    return CalibrationState(
        running=words.status == RUNNING,
        status=words.status,
        message=words.message,
        iteration=standing.number,
        cost=standing.cost,
        residuals=_residuals(standing, first),
    )


def _residuals(standing: Standing, first: Standing) -> List[ResidualSummary]:
    rows = []
    for (sensor, kind, collection), value in standing.table.items():
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
    order = list(standing.dataset.sensors)
    return sorted(rows, key=lambda row: order.index(row.sensor))
