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
    wide gap of lost beams as nothing within reach, unless it is at the end of the field of view.
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
    silent = ~np.isfinite(ranges)
    borders = np.flatnonzero(np.diff(silent.astype(int), prepend=0, append=0))
    for first, beyond in zip(borders[::2].tolist(), borders[1::2].tolist()):
        if first == 0 or beyond == count:
            continue
        gap = ranges[first:beyond]
        nearer = min(ranges[first - 1], ranges[beyond])
        if nearer * step * (beyond - first + 1) <= _GAP_M:
            gap[:] = np.nan
        elif np.all(np.isnan(gap)):
            gap[(beyond - first) // 2] = np.inf
    kept = np.flatnonzero(~np.isnan(ranges))
    between = np.diff(kept, prepend=kept[0] - 1) - 1
    return Beams(index[kept], angle[kept], ranges[kept], between, step, scan.is_closed)
