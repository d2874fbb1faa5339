"""Whether a sensor, a fixed board or an arm's base was moved while the collections were made.

Then two poses fit what was seen before and after, and the solution has neither. For every sensor
and every place between two collections, one Gauss-Newton step is taken with six more numbers: by
how much it is elsewhere in the later collections (a structural change at an unknown time: Andrews
1993); and one with how far it creeps from the first collection to the last. What that explains is
compared with how much the collections differ anyway.

A sensor that is elsewhere in all collections is where its edge puts it, unless it shares the edge
with another one, or the edge is not calibrated: then the description is wrong.
"""

from __future__ import annotations

from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np

from atom_core.calibration.refine.changed_focus import Refocused, changed_focus
from atom_core.calibration.refine.model_checks import ModelCheck
from atom_core.calibration.refine.model_errors import CheckedSolution
from atom_core.calibration.refine.moving_edges import moving_runs
from atom_core.calibration.refine.order_of_places import order_of_places
from atom_core.calibration.refine.steps import (
    ALIKE,
    BY_CHANCE,
    CHANCE,
    FEWEST,
    MORE,
    Changes,
    Step,
    all_steps,
    order_of,
    rests_on,
    shared_parts,
    step_at,
    step_between,
)
from atom_core.calibration.start.boards import solved_dataset
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, pose
from atom_core.problem.blocks import BLOCK_SIZE, SENSOR
from atom_core.problem.problem import Problem
from atom_core.solvers.base import Solver, SolverSummary
from atom_core.solvers.detection_columns import DetectionColumns, collection_columns
from atom_core.solvers.normal_equations import NormalEquations, summed
from atom_core.solvers.shared_equations import SharedEquations, inverse, shares_of, tempered

_LEAST_M, _LEAST_RAD = 0.002, float(np.radians(0.1))  # less is nobody's concern
_SAME = 1e-6  # part of a gain by which two differ that are the same but for rounding
_BASE = "base "  # begins the names of bases
_MOST_M, _MOST_RAD = 0.3, float(np.radians(20.0))  # what looks like more is something else


