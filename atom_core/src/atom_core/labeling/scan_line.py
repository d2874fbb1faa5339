"""Straight pieces in the scan of a 2D LiDAR: lines grown from a beam, what is beyond their ends.

A line that misses the sensor is ``1 / range = a cos(angle) + b sin(angle)``, linear in (a, b).
Noise lies along the beam, so that the inverse ranges are weighted by range to the fourth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import List, NamedTuple, Optional, Tuple

import numpy as np

from atom_core.geometry.robust_sigma import PER_MEDIAN
from atom_core.labeling.scan_beams import Beams, Part

ON, BEHIND, BEFORE = 0, 1, -1  # where a return lies, as seen from the sensor
EDGE, SWALLOWED, HIDDEN = "edge", "swallowed", "hidden"
OUT_OF_VIEW, UNCLEAR = "out_of_view", "unclear"

_MOST_LOST = 2  # beams without an answer that leave an end as exact as it is
_FIRST_M, _LEAST_FIRST = 0.12, 5  # the line grows from a piece of this length and so many returns
_ROUNDS = 8
_LIMITS = (0.8, 2.0)  # of the expected noise; between them it is taken from the returns
_SIGMAS = 3.5
_MOST_MIXED, _MIXED_SIGMAS = 2, 2.5
_RESUMED = 4  # returns on the line beyond something that hides part of it
_LOOK_BEYOND = 3  # beams beyond an end; up to two may have met both the board and what is behind
_JUMP_M, _JUMP_SIGMAS = 0.05, 5.0
_CHAIN_M = 0.15  # between neighbors of a surface that begins where the line ends
_GRIP_M, _LEAST_GRIP = 0.15, 3  # along the line, and returns, of a hand at an end of a board
_GRIP_OFF_M, _GRIP_SIGMAS = 0.010, 3.5  # of their mean, off the line through all others


class Line(NamedTuple):
    """``1 / range = a cos(angle) + b sin(angle)``; (a, b) over its length is the normal."""

    a: float
    b: float

    @property
    def distance_m(self) -> float:
        """From the sensor, at right angles [m]."""
        return 1.0 / max(math.hypot(self.a, self.b), 1e-9)

    @property
    def normal(self) -> np.ndarray:
        """(2,) unit vector from the sensor to the line."""
        return np.array([self.a, self.b]) * self.distance_m

    @property
    def direction(self) -> np.ndarray:
        """(2,) unit vector along the line, towards growing angles."""
        return np.array([-self.b, self.a]) * self.distance_m


class End(NamedTuple):
    """One end of a cut.

    Attributes:
        kind: ``edge`` where something farther, or nothing, is beyond; ``swallowed`` likewise, but
            beams between them have no answer, as from black squares; ``hidden`` by something
            nearer; ``out_of_view``; ``unclear`` where what is beyond is hardly farther.
        behind_m: how far behind the line the beams beyond are, along the beam; infinite for open.
        attached: another surface begins where the line ends.
    """

    kind: str
    behind_m: float
    attached: bool

    @property
    def is_free(self) -> bool:
        """Tell whether the surface ends there, with something farther beyond."""
        return self.kind in (EDGE, SWALLOWED)


@dataclass(frozen=True, eq=False)
class Cut:
    """A straight piece of a scan.

    Attributes:
        beams: what it was found in.
        members: (n,) positions in ``beams`` of the returns on it, by growing angle.
        line: through them.
        sigma_m: noise along the beam, from the returns.
        residual_m: (n,) along the beam, positive behind the line.
        along_m: (n,) positions along the line [m], from the foot of the perpendicular.
        outer: first and last position in ``beams`` of what is on the line; farther out than the
            members where a hand, or another thing a little off the line, is at an end.
    """

    beams: Beams
    members: np.ndarray
    line: Line
    sigma_m: float
    residual_m: np.ndarray
    along_m: np.ndarray
    outer: Tuple[int, int]

    @cached_property
    def ends(self) -> Tuple[End, End]:
        """What is beyond the first and beyond the last member."""
        return (_end(self, -1), _end(self, 1))

    @property
    def indices(self) -> np.ndarray:
        """(n,) of the members in the scan's ranges, in the order of the members."""
        return self.beams.index[self.members]

    @property
    def length_m(self) -> float:
        """Between the first and the last member [m]."""
        return float(self.along_m[-1] - self.along_m[0])

    @property
    def step_m(self) -> float:
        """Between neighbors, at the end where they are farther apart [m]."""
        far = max(-self.along_m[0], self.along_m[-1]) / self.line.distance_m
        return float(self.beams.step_rad * self.line.distance_m * (1.0 + far**2))

    @property
    def middle(self) -> np.ndarray:
        """(2,) [m] on the line, halfway between the ends."""
        halfway = 0.5 * float(self.along_m[0] + self.along_m[-1])
        return self.line.normal * self.line.distance_m + self.line.direction * halfway

    @property
    def cosine(self) -> float:
        """Of the angle between the line's normal and the beam to the middle."""
        halfway = 0.5 * float(self.along_m[0] + self.along_m[-1])
        return self.line.distance_m / float(np.hypot(self.line.distance_m, halfway))

    @property
    def rms_m(self) -> float:
        """Deviation of the returns from the line, at right angles to it [m]."""
        free = max(len(self.members) - 2, 1)
        return float(np.sqrt(np.sum(self.residual_m**2) / free)) * self.cosine

    @cached_property
    def bend_m(self) -> Tuple[float, float]:
        """How far the middle bulges out of the chord, at right angles [m], and its deviation."""
        half = 0.5 * max(self.length_m, 1e-6)
        x = (self.along_m - 0.5 * (self.along_m[0] + self.along_m[-1])) / half
        design = np.stack([np.ones(len(x)), x, x**2])
        inverse = np.linalg.inv(design @ design.T + 1e-9 * np.eye(3))
        curve = inverse @ (design @ self.residual_m)
        left = self.residual_m - curve @ design
        sigma = math.sqrt(float(left @ left) / max(len(x) - 3, 1))
        return float(curve[2]) * self.cosine, sigma * math.sqrt(inverse[2, 2]) * self.cosine


