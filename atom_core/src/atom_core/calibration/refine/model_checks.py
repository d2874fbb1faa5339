"""Which error of the model would explain the residuals: score tests, without another solve.

For every candidate (a range offset, a board's size, a focal length, ...) the solution is taken one
Gauss-Newton step farther with that number free beside all others. How exactly the number is known
is seen from how much the collections differ about it, not from the assumed noise, which model
errors make wrong (the cluster-robust or sandwich covariance: Liang and Zeger 1986; with a
correction for leverage: Bell and McCaffrey 2002). What explains most is taken first, and the rest
is tested beside it, until nothing significant is left.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, Mapping, NamedTuple, Optional, Sequence, Tuple, Type

import numpy as np
from scipy import special

from atom_core.problem.board_errors import SeenBorder
from atom_core.problem.model_errors import ModelError
from atom_core.solvers import losses
from atom_core.solvers.shared_equations import SharedEquations, inverse

_CHANCE = 0.01  # of naming anything where the model is right, for all candidates together
_HINT = 0.05  # of what is a hint only, each error by itself ...
_UNLIKELY = 3.0  # ... where it is more than so many times what is usual
_LEVERAGE = 0.9  # no collection counts as deciding more than this of a number
_DETERMINED = 1e-6  # part of its information that other numbers must leave a candidate
_SAME = 0.9  # two candidates whose effects are so much alike cannot be told apart ...
_RIVAL = 0.8  # ... where the second one explains this part of what the first one does
UNUSUAL = 10.0  # times as unusual, a rival is none
_TIE = 1e-3  # part of the gain by which errors that explain the same differ by rounding and noise
_CAUTIOUS = 16.0  # gain that is left when a detection counts for little more than one row
_MOST = 12


@dataclass(frozen=True)
class ModelCheck:
    """A model error that the data show.

    Attributes:
        error: which.
        value: estimated, in its unit; one step from the solution.
        sigma: its standard deviation, seen from how the collections differ.
        gain: by how much the cost (twice the negative logarithm of the likelihood) would fall.
        moves: (m,) by how much the shared numbers would change.
        rivals: other errors that would explain it nearly as well.
        rival_values: theirs, each alone, in their units.
    """

    error: ModelError
    value: float
    sigma: float
    gain: float
    moves: np.ndarray
    rivals: Tuple[ModelError, ...]
    rival_values: Tuple[float, ...] = ()


class Hint(NamedTuple):
    """A model error that may be one by chance: its value and standard deviation, in its unit."""

    error: ModelError
    value: float
    sigma: float


def model_checks(
    equations: SharedEquations,
    cautious: SharedEquations,
    estimated: Sequence[ModelError],
    loss: str,
) -> List[ModelCheck]:
    """Return what the data show, what explains most first.

    Args:
        equations: at the solution; the model errors are the estimated ones, the candidates, and
            the borders as the sensors see them, which are free in every test.
        cautious: likewise, with what the rows of a detection may have in common; an error that is
            to be named must show in them, too.
        estimated: those that the solution has estimated.
        loss: robust loss of the equations.
    """
    known = [e for e in equations.errors if e in estimated or isinstance(e, SeenBorder)]
    found: List[ModelCheck] = []
    while len(found) < _MOST:
        taken = [*known, *(check.error for check in found)]
        best = _best(_Step(equations, taken, loss), _Step(cautious, taken, loss))
        if best is None:
            break
        found.append(best)
    return found


def hints(
    equations: SharedEquations,
    estimated: Sequence[ModelError],
    kind: Type[ModelError],
    loss: str,
) -> List[Hint]:
    """Return errors of a kind that the data may show, each beside what is estimated alone.

    Args:
        equations: as of `model_checks`.
        estimated: likewise.
        kind: of errors.
        loss: robust loss of the equations.
    """
    known = [e for e in equations.errors if e in estimated or isinstance(e, SeenBorder)]
    step = _Step(equations, known, loss)
    tested = step.tested()
    values, sigmas = tested.value, tested.sigma
    unusual = np.abs(values) > _UNLIKELY * np.array([e.usual / e.step for e in step.candidates])
    shown = tested.determined & (tested.chance < _HINT) & unusual
    return [
        Hint(error, error.step * float(values[i]), error.step * float(sigmas[i]))
        for i, error in enumerate(step.candidates)
        if isinstance(error, kind) and shown[i]
    ]


def sigma_beside(
    equations: SharedEquations, error: ModelError, expected: Mapping[ModelError, float]
) -> float:
    """Return how exactly the data tell an error where others may be there, too, in its unit.

    Args:
        equations: at the solution.
        error: which; nothing is expected of it.
        expected: standard deviations of the others, in their units; those without are free.
    """
    total = np.array(equations.total)
    for other, place in equations.place.items():
        if other in expected and other != error:
            total[place, place] += (other.step / expected[other]) ** 2
    at = equations.place[error]
    return error.step * float(np.sqrt(max(inverse(total)[at, at], 0.0)))


def _best(step: _Step, cautious: _Step) -> Optional[ModelCheck]:
    """Return the significant candidate that explains most, if there is one."""
    if not step.candidates:
        return None
    tested, careful = step.tested(), cautious.stepped()
    both = tested.significant & (careful.gain > _CAUTIOUS) & (tested.value * careful.value > 0.0)
    gains = np.where(both, tested.gain, -1.0)
    if np.max(gains) < 0.0:
        return None
    # Of those that explain the same, what is least unusual is the likeliest.
    usual = np.array([error.usual / error.step for error in step.candidates])
    unusual = np.abs(tested.value) / usual
    tied = gains >= (1.0 - _TIE) * np.max(gains)
    i = int(np.argmin(np.where(tied, unusual, np.inf)))
    rivals = tested.determined & (np.abs(step.alike[i]) > _SAME)
    rivals &= unusual < UNUSUAL * np.maximum(unusual[i], 1.0)
    rivals &= tested.gain > _RIVAL * tested.gain[i]
    rivals[i] = False
    error = step.candidates[i]
    return ModelCheck(
        error,
        float(error.step * tested.value[i]),
        float(error.step * tested.sigma[i]),
        float(gains[i]),
        step.moves(i, tested.value[i]),
        tuple(step.candidates[j] for j in np.flatnonzero(rivals)),
        tuple(step.candidates[j].step * tested.value[j] for j in np.flatnonzero(rivals)),
    )


class _Stepped(NamedTuple):
    """One step in each candidate: its value, what it gains, and whether it is determined."""

    value: np.ndarray
    gain: np.ndarray
    determined: np.ndarray


class _Tested(NamedTuple):
    value: np.ndarray
    sigma: np.ndarray
    gain: np.ndarray
    chance: np.ndarray
    significant: np.ndarray
    determined: np.ndarray


class _Step:
    """All candidates, each tested beside the base: shared numbers and errors already taken."""

    def __init__(self, equations: SharedEquations, taken: Sequence[ModelError], loss: str):
        self._equations, self._length = equations, losses.step_length(loss)
        place = equations.place
        base = [*range(equations.shared), *(place[e] for e in taken)]
        self.candidates = [e for e in equations.errors if e not in taken and e.is_named]
        rest = [place[e] for e in self.candidates]
        self._most = np.array([e.most / e.step for e in self.candidates])
        total = equations.total
        gradient = equations.total_gradient
        cross = total[np.ix_(base, rest)]
        self._gains = inverse(total[np.ix_(base, base)]) @ cross  # (b, c)
        of_all = total[np.ix_(rest, rest)] - cross.T @ self._gains
        self._alone, self._curvature = np.diagonal(total)[rest], np.diagonal(of_all)
        scale = np.sqrt(np.maximum(self._curvature, 1e-30))
        self.alike = of_all / scale[:, None] / scale
        self._slope = gradient[rest] - self._gains.T @ gradient[base]
        # (m, c) how all numbers go with each candidate
        self._along = np.zeros((len(total), len(rest)))
        self._along[base], self._along[rest] = -self._gains, np.eye(len(rest))

    def _independent(self, determined: np.ndarray) -> float:
        """Return how many independent tests the candidates are worth (Li and Ji 2005), at least 1.

        What goes with one joint's position, or a lens's centre and a turn, is much alike.
        """
        alike = self.alike[np.ix_(determined, determined)]
        values = np.abs(np.linalg.eigvalsh(alike))
        return max(float(np.sum((values >= 1.0) + values % 1.0)), 1.0)

    def moves(self, candidate: int, value: float) -> np.ndarray:
        """Return (m,) by how much the shared numbers change with a candidate's value in steps."""
        return -self._gains[: self._equations.shared, candidate] * value

    def stepped(self) -> _Stepped:
        """Return one step in each candidate."""
        determined = self._curvature > _DETERMINED * np.maximum(self._alone, 1e-30)
        curvature = np.where(determined, self._curvature, 1.0)
        value = -self._slope / curvature
        determined &= np.abs(value) < self._most
        value = np.where(determined, value, 0.0)
        return _Stepped(value, value**2 * curvature * self._length, determined)

    def tested(self) -> _Tested:
        """Return the candidates' values and how sure they are, by how the collections differ."""
        value, gain, determined = self.stepped()
        curvature = np.where(determined, self._curvature, 1.0)
        parts = self._equations.parts
        own = ((part.information, self._along[part.numbers]) for part in parts)
        curvatures = np.array([np.sum((inner @ way) * way, axis=0) for inner, way in own])
        curvatures = np.maximum(curvatures.reshape(len(parts), len(value)), 0.0)
        left = self._equations.gradient @ self._along + curvatures * value
        leverage = np.minimum(curvatures / curvature, _LEVERAGE)
        variance = np.sum((left / (1.0 - leverage)) ** 2, axis=0) / curvature**2
        sigma = np.sqrt(np.maximum(variance, 1.0 / curvature))
        effective = 1.0 / np.maximum(np.sum(leverage**2, axis=0), 1e-30)
        freedom = np.maximum(effective - 1.0, 1.0)
        chance = 2.0 * special.stdtr(freedom, -np.abs(value) / sigma)
        significant = determined & (chance < _CHANCE / self._independent(determined))
        # What is far off counts less in the equations: the step falls short, and so does its sigma.
        value, sigma = self._length * value, self._length * sigma
        return _Tested(value, sigma, gain, chance, significant, determined)
