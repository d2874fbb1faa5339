"""A start for a sensor on a moving arm before a board that stays (or the other way round).

In every collection ``F = G_i X H_i``: the motion G_i is known, the pose H_i is seen, the edge X
and the board's pose F are constants. Solved in closed form (Park, Martin 1994, by OpenCV) from a
few collections at a time, since the poses H_i may be ambiguous or wrong; consensus decides.
"""

from __future__ import annotations

from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.pose_solvers import hand_eye_pose

_TOLERANCE = 0.25  # of the board's diagonal, as for votes
_TRIALS, _SAMPLE = 150, 5
_LEAST = 3  # collections with motion between them that the equation needs
_FIRST_POSE = 0.7  # how often a trial takes the likeliest pose of a detection
_FARTHEST_M = 20.0


class MovingView(NamedTuple):
    """One collection: ``G`` (4, 4), and the poses ``H`` (k, 4, 4) that the detection allows."""

    G: np.ndarray
    H: np.ndarray


def solve_hand_eye(views: Sequence[MovingView], outline: np.ndarray) -> Optional[np.ndarray]:
    """Return the X (4, 4) that most views agree with, or None where the motion does not tell.

    Args:
        views: one for each collection in which the board was seen.
        outline: (4, 3) corners of the board in its own frame [m].
    """
    views = [v for v in views if len(v.H)]
    if len(views) < _LEAST:
        return None
    rng = np.random.default_rng(0)  # the same data give the same start
    best: Tuple[float, Optional[np.ndarray]] = (0.0, None)
    for _ in range(_TRIALS):
        chosen = rng.permutation(len(views))[:_SAMPLE]
        picks = [_pick(len(views[i].H), rng) for i in chosen]
        X = _closed_form(
            [views[i].G for i in chosen], [views[i].H[k] for i, k in zip(chosen, picks)]
        )
        if X is None:
            continue
        support, _ = _agreement(views, X, outline)
        if support > best[0]:
            best = (support, X)
    if best[1] is None:
        return None
    support, X = _refined(views, best, outline)
    return X if support >= max(0.5 * len(views), _LEAST - 0.5) else None


def _pick(count: int, rng: np.random.Generator) -> int:
    return 0 if rng.random() < _FIRST_POSE else int(rng.integers(count))


def _refined(
    views: Sequence[MovingView], best: Tuple[float, Optional[np.ndarray]], outline: np.ndarray
) -> Tuple[float, np.ndarray]:
    support, X = best
    assert X is not None
    _, picks = _agreement(views, X, outline)
    used = [(v, k) for v, k in zip(views, picks) if k >= 0]
    if len(used) >= _LEAST:
        again = _closed_form([v.G for v, _ in used], [v.H[k] for v, k in used])
        if again is not None and (now := _agreement(views, again, outline)[0]) > support:
            return now, again
    return support, X


def _closed_form(G: List[np.ndarray], H: List[np.ndarray]) -> Optional[np.ndarray]:
    X = hand_eye_pose(G, H)
    return None if X is None or np.linalg.norm(X[:3, 3]) >= _FARTHEST_M else X


def _agreement(
    views: Sequence[MovingView], X: np.ndarray, outline: np.ndarray
) -> Tuple[float, List[int]]:
    """Return how many views put the board in one place, and the pose each one takes (-1: none)."""
    places = [se3.apply(v.G @ X @ h, outline) for v in views for h in v.H]
    corners = np.stack(places)
    owner = np.repeat(np.arange(len(views)), [len(v.H) for v in views])
    apart = np.mean(np.sum((corners[:, None] - corners[None]) ** 2, axis=-1), axis=-1)
    tolerance = (_TOLERANCE * np.linalg.norm(outline[2] - outline[0])) ** 2
    agree = np.maximum(1.0 - apart / tolerance, 0.0)
    by_view = np.stack([agree[:, owner == i].max(axis=1) for i in range(len(views))], axis=1)
    middle = int(np.argmax(by_view.sum(axis=1)))
    picks = []
    for i in range(len(views)):
        mine = np.flatnonzero(owner == i)
        best = mine[np.argmax(agree[middle, mine])]
        picks.append(int(best - mine[0]) if agree[middle, best] > 0 else -1)
    return float(by_view[middle].sum()), picks
