"""How rare a change of an edge is if nothing moved: asked as a shift, as a turn, and as both.

Someone who knocks a sensor shifts it, or turns it. Asked for the three numbers of that alone, a
smaller move is told from chance than among all six. The three questions share the false alarms:
how often chance answers any of them is integrated, for what chance tells as a shift it often tells
as a turn, too.
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
_QUESTIONS = (TRANSLATION, ROTATION, slice(0, NUMBERS))
_SHARES = (0.45, 0.45, 0.1)  # of the false alarms
_COUNTS = (3, 3, NUMBERS)
_UNKNOWN = 1e-6  # weight of what is not determined
_STEPS = 5  # of a search: each comes some twenty times nearer
# Directions in which chance may deviate, spread evenly by the roots of primes (Richtmyer 1951).
_EVEN = np.arange(1, 2049)[:, None] * np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0]) % 1.0
_DIRECTIONS = special.ndtri(_EVEN) / np.linalg.norm(special.ndtri(_EVEN), axis=1, keepdims=True)


def rarity(change: PoseError, covariance: np.ndarray, freedom: float = np.inf) -> float:
    """Return the chi-square of six numbers that is as rare as what a change says if nothing moved.

    The rarest answer to the three questions counts, each with its part of the false alarms, and is
    as rare as chance gives any such answer. That of a part is the chi-square by which the change
    becomes likelier where this part may move; with a covariance that is estimated itself, a third
    or a sixth of it is distributed as F.

    Args:
        change: the six numbers.
        covariance: of them (6, 6), turns [rad] and shifts [m].
        freedom: how many independent numbers told the covariance's scale; infinite: it is known.
    """
    chance = _Chance(covariance, freedom)
    rare = float(special.chdtri(NUMBERS, chance.of_any(chance.rarest(change))))
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
    asked = _QUESTIONS.index(part)
    rare = _Chance(covariance, freedom).rare_enough(float(special.chdtrc(NUMBERS, limit)))
    bound = _bound(_of_question(rare, _SHARES[asked]), _COUNTS[asked], freedom)
    size = np.sqrt(_noncentrality(bound, _COUNTS[asked], freedom))
    weight = np.linalg.inv(covariance + LEAST_VARIANCE * np.eye(NUMBERS))[part, part]
    return float(size / np.sqrt(max(np.min(np.linalg.eigvalsh(weight)), _UNKNOWN)))


class _Chance:
    """What chance answers to the three questions.

    In units of sigma, chance deviates in each direction alike, and its size is independent of the
    direction. In each there is a size from which the first question is answered; how often chance
    is larger, in the mean over all directions, is how often it answers any.

    Args:
        covariance: of the six numbers (6, 6), turns [rad] and shifts [m].
        freedom: how many independent numbers told the covariance's scale; infinite: it is known.
    """

    def __init__(self, covariance: np.ndarray, freedom: float) -> None:
        self._freedom = freedom
        self._scale = np.sqrt(np.diagonal(covariance) + LEAST_VARIANCE)
        correlation = covariance / np.outer(self._scale, self._scale) + 1e-12 * np.eye(NUMBERS)
        self._whitening = np.linalg.inv(np.linalg.cholesky(correlation))
        self._bases = [np.linalg.qr(self._whitening[:, part])[0] for part in _QUESTIONS]
        self._parts = np.array([_squares(_DIRECTIONS, basis) for basis in self._bases])

    def rarest(self, change: PoseError) -> float:
        """Return how rare the rarest answer is, weighed by its question's share."""
        numbers = np.concatenate([change.turn_rad, change.shift_m]) / self._scale
        squares = [_squares(self._whitening @ numbers, basis) for basis in self._bases]
        chances = (_beyond(s, count, self._freedom) for s, count in zip(squares, _COUNTS))
        return min(_of_all(float(c), share) for c, share in zip(chances, _SHARES))

    def of_any(self, rare: float) -> float:
        """Return how often chance gives an answer that is so rare or rarer."""
        each = [_of_question(rare, share) for share in _SHARES]
        bounds = [_bound(c, count, self._freedom) for c, count in zip(each, _COUNTS)]
        with np.errstate(divide="ignore"):
            first = np.min(np.array(bounds)[:, None] / self._parts, axis=0)
        found = float(np.mean(_beyond(first, NUMBERS, self._freedom)))
        return min(max(found, *each), sum(each))  # what is known without the directions

    def rare_enough(self, chance: float) -> float:
        """Return how rare answers must be for chance to give any so often."""
        rare = chance
        for _ in range(_STEPS):
            rare *= chance / self.of_any(rare)
        return min(rare, 1.0)


def _squares(numbers: np.ndarray, basis: np.ndarray) -> np.ndarray:
    along = numbers @ basis
    return np.einsum("...i,...i->...", along, along)


def _of_all(chance: float, share: float) -> float:
    """Return how rare a question's answer is among all, where they were independent (Sidak)."""
    return -float(np.expm1(np.log1p(-chance) / share)) if chance < 1.0 else 1.0


def _of_question(rare: float, share: float) -> float:
    """Return the chance of one question's answer that is so rare among all."""
    return -float(np.expm1(share * np.log1p(-rare))) if rare < 1.0 else 1.0


def _beyond(square: np.ndarray, count: int, freedom: float) -> np.ndarray:
    """Return how often chance's square of so many numbers is larger."""
    if np.isinf(freedom):
        return special.chdtrc(count, square)
    return special.fdtrc(count, freedom, square / count)


def _bound(chance: float, count: int, freedom: float) -> float:
    """Return the square of so many numbers that chance exceeds so often."""
    if np.isinf(freedom):
        return float(special.chdtri(count, chance))
    # The tail of F by that of 1 / F: 1 - chance has no digits left where chance is small.
    inverse = float(special.fdtri(freedom, count, chance))
    return count / inverse if inverse > 0.0 else np.inf


def _noncentrality(bound: float, count: int, freedom: float) -> float:
    """Return how large a square is on top when it is beyond a bound in 95 % of cases."""
    if np.isinf(freedom):
        beyond = partial(_beyond_chi_square, bound, count)
    else:
        beyond = partial(_beyond_f, bound / count, count, freedom)
    low, high = 0.0, 10.0 * bound + 200.0
    for _ in range(60):
        middle = (low + high) / 2.0
        enough = beyond(max(middle, 1e-9)) >= FOUND
        low, high = (low, middle) if enough else (middle, high)
    return high


def _beyond_chi_square(bound: float, count: int, noncentrality: float) -> float:
    return 1.0 - float(special.chndtr(bound, count, noncentrality))


def _beyond_f(bound: float, count: int, freedom: float, noncentrality: float) -> float:
    return 1.0 - float(special.ncfdtr(count, freedom, noncentrality, bound))
