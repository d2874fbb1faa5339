"""Whether a board has the configured size, told by what a 3D LiDAR saw of it several times.

A single label leaves a few per cent open. Over several boards their median tells; and since wide
beams enlarge a board by their width times its distance, ranges that are too long by their share of
it, and a board of another size is that at any distance, boards from near and far tell these apart.
"""

from __future__ import annotations

from typing import Iterable, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.errors import LabelingError
from atom_core.geometry.rectangle import Rectangle
from atom_core.geometry.robust_sigma import OF_A_MEDIAN, robust_sigma
from atom_core.labeling.lidar3d import CloudLike, Lidar3dOptions, as_cloud, board_at

OTHER_SIZE = "; the configuration says "  # in each remark about a board of another size

LEAST_SIDES = 3  # of a kind, to say anything
OFF_SHARE = 0.02  # of a side: so much the outline of a right board may leave open
SURELY_SMALLER_SHARE = 0.03  # of a side, over several labels: no right board looks so
FEW_OFF_SHARE = 0.04  # of fewer labels: right boards of LiDAR models look 3.5 % smaller at most
_SIGMAS = 3.0
_ROUNDS = 10
_LEAST_RATIO = 1.6  # of the farthest board's range to the nearest, to tell another size from beams
_LEAST_SIGMA_M = 0.002  # of a side that is measured once
_LEAST_SIGMA_SHARE = 0.002  # the same, as a share of the side


class SeenBoard(NamedTuple):
    """What one label says of a board's size.

    Attributes:
        away_m: range of its middle.
        sides_m: its width and height without what beams of the configured width add; NaN where two
            opposite sides were not seen.
    """

    away_m: float
    sides_m: Tuple[float, float]


class SizeFinding(NamedTuple):
    """How large boards look.

    Attributes:
        sides_m: medians of width and height, NaN where fewer than three labels tell.
        sigma_m: of these.
        counts: labels that tell.
        nearest_m, farthest_m: ranges of the boards.
        by_size: neither wide beams alone explain it, nor ranges that are too long or short.
        by_beams: another size alone does not explain it: the farther, the larger.
        range_offset_m: by which ranges are too long, or too short (negative), where that explains
            it and neither of the others does: the nearer, the more. None where it does not.
    """

    sides_m: Tuple[float, float]
    sigma_m: Tuple[float, float]
    counts: Tuple[int, int]
    nearest_m: float
    farthest_m: float
    by_size: bool
    by_beams: bool
    range_offset_m: Optional[float] = None


def seen_boards(
    boards: Iterable[Tuple[CloudLike, np.ndarray]], border: Rectangle, beam_width_rad: float
) -> List[SeenBoard]:
    """Return what is seen of a board in each cloud where it is found.

    Args:
        boards: clouds of one sensor, each with a seed (3,) on its board [m].
        border: the board's edges [m].
        beam_width_rad: as configured; 0 where it is not.
    """
    seen, options = [], Lidar3dOptions(beam_width_rad=beam_width_rad)
    for cloud, seed in boards:
        try:
            found = board_at(as_cloud(cloud), border, seed, options)
        except LabelingError:
            continue
        quality = found.labeled.quality
        if found.labeled.detected:
            width, height = (quality.get(f"measured_{s}_m", np.nan) for s in ("width", "height"))
            away = float(np.linalg.norm(found.sensor_T_centre[:3, 3]))
            seen.append(SeenBoard(away, (width, height)))
    return seen


def find_size(seen: Sequence[SeenBoard], border: Rectangle) -> Optional[SizeFinding]:
    """Return how large boards look; None where fewer than three labels show a side whole."""
    configured = 2.0 * border.half_size
    sides = np.array([one.sides_m for one in seen], dtype=float).reshape(-1, 2)
    known = np.isfinite(sides).sum(axis=0)
    told = [axis for axis in (0, 1) if known[axis] >= LEAST_SIDES]
    if not told:
        return None
    medians, sigmas = np.full(2, np.nan), np.full(2, np.nan)
    for axis in told:
        medians[axis], sigmas[axis] = _median(sides[np.isfinite(sides[:, axis]), axis])
    away = np.array([one.away_m for one in seen])
    beyond_beams, by_beams = _causes(away, sides - configured, told)
    larger, smaller, offset_m = _beside_ranges(away, sides / configured - 1.0, told)
    return SizeFinding(
        (float(medians[0]), float(medians[1])),
        (float(sigmas[0]), float(sigmas[1])),
        (int(known[0]), int(known[1])),
        float(away.min()),
        float(away.max()),
        smaller or (larger and beyond_beams),
        by_beams and offset_m is None,
        offset_m,
    )


