"""Whether a sensor, or a fixed board, was moved while the collections were made.

Then two poses fit what was seen before and after, and the solution has neither. For every sensor
and every place between two collections, one Gauss-Newton step is taken with six more numbers: by
how much it is elsewhere in the later collections (a structural change at an unknown time: Andrews
1993); and one with how far it creeps from the first collection to the last. What that explains is
compared with how much the collections differ anyway.

A sensor that is elsewhere in all collections is where its edge puts it, unless it shares the edge
with another one, or the edge is not calibrated: then the description is wrong.
"""

from __future__ import annotations

from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np
from scipy import special

from atom_core.calibration.refine.model_checks import ModelCheck
from atom_core.calibration.refine.model_errors import CheckedSolution
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset
from atom_core.problem.blocks import BLOCK_SIZE, ROTATION, SENSOR, TRANSLATION
from atom_core.problem.problem import Problem
from atom_core.solvers.base import Solver, SolverSummary
from atom_core.solvers.detection_columns import (
    CollectionColumns,
    DetectionColumns,
    collection_columns,
)
from atom_core.solvers.normal_equations import NormalEquations, summed
from atom_core.solvers.shared_equations import SharedEquations, inverse, shares_of, tempered

_CHANCE = 0.01  # of telling a move where there is none, all of a calibration together
_FEWEST = 3  # collections before and after
_LEAST_M, _LEAST_RAD = 0.002, float(np.radians(0.1))  # less is nobody's concern
_MOST_M, _MOST_RAD = 0.3, float(np.radians(20.0))  # what looks like more is something else
_MORE = 1.2  # times what the best single error explains, beside _OF_SIX
_OF_SIX = 30.0  # gain that six numbers and the choice of the place have by chance
_ALIKE = 0.9  # part of the gain with which another one explains it as well
_LOOSE = 5.0  # so much more than noise, or so little beside the step, differ the collections
_SEEN = 1e-6  # part of its information that other numbers must leave a direction


class Moved(NamedTuple):
    """A sensor or a fixed board that stood elsewhere in the later collections.

    Attributes:
        names: it, and others that explain it as well.
        last, first: the collections before and after; of what crept, the first and the last.
        translation_m, rotation_rad: by how much.
        gain: by how much the cost (twice the negative logarithm of the likelihood) would fall.
        stood_still: before and after that; else this is only the largest of many steps.
        crept: little by little, from collection to collection.
    """

    names: Tuple[str, ...]
    last: str
    first: str
    translation_m: float
    rotation_rad: float
    gain: float
    stood_still: bool
    crept: bool = False

    @property
    def is_clear(self) -> bool:
        """Whether no single error explains nearly as much: else it is not told."""
        return True

    @property
    def why(self) -> str:
        """One sentence for the user."""
        one = " or ".join(self.names)
        unsure = "; which one, these data do not tell" if len(self.names) > 1 else ""
        if not self.stood_still:
            return (
                f"{one} did not stand still, its place differs from collection to collection"
                f"{unsure}: fasten it, and collect again"
            )
        far = f"{1e3 * self.translation_m:.2g} mm and {np.degrees(self.rotation_rad):.2g} deg"
        if self.crept:
            return (
                f"{one} crept between collections {self.last} and {self.first}, by {far} little by "
                f"little{unsure}: fasten it, let it warm up, and collect again"
            )
        return (
            f"{one} was moved between collections {self.last} and {self.first}, by {far}"
            f"{unsure}: fasten it, and calibrate the collections of one side alone (-csf)"
        )


class Misplaced(NamedTuple):
    """A sensor that no calibrated edge puts where it is.

    Attributes:
        names: it, and others of its edge that explain it as well.
        beside: the others of its edge.
        translation_m, rotation_rad: how far from there.
        gain: as of `Moved`.
        is_clear: no single error explains nearly as much.
    """

    names: Tuple[str, ...]
    beside: Tuple[str, ...]
    translation_m: float
    rotation_rad: float
    gain: float
    is_clear: bool

    @property
    def why(self) -> str:
        """One sentence for the user."""
        off = f"{1e3 * self.translation_m:.2g} mm and {np.degrees(self.rotation_rad):.2g} deg"
        one = self.names[0]
        if not self.beside:
            return (
                f"{one} is not where the description has it, but {off} off, and its edge is not "
                f"calibrated: correct its transform, or calibrate its edge"
            )
        return (
            f"{one} and {', '.join(self.beside)}, which have one edge, do not stand to one another "
            f"as the description has them, but {off} off: correct the transform between them, or "
            f"calibrate one by an edge of its own"
        )


