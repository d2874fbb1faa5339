"""Outcomes of several starts that are equally good: the data do not tell which one is right."""

from __future__ import annotations

from typing import List, Sequence

from atom_core.calibration.judge.weak_directions import WeakDirection
from atom_core.calibration.start.starts import RoughSolution, moved_sensors


def ambiguity(solution: RoughSolution, rivals: Sequence[RoughSolution]) -> List[WeakDirection]:
    """Return, for each equally good outcome, which sensors it puts elsewhere."""
    found = []
    for rival in rivals:
        moved = moved_sensors(solution, rival)
        parameters = tuple(f"{name} pose" for name in moved)
        why = (
            f"the data allow {', '.join(moved)} at two places, equally good: range sensors cannot "
            f"tell a board from one turned by half; add collections that cameras see as well, or "
            f"start from a description"
        )
        found.append(WeakDirection(parameters, max(moved.values()), "m", why))
    return found