def fit_line(beams: Beams, members: np.ndarray) -> Line:
    """Return the line that fits returns best, by least squares along the beams."""
    r, c, s = beams.range_m[members], beams.cosine[members], beams.sine[members]
    c, s = r**2 * c, r**2 * s
    cc, cs, ss = float(c @ c), float(c @ s), float(s @ s)
    right_c, right_s = float(c @ r), float(s @ r)
    determinant = max(cc * ss - cs**2, 1e-30)
    return Line(
        (ss * right_c - cs * right_s) / determinant, (cc * right_s - cs * right_c) / determinant
    )


def behind_line(beams: Beams, line: Line, part: Part = slice(None)) -> np.ndarray:
    """Return how far behind a line returns lie, along their beams [m]; negative before it.

    Beams that never meet the line are before it wherever they end.
    """
    inverse = line.a * beams.cosine[part] + line.b * beams.sine[part]
    meets = inverse > 1e-6
    return np.where(meets, beams.range_m[part] - 1.0 / np.where(meets, inverse, 1.0), -np.inf)


def along_line(beams: Beams, line: Line, part: Part = slice(None)) -> np.ndarray:
    """Return where beams meet a line [m], from the foot of the perpendicular; for those that do."""
    return line.distance_m * np.tan(beams.angle[part] - np.arctan2(line.b, line.a))


def grown_cut(beams: Beams, start: int, longest_m: float, sigma_m: float = 0.01) -> Optional[Cut]:
    """Grow a straight piece from a return, in both directions, until something else is met.

    Args:
        beams: the scan.
        start: position of a return in ``beams``.
        longest_m: it grows no farther than this from the start.
        sigma_m: noise of a range that is expected.

    Returns:
        The piece, or None where fewer than three returns lie on a line.
    """
    first = _first_piece(beams, start)
    return None if first is None else cut_along(beams, first, start, longest_m, sigma_m)


