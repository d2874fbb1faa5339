"""Whether there are enough collections, with boards in places of their own, to differ."""

from __future__ import annotations

from typing import Mapping, Tuple

from atom_core.calibration.refine.model_errors import COMMON
from atom_core.problem.residuals import BORDER, ORTHOGONAL, REPROJECTION
from atom_core.solvers.robust_covariance import FEWEST

_MUCH = 2  # collections to a stop


def few_stops(stops: Mapping[str, str]) -> Tuple[str, ...]:
    """Return a sentence where the sigmas rest on few stops, or on far fewer than collections.

    Args:
        stops: the first collection of its stop by collection (`stops_of`).
    """
    collections, count = len(stops), len(set(stops.values()))
    what, more = f"{count} collection(s)", "collect"
    if count < collections:
        what = f"{collections} collections that show the boards in {count} place(s) only"
        more = "show the boards in"
    if count < FEWEST:
        return (
            f"{what} do not tell by their differences how sure the answer is: its "
            f"sigmas assume that each detection is off as a whole by {COMMON[REPROJECTION]:g} px, "
            f"by {1e3 * COMMON[ORTHOGONAL]:g} mm across the board, and by "
            f"{1e3 * COMMON[BORDER]:g} mm along it, beside its noise; {more} {FEWEST} or more",
        )
    if collections < _MUCH * count:
        return ()
    return (
        f"{what} are worth {count} of them where it is told how sure the answer is: what goes "
        f"wrong in one place goes wrong there each time; move the boards between collections",
    )
