"""Gaps in a spinning LiDAR's scan, in which no layer returns anything.

Lost packets leave them (one is 2 to 6 degrees of most models), and scans of which a driver makes
fewer packets than a turn has: there the scan does not close. A board behind such a gap is seen in
two parts.
"""

from __future__ import annotations

from typing import List, NamedTuple, Tuple

import numpy as np

_NARROWEST_RAD, _WIDEST_RAD = np.radians(0.5), np.radians(8.0)
_STEPS = 3.0  # between neighbouring azimuths: what is wider is a gap
_STRIP_RAD = np.radians(0.7)  # beside it: one or two returns of each layer
_SAME_LAYER_RAD = np.radians(0.3)
_SAME_RANGE_M, _SAME_RANGE_SHARE = 0.05, 0.05
_SLANT = 1.3  # a surface that is seen slantwise is longer than the arc that it hides
_MOST_SEEDS = 4  # of a gap: what stands nearest
_MOST_PLACES = 8  # of all gaps: a sparse cloud has many, and each is looked at


class ScanGap(NamedTuple):
    """A place where something may stand behind a gap.

    Attributes:
        seed: (3,) [m] between what is seen of it on both sides, in the sensor's frame.
        width_m: of the gap, at that distance.
    """

    seed: np.ndarray
    width_m: float


def scan_gaps(points: np.ndarray, apart_m: float) -> List[ScanGap]:
    """Return where something is seen at the same range on both sides of a gap, eight at most.

    The nearest stands first.

    Args:
        points: (n, 3) [m] in the sensor's frame, which turns about z; NaN and zeros are invalid.
        apart_m: places of one gap that are nearer to one another count as one.
    """
    points = np.asarray(points, dtype=float)
    across = np.hypot(points[:, 0], points[:, 1])
    valid = np.isfinite(points).all(axis=1) & (across > 1e-6)
    points = points[valid]
    azimuth = np.arctan2(points[:, 1], points[:, 0])
    found: List[ScanGap] = []
    for begin, end in _gaps(azimuth):
        before = np.flatnonzero((begin - azimuth) % (2.0 * np.pi) <= _STRIP_RAD)
        behind = np.flatnonzero((azimuth - end) % (2.0 * np.pi) <= _STRIP_RAD)
        places = _between(points[before], points[behind])
        width = (end - begin) % (2.0 * np.pi) * _SLANT
        for place in _apart(places, apart_m):
            found.append(ScanGap(place, float(width * np.hypot(place[0], place[1]))))
    return sorted(found, key=lambda gap: float(np.linalg.norm(gap.seed)))[:_MOST_PLACES]


def _gaps(azimuth: np.ndarray) -> List[Tuple[float, float]]:
    """Return begin and end [rad] of the gaps between azimuths (n,) [rad] in [-pi, pi]."""
    if len(azimuth) < 2:
        return []
    around = np.sort(azimuth)
    steps = np.diff(around, append=around[0] + 2.0 * np.pi)
    usual = float(np.percentile(steps, 99.0))
    wide = (steps > max(_STEPS * usual, _NARROWEST_RAD)) & (steps < _WIDEST_RAD)
    return [(float(around[i]), float(around[i] + steps[i])) for i in np.flatnonzero(wide)]


def _between(before: np.ndarray, behind: np.ndarray) -> np.ndarray:
    """Return (k, 3): the middles of returns (n, 3), (m, 3) of one layer that are equally far."""
    if not (len(before) and len(behind)):
        return np.zeros((0, 3))
    ranges = [np.linalg.norm(side, axis=1) for side in (before, behind)]
    elevations = [np.arcsin(side[:, 2] / r) for side, r in zip((before, behind), ranges)]
    layer = np.abs(elevations[0][:, None] - elevations[1]) < _SAME_LAYER_RAD
    nearness = np.maximum(_SAME_RANGE_M, _SAME_RANGE_SHARE * ranges[0])
    alike = layer & (np.abs(ranges[0][:, None] - ranges[1]) < nearness[:, None])
    one, other = np.nonzero(alike)
    return (before[one] + behind[other]) / 2.0


def _apart(places: np.ndarray, apart_m: float) -> List[np.ndarray]:
    """Return middles of the groups of places (k, 3), each not longer than ``apart_m``."""
    groups: List[np.ndarray] = []
    left = places[np.argsort(np.linalg.norm(places, axis=1))]
    while len(left) and len(groups) < _MOST_SEEDS:
        near = np.linalg.norm(left - left[0], axis=1) < apart_m
        groups.append(left[near].mean(axis=0))
        left = left[~near]
    return groups