Motion = Union[Moved, Misplaced]


def moved_sensors(
    dataset: Dataset,
    solver: Solver,
    summary: SolverSummary,
    loss: str,
    solution: CheckedSolution,
    others: Sequence[ModelCheck],
) -> Optional[Motion]:
    """Return what was moved, where no single error explains as much, or misplaced; None: nothing.

    What is misplaced is returned, too, where it is but as good an explanation as a single error.

    Args:
        dataset: the order of its collections is that in which they were made.
        solver: of the problem.
        summary: its solution.
        loss: robust loss.
        solution: its equations.
        others: the checks of single errors.
    """
    if len(solution.cautious.collections) < 2 * _FEWEST:
        return None
    equations = solver.equations(summary.x, summary.sigmas, loss)
    shares = shares_of(solver.problem, summary.sigmas, solution.common)
    with_common = tempered(solver.problem, equations, shares, summary.x)
    cautious = _motions(dataset, solver.problem, summary.x, with_common, solution.cautious)
    best = _clearest(cautious, _unplaced(dataset, solver.problem))
    if not best:
        return None
    name = max(best, key=lambda n: best[n].gain)
    step = best[name]
    shares = shares_of(solver.problem, summary.sigmas, summary.common or [0.0] * len(shares))
    as_weighted = tempered(solver.problem, equations, shares, summary.x)
    again = _motions(dataset, solver.problem, summary.x, as_weighted, solution.equations)
    found = _step(again, name, step.last, step.first, step.creeps)
    explained = max((check.gain for check in others), default=0.0)
    if found is None:
        return None
    is_clear = found.gain >= _MORE * explained + _OF_SIX
    if not is_clear and not (step.is_of_all and found.gain > _ALIKE * explained + _OF_SIX):
        return None
    alike = [n for n, s in best.items() if n != name and s.gain > _ALIKE * step.gain]
    shift, turn = (float(np.linalg.norm(found.value[part])) for part in (TRANSLATION, ROTATION))
    if step.is_of_all:
        beside = _beside(dataset, name)
        return Misplaced((name, *alike), beside, shift, turn, found.gain, is_clear)
    keys = cautious.keys
    stood_still = step.spread < max(_LOOSE * step.freedom, step.gain / _LOOSE)
    places = keys[step.last], keys[step.first]
    return Moved((name, *alike), *places, shift, turn, found.gain, stood_still, step.creeps)


def _unplaced(dataset: Dataset, problem: Problem) -> List[str]:
    """Return the sensors that no calibrated edge of their own puts where they are."""
    blocks = problem.parameters.blocks
    own = {b.names[0] for b in blocks if b.kind == SENSOR and len(b.names) == 1 and b.free.any()}
    return [name for name in dataset.sensors if name not in own]


def _beside(dataset: Dataset, name: str) -> Tuple[str, ...]:
    """Return the other sensors of a sensor's edge."""
    edge = dataset.sensors[name].edge
    return tuple(n for n, other in dataset.sensors.items() if n != name and other.edge == edge)


class _Motions(NamedTuple):
    """What sensors and fixed boards may have been moved by, in the order of g collections.

    Attributes:
        keys: of the collections.
        columns: a turn and a shift of each, by its name.
        inverse_of_all: (s, s) inverse of all information of the shared blocks.
        of_shared: (g, s, s) what each collection says of these.
        gradient: (g, s) likewise.
    """

    keys: Tuple[str, ...]
    columns: Dict[str, CollectionColumns]
    inverse_of_all: np.ndarray
    of_shared: np.ndarray
    gradient: np.ndarray


