"""The search for straight pieces of a scan that stand before what is beside them.

Where the ranges step back there is an end; every pair of ends is fitted with a line, all at once.
"""

from __future__ import annotations

from typing import List, NamedTuple, Tuple

import numpy as np

from atom_core.labeling.scan_beams import Beams

_FAR_M = 30.0  # nothing is looked for beyond
_LOOK_BACK = 3  # beams before an end, of which one is to be farther


class Sought(NamedTuple):
    """What a piece must be.

    Attributes:
        shortest_m, longest_m: between its first and last return.
        least_points: returns.
        most_rms_m: about a line, along the beams.
        least_step_m: how far the ranges step back at its ends.
    """

    shortest_m: float
    longest_m: float
    least_points: int
    most_rms_m: float
    least_step_m: float


def doubled(beams: Beams) -> Beams:
    """Return a closed scan with its first half once more at its end, so that no seam is left.

    Where most beams are lost, half a turn may hold more than half of those there are.
    """
    if not beams.closed:
        return beams
    turned = int(np.searchsorted(beams.angle, beams.angle[0] + np.pi)) + _LOOK_BACK
    half = min(max(len(beams.index) // 2, turned), len(beams.index))
    return Beams(
        np.concatenate([beams.index, beams.index[:half]]),
        np.concatenate([beams.angle, beams.angle[:half] + 2.0 * np.pi]),
        np.concatenate([beams.range_m, beams.range_m[:half]]),
        np.concatenate([beams.lost, beams.lost[:half]]),
        beams.step_rad,
        beams.closed,
    )


def free_pieces(beams: Beams, sought: Sought) -> List[Tuple[int, int]]:
    """Return (first, last) of straight pieces with steps back at both ends, most returns first."""
    r = np.where(beams.range_m < _FAR_M, beams.range_m, np.inf)
    left = _steps_back(beams.angle, r, sought.least_step_m)
    if beams.closed:
        left[:_LOOK_BACK] = False  # the same beams come once more, with what is before them
    right = _steps_back(-beams.angle[::-1], r[::-1], sought.least_step_m)[::-1]
    first, last = np.meshgrid(np.flatnonzero(left), np.flatnonzero(right), indexing="ij")
    first, last = first.ravel(), last.ravel()
    fits = (last - first + 1 >= sought.least_points) & (
        beams.angle[last] - beams.angle[first] < np.pi
    )
    first, last = first[fits], last[fits]
    known = np.where(np.isfinite(r), r, 0.0)
    x, y = known * beams.cosine, known * beams.sine
    chord = np.hypot(x[last] - x[first], y[last] - y[first])
    fits = (chord > sought.shortest_m) & (chord < sought.longest_m)
    first, last = first[fits], last[fits]
    count = last - first + 1
    rms, finite = _rms(beams, r, first, last)
    good = finite & (rms < sought.most_rms_m)
    first, last, count = first[good], last[good], count[good]
    order = np.argsort(-count, kind="stable")
    return [(int(first[n]), int(last[n])) for n in order]


def _steps_back(angle: np.ndarray, r: np.ndarray, least_m: float) -> np.ndarray:
    """Return (m,) bool: beams before this one, in order, are behind the line through it.

    Its slope is that of the two returns that follow, where it leads away.
    """
    with np.errstate(invalid="ignore"):
        slope = (r[:-2] - r[2:]) / (angle[2:] - angle[:-2])
    slope = np.concatenate([np.where(np.isfinite(slope), np.maximum(slope, 0.0), 0.0), [0.0, 0.0]])
    back = np.zeros(len(r), dtype=bool)
    for step in range(1, _LOOK_BACK + 1):
        expected = r[step:] + slope[step:] * (angle[step:] - angle[:-step])
        back[step:] |= r[:-step] > expected + least_m
    return back & np.isfinite(r)


def _rms(
    beams: Beams, r: np.ndarray, first: np.ndarray, last: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Return (n,) deviations of pieces from their lines [m], and which pieces have no gap."""
    inside = np.isfinite(r)
    known = np.where(inside, r, 0.0)
    c, s = beams.cosine, beams.sine
    rows = np.stack(
        [
            known**4 * c * c,
            known**4 * c * s,
            known**4 * s * s,
            known**3 * c,
            known**3 * s,
            known**2,
            inside.astype(float),
        ]
    )
    sums = np.concatenate([np.zeros((len(rows), 1)), np.cumsum(rows, axis=1)], axis=1)
    cc, cs, ss, c1, s1, square, count = sums[:, last + 1] - sums[:, first]
    determinant = np.maximum(cc * ss - cs**2, 1e-30)
    explained = (ss * c1**2 - 2.0 * cs * c1 * s1 + cc * s1**2) / determinant
    rms = np.sqrt(np.maximum(square - explained, 0.0) / np.maximum(count, 1.0))
    return rms, count == last - first + 1
