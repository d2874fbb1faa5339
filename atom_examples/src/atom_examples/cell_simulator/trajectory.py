"""How the board gets from stop to stop: straight and smooth, no point of it faster than 0.5 m/s."""

from __future__ import annotations

from typing import Callable, List, NamedTuple, Optional, Sequence, TypeVar

import numpy as np

from atom_core.geometry import se3
from atom_core.model.pattern import Pattern
from atom_examples.cell_simulator.scene import Person

TICK_S = 0.1
SPEED_M_S, ACCELERATION_M_S2 = 0.5, 1.0
T = TypeVar("T")


class State(NamedTuple):
    """The moving part of the world at one instant.

    Attributes:
        world_T_pattern: (4, 4) the board.
        person: where the person stands.
        stop: number of the stop where the board stands still, None while it moves.
        tick_of_stop: ticks since the board came to the stop.
    """

    world_T_pattern: np.ndarray
    person: Person
    stop: Optional[int] = None
    tick_of_stop: int = 0


class Trajectory:
    """Board and person at each tick.

    Attributes:
        starts: tick at which each stop begins.
        ticks: number of ticks.
    """

    def __init__(self, stops: Sequence, stop_s: float, pattern: Pattern):
        """Plan the motion.

        Args:
            stops: each with ``world_T_pattern`` and ``person``.
            stop_s: how long the board stands still at each.
            pattern: the board.
        """
        self._stops = stops
        self._middle = pattern.border.centre_in_pattern
        self._stop_ticks = max(int(round(stop_s / TICK_S)), 1)
        poses = [stop.world_T_pattern for stop in stops]
        self._ways = [pattern.border.way_m(a, b) for a, b in zip(poses, poses[1:])]
        moves = [_ticks(way) for way in self._ways]
        self.starts = [0, *np.cumsum([self._stop_ticks + n for n in moves]).tolist()]
        self.ticks = self.starts[-1] + self._stop_ticks

    def interval(self, stop: int) -> tuple:
        """Return the first tick of a stop and the first one after it."""
        return self.starts[stop], self.starts[stop] + self._stop_ticks

    def state(self, tick: float) -> State:
        """Return where board and person are at a tick, or between two."""
        stop = int(np.searchsorted(self.starts, tick, side="right")) - 1
        since, here = tick - self.starts[stop], self._stops[stop]
        if since <= self._stop_ticks - 1:
            return State(here.world_T_pattern, here.person, stop, int(since))
        there = self._stops[stop + 1]
        moving = self.starts[stop + 1] - self.starts[stop] - self._stop_ticks + 1
        share = _share((since - self._stop_ticks + 1) / moving, self._ways[stop])
        pose = between(here.world_T_pattern, there.world_T_pattern, self._middle, share)
        centres = [
            se3.apply(p, self._middle[None])[0]
            for p in (here.world_T_pattern, there.world_T_pattern, pose)
        ]
        return State(pose, _person_between(here.person, there.person, centres, share))


def between(a: np.ndarray, b: np.ndarray, middle: np.ndarray, share: float) -> np.ndarray:
    """Return the pose between two: the middle (3,) on a line, turned about one axis."""
    turn = se3.rotation_vector_from_rotation(a[:3, :3].T @ b[:3, :3])
    rotation = a[:3, :3] @ se3.rotation_from_rotation_vector(share * turn)
    start, end = se3.apply(a, middle[None])[0], se3.apply(b, middle[None])[0]
    return se3.transform(rotation, start + share * (end - start) - rotation @ middle)


def ordered(items: Sequence[T], pose: Callable[[T], np.ndarray], pattern: Pattern) -> List[T]:
    """Return items in an order with short ways between their poses: nearest next, then 2-opt."""
    count = len(items)
    way_m = pattern.border.way_m
    ways = np.array([[way_m(pose(a), pose(b)) for b in items] for a in items])
    order, left = [0], set(range(1, count))
    while left:
        order.append(min(left, key=lambda other: ways[order[-1], other]))
        left.remove(order[-1])
    improved = True
    while improved:
        improved = False
        for first in range(1, count - 1):
            for last in range(first + 1, count):
                turned = order[:first] + order[first : last + 1][::-1] + order[last + 1 :]
                if _length(turned, ways) < _length(order, ways) - 1e-9:
                    order, improved = turned, True
    return [items[i] for i in order]


def _length(order: Sequence[int], ways: np.ndarray) -> float:
    return float(ways[order[:-1], order[1:]].sum())


def _seconds(metres: float) -> float:
    """Return how long a way takes that starts and ends at rest."""
    ramp = SPEED_M_S**2 / ACCELERATION_M_S2  # speeding up and braking together
    if metres < ramp:
        return 2.0 * float(np.sqrt(metres / ACCELERATION_M_S2))
    return metres / SPEED_M_S + SPEED_M_S / ACCELERATION_M_S2


def _ticks(metres: float) -> int:
    """Return the ticks strictly between two stops."""
    return max(int(np.ceil(_seconds(metres) / TICK_S - 1e-9)) - 1, 0)


def _share(time_share: float, metres: float) -> float:
    """Return the share of the way that is done after a share of its time."""
    total = _seconds(metres)
    if total == 0.0:
        return time_share
    time = min(time_share, 1.0 - time_share) * total
    top = min(SPEED_M_S, 0.5 * ACCELERATION_M_S2 * total)
    ramp = top / ACCELERATION_M_S2
    if time < ramp:
        done = 0.5 * ACCELERATION_M_S2 * time**2
    else:
        done = 0.5 * top * ramp + top * (time - ramp)
    share = done / metres
    return share if time_share <= 0.5 else 1.0 - share


def _person_between(a: Person, b: Person, centres: List[np.ndarray], share: float) -> Person:
    """Return the person who walks around the board, never through it."""
    from_a, from_b = (
        np.array([p.x, p.y]) - centre[:2] for p, centre in zip((a, b), (centres[0], centres[1]))
    )
    angle_a, angle_b = np.arctan2(from_a[1], from_a[0]), np.arctan2(from_b[1], from_b[0])
    turn = (angle_b - angle_a + np.pi) % (2 * np.pi) - np.pi
    radius = (1 - share) * np.linalg.norm(from_a) + share * np.linalg.norm(from_b)
    angle = angle_a + share * turn
    x, y = centres[2][:2] + radius * np.array([np.cos(angle), np.sin(angle)])
    return Person(float(x), float(y), float(angle + np.pi / 2))