def _motions(
    dataset: Dataset,
    problem: Problem,
    x: np.ndarray,
    equations: NormalEquations,
    shared: SharedEquations,
) -> _Motions:
    """Return the motions, at the vector x."""
    place = {name: i for i, name in enumerate(dataset.collections)}
    order = np.argsort([place[name] for name in shared.collections])
    keys = tuple(shared.collections[i] for i in order)
    sums = summed(equations.parts, len(problem.detections), equations.state_jacobians.shape[2])
    columns = {
        name: collection_columns(problem, equations, keys, own)
        for name, own in _turns_and_shifts(dataset, problem, x, *sums).items()
    }
    size = BLOCK_SIZE * shared.blocks
    of_shared = np.zeros((len(order), size, size))
    for own, which in zip(of_shared, order):
        part = shared.parts[which]
        kept = part.numbers < size
        mine = part.numbers[kept]
        own[mine[:, None], mine] = part.information[np.ix_(kept, kept)]
    of_all = inverse(shared.total[:size, :size])
    return _Motions(keys, columns, of_all, of_shared, shared.gradient[order, :size])


def _turns_and_shifts(
    dataset: Dataset,
    problem: Problem,
    x: np.ndarray,
    information: np.ndarray,
    gradient: np.ndarray,
) -> Dict[str, DetectionColumns]:
    """Return six columns for each sensor and each fixed board.

    Args:
        dataset: with the boards.
        problem: whose detections.
        x: its vector.
        information: (d, s, s) of the detections' states.
        gradient: (d, s) likewise.
    """
    by_twist, gradient = information[:, :BLOCK_SIZE], gradient[:, :BLOCK_SIZE]
    information = by_twist[:, :, :BLOCK_SIZE]
    sensors = np.array([key.sensor for key in problem.detections])
    patterns = np.array([key.pattern for key in problem.detections])
    found = {}
    for name in dict.fromkeys(sensors.tolist()):
        one = (sensors == name)[:, None]
        other = one[:, :, None]
        found[name] = DetectionColumns(information * other, gradient * one, by_twist * other)
    fixed = [name for name in dict.fromkeys(patterns.tolist()) if dataset.patterns[name].fixed]
    by_board = se3.adjoint(problem.poses(x)) if fixed else np.zeros(0)  # left twists by right ones
    for name in fixed:
        own = by_board * (patterns == name)[:, None, None]
        turned, slope = np.swapaxes(own, 1, 2), np.einsum("dij,di->dj", own, gradient)
        found[f"board {name}"] = DetectionColumns(
            turned @ information @ own, slope, turned @ by_twist
        )
    return found


class _Step(NamedTuple):
    """A move between two collections.

    Attributes:
        last, first: indices of the collections before and after it that tell of it; -1 and 0: it
            comes before all of them. Of what creeps, the first and the last that tell.
        value: (6,) turn and shift.
        gain: what it explains.
        spread: by how much collections differ beside it, as a chi-square.
        freedom: of that.
        chance: that there is none.
    """

    last: int
    first: int
    value: np.ndarray
    gain: float
    spread: float
    freedom: int
    chance: float
    creeps: bool

    @property
    def is_of_all(self) -> bool:
        """Whether it comes before all collections."""
        return self.last < 0


def _places(columns: CollectionColumns) -> List[Tuple[int, int]]:
    """Return between which two collections, by their indices, a step may be."""
    told = _telling(columns).tolist()
    return list(zip(told[_FEWEST - 1 :], told[_FEWEST : len(told) - _FEWEST + 1]))


def _telling(columns: CollectionColumns) -> np.ndarray:
    """Return the indices of the collections that say something of a motion."""
    return np.flatnonzero(np.trace(columns.information, axis1=1, axis2=2) > 0)


def _shares(count: int, last: int, first: int, creeps: bool) -> np.ndarray:
    """Return which part (g,) of a move each of so many collections has."""
    places = np.arange(count)
    if creeps:
        return np.clip((places - last) / (first - last), 0.0, 1.0)
    return np.asarray(places >= first, dtype=float)


