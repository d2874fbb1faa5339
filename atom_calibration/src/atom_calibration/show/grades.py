"""Good, weak or wrong: what the figures on the screens are worth, by the limits of the verdict."""

from __future__ import annotations

import math

from atom_core.report.verdict import RESIDUAL, Limits, worst

# Of a label by itself: root of the mean square, and its worst corner or point [px, m].
_LABEL_RMS = {"px": Limits(0.7, 2.0), "m": Limits(0.025, 0.05)}
_LABEL_WORST = {"px": Limits(2.0, 5.0), "m": Limits(0.08, 0.2)}


def residual_grade(kind: str, mean: float) -> str:
    """Return the grade of a mean residual of a kind."""
    return RESIDUAL[kind].grade(mean)


def label_grade(unit: str, rms: float, largest: float) -> str:
    """Return the grade of a label by itself; empty where nothing is known of it."""
    if unit not in _LABEL_RMS or not math.isfinite(rms):
        return ""
    return worst([_LABEL_RMS[unit].grade(rms), _LABEL_WORST[unit].grade(largest)])