class Moved(NamedTuple):
    """A sensor, a fixed board or an arm's base that stood elsewhere in the later collections.

    Attributes:
        names: it, and others that explain it as well.
        last, first: the collections before and after; of what crept, the first and the last.
        translation_m, rotation_rad: by how much.
        gain: by how much the cost (twice the negative logarithm of the likelihood) would fall.
        stood_still: before and after that; else this is only the largest of many steps.
        crept: little by little, from collection to collection.
        order: a clause, where what crept may depend on the boards' places instead.
    """

    names: Tuple[str, ...]
    last: str
    first: str
    translation_m: float
    rotation_rad: float
    gain: float
    stood_still: bool
    crept: bool = False
    order: str = ""

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
        far = _in_words(self.translation_m, self.rotation_rad)
        if self.crept:
            return (
                f"{one} crept between collections {self.last} and {self.first}, by {far} little by "
                f"little{unsure}: fasten it, let it warm up, and collect again{self.order}"
            )
        jumped = "; or what /tf says of the parts that move in it jumped (homing, odometry)"
        return (
            f"{one} was moved between collections {self.last} and {self.first}, by {far}"
            f"{unsure}: fasten it, and calibrate the collections of one side alone (-csf)"
            f"{jumped if any(name.startswith(_BASE) for name in self.names) else ''}"
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
        off = _in_words(self.translation_m, self.rotation_rad)
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


class OnceElsewhere(NamedTuple):
    """A sensor, a fixed board or an arm's base that stands elsewhere in one stop alone.

    Attributes:
        names: it, and others that explain it as well.
        first, last: the collections of the stop; mostly one.
        translation_m, rotation_rad: by how much.
        gain: as of `Moved`.
        or_moved: a move that explains it as well.
    """

    names: Tuple[str, ...]
    first: str
    last: str
    translation_m: float
    rotation_rad: float
    gain: float
    or_moved: Optional[Moved]

    @property
    def is_clear(self) -> bool:
        """Whether no single error explains nearly as much: else it is not told."""
        return True

    @property
    def why(self) -> str:
        """One sentence for the user."""
        one = " or ".join(self.names)
        where = f"collection {self.first}"
        if self.last != self.first:
            where = f"collections {self.first} to {self.last}"
        far = _in_words(self.translation_m, self.rotation_rad)
        rival = "" if self.or_moved is None else f"; or {self.or_moved.why}"
        return (
            f"{one} seems to be elsewhere in {where} alone, by {far}, which does not tell a wrong "
            f"label from a move: look at the labels there, and correct them, or leave it out "
            f"(-csf '!{self.first}'){rival}"
        )


Motion = Union[Moved, OnceElsewhere, Misplaced, Refocused]


def moved_sensors(
    dataset: Dataset,
    solver: Solver,
    summary: SolverSummary,
    loss: str,
    solution: CheckedSolution,
    others: Sequence[ModelCheck],
) -> Optional[Motion]:
    """Return what was moved, where no single error explains as much, or misplaced; None: nothing.

    Of a camera, its focus instead where this explains it as well. What is misplaced is returned,
    too, where it is but as good an explanation as a single error.

    Args:
        dataset: the order of its collections is that in which they were made.
        solver: of the problem.
        summary: its solution.
        loss: robust loss.
        solution: its equations.
        others: the checks of single errors.
    """
    if len(solution.cautious.collections) < 2 * FEWEST:
        return None
    equations = solver.equations(summary.x, summary.sigmas, loss)
    problem, x, stops = solver.problem, summary.x, solution.stops
    shares = shares_of(problem, summary.sigmas, solution.common, solution.repeated)
    said = tempered(problem, equations, shares, x)
    cautious = _motions(dataset, problem, x, said, solution.cautious, stops)
    best, limit = _clearest(cautious, _unplaced(dataset, problem))
    refocused = changed_focus(dataset, solution, cautious, best, others)
    if refocused is not None or not best:
        return refocused
    name, step = _most_telling(best)
    shares = shares_of(problem, summary.sigmas, summary.common or [0.0] * len(shares))
    said = tempered(problem, equations, shares, x)  # as weighted
    again = _motions(dataset, problem, x, said, solution.equations, stops)
    found = step_between(again, name, step.last, step.first, step.creeps)
    if found is None:
        return None
    explained = max((check.gain for check in others), default=0.0)
    is_clear = found.gain >= MORE * explained + BY_CHANCE
    if not is_clear and not (step.is_of_all and found.gain > ALIKE * explained + BY_CHANCE):
        return None
    names = (name, *(n for n, s in best.items() if n != name and s.gain > ALIKE * step.gain))
    far = (*se3.twist_sizes(found.value), found.gain)
    if step.is_of_all:
        return Misplaced(names, _beside(dataset, name), *far, is_clear)
    order = order_of_places(dataset, problem, x, names) if step.creeps else ""
    moved = Moved(names, *cautious.places(step), *far, step.stood_still, step.creeps, order)
    return _or_once(again, _at_one_stop(cautious, name, step, limit), step, moved)


def _at_one_stop(motions: Changes, name: str, step: Step, limit: float) -> Dict[str, Step]:
    """Return what explains a step as well at one stop alone, by name, the best of it first.

    Args:
        motions: of sensors and boards.
        name: of what has the step.
        step: between two collections.
        limit: of the chance up to which a step is clear.
    """
    best: Dict[str, Step] = {}
    for stop in rests_on(motions, name, step, limit):
        each = {other: step_at(motions, other, stop) for other in motions.columns}
        told = {other: at for other, at in each.items() if at is not None}
        most = max((at.gain for at in told.values()), default=0.0)
        if most > max([ALIKE * step.gain, *(at.gain for at in best.values())]):
            alike = {other: at for other, at in told.items() if at.gain > ALIKE * most}
            first, _ = _most_telling(alike)
            best = {first: alike.pop(first), **alike}
    return best


def _or_once(
    again: Changes, once: Mapping[str, Step], step: Step, moved: Moved
) -> Union[OnceElsewhere, Moved]:
    """Return a move, or what is elsewhere at one stop instead, with the move if it is as good.

    Args:
        again: the motions as weighted.
        once: what explains the step at one stop, by name, the best of it first.
        step: the move's.
        moved: it.
    """
    name, best = next(iter(once.items()), ("", step))
    found = step_at(again, name, best.first) if once else None
    if found is None:
        return moved
    where = again.keys[best.first], again.ends[best.first]
    rival = moved if step.gain > ALIKE * best.gain else None
    return OnceElsewhere(tuple(once), *where, *se3.twist_sizes(found.value), found.gain, rival)


def _unplaced(dataset: Dataset, problem: Problem) -> List[str]:
    """Return the sensors that no calibrated edge of their own puts where they are."""
    blocks = problem.parameters.blocks
    own = {b.names[0] for b in blocks if b.kind == SENSOR and len(b.names) == 1 and b.free.any()}
    return [name for name in dataset.sensors if name not in own]


def _beside(dataset: Dataset, name: str) -> Tuple[str, ...]:
    """Return the other sensors of a sensor's edge."""
    return tuple(other for other in dataset.sensors_on(dataset.sensors[name].edge) if other != name)


def _motions(
    dataset: Dataset,
    problem: Problem,
    x: np.ndarray,
    equations: NormalEquations,
    shared: SharedEquations,
    stops: Mapping[str, str],
) -> Changes:
    """Return the motions, at the vector x."""
    order = order_of(dataset, shared)
    keys = tuple(shared.collections[i] for i in order)
    sums = summed(equations.parts, len(problem.detections), equations.state_jacobians.shape[2])
    columns = {
        name: collection_columns(problem, equations, keys, own)
        for name, own in _turns_and_shifts(dataset, problem, x, *sums).items()
    }
    numbers = np.arange(BLOCK_SIZE * shared.blocks)
    of_all = inverse(shared.total[: len(numbers), : len(numbers)])
    of_shared = shared_parts(shared, order, numbers)
    gradient = shared.gradient[order, : len(numbers)]
    return Changes.of_stops(keys, stops, columns, of_all, of_shared, gradient)


def _turns_and_shifts(
    dataset: Dataset,
    problem: Problem,
    x: np.ndarray,
    information: np.ndarray,
    gradient: np.ndarray,
) -> Dict[str, DetectionColumns]:
    """Return six columns for each sensor, each fixed board, and each base of a moving part.

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
        found[f"board {name}"] = _turned(own, information, gradient, by_twist)
    for name, own in _by_bases(dataset, problem, x).items():
        found[f"{_BASE}'{name}'"] = _turned(own, information, gradient, by_twist)
    return found


def _turned(
    own: np.ndarray, information: np.ndarray, gradient: np.ndarray, by_twist: np.ndarray
) -> DetectionColumns:
    """Return the columns of a twist of which (d, 6, 6) tell what the detections have of it."""
    transposed = np.swapaxes(own, 1, 2)
    slope = np.einsum("dij,di->dj", own, gradient)
    return DetectionColumns(transposed @ information @ own, slope, transposed @ by_twist)


def _by_bases(dataset: Dataset, problem: Problem, x: np.ndarray) -> Dict[str, np.ndarray]:
    """Return (d, 6, 6) by the frame on which an arm stands: the detections' twists by its own."""
    found: Dict[str, np.ndarray] = {}
    runs = moving_runs(dataset, problem)
    if not runs:
        return found
    solved = solved_dataset(dataset, problem, x, {})
    graph = solved.graph
    sensors = set(dataset.sensor_edges)
    for run, walked in runs.items():
        base = run[0].parent
        if sensors & {step.edge for step in graph.chain(dataset.world, base)}:
            continue  # inside a device
        own = found.setdefault(base, np.zeros((len(problem.detections), BLOCK_SIZE, BLOCK_SIZE)))
        for d, sign in walked.items():
            key = problem.detections[d]
            frame = solved.sensors[key.sensor].frame
            sensor_T_base = pose(solved.collections[key.collection], graph, frame, base)
            own[d] += sign * se3.adjoint(sensor_T_base)
    return found


def _clearest(motions: Changes, unplaced: Sequence[str]) -> Tuple[Dict[str, Step], float]:
    """Return the step of each sensor and board that explains most, of those that are clear.

    With them, the chance up to which one is clear.

    Args:
        motions: of sensors and boards.
        unplaced: sensors that may be elsewhere in all collections.
    """
    steps, looked_at = all_steps(motions)
    of_all = [name for name in unplaced if name in motions.columns]
    limit = CHANCE / max(looked_at + len(of_all), 1)
    best: Dict[str, Step] = {}
    for name, found in steps.items():
        clear = [s for s in found if s.chance < limit and _is_likely(s.value)]
        if clear:
            best[name] = max(clear, key=lambda step: step.gain)
    always = {name: step_between(motions, name, -1, 0) for name in of_all}
    most = ALIKE * max((step.gain for step in best.values()), default=0.0)
    clear_always = {
        name: step
        for name, step in always.items()
        if step is not None and step.chance < limit and _is_likely(step.value) and step.gain > most
    }
    return clear_always or best, limit  # a move is told where no place explains it as well


def _most_telling(steps: Mapping[str, Step]) -> Tuple[str, Step]:
    """Return what explains most; the first of those that explain the very same.

    As a board that stands still and the base of the arm before it do.
    """
    most = max(step.gain for step in steps.values())
    return next((n, s) for n, s in steps.items() if s.gain > (1.0 - _SAME) * most)


def _is_likely(value: np.ndarray) -> bool:
    shift, turn = se3.twist_sizes(value)
    is_much = shift > _LEAST_M or turn > _LEAST_RAD
    return bool(is_much and shift < _MOST_M and turn < _MOST_RAD)


def _in_words(translation_m: float, rotation_rad: float) -> str:
    return f"{1e3 * translation_m:.2g} mm and {np.degrees(rotation_rad):.2g} deg"