def cut_along(
    beams: Beams, first: np.ndarray, start: int, longest_m: float, sigma_m: float = 0.01
) -> Optional[Cut]:
    """Fit a line to a piece and let it grow or shrink until it keeps its returns.

    Args:
        beams: the scan.
        first: (n,) positions of the piece's returns in ``beams``.
        start: one of them.
        longest_m: it grows no farther than this from there.
        sigma_m: noise of a range that is expected.

    Returns:
        The piece, or None where fewer than three returns lie on a line.
    """
    reach = _within(beams, start, longest_m)
    members, sigma = first, _LIMITS[1] * sigma_m
    line = fit_line(beams, members)
    for _ in range(_ROUNDS):
        before, spread = members, sigma
        off = behind_line(beams, line, reach)
        middle = int(members[len(members) // 2]) - reach.start
        members = reach.start + _walked(off, middle, _SIGMAS * sigma)
        if len(members) < 3:
            return None
        line = fit_line(beams, members)
        off = behind_line(beams, line, members)
        sigma = _sigma(off, sigma_m)
        if abs(sigma - spread) < 1e-3 and np.array_equal(before, members):
            break
    kept = _without_mixed(off, sigma)
    if kept != slice(0, len(members)):
        members = members[kept]
        line = fit_line(beams, members)
    outer = (int(members[0]), int(members[-1]))
    held = _without_grips(beams, members, sigma)
    if held != slice(0, len(members)):
        members = members[held]
        line = fit_line(beams, members)
    off = behind_line(beams, line, members)
    sigma = _sigma(off, sigma_m)
    return Cut(beams, members, line, sigma, off, along_line(beams, line, members), outer)


def _without_mixed(off: np.ndarray, sigma_m: float) -> slice:
    """Return the part without returns at the ends that met something behind the surface, too."""
    first, beyond = 0, len(off)
    while first < _MOST_MIXED and beyond - first > 3 and off[first] > _MIXED_SIGMAS * sigma_m:
        first += 1
    while len(off) - beyond < _MOST_MIXED and beyond - first > 3:
        if off[beyond - 1] <= _MIXED_SIGMAS * sigma_m:
            break
        beyond -= 1
    return slice(first, beyond)


def _without_grips(beams: Beams, members: np.ndarray, sigma_m: float) -> slice:
    """Return the part of a cut without what its ends hold that is a little off its line: a hand.

    The line is that through all that is farther from the ends than a hand is wide.
    """
    whole = slice(0, len(members))
    along = along_line(beams, fit_line(beams, members), members)
    middle = (along > along[0] + _GRIP_M) & (along < along[-1] - _GRIP_M)
    count = int(np.count_nonzero(middle))
    if count < 2 * _LEAST_FIRST:
        return whole
    line = fit_line(beams, members[middle])
    off = behind_line(beams, line, members)
    spread = max(float(np.ptp(along[middle])), 0.05)
    from_middle = (along - along[middle].mean()) / spread
    variance = (1.0 + 12.0 * from_middle**2) / count  # of the line, there
    first = _grip(off[~middle & (from_middle < 0)], variance, sigma_m)
    last = _grip(off[~middle & (from_middle > 0)][::-1], variance[::-1], sigma_m)
    return slice(first, len(members) - last)


def _grip(off: np.ndarray, variance: np.ndarray, sigma_m: float) -> int:
    """Return how many returns (n,) from an end on are off a line by their mean; 0 if none are.

    Args:
        off: how far behind it they are [m].
        variance: of the line there, over that of a return.
        sigma_m: noise of a return.
    """
    numbers = np.arange(1, len(off) + 1)
    mean = np.cumsum(off) / numbers
    excess = np.abs(mean) / (sigma_m * np.sqrt(1.0 / numbers + variance[: len(off)]))
    excess[np.abs(mean) < _GRIP_OFF_M] = 0.0
    excess[: _LEAST_GRIP - 1] = 0.0
    if not len(excess) or excess.max() < _GRIP_SIGMAS:
        return 0
    return int(np.argmax(excess)) + 1


def _sigma(off: np.ndarray, expected_m: float) -> float:
    """Return the deviation of returns about a line fitted to them [m], by the median."""
    half = len(off) // 2
    median = float(np.partition(np.abs(off), half)[half])
    sigma = PER_MEDIAN * median * _few(len(off))
    return min(max(sigma, _LIMITS[0] * expected_m), _LIMITS[1] * expected_m)


def _few(count: int) -> float:
    """Return the factor that undoes the two numbers a line takes out of few returns."""
    return (count / max(count - 2.0, 1.0)) ** 0.5


def _first_piece(beams: Beams, start: int) -> Optional[np.ndarray]:
    """Return the straightest short piece about, before or after a return."""
    r = beams.range_m
    if not np.isfinite(r[start]):
        return None
    here = beams.points(slice(start, start + 1))[0]
    lo, hi = max(start - 200, 0), min(start + 201, len(r))
    with np.errstate(invalid="ignore"):
        away = np.linalg.norm(beams.points(slice(lo, hi)) - here, axis=1)
    best: Optional[np.ndarray] = None
    least = np.inf
    for share in (0.5, 0.0, 1.0):
        piece = _piece(away, start - lo, share)
        if len(piece) < 3:
            continue
        off = behind_line(beams, fit_line(beams, piece + lo), piece + lo)
        rms = float(np.sqrt(np.mean(off**2))) * _few(len(piece))
        if rms < least:
            best, least = piece + lo, rms
    return best


def _piece(away: np.ndarray, start: int, share: float) -> np.ndarray:
    """Return positions about a start, this share of them before it, that hang together."""
    lo = hi = start
    while True:
        count = hi - lo + 1
        span = away[lo] + away[hi]
        if count >= _LEAST_FIRST and span >= _FIRST_M:
            break
        before = (start - lo + 1) <= share * (count + 1)
        if before and lo > 0 and _near(away[lo - 1], away[lo]):
            lo -= 1
        elif not before and hi + 1 < len(away) and _near(away[hi + 1], away[hi]):
            hi += 1
        else:
            break
    return np.arange(lo, hi + 1)


def _near(value: float, neighbor: float) -> bool:
    return bool(value - neighbor < 0.3)


def _within(beams: Beams, start: int, reach_m: float) -> slice:
    """Return the beams that may meet something this long through a return."""
    half = np.arcsin(min(reach_m / max(beams.range_m[start], 1e-3), 1.0))
    half = max(half, 2.0 * beams.step_rad) if reach_m < beams.range_m[start] else np.pi
    lo = int(np.searchsorted(beams.angle, beams.angle[start] - half))
    hi = int(np.searchsorted(beams.angle, beams.angle[start] + half, side="right"))
    return slice(lo, hi)


def _walked(off: np.ndarray, start: int, tolerance_m: float) -> np.ndarray:
    """Return the positions on the line that are reached from a start without a step behind it.

    What is nearer hides the line and is passed, if the line then goes on for some returns. Two
    returns in a row behind it end the walk.
    """
    side = np.where(off > tolerance_m, BEHIND, np.where(off < -tolerance_m, BEFORE, ON))
    found = [start] if side[start] == ON else []
    for step in (-1, 1):
        part = slice(start + 1, None) if step > 0 else slice(start - 1, None, -1)
        if start == 0 and step < 0:
            continue
        found += [
            start + step * (1 + n) for n in _reached(side[part].tolist(), off[part], tolerance_m)
        ]
    return np.array(sorted(found), dtype=int)


def _reached(kinds: List[int], off: np.ndarray, tolerance_m: float) -> List[int]:
    """Return which beams of one direction, in its order, are on the line (see ``_walked``)."""
    found: List[int] = []
    passed = False
    for at, kind in enumerate(kinds):
        if kind == BEHIND:
            if kinds[at + 1 : at + 4] != [ON] * 3:
                break
        elif kind == BEFORE:  # one alone is an error of the range
            passed = passed or kinds[at + 1 : at + 2] != [ON]
        elif passed:
            ahead = off[at : at + _RESUMED]  # a surface that crosses the line moves through it
            if len(ahead) < _RESUMED or kinds[at : at + _RESUMED] != [ON] * _RESUMED:
                continue
            if abs(ahead[-1] - ahead[0]) > tolerance_m:
                continue
            passed = False
            found.append(at)
        else:
            found.append(at)
    return found


def _end(cut: Cut, step: int) -> End:
    """Tell what is beyond the last (step 1) or the first (step -1) return of a cut."""
    beams, members, sigma_m = cut.beams, cut.members, cut.sigma_m
    last = cut.outer[1 if step > 0 else 0]
    is_held = last != (members[-1] if step > 0 else members[0])
    beyond = last + step * np.arange(1, _LOOK_BEYOND + 1)
    beyond = beyond[(beyond >= 0) & (beyond < len(beams.angle))]
    if len(beyond) == 0:
        return End(UNCLEAR if beams.closed else OUT_OF_VIEW, 0.0, False)
    nothing = np.isinf(beams.range_m[beyond])  # and so hides nothing, whether it meets the line
    off = np.where(nothing, np.inf, behind_line(beams, cut.line, beyond))
    jump = max(_JUMP_M, _JUMP_SIGMAS * sigma_m)
    nearer = np.flatnonzero(off < -_SIGMAS * sigma_m)
    farther = np.flatnonzero(off > jump)
    behind = float(off.max())
    attached = _is_attached(beams, np.concatenate([[last], beyond]))
    if is_held:
        return End(HIDDEN, 0.0, attached)
    if len(farther) and (len(nearer) == 0 or farther[0] < nearer[0]):
        lost = int(beams.lost[last if step < 0 else last + 1])
        wide = bool(nothing[0])
        inside = beams.lost[members[0] + 1 : members[-1] + 1]
        exact = lost <= _MOST_LOST or (wide and not np.any(inside > _MOST_LOST))
        return End(EDGE if exact else SWALLOWED, behind, attached)
    if len(nearer):
        return End(HIDDEN, 0.0, attached)
    return End(UNCLEAR, behind, attached)


def _is_attached(beams: Beams, chain: np.ndarray) -> bool:
    """Tell whether beams follow each other without a gap, as on the next face of a box."""
    if len(chain) <= _LOOK_BEYOND:
        return False
    if np.any(np.isinf(beams.range_m[chain])):
        return False
    points = beams.points(chain)
    gaps = points[1:] - points[:-1]
    return bool(np.all(gaps[:, 0] ** 2 + gaps[:, 1] ** 2 < _CHAIN_M**2))
