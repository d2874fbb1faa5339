"""2D LiDARs: a scan, a point near the board and the pattern in, the returns on the board out.

A scan cuts a board in a straight segment. A line is grown about the seed; it is the board's if it
is no longer than the diagonal and ends where something farther, or nothing, is beyond. One scan
tells no more. Without a seed, a segment is labeled only where both ends stand free, where nothing
is attached to them, and where no other segment could be the board as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Dict, List, Optional, Sequence

import numpy as np

from atom_core.errors import LabelingError
from atom_core.geometry.rectangle import Rectangle
from atom_core.labeling.base import Labeled, nothing
from atom_core.labeling.scan_beams import Beams, beams_of
from atom_core.labeling.scan_line import (
    EDGE,
    Cut,
    Line,
    along_line,
    behind_line,
    cut_along,
    fit_line,
    grown_cut,
)
from atom_core.labeling.scan_search import Sought, doubled, free_pieces
from atom_core.model.config import PatternConfig
from atom_core.model.labels import RangeLabel
from atom_core.model.laser_scan import LaserScan
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import LIDAR2D, Sensor

_SIGMAS = 3.5
_TRIES = 6  # returns about a seed from which a line is grown
_MOST_CANDIDATES = 12
_MOST_TAKEN = 0.3  # of a piece's returns that may belong to something known already
_RUN, _RUN_M = 4, 0.2  # returns, and their length, that make a wall go on beyond a gap
_GOES_ON_M, _LARGEST_OFF_M = 2.0, 0.15


@dataclass(frozen=True)
class Lidar2dOptions:
    """What a board looks like in a scan.

    Attributes:
        least_length_m: shorter cuts are no board; at most half of the board's shorter side.
        least_points: fewer returns are no board.
        least_points_searched: likewise without a seed; fewer do not tell a post from a board.
        sigma_m: noise of a range that is expected; up to twice as much is told from the scan.
        most_rms_m: of the returns about the line, at right angles.
        most_bend_m: bulge of the middle out of the chord, beyond what noise explains.
        largest_angle_deg: between the beam and the cut's normal.
        seed_reach_m: how far from the seed the cut may be, in the scan's plane; half the height of
            a seed above or below that plane is added, since boards lean.
        least_behind_m: how far behind both ends things must be without a seed.
        box_depth_m: a box is at least so deep; its next face would be seen beside a cut.
        least_nearer_m: how far before the background a segment must be.
        boxes: boxes as long as the board may stand in the room. Without seed and background, what
            may be the face of one is then not labeled, nor what is shorter than the board's sides.
    """

    least_length_m: float = 0.25
    least_points: int = 5
    least_points_searched: int = 8
    sigma_m: float = 0.010
    most_rms_m: float = 0.03
    most_bend_m: float = 0.012
    largest_angle_deg: float = 80.0
    seed_reach_m: float = 0.25
    least_behind_m: float = 0.25
    box_depth_m: float = 0.2
    least_nearer_m: float = 0.1
    boxes: bool = True


class Lidar2dLabeler:
    """Finds one pattern in the scans of one 2D LiDAR."""

    def __init__(
        self,
        sensor: Sensor,
        pattern: Pattern,
        config: Optional[PatternConfig] = None,
        options: Lidar2dOptions = Lidar2dOptions(),  # noqa: B008 (frozen)
    ):
        """Take what is known of sensor and pattern; the configuration is not used."""
        self._place = f"sensor '{sensor.name}', pattern '{pattern.name}'"
        self._border, self._options = pattern.border, options

    def label(
        self,
        data: Any,
        seed: Optional[np.ndarray] = None,
        background: Optional[np.ndarray] = None,
        reach_m: Optional[float] = None,
    ) -> Labeled:
        """Label one scan.

        Args:
            data: ``LaserScan``.
            seed: (3,) [m] near the board in the sensor's frame; None: search the scan for it.
            background: (n,) ranges [m] of what stands there at other times, from a sensor that has
                not moved (`background_of`); a search then passes over what belongs to it.
            reach_m: how far from a seed that was predicted the cut may be; None: it was pointed at.

        Returns:
            Indices are into the scan's ranges; ``limit_indices`` holds the ends that are the
            board's edge. ``quality``: ``points``, ``line_rms_m``, ``length_m``, ``step_m``,
            ``bend_m``, ``distance_m``, ``incidence_deg``, ``free_ends``. ``next_seed`` is the
            middle of the cut.

        Raises:
            LabelingError: the data are no scan, or the seed is no point.
        """
        if not isinstance(data, LaserScan):
            raise LabelingError(
                f"{self._place}: a 2D LiDAR's data are a LaserScan, not {type(data).__name__}"
            )
        if seed is None:
            return find_cut(data, self._border, self._options, background)
        point = np.asarray(seed, dtype=float)
        if point.shape != (3,) or not np.all(np.isfinite(point)):
            raise LabelingError(
                f"{self._place}: a seed is a point (3,) in metres, not {point.tolist()}"
            )
        if reach_m is not None:
            return cut_near(data, self._border, point, reach_m, self._options, background)
        return cut_at(data, self._border, point, self._options)


def cut_at(
    scan: LaserScan,
    border: Rectangle,
    seed: np.ndarray,
    options: Lidar2dOptions = Lidar2dOptions(),  # noqa: B008 (frozen)
) -> Labeled:
    """Label the board's cut nearest to a seed (3,) [m]; empty, with a reason, if there is none."""
    points = scan.points[:, :2]
    with np.errstate(invalid="ignore"):
        away = np.linalg.norm(points - seed[:2], axis=1)
    reach = options.seed_reach_m + 0.5 * abs(float(seed[2]))
    near = np.flatnonzero(away <= reach)
    if len(near) == 0:
        nearest = np.nanmin(away)
        return _nothing(
            f"no return lies within {reach:.2f} m of the seed; the nearest is {nearest:.2f} m away"
        )
    beams = beams_of(scan, int(near[np.argmin(away[near])]))
    position = np.full(len(away), -1)
    position[beams.index] = np.arange(len(beams.index))
    refused: Optional[Labeled] = None
    seen = np.zeros(len(away), dtype=bool)
    tries = 0
    for index in near[np.argsort(away[near])]:
        if seen[index] or tries == _TRIES:
            continue
        tries += 1
        cut = grown_cut(beams, int(position[index]), 1.5 * _diagonal(border), options.sigma_m)
        seen[max(index - 1, 0) : index + 2] = True
        if cut is None:
            continue
        seen[cut.indices] = True
        reason = _why_not(cut, border, options)
        if not reason:
            return _labeled(cut)
        if refused is None:
            refused = _nothing(reason, _quality(cut))
    return refused or _nothing("the returns at the seed lie on no line")


