"""What a 2D LiDAR sees and labels: a fan of beams across the boards, and the room behind them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, List, Mapping, NamedTuple, Optional, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.labels import RangeLabel
from atom_core.model.laser_scan import LaserScan
from atom_core.model.pattern import Pattern
from atom_core.synthetic.board import board_hits, is_dark
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.planted import RangeErrors
from atom_core.synthetic.rig import Room

LARGEST_ANGLE_DEG = 80.0  # between the beams and the cut's normal, in the scan's plane
LEAST_POINTS = 5
LEAST_LENGTH_M = 0.25  # of the cut, or half of the board's shorter side

Board = Tuple[np.ndarray, Pattern]  # pose lidar_T_pattern (4, 4), and what it is


@dataclass(frozen=True)
class Lidar2dModel:
    """Beams of a 2D LiDAR, in the plane z = 0 of its frame.

    Attributes:
        angle_min: azimuth of the first beam [rad].
        angle_increment: from one beam to the next [rad]; negative: clockwise.
        beams: how many; 1440 of the default make one turn.
        range_m: nearest and farthest return.
        beam_width_rad: a beam meets what lies within this full angle; where it meets two things,
            its range is somewhere between. 0: it meets a point.
    """

    angle_min: float = -np.pi
    angle_increment: float = 2.0 * np.pi / 1440
    beams: int = 1440
    range_m: Tuple[float, float] = (0.1, 30.0)
    beam_width_rad: float = 0.0

    @property
    def angles(self) -> np.ndarray:
        """(beams,) azimuth of each beam [rad]."""
        return self.angle_min + self.angle_increment * np.arange(self.beams)

    @property
    def directions(self) -> np.ndarray:
        """(beams, 3) unit vectors in the LiDAR's frame."""
        return directions(self.angles)

    @property
    def is_closed(self) -> bool:
        """Tell whether the beams go all the way round."""
        return self.beams * abs(self.angle_increment) > 2.0 * np.pi - 0.5 * abs(
            self.angle_increment
        )


def directions(angles: np.ndarray) -> np.ndarray:
    """Return unit vectors (n, 3) of azimuths (n,) [rad] in the plane z = 0."""
    return np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])


class Around(NamedTuple):
    """What is around the boards.

    Attributes:
        world_T_lidar: (4, 4) pose of the LiDAR's data frame.
        room: behind the boards.
        others: (beams,) distances [m] of what hides things behind it; infinite: nothing does.
    """

    world_T_lidar: np.ndarray
    room: Room
    others: Optional[np.ndarray] = None

    def ranges(self, model: Lidar2dModel) -> np.ndarray:
        """Return the distance (beams,) [m] along each beam."""
        pose = self.world_T_lidar
        walls = self.room.distance(pose[:3, 3], model.directions @ pose[:3, :3].T)
        return walls if self.others is None else np.minimum(walls, self.others)


def scan(
    model: Lidar2dModel,
    boards: Mapping[str, Board],
    around: Around,
    noise: Noise,
    rng: np.random.Generator,
    errors: RangeErrors = RangeErrors(),  # noqa: B008 (frozen)
    errors_rng: Optional[np.random.Generator] = None,
) -> Tuple[LaserScan, Dict[str, RangeLabel]]:
    """Return the scan and the labels of the boards in it.

    Beams with nothing within reach are infinite, lost ones NaN. An end of a cut is a limit point
    where the board ends, not where something hides it or the field of view ends.

    Args:
        model: the LiDAR.
        boards: pose ``lidar_T_pattern`` (4, 4) and pattern, by name.
        around: what is behind them.
        noise: of ranges (``lidar_m``), with gross errors on labeled ones, and dropouts on boards.
        rng: draws it.
        errors: the systematic ones; layers and divergence are those of 3D LiDARs.
        errors_rng: draws which returns from dark squares are lost.
    """
    poses = list(boards.values())
    on_board, owner, nearest = _met(model, poses, around)
    mixed = _mixed(model, poses, owner, nearest, rng)
    ranges = np.where(np.isnan(mixed), nearest, mixed)
    error_m, lost = _spoiled(model, poses, owner, nearest, errors, errors_rng or rng)
    lost |= (owner < len(poses)) & (rng.random(model.beams) < noise.dropout)
    in_reach = (ranges >= model.range_m[0]) & (ranges <= model.range_m[1])
    usable = in_reach & ~lost & np.isnan(mixed)
    labels: Dict[str, RangeLabel] = {}
    for number, (name, (_, pattern)) in enumerate(boards.items()):
        label = _label(model, usable & (owner == number), on_board[number], nearest)
        if is_detected(model, label, ranges, pattern):
            labels[name] = label
    ranges = ranges + (error_m + noise.lidar_m * rng.standard_normal(model.beams))
    for label in labels.values():
        ranges[label.indices] += noise.gross_range_errors(len(label.indices), rng)
    ranges = np.clip(ranges, model.range_m[0], model.range_m[1] * (1.0 - 1e-6))
    ranges[nearest > model.range_m[1]] = np.inf
    ranges[(nearest < model.range_m[0]) | lost] = np.nan
    made = LaserScan(noise.round(ranges), model.angle_min, model.angle_increment, *model.range_m)
    return made, labels


