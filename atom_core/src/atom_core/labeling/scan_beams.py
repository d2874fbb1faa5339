"""The beams of a 2D LiDAR's scan by growing angle, without those that got no answer."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Optional, Union

import numpy as np

from atom_core.model.laser_scan import LaserScan

Part = Union[slice, np.ndarray]  # of the beams
_GAP_M = 0.3  # a wider gap of lost beams is open; black squares swallow beams, too


@dataclass(frozen=True, eq=False)
class Beams:
    """The beams of a scan that say something, by growing angle.

    Attributes:
        index: (m,) into the scan's ranges.
        angle: (m,) [rad], unwrapped.
        range_m: (m,) [m]; infinite where nothing is within reach.
        lost: (m,) how many beams without an answer lie between a beam and the one before it.
        step_rad: between neighbors in the scan, positive.
        closed: the scan goes all the way round; otherwise the first and the last beam are the ends
            of the field of view.
    """

    index: np.ndarray
    angle: np.ndarray
    range_m: np.ndarray
    lost: np.ndarray
    step_rad: float
    closed: bool
    cosine: np.ndarray = field(init=False)
    sine: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "cosine", np.cos(self.angle))
        object.__setattr__(self, "sine", np.sin(self.angle))

    def points(self, part: Part = slice(None)) -> np.ndarray:
        """Return points (n, 2) [m]; infinite or NaN where nothing is within reach."""
        with np.errstate(invalid="ignore"):
            rays = np.column_stack([self.cosine[part], self.sine[part]])
            return self.range_m[part, None] * rays


def beams_of(scan: LaserScan, middle: Optional[int] = None) -> Beams:
    """Return the beams that say something, by growing angle.

    Where the scan goes all the way round, its seam is put opposite to the beam ``middle`` (an index
    into the ranges); None keeps it. Lost beams are left out. A narrow gap without returns counts as
    lost, since many drivers report a beam that got no answer like one with nothing within reach; a
    wide gap of lost beams as nothing within reach, unless it is at the end of the field of view; so
    also across the seam of a whole turn.
    """
    count = len(scan.ranges)
    index = np.arange(count) if scan.angle_increment > 0 else np.arange(count)[::-1]
    angle = scan.angles
    if scan.is_closed and middle is not None:
        place = middle if scan.angle_increment > 0 else count - 1 - middle
        index = np.roll(index, count // 2 - place)
    angle = angle[index]
    angle = np.where(angle < angle[0] - 1e-9, angle + 2.0 * np.pi, angle)
    ranges = np.where(scan.valid, scan.ranges, np.where(scan.beyond, np.inf, np.nan))[index]
    step = abs(scan.angle_increment)
    _judge_gaps(ranges, step, scan.is_closed)
    kept = np.flatnonzero(~np.isnan(ranges))
    before = kept[-1] - count if scan.is_closed else kept[0] - 1
    between = np.diff(kept, prepend=before) - 1
    return Beams(index[kept], angle[kept], ranges[kept], between, step, scan.is_closed)


def _judge_gaps(ranges: np.ndarray, step_rad: float, closed: bool) -> None:
    """Make narrow gaps without returns lost, and a beam in wide gaps of lost beams infinite.

    Args:
        ranges: (n,) [m] in the order of the beams, changed; infinite or NaN without a return.
        step_rad: between neighbors.
        closed: the last beam is the neighbor of the first; a gap may lie across the seam.
    """
    count, silent = len(ranges), ~np.isfinite(ranges)
    start = int(np.argmin(silent)) if closed else 0  # a return: no gap begins before it
    places = np.roll(np.arange(count), -start)
    borders = np.flatnonzero(np.diff(silent[places].astype(int), prepend=0, append=0))
    for first, beyond in zip(borders[::2].tolist(), borders[1::2].tolist()):
        if not closed and (first == 0 or beyond == count):
            continue
        gap = places[first:beyond]
        apart_m = min(ranges[places[first - 1]], ranges[places[beyond % count]]) * step_rad
        if apart_m * (len(gap) + 1) <= _GAP_M:
            ranges[gap] = np.nan
        elif np.all(np.isnan(ranges[gap])):
            seam = int(np.argmin(gap))  # from where on it lies after the seam; 0: on one side
            for part in (gap, gap[:seam], gap[seam:]) if seam else (gap,):
                if apart_m * (len(part) + 1) > _GAP_M:  # seen from either side of the seam
                    ranges[part[len(part) // 2]] = np.inf