def _step(
    motions: _Motions, name: str, last: int, first: int, creeps: bool = False
) -> Optional[_Step]:
    """Return the move between two collections; None: the data do not tell it, or it is chance."""
    columns = _weighted(motions.columns[name], _shares(len(motions.keys), last, first, creeps))
    crossed = columns.cross.sum(axis=0)
    follow = motions.inverse_of_all @ crossed
    total = columns.information.sum(axis=0) - crossed.T @ follow
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(columns.information.sum(axis=0)), 1e-30))
    if np.linalg.eigvalsh(total * scale[:, None] * scale)[0] < _SEEN:
        return None
    slope = columns.gradient.sum(axis=0) - motions.gradient.sum(axis=0) @ follow
    value = -np.linalg.solve(total, slope)
    gain = float(value @ total @ value)
    freedom = BLOCK_SIZE * (len(_telling(motions.columns[name])) - 2)
    if special.fdtrc(BLOCK_SIZE, freedom, gain / BLOCK_SIZE) > _CHANCE:
        return None  # even if collections differed by no more than noise
    spread = _spread(motions, columns, follow, value)
    ratio = gain / BLOCK_SIZE / max(spread / freedom, 1.0)
    chance = float(special.fdtrc(BLOCK_SIZE, freedom, ratio))
    return _Step(last, first, value, gain, spread, freedom, chance, creeps)


def _weighted(columns: CollectionColumns, shares: np.ndarray) -> CollectionColumns:
    """Return the columns of a motion of which each collection has a part (g,)."""
    each = shares[:, None, None]
    return columns._replace(
        information=columns.information * each**2,
        gradient=columns.gradient * shares[:, None],
        cross=columns.cross * each,
    )


def _spread(
    motions: _Motions, columns: CollectionColumns, follow: np.ndarray, value: np.ndarray
) -> float:
    """Return by how much collections differ beside a step, as a chi-square.

    Args:
        motions: with what each collection says of the shared numbers.
        columns: of the step.
        follow: (s, 6) by how much the shared numbers follow it, with the other sign.
        value: (6,) of the step.
    """
    slope = columns.gradient - motions.gradient @ follow
    crossed = np.swapaxes(columns.cross, 1, 2) @ follow
    own = columns.information - crossed - np.swapaxes(crossed, 1, 2)
    own += follow.T @ motions.of_shared @ follow
    left = slope + own @ value
    return float(np.einsum("gi,gij,gj->", left, np.linalg.pinv(own, rcond=1e-8), left))


def _clearest(motions: _Motions, unplaced: Sequence[str]) -> Dict[str, _Step]:
    """Return the step of each sensor and board that explains most, of those that are clear.

    Args:
        motions: of sensors and boards.
        unplaced: sensors that may be elsewhere in all collections.
    """
    places = {name: _places(columns) for name, columns in motions.columns.items()}
    of_all = [name for name in unplaced if name in motions.columns]
    looked_at = sum(len(before) + 1 for before in places.values() if before) + len(of_all)
    limit = _CHANCE / max(looked_at, 1)
    best: Dict[str, _Step] = {}
    for name, before in places.items():
        steps = [_step(motions, name, last, first) for last, first in before]
        if before:
            told = _telling(motions.columns[name])
            steps.append(_step(motions, name, int(told[0]), int(told[-1]), creeps=True))
        clear = [s for s in steps if s is not None and s.chance < limit and _is_likely(s.value)]
        if clear:
            best[name] = max(clear, key=lambda step: step.gain)
    always = {name: _step(motions, name, -1, 0) for name in of_all}
    most = _ALIKE * max((step.gain for step in best.values()), default=0.0)
    clear_always = {
        name: step
        for name, step in always.items()
        if step is not None and step.chance < limit and _is_likely(step.value) and step.gain > most
    }
    return clear_always or best  # a move is told where no place explains it as well


def _is_likely(value: np.ndarray) -> bool:
    shift, turn = np.linalg.norm(value[TRANSLATION]), np.linalg.norm(value[ROTATION])
    is_much = shift > _LEAST_M or turn > _LEAST_RAD
    return bool(is_much and shift < _MOST_M and turn < _MOST_RAD)