def cut_near(
    scan: LaserScan,
    border: Rectangle,
    seed: np.ndarray,
    reach_m: float,
    options: Lidar2dOptions = Lidar2dOptions(),  # noqa: B008 (frozen)
    background: Optional[np.ndarray] = None,
) -> Labeled:
    """Label the only cut about a predicted place (3,) [m]; nothing where there are several.

    The cut is at the seed, as in `cut_at`, or stands free and comes nearer to it than ``reach_m``.
    """
    at_seed = cut_at(scan, border, seed, options)
    assert isinstance(at_seed.label, RangeLabel)
    known = at_seed.label.indices
    others = [
        cut
        for cut in find_cuts(scan, border, options, background)
        if _away(cut, seed) <= reach_m and not np.intersect1d(cut.indices, known).size
    ]
    count = len(others) + at_seed.detected
    if count > 1:
        return _nothing(f"{count} segments within {reach_m:.2f} m of the predicted place may be it")
    return _labeled(others[0]) if others else at_seed


def background_of(scans: Sequence[LaserScan]) -> np.ndarray:
    """Return ranges (n,) [m] of what does not move: what each beam meets in most of the scans.

    Infinite where that is nothing. The sensor stands still; the board must not stay at one place in
    half of the scans.

    Raises:
        LabelingError: there is no scan, or their beams differ.
    """
    if len({(len(s.ranges), s.angle_min, s.angle_increment) for s in scans}) != 1:
        raise LabelingError(
            "a background needs scans with the same beams; use scans of one sensor, recorded with "
            "one setting"
        )
    ranges = np.stack([np.where(scan.valid, scan.ranges, np.inf) for scan in scans])
    middle = len(ranges) // 2
    return np.partition(ranges, middle, axis=0)[middle]


