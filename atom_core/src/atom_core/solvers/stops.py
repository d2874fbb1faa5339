"""Collections in which every sensor sees the boards where it saw them in another one: one stop.

What goes wrong where a board stands in one place (a lens that bends there, an arm that is a little
off there) goes wrong in each of its collections alike. They average noise, and no more: how much
the answer hangs on chance is seen from stop to stop.
"""

from __future__ import annotations

from collections import Counter
from typing import Dict, List, Mapping, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.problem.problem import Problem
from atom_core.solvers.collection_part import CollectionPart
from atom_core.solvers.shared_equations import SharedEquations

_NEAR, _TURNED_RAD = 0.01, float(np.radians(1.0))  # part of the distance; what is less is the same
_AT_A_TIME = 64  # collections beside all


class _Seen(NamedTuple):
    """Where collections saw one pattern by one sensor, and what carries both.

    Attributes:
        is_seen: (g,).
        places: (g, n, 3) of the board in the sensor, and of what moves between them.
        turns: (g, n, 9) likewise.
        near_m: (g,) what counts as the same place.
    """

    is_seen: np.ndarray
    places: np.ndarray
    turns: np.ndarray
    near_m: np.ndarray

    def same(self, some: slice) -> Tuple[np.ndarray, np.ndarray]:
        """Return (c, g) which of some collections and of all saw it, and where that is the same."""
        both = self.is_seen[some, None] & self.is_seen
        alike = both.copy()
        for i in range(self.places.shape[1]):
            shift = self.places[some, i, None] - self.places[:, i]
            square = np.einsum("cgi,cgi->cg", shift, shift)
            cosine = (self.turns[some, i] @ self.turns[:, i].T - 1.0) / 2.0
            alike &= (square <= self.near_m[some, None] ** 2) & (cosine >= np.cos(_TURNED_RAD))
        return both, alike


def stops_of(problem: Problem, x: np.ndarray) -> Dict[str, str]:
    """Return the first collection of its stop by collection, in the order of the names.

    Two collections are of one stop where all that both of them saw stood alike, to a hundredth of
    its distance and a degree, and so did what moves between the sensors and the boards.

    Args:
        problem: whose detections.
        x: its solution.
    """
    names, of_detection = np.unique([k.collection for k in problem.detections], return_inverse=True)
    seen, count = _seen(problem, x, of_detection, len(names)), len(names)
    first, stop = np.zeros(count, dtype=bool), np.arange(count)
    for start in range(0, count, _AT_A_TIME):
        some = slice(start, min(start + _AT_A_TIME, count))
        apart = np.zeros((some.stop - start, count), dtype=bool)
        together = np.zeros_like(apart)
        for one in seen:
            both, alike = one.same(some)
            together |= both
            apart |= both & ~alike
        for c, same in enumerate(together & ~apart, start):
            earlier = np.flatnonzero(same[:c] & first[:c])
            first[c] = len(earlier) == 0
            stop[c] = c if first[c] else earlier[0]
    return dict(zip(names.tolist(), names[stop].tolist()))


def _seen(problem: Problem, x: np.ndarray, of_detection: np.ndarray, count: int) -> List[_Seen]:
    """Return what collections saw, by sensor and pattern."""
    poses = np.concatenate([problem.poses(x)[:, None], problem.chains.constants], axis=1)
    pairs: Dict[Tuple[str, str], List[int]] = {}
    for d, key in enumerate(problem.detections):
        pairs.setdefault((key.sensor, key.pattern), []).append(d)
    found = []
    for mine in pairs.values():
        all_poses = np.zeros((count, poses.shape[1], 4, 4))
        all_poses[of_detection[mine]] = poses[mine]
        is_seen = np.zeros(count, dtype=bool)
        is_seen[of_detection[mine]] = True
        places = all_poses[:, :, :3, 3]
        turns = all_poses[:, :, :3, :3].reshape(count, -1, 9)
        found.append(_Seen(is_seen, places, turns, _NEAR * np.linalg.norm(places[:, 0], axis=1)))
    return found


def repeats(problem: Problem, stops: Mapping[str, str]) -> np.ndarray:
    """Return (d,) how many detections of its stop each one's sensor has of its pattern."""
    places = [(stops[k.collection], k.sensor, k.pattern) for k in problem.detections]
    counts = Counter(places)
    return np.array([counts[place] for place in places])


def by_stop(equations: SharedEquations, stops: Mapping[str, str]) -> SharedEquations:
    """Return what each stop says, under the name of its first collection."""
    members: Dict[str, List[int]] = {}
    for i, name in enumerate(equations.collections):
        members.setdefault(stops[name], []).append(i)
    if len(members) == len(equations.collections):
        return equations
    parts = tuple(_together([equations.parts[i] for i in mine]) for mine in members.values())
    gradient = np.array([equations.gradient[mine].sum(axis=0) for mine in members.values()])
    return equations.of_collections(tuple(members), parts, gradient)


def _together(parts: Sequence[CollectionPart]) -> CollectionPart:
    """Return what several collections say."""
    numbers = np.unique(np.concatenate([part.numbers for part in parts]))
    information = np.zeros((len(numbers), len(numbers)))
    for part in parts:
        own = np.searchsorted(numbers, part.numbers)
        information[own[:, None], own] += part.information
    return CollectionPart.of(numbers, information)