def is_detected(
    model: Lidar2dModel, label: RangeLabel, ranges: np.ndarray, pattern: Pattern
) -> bool:
    """Tell whether a cut is long enough, and not too slanted, for a label.

    Args:
        model: the LiDAR.
        label: all beams on the board.
        ranges: (beams,) without noise [m].
        pattern: the board.
    """
    if len(label.indices) < LEAST_POINTS:
        return False
    in_order = _in_order(model, label.indices)
    points = directions(model.angles[in_order]) * ranges[in_order, None]
    chord, middle = points[-1] - points[0], 0.5 * (points[0] + points[-1])
    length = float(np.linalg.norm(chord))
    if length < min(LEAST_LENGTH_M, float(pattern.border.half_size.min())):
        return False
    sine = abs(float(np.dot(chord, middle))) / (length * float(np.linalg.norm(middle)))
    return sine < np.sin(np.radians(LARGEST_ANGLE_DEG))


def _in_order(model: Lidar2dModel, indices: np.ndarray) -> np.ndarray:
    """Return the beams on a board (n,) in the order of the cut, also across the scan's seam."""
    gaps = np.diff(indices, append=indices[0] + model.beams)
    last = int(np.argmax(gaps))  # no board reaches half around the sensor
    return np.roll(indices, -(last + 1)) if model.is_closed else indices


def _label(
    model: Lidar2dModel, seen: np.ndarray, on_board: np.ndarray, nearest: np.ndarray
) -> RangeLabel:
    """Return the beams on a board, and those ends that are the board's.

    Args:
        model: the LiDAR.
        seen: (beams,) bool, the returns on the board.
        on_board: (beams,) distance of the board, infinite where a beam misses it.
        nearest: (beams,) distance of what a beam meets.
    """
    indices = np.flatnonzero(seen)
    if len(indices) == 0:
        return RangeLabel(indices, indices)
    in_order = _in_order(model, indices)
    limit: List[int] = []
    for end, step in ((in_order[0], -1), (in_order[-1], 1)):
        beam = int(end) + step
        while True:
            if model.is_closed:
                beam %= model.beams
            elif not 0 <= beam < model.beams:
                break  # the end of the field of view
            if np.isinf(on_board[beam]):
                if nearest[beam] > nearest[end]:
                    limit.append(int(end))
                break
            if nearest[beam] < on_board[beam]:
                break  # hidden
            beam += step
    return RangeLabel(indices, np.unique(np.array(limit, dtype=int)))


def _met(
    model: Lidar2dModel, poses: List[Board], around: Around
) -> Tuple[List[np.ndarray], np.ndarray, np.ndarray]:
    """Return distances of each board, which thing beams (beams,) meet, and its distance [m]."""
    on_board = [board_hits(pose, p, model.directions)[0] for pose, p in poses]
    surfaces = np.vstack([*on_board, around.ranges(model)])
    return on_board, np.argmin(surfaces, axis=0), np.min(surfaces, axis=0)


def _spoiled(
    model: Lidar2dModel,
    poses: List[Board],
    owner: np.ndarray,
    nearest: np.ndarray,
    errors: RangeErrors,
    rng: np.random.Generator,
) -> Tuple[np.ndarray, np.ndarray]:
    """Return by how much beams (beams,) read long [m], and which are lost on dark squares."""
    dark = np.zeros(model.beams, dtype=bool)
    if errors == RangeErrors():
        return np.zeros(model.beams), dark
    for number, (lidar_T_pattern, pattern) in enumerate(poses):
        mine = (owner == number) & np.isfinite(nearest)
        points = model.directions[mine] * nearest[mine, None]
        in_plane = se3.apply(se3.inverse(lidar_T_pattern), points)[:, :2]
        dark[mine] = is_dark(lidar_T_pattern, pattern, in_plane)
    error_m = errors.error_m(nearest, np.zeros(model.beams, dtype=int))
    return error_m + errors.dark_offset_m * dark, dark & (rng.random(len(dark)) < errors.dark_lost)


def _mixed(
    model: Lidar2dModel,
    poses: List[Board],
    owner: np.ndarray,
    nearest: np.ndarray,
    rng: np.random.Generator,
) -> np.ndarray:
    """Return (beams,) ranges of those beams that meet a board's edge [m], NaN for all others."""
    mixed = np.full(model.beams, np.nan)
    if model.beam_width_rad == 0.0:
        return mixed
    for number, (lidar_T_pattern, pattern) in enumerate(poses):
        sides = [
            board_hits(lidar_T_pattern, pattern, directions(model.angles + half))[0]
            for half in (-0.5 * model.beam_width_rad, 0.5 * model.beam_width_rad)
        ]
        cut = np.flatnonzero(np.isfinite(sides[0]) != np.isfinite(sides[1]))
        board = np.where(np.isfinite(sides[0]), sides[0], sides[1])
        for beam in cut:
            other = nearest[beam]
            if owner[beam] == number:  # what is beside it lies behind the board's edge
                beside = [(beam + side) % model.beams for side in (-1, 1)]
                other = max(nearest[b] for b in beside)
            if board[beam] < other < np.inf:
                mixed[beam] = board[beam] + rng.random() * (other - board[beam])
    return mixed