def find_cut(
    scan: LaserScan,
    border: Rectangle,
    options: Lidar2dOptions = Lidar2dOptions(),  # noqa: B008 (frozen)
    background: Optional[np.ndarray] = None,
) -> Labeled:
    """Search a scan for the one segment that can be the board's cut."""
    cuts = find_cuts(scan, border, options, background)
    if not cuts:
        return _nothing("no free-standing straight segment of the board's size is in the scan")
    if len(cuts) > 1:
        lengths = " and ".join(f"{cut.length_m:.2f} m" for cut in cuts[:2])
        return _nothing(
            f"{len(cuts)} segments may be the board's cut ({lengths} long); give a seed",
            _quality(cuts[0]),
        )
    cut = cuts[0]
    if background is not None or not options.boxes:
        return _labeled(cut)
    if not _is_full(cut, border):
        return _nothing(
            f"a free-standing segment is only {cut.length_m:.2f} m long; without a seed it must be "
            f"as long as the board's shorter side",
            _quality(cut),
        )
    if _may_be_box(cut, options):
        return _nothing(
            f"a free-standing segment of {cut.length_m:.2f} m may be a box seen from the front; "
            f"give a seed, or turn the board",
            _quality(cut),
        )
    return _labeled(cut)


def find_cuts(
    scan: LaserScan,
    border: Rectangle,
    options: Lidar2dOptions = Lidar2dOptions(),  # noqa: B008 (frozen)
    background: Optional[np.ndarray] = None,
) -> List[Cut]:
    """Return all free-standing segments that may be the board's cut, the longest first.

    Args:
        scan: what was measured.
        border: the board's edges [m].
        options: what counts as a board.
        background: (n,) ranges [m] of what does not move, or None.
    """
    beams = doubled(beams_of(scan))
    taken = np.zeros(len(scan.ranges), dtype=bool)
    if background is not None:
        with np.errstate(invalid="ignore"):
            taken = ~(scan.ranges < background - options.least_nearer_m)
    found: List[Cut] = []
    tries = 0
    sought = Sought(
        shortest_m=0.5 * _least(border, options),
        longest_m=_diagonal(border) + 0.2,
        least_points=options.least_points_searched,
        most_rms_m=1.5 * options.most_rms_m,
        least_step_m=0.6 * options.least_behind_m,
    )
    for first, last in free_pieces(beams, sought):
        middle = (first + last) // 2
        piece = np.arange(first, last + 1)
        if np.mean(taken[beams.index[piece]]) > _MOST_TAKEN:
            continue
        tries += 1
        if tries > _MOST_CANDIDATES:
            break
        cut = cut_along(beams, piece, middle, 1.5 * _diagonal(border), options.sigma_m)
        taken[beams.index[piece]] = True
        if cut is None:
            continue
        taken[cut.indices] = True
        if len(cut.members) < options.least_points_searched or not _stands_free(cut, options):
            continue
        if not _why_not(cut, border, options) and not _is_bent(cut, options, 1.0):
            found.append(cut)
    return sorted(found, key=lambda cut: -cut.length_m)


def _diagonal(border: Rectangle) -> float:
    return 2.0 * float(np.hypot(*border.half_size))


def _least(border: Rectangle, options: Lidar2dOptions) -> float:
    return min(options.least_length_m, float(border.half_size.min()))


def _why_not(cut: Cut, border: Rectangle, options: Lidar2dOptions) -> str:
    """Return why a piece is not the board's cut, for the user; empty if it may be."""
    length, step, points = cut.length_m, cut.step_m, len(cut.members)
    most, least = _diagonal(border), _least(border, options)
    if length > most + 0.02 + _SIGMAS * cut.sigma_m:
        return (
            f"the line there is {length:.2f} m long or longer, the board's diagonal only "
            f"{most:.2f} m; a board less than 0.1 m before a wall is not told from it"
        )
    if points < options.least_points:
        return f"only {points} returns lie on the line there; {options.least_points} are needed"
    if length + step < least:
        return f"the line there is only {length:.2f} m long; {least:.2f} m are needed"
    rms = cut.rms_m
    if rms > options.most_rms_m:
        return f"the returns there lie on no line (deviation {1000.0 * rms:.0f} mm)"
    if _is_bent(cut, options, 3.0):
        return (
            f"the returns there are bent by {1000.0 * abs(cut.bend_m[0]):.0f} mm; a board is flat"
        )
    incidence = float(np.degrees(np.arccos(min(cut.cosine, 1.0))))
    if incidence > options.largest_angle_deg:
        return f"the line there is seen at {incidence:.0f} deg from its normal, too slanted"
    if not any(end.is_free for end in cut.ends):
        return "neither end of the line there is an edge with something farther beyond it"
    if any(end.attached for end in cut.ends):
        return (
            "another surface begins where the line there ends, as on a box, at a hand that holds a "
            "board, or at a wall right behind it: keep hands out of the scan, and the board 0.2 m "
            "before what is behind it"
        )
    if _goes_on(cut):
        return "the line there goes on beyond its ends, as a wall does"
    return ""


