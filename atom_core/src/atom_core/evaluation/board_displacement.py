"""How far two sensors are apart from where the planes of the boards would have them.

A plane shows a shift across itself only. Boards that are tilted in several ways show any shift:
the one that would lay them on one another is found by least squares.
"""

from __future__ import annotations

from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.evaluation.observed import NotMeasurableError, Observed
from atom_core.evaluation.pairs import board_points
from atom_core.geometry import se3
from atom_core.geometry.plane import fit_plane
from atom_core.model.labels import DetectionKey
from atom_core.problem.blocks import ROTATION, TRANSLATION

Seen = Sequence[Tuple[DetectionKey, DetectionKey, np.ndarray]]  # source, target, target_T_source
_ROUNDS = 10  # of weights by residuals
_BOARD_M = 0.003  # how far off a board's plane is known to be at least, all its points alike
_FEWEST = 2  # boards beyond which their differences tell a scatter
_BY_CHANCE = 16.3  # chi-square of three numbers that one of a thousand exceeds
_TOLD_M, _TOLD_RAD = 0.02, float(np.radians(1.5))  # sigmas; three of them are noticed
_OPEN = 1e3  # what is not determined is as uncertain as that [m, rad]


class Displacement(NamedTuple):
    """A small motion of the source that would lay the boards on one another.

    Attributes:
        shift_m: (3,) of the boards' middle, along the target's axes.
        turn_rad: (3,) about that middle, a rotation vector in the target's axes.
        covariance: (6, 6) of turn and shift.
    """

    shift_m: np.ndarray
    turn_rad: np.ndarray
    covariance: np.ndarray

    @property
    def told(self) -> bool:
        """Whether boards suffice to notice a shift or a turn that matters, in any direction."""
        return self.sigma_m <= _TOLD_M and self.sigma_rad <= _TOLD_RAD

    @property
    def sigma_m(self) -> float:
        """Standard deviation of the shift in the direction that the boards tell worst."""
        return _largest(self.covariance[TRANSLATION, TRANSLATION])

    @property
    def sigma_rad(self) -> float:
        """Likewise of the turn."""
        return _largest(self.covariance[ROTATION, ROTATION])

    @property
    def apart_m(self) -> float:
        """Length of the shift; zero where chance may have made it."""
        return _beyond_chance(self.shift_m, self.covariance[TRANSLATION, TRANSLATION])

    @property
    def turned_rad(self) -> float:
        """Likewise the angle of the turn."""
        return _beyond_chance(self.turn_rad, self.covariance[ROTATION, ROTATION])


def _largest(covariance: np.ndarray) -> float:
    return float(np.sqrt(np.max(np.linalg.eigvalsh(covariance))))


def _beyond_chance(numbers: np.ndarray, covariance: np.ndarray) -> float:
    square = float(numbers @ np.linalg.solve(covariance, numbers))
    return float(np.linalg.norm(numbers)) if square > _BY_CHANCE else 0.0


def board_displacement(observed: Observed, seen: Seen) -> Optional[Displacement]:
    """Return how far the source would have to be shifted; it may turn as well. None: no planes.

    Args:
        observed: the labels.
        seen: boards that both sensors see.
    """
    planes = [plane for plane in (_plane(observed, *board) for board in seen) if plane is not None]
    if not planes:
        return None
    middle = np.mean([np.mean(points, axis=0) for points, _, _ in planes], axis=0)
    normals, pulls = (np.array(part) for part in zip(*(_rows(*p, middle) for p in planes)))
    weights = np.ones(len(planes))
    for _ in range(_ROUNDS):  # a wrong label among them does not carry the others away
        move = np.linalg.pinv(_sum(weights, normals), rcond=1e-9) @ _sum(weights, pulls)
        off = np.linalg.norm(pulls - normals @ move, axis=1)
        weights = 1.0 / (1.0 + (off / (2.0 * np.median(off) + _BOARD_M)) ** 2)
    covariance = _covariance(weights, normals, pulls - normals @ move)
    return Displacement(move[TRANSLATION], move[ROTATION], covariance)


def _plane(
    observed: Observed, source: DetectionKey, target: DetectionKey, target_T_source: np.ndarray
) -> Optional[Tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return the target's points (n, 3) [m], and centroid and normal of the source's plane."""
    try:
        points = board_points(observed, target)
        carried = se3.apply(target_T_source, board_points(observed, source))
        centroid, normal, _ = fit_plane(carried)
    except (NotMeasurableError, ValueError):
        return None
    return points, centroid, normal


def _rows(
    points: np.ndarray, centroid: np.ndarray, normal: np.ndarray, middle: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Return a board's normal matrix (6, 6) and right side (6,), as means over its points.

    Of the distances by a turn about the middle and a shift of the source.
    """
    turns = np.cross(points - middle, normal)
    rows = np.column_stack([turns, np.broadcast_to(normal, points.shape)])
    distances = (points - centroid) @ normal
    return rows.T @ rows / len(points), rows.T @ distances / len(points)


def _sum(weights: np.ndarray, parts: np.ndarray) -> np.ndarray:
    return np.tensordot(weights, parts, axes=1)


def _covariance(weights: np.ndarray, normals: np.ndarray, pulls: np.ndarray) -> np.ndarray:
    """Return the covariance (6, 6) by how the boards differ, and by how well one is known."""
    values, vectors = np.linalg.eigh(_sum(weights, normals))
    told = np.maximum(values, (_BOARD_M / _OPEN) ** 2)
    inverse = (vectors / told) @ vectors.T
    pulled: List[np.ndarray] = [w * pull for w, pull in zip(weights, pulls)]
    scatter = sum(np.outer(pull, pull) for pull in pulled)
    count = len(weights)
    more = count / (count - _FEWEST) if count > _FEWEST else 1.0
    return np.asarray(
        inverse @ (more * scatter + _BOARD_M**2 * _sum(weights**2, normals)) @ inverse
    )