def is_off(side_m: float, configured_m: float, sigma_m: float) -> bool:
    """Tell whether a side is farther from the configured one than its measurement leaves open."""
    off_m = abs(side_m - configured_m)
    return bool(off_m > max(OFF_SHARE * configured_m, _SIGMAS * sigma_m))


def is_surely_smaller(border: Rectangle, finding: Optional[SizeFinding]) -> bool:
    """Tell whether several labels are of a board that is smaller than configured.

    What looks larger may be seen by wide beams, and what looks so the nearer it is, by ranges that
    are off.
    """
    if finding is None or finding.range_offset_m is not None:
        return False
    configured = 2.0 * border.half_size
    smaller = configured * (1.0 - SURELY_SMALLER_SHARE)
    return any(
        is_off(side, full, sigma) and side < most
        for side, full, sigma, most in zip(finding.sides_m, configured, finding.sigma_m, smaller)
        if np.isfinite(side)
    )


def size_remark(
    sensor: str, pattern: str, border: Rectangle, finding: Optional[SizeFinding]
) -> Optional[str]:
    """Return a sentence where a board looks larger or smaller than configured, and why; or None."""
    if finding is None:
        return None
    configured = 2.0 * border.half_size
    told = [axis for axis in (0, 1) if np.isfinite(finding.sides_m[axis])]
    off = [
        axis
        for axis in told
        if is_off(finding.sides_m[axis], configured[axis], finding.sigma_m[axis])
    ]
    if not off:
        return None
    looks, says = (
        " and ".join(f"{lengths[axis]:.3f} m {('wide', 'high')[axis]}" for axis in told)
        for lengths in (finding.sides_m, configured)
    )
    remark = f"pattern '{pattern}' looks {looks} to sensor '{sensor}'{OTHER_SIZE}{says}"
    if finding.range_offset_m is not None:
        return remark + _by_ranges(sensor, finding, finding.range_offset_m)
    remark += ": measure the board, and correct its size and border"
    larger = all(finding.sides_m[axis] > configured[axis] for axis in off)
    return remark + (_cause(finding) if larger else _cause_of_smaller(finding))


def few_boards_remark(
    sensor: str, pattern: str, border: Rectangle, seen: Sequence[SeenBoard]
) -> Optional[str]:
    """Return a sentence where all of a few labels show a smaller board than configured; or None.

    Such a board is refused mostly, and one or two labels are all there is. No beam makes a board
    look smaller; larger ones need more labels.
    """
    configured = 2.0 * border.half_size
    shares = np.array([one.sides_m for one in seen], dtype=float).reshape(-1, 2) / configured
    known = np.isfinite(shares)
    if not np.any(known) or np.nanmax(shares) > 1.0 - FEW_OFF_SHARE:
        return None
    told = np.flatnonzero(np.any(known, axis=0))
    looks, says = (
        " and ".join(f"{lengths[axis]:.3f} m {('wide', 'high')[axis]}" for axis in told)
        for lengths in ({a: configured[a] * np.nanmedian(shares[:, a]) for a in told}, configured)
    )
    labels = "the only label" if len(seen) == 1 else f"all {len(seen)} labels"
    return (
        f"pattern '{pattern}' looks {looks} to sensor '{sensor}', in {labels} there "
        f"{'is' if len(seen) == 1 else 'are'}{OTHER_SIZE}{says}: measure the board, "
        f"and correct its size and border. A board of another size is refused mostly, which may be "
        f"why there are so few labels"
    )


def _by_ranges(sensor: str, finding: SizeFinding, offset_m: float) -> str:
    looks, reads = ("larger", "long") if offset_m > 0 else ("smaller", "short")
    return (
        f". The nearer it is ({_spread(finding)}), the {looks} it looks, as ranges that are some "
        f"{abs(1000.0 * offset_m):.0f} mm too {reads} make it, and no board does: calibrate with "
        f"--range_offset {sensor}"
    )