def _goes_on(cut: Cut) -> bool:
    """Tell whether returns beyond the ends lie on the same line, as those of a wall with a gap."""
    beams, line = cut.beams, cut.line
    along, off = along_line(beams, line), behind_line(beams, line)
    away = np.maximum(along - cut.along_m[-1], cut.along_m[0] - along)
    turned = cut.sigma_m * np.sqrt(12.0 / len(cut.members)) / max(cut.length_m, 0.05)
    tolerance = _SIGMAS * cut.sigma_m + np.minimum(3.0 * turned * np.abs(away), _LARGEST_OFF_M)
    on = (away > 0.0) & (away < _GOES_ON_M) & (np.abs(off) < tolerance)
    on[cut.members] = False
    borders = np.flatnonzero(np.diff(on.astype(int), prepend=0, append=0))
    for first, beyond in zip(borders[::2].tolist(), borders[1::2].tolist()):
        if beyond - first < _RUN or abs(along[beyond - 1] - along[first]) < _RUN_M:
            continue
        run = np.arange(first, beyond)
        joint = fit_line(beams, np.concatenate([cut.members, run]))
        if all(_rms_of(beams, joint, part) < 1.5 * cut.sigma_m for part in (cut.members, run)):
            return True
    return False


def _rms_of(beams: Beams, line: Line, members: np.ndarray) -> float:
    return float(np.sqrt(np.mean(behind_line(beams, line, members) ** 2)))


def _is_bent(cut: Cut, options: Lidar2dOptions, sigmas: float) -> bool:
    """Tell whether a piece is bent more than the board may be and noise explains."""
    bend, deviation = cut.bend_m
    return abs(bend) > options.most_bend_m + sigmas * deviation


def _stands_free(cut: Cut, options: Lidar2dOptions) -> bool:
    """Tell whether there is nothing near behind either end."""
    return all(end.is_free and end.behind_m >= options.least_behind_m for end in cut.ends)


def _is_full(cut: Cut, border: Rectangle) -> bool:
    """Tell whether a cut is as long as those through the board's middle."""
    return cut.length_m + cut.step_m > 0.95 * 2.0 * float(border.half_size.min())


def _may_be_box(cut: Cut, options: Lidar2dOptions) -> bool:
    """Tell whether a box with this face would hide its other faces behind it."""
    foot = cut.line.normal * cut.line.distance_m
    for along, sign in zip(cut.along_m[[0, -1]], (-1.0, 1.0)):
        corner = foot + cut.line.direction * along
        rear = corner + options.box_depth_m * cut.line.normal
        turn = sign * (corner[0] * rear[1] - corner[1] * rear[0])
        angle = np.arcsin(turn / (np.linalg.norm(corner) * np.linalg.norm(rear)))
        if angle > 3.0 * cut.beams.step_rad:
            return False
    return True


def _away(cut: Cut, point: np.ndarray) -> float:
    """Return how far a cut is from a point (3,), in the scan's plane [m]."""
    offset = point[:2] - cut.middle
    along = abs(float(offset @ cut.line.direction))
    beyond = max(along - 0.5 * cut.length_m, 0.0)
    return float(np.hypot(beyond, offset @ cut.line.normal))


def _labeled(cut: Cut) -> Labeled:
    indices = cut.indices
    limit = [index for index, end in zip(indices[[0, -1]], cut.ends) if end.kind == EDGE]
    return Labeled(
        RangeLabel(np.sort(indices), np.unique(np.array(limit, dtype=int))),
        quality=_quality(cut),
        next_seed=np.append(cut.middle, 0.0),
    )


def _quality(cut: Cut) -> Dict[str, float]:
    return {
        "points": float(len(cut.members)),
        "line_rms_m": cut.rms_m,
        "length_m": cut.length_m,
        "step_m": cut.step_m,
        "bend_m": cut.bend_m[0],
        "distance_m": float(np.linalg.norm(cut.middle)),
        "incidence_deg": float(np.degrees(np.arccos(min(cut.cosine, 1.0)))),
        "free_ends": float(sum(end.is_free for end in cut.ends)),
    }


def _nothing(reason: str, quality: Optional[Dict[str, float]] = None) -> Labeled:
    return nothing(LIDAR2D, reason, quality)
