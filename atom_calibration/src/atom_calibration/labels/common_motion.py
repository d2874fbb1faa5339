"""A first estimate that is wholly wrong: the motion by which all labels contradict it alike.

A label that contradicts the prediction once is another thing in the room. Where many do, and one
rigid motion brings all predictions to what was found, the transform between camera and sensor is
wrong, not the labels: boards that move cannot agree by chance.
"""

from __future__ import annotations

from itertools import combinations
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_calibration.labels.guess import NORMAL_RAD, OFF_PLANE_M, Guess, misfit
from atom_core.geometry import se3
from atom_core.labeling.stillness import SurfaceSighting

LEAST_PLACES = 5
FEWEST_PLACES = 3  # at the end of a recording, if all of them agree
_LEAST_SHARE = 0.7  # of the places must agree
_MOST_TRIPLES = 60
_COARSE_RAD, _COARSE_M = 0.25, 0.5
_FINE_RAD, _FINE_OFF_M, _FINE_M = 0.1, 0.12, 0.1  # direction; off the plane; beside
_PRIOR_SIGMAS = np.array([2.0] * 3 + [10.0] * 3)  # [rad], [m]: hardly any
_MOST_SIGMA_RAD, _MOST_SIGMA_M = 0.1, 0.3
_ITERATIONS = 8

Place = Tuple[Guess, SurfaceSighting]


class CommonMotion(NamedTuple):
    """What brings the predictions to the labels.

    Attributes:
        found_T_predicted: (4, 4) in the sensor's frame.
        places: those that agree with it.
    """

    found_T_predicted: np.ndarray
    places: List[Place]


def common_motion(places: Sequence[Place], few: bool = False) -> Optional[CommonMotion]:
    """Return the motion by which nearly all places agree; None if there is none, or too few.

    Args:
        places: predictions and the planes that were found, of boards apart from each other.
        few: there will be no more; three are enough, if all places agree.
    """
    least = max(LEAST_PLACES, int(np.ceil(_LEAST_SHARE * len(places))))
    if few and len(places) < LEAST_PLACES:
        least = max(FEWEST_PLACES, len(places))
    if len(places) < least:
        return None
    poses = _hypotheses(places)
    agree = _coarsely(poses, places)
    best = [place for place, one in zip(places, agree[np.argmax(agree.sum(axis=1))]) if one]
    if len(best) < least:
        return None
    for _ in range(2):
        pose, covariance = _fitted(best)
        best = _agreeing(pose, places)
        if len(best) < least:
            return None
    return CommonMotion(pose, best) if _is_determined(covariance, best) else None


def _hypotheses(places: Sequence[Place]) -> np.ndarray:
    """Return motions (n, 4, 4) by three places each, boards seen from the front or from behind."""
    triples = list(combinations(range(len(places)), 3))
    if len(triples) > _MOST_TRIPLES:
        chosen = np.random.default_rng(0).choice(len(triples), _MOST_TRIPLES, replace=False)
        triples = [triples[k] for k in sorted(chosen)]
    of_three = [[places[k] for k in triple] for triple in triples]
    return np.array([_of_three(chosen, side) for chosen in of_three for side in (1, -1)])


def _of_three(places: Sequence[Place], side: int) -> np.ndarray:
    """Return the motion of normals and middles (Kabsch); a sensor's normals look towards it."""
    middles = np.array([guess.middle for guess, _ in places])
    centres = np.array([found.centre for _, found in places])
    normals = np.array([guess.normal for guess, _ in places])
    seen = np.array([side * _towards_sensor(found) for _, found in places])
    before = np.vstack([normals, middles - middles.mean(axis=0)])
    after = np.vstack([seen, centres - centres.mean(axis=0)])
    u, _, vt = np.linalg.svd(after.T @ before)
    rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return se3.transform(rotation, centres.mean(axis=0) - rotation @ middles.mean(axis=0))


def _towards_sensor(found: SurfaceSighting) -> np.ndarray:
    normal = found.board_axes(found.centre)[:, 2]
    return -normal if normal @ found.centre > 0 else normal


def _coarsely(poses: np.ndarray, places: Sequence[Place]) -> np.ndarray:
    """Return (poses, places) whether a place agrees with a motion, more or less."""
    middles = np.array([guess.middle for guess, _ in places])
    normals = np.array([guess.normal for guess, _ in places])
    centres = np.array([found.centre for _, found in places])
    seen = np.array([_towards_sensor(found) for _, found in places])
    reach_m = np.array([guess.half_diagonal_m for guess, _ in places]) + _COARSE_M
    moved = np.einsum("pij,nj->pni", poses[:, :3, :3], middles) + poses[:, None, :3, 3]
    turned = np.einsum("pij,nj->pni", poses[:, :3, :3], normals)
    aside = np.linalg.norm(np.cross(turned, seen), axis=2) < _COARSE_RAD
    return aside & (np.linalg.norm(moved - centres, axis=2) < reach_m)


def _agreeing(pose: np.ndarray, places: Sequence[Place]) -> List[Place]:
    agreeing = []
    for guess, found in places:
        moved = guess.moved(pose)
        off = misfit(moved.middle, moved.normal, found)
        limit = off.by_kind(_FINE_RAD, _FINE_OFF_M, _FINE_M + guess.half_diagonal_m)
        if np.all(np.abs(off.numbers) <= limit):
            agreeing.append((guess, found))
    return agreeing


def _fitted(places: Sequence[Place]) -> Tuple[np.ndarray, np.ndarray]:
    """Return motion and covariance by least squares from the one of three places that fits best."""
    starts = _hypotheses(places[:6])
    pose = min(starts, key=lambda start: _square(start, places))
    for _ in range(_ITERATIONS):
        information = np.diag(_PRIOR_SIGMAS**-2.0)
        gradient = np.zeros(6)
        for guess, found in places:
            moved = guess.moved(pose)
            off = misfit(moved.middle, moved.normal, found)
            sigma = off.by_kind(NORMAL_RAD, OFF_PLANE_M, 0.5 * guess.half_diagonal_m)
            rows = off.jacobian / sigma[:, None]
            information += rows.T @ rows
            gradient += rows.T @ (off.numbers / sigma)
        step = -np.linalg.solve(information, gradient)
        pose = se3.transform(se3.rotation_from_rotation_vector(step[:3]), step[3:]) @ pose
    return pose, np.linalg.inv(information)


def _square(pose: np.ndarray, places: Sequence[Place]) -> float:
    total = 0.0
    for guess, found in places:
        moved = guess.moved(pose)
        off = misfit(moved.middle, moved.normal, found)
        sigma = off.by_kind(NORMAL_RAD, OFF_PLANE_M, 0.5 * guess.half_diagonal_m)
        total += float(np.sum((off.numbers / sigma) ** 2))
    return total


def _is_determined(covariance: np.ndarray, places: Sequence[Place]) -> bool:
    """Tell whether the places show all six numbers: boards all parallel do not."""
    middle = np.mean([found.centre for _, found in places], axis=0)
    at_middle = np.hstack([-se3.skew(middle), np.eye(3)])
    turn = np.max(np.linalg.eigvalsh(covariance[:3, :3]))
    shift = np.max(np.linalg.eigvalsh(at_middle @ covariance @ at_middle.T))
    return bool(turn < _MOST_SIGMA_RAD**2 and shift < _MOST_SIGMA_M**2)
