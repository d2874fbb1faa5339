"""How rare a change of an edge is if nothing moved: asked as a shift, as a turn, and as both.

Someone who knocks a sensor shifts it, or turns it. Asked for the three numbers of that alone, a
smaller move is told from chance than among all six; the three questions share the false alarms.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from scipy import special  # scipy.stats has the distributions by name, and takes long to load

from atom_core.evaluation.changes import chi_square
from atom_core.evaluation.edge_errors import PoseError
from atom_core.evaluation.spreads import LEAST_VARIANCE, NUMBERS
from atom_core.problem.blocks import ROTATION, TRANSLATION

FOUND = 0.95
_QUESTIONS = ((TRANSLATION, 0.45), (ROTATION, 0.45), (slice(0, NUMBERS), 0.1))
_UNKNOWN = 1e-6  # weight of what is not determined


def rarity(change: PoseError, covariance: np.ndarray, freedom: float = np.inf) -> float:
    """Return the chi-square of six numbers that is as rare as what a change says if nothing moved.

    The rarest answer to the three questions counts, each with its part of the false alarms (Sidak
    1967). That of a part is the chi-square by which the change becomes likelier where this part may
    move; with a covariance that is estimated itself, a third or a sixth of it is distributed as F.

    Args:
        change: the six numbers.
        covariance: of them (6, 6), turns [rad] and shifts [m].
        freedom: how many independent numbers told the covariance's scale; infinite: it is known.
    """
    numbers = np.concatenate([change.turn_rad, change.shift_m])
    weight = _weight(covariance)
    rarest = 1.0
    for part, share in _QUESTIONS:
        pull = (weight @ numbers)[part]
        square = float(pull @ np.linalg.solve(weight[part, part], pull))
        chance = _beyond_by_chance(square, len(pull), freedom)
        rarest = min(rarest, -float(np.expm1(np.log1p(-chance) / share)) if chance < 1.0 else 1.0)
    rare = float(special.chdtri(NUMBERS, rarest))
    return rare if np.isfinite(rare) else chi_square(change, covariance)


def found_from(covariance: np.ndarray, limit: float, freedom: float, part: slice) -> float:
    """Return the size of a move of a part alone that is beyond the limit in 95 % of cases.

    Args:
        covariance: of the six numbers (6, 6), turns [rad] and shifts [m].
        limit: of `rarity`.
        freedom: as for `rarity`.
        part: ROTATION or TRANSLATION.

    Returns:
        A size [rad] or [m], in the direction that is told worst.
    """
    weight = _weight(covariance)[part, part]
    share = next(share for asked, share in _QUESTIONS if asked == part)
    size = np.sqrt(_noncentrality(limit, share, len(weight), freedom))
    return float(size / np.sqrt(max(np.min(np.linalg.eigvalsh(weight)), _UNKNOWN)))


def _weight(covariance: np.ndarray) -> np.ndarray:
    return np.linalg.inv(covariance + LEAST_VARIANCE * np.eye(NUMBERS))


def _beyond_by_chance(square: float, count: int, freedom: float) -> float:
    """Return how often a chi-square of so many numbers is larger."""
    if np.isinf(freedom):
        return float(special.chdtrc(count, square))
    return float(special.fdtrc(count, freedom, square / count))


def _noncentrality(limit: float, share: float, count: int, freedom: float) -> float:
    """Return how large a chi-square is on top when its question is beyond in 95 % of cases."""
    rare = -np.expm1(share * np.log1p(-special.chdtrc(NUMBERS, limit)))
    if np.isinf(freedom):
        beyond = partial(_beyond_chi_square, special.chdtri(count, rare), count)
    else:
        beyond = partial(_beyond_f, special.fdtri(count, freedom, 1.0 - rare), count, freedom)
    low, high = 0.0, 10.0 * limit + 200.0
    for _ in range(60):
        middle = (low + high) / 2.0
        enough = beyond(max(middle, 1e-9)) >= FOUND
        low, high = (low, middle) if enough else (middle, high)
    return high


def _beyond_chi_square(bound: float, count: int, noncentrality: float) -> float:
    return 1.0 - float(special.chndtr(bound, count, noncentrality))


def _beyond_f(bound: float, count: int, freedom: float, noncentrality: float) -> float:
    return 1.0 - float(special.ncfdtr(count, freedom, noncentrality, bound))