def _spread(finding: SizeFinding) -> str:
    return f"{finding.nearest_m:.1f} to {finding.farthest_m:.1f} m"


def _cause_of_smaller(finding: SizeFinding) -> str:
    if finding.by_size:
        return ""
    return (
        f". These boards ({_spread(finding)} away) do not tell a smaller board from ranges that "
        f"are too short; boards nearer and farther away would"
    )


def _cause(finding: SizeFinding) -> str:
    spread = _spread(finding)
    if finding.by_size and not finding.by_beams:
        return (
            f". It looks so at any distance ({spread}), as it does where ranges are too long by as "
            f"many percent; wide beams would enlarge it with distance"
        )
    if finding.by_beams and not finding.by_size:
        return f". It looks the larger the farther it is ({spread}), as wide beams make it"
    if finding.by_size:
        return f". It looks so near by, and still larger far away ({spread}): wide beams add to it"
    return (
        f". These boards ({spread} away) do not tell a larger board from wide beams, and from "
        f"ranges that are too long; boards nearer and farther away would"
    )


def _causes(away_m: np.ndarray, beyond_m: np.ndarray, told: List[int]) -> Tuple[bool, bool]:
    """Fit beyond = own of the side + width * range, robustly; return which of the two is sure."""
    rows = [
        ([*(float(axis == a) for a in told), away], beyond)
        for axis in told
        for away, beyond in zip(away_m, beyond_m[:, axis])
    ]
    x, sigmas = _fitted(rows, _LEAST_SIGMA_M)
    by_size = bool(np.any(x[:-1] > _SIGMAS * sigmas[:-1]))
    return by_size, bool(x[-1] > _SIGMAS * sigmas[-1])


def _beside_ranges(
    away_m: np.ndarray, beyond_share: np.ndarray, told: List[int]
) -> Tuple[bool, bool, Optional[float]]:
    """Fit beyond = share + offset / range, robustly; tell whether boards are larger, or smaller.

    What is beyond the configured side is a share of it here: ranges that are too long by a share of
    themselves enlarge all that the sensor sees by that. The offset is returned if it alone is sure.
    """
    rows = [
        ([1.0, 1.0 / away], beyond)
        for axis in told
        for away, beyond in zip(away_m, beyond_share[:, axis])
    ]
    (share, offset_m), (sigma_share, sigma_m) = _fitted(rows, _LEAST_SIGMA_SHARE)
    larger, smaller = share > _SIGMAS * sigma_share, share < -_SIGMAS * sigma_share
    if larger or smaller or not abs(offset_m) > _SIGMAS * sigma_m:
        return bool(larger), bool(smaller), None
    alone, _ = _fitted([([row[1]], beyond) for row, beyond in rows], _LEAST_SIGMA_SHARE)
    return False, False, float(alone[0])


def _fitted(
    rows: Sequence[Tuple[List[float], float]], least_sigma: float
) -> Tuple[np.ndarray, np.ndarray]:
    """Return x and its sigmas of ``row @ x = value``, robustly; infinite sigmas if too little told.

    The last number of a row says how far away its board is, or one over that.
    """
    known = [(row, value) for row, value in rows if np.isfinite(value)]
    A, b = np.array([row for row, _ in known]), np.array([value for _, value in known])
    count = len(rows[0][0])
    if len(b) <= count + 1 or A[:, -1].max() < _LEAST_RATIO * A[:, -1].min():
        return np.zeros(count), np.full(count, np.inf)
    weight, x, sigma = np.ones(len(b)), np.zeros(count), least_sigma
    for _ in range(_ROUNDS):
        x = np.linalg.lstsq(A * weight[:, None], b * weight, rcond=None)[0]
        off = b - A @ x
        sigma = max(robust_sigma(off), least_sigma)
        weight = 1.0 / np.sqrt(1.0 + (off / (2.0 * sigma)) ** 2)
    # Two sides of one label have their plane and distance in common.
    covariance = 2.0 * sigma**2 * np.linalg.pinv((A * weight[:, None] ** 2).T @ A)
    return x, np.sqrt(np.diag(covariance))


def _median(values: np.ndarray) -> Tuple[float, float]:
    """Return the median and its sigma."""
    median = float(np.median(values))
    scatter = max(robust_sigma(values - median), _LEAST_SIGMA_M)
    return median, OF_A_MEDIAN * scatter / float(np.sqrt(len(values)))
