"""The calibration, step by step: dataset and options in, calibration out."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Dict, Mapping, Optional, Tuple

from atom_core.calibration.judge.judgement import Judgement, judge
from atom_core.calibration.judge.solved import Solved
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.preparation import prepare
from atom_core.calibration.refine.refinement import Earlier, refine
from atom_core.calibration.refine.rejection import Rejected
from atom_core.calibration.start.half_turns import with_half_turns
from atom_core.calibration.start.starts import choose_start, find_starts
from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey
from atom_core.problem.builder import FreeEdges
from atom_core.problem.measurements import Measured
from atom_core.problem.model_errors import ErrorPriors
from atom_core.problem.problem import Problem
from atom_core.solvers.base import SolverSetup, SolverSummary
from atom_core.solvers.choice import solver_factory
from atom_core.solvers.error_columns import without_rows
from atom_core.solvers.interrupt import Interrupt


@dataclass(frozen=True)
class Calibration(Judgement):
    """The answer: what it is worth, and what it was made from.

    Attributes:
        initial: the dataset that the solver started from (after any disturbance).
        free: what was estimated and what was held.
        problem, summary: of the solver.
        error_priors: what was assumed of estimated errors of the model; the others were free.
        unused: why a collection was not used, by key.
        rejected: detections that were left out since they contradict the others.
        relabeled: detections whose corners were renumbered; ``dataset`` has them so.
        warnings: what the user should know, of all steps.
        seconds: time by step.
        seed: of the disturbance.
    """

    initial: Dataset
    free: FreeEdges
    problem: Problem
    summary: SolverSummary
    error_priors: ErrorPriors
    unused: Mapping[str, str]
    rejected: Tuple[Rejected, ...]
    relabeled: Tuple[DetectionKey, ...]
    warnings: Tuple[str, ...]
    seconds: Mapping[str, float]
    seed: int


def calibrate(dataset: Dataset, options: Optional[CalibrationOptions] = None) -> Calibration:
    """Estimate the selected edges of a dataset, and its board poses.

    Args:
        dataset: already reduced to the selected sensors, collections and patterns.
        options: what to hold, how to solve.

    Raises:
        AtomError: the calibration cannot be posed; one sentence says why and what to do.
    """
    return judged(solved(dataset, options or CalibrationOptions()))


def solved(
    dataset: Dataset,
    options: CalibrationOptions,
    read_before: Mapping[DetectionKey, Measured] = MappingProxyType({}),
    earlier: Optional[Earlier] = None,
) -> Solved:
    """Do what ``calibrate`` does, without the judgement.

    Args:
        dataset: already reduced to the selected sensors, collections and patterns.
        options: what to hold, how to solve.
        read_before: what was read of detections that are the same still.
        earlier: a solution of nearly the same problem; it saves time, and leaves the answer.

    Raises:
        AtomError: the calibration cannot be posed; one sentence says why and what to do.
    """
    clock = _Clock()
    prepared = prepare(dataset, options, read_before)
    clock.lap("build")
    starts = find_starts(prepared, options)
    clock.lap("initialise")
    with Interrupt() as interrupt:
        setup, unseen = _setup(dataset, options, interrupt, starts.problems[0].problem)
        prepared = replace(prepared, remarks=(*prepared.remarks, *unseen))
        chosen = choose_start(starts, prepared, options, setup)
        chosen = with_half_turns(chosen, starts, prepared, setup)
        refined = refine(chosen.solution, prepared.free, prepared.moving, options, setup, earlier)
    clock.lap("solve")
    return Solved(dataset, options, prepared, starts, chosen, refined, setup, clock.laps)


def judged(solution: Solved) -> Calibration:
    """Return the calibration with all that tells what it is worth."""
    clock = _Clock()
    chosen, refined, prepared = solution.chosen, solution.refined, solution.prepared
    judgement = judge(solution)
    clock.lap("covariance")
    steps = (prepared, solution.starts, chosen, refined, judgement)
    return Calibration(
        **vars(judgement),
        initial=solution.start.initial,
        free=refined.free,
        problem=solution.problem,
        summary=refined.summary,
        error_priors=refined.options.error_priors,
        unused=refined.unused,
        rejected=refined.rejected,
        relabeled=_relabeled(solution.given, judgement.dataset),
        warnings=(*prepared.dataset.warnings, *(r for step in steps for r in step.remarks)),
        seconds={**solution.seconds, **clock.laps},
        seed=solution.options.seed,
    )


def _relabeled(before: Dataset, after: Dataset) -> Tuple[DetectionKey, ...]:
    return tuple(key for key, label in after.detections() if label is not before.label(key))


def _setup(
    dataset: Dataset, options: CalibrationOptions, interrupt: Interrupt, problem: Problem
) -> Tuple[SolverSetup, Tuple[str, ...]]:
    """Return which solver; and what is not estimated though it was to be."""
    of_solver = options.solver_options(dataset)
    progress = interrupt.watching(of_solver.progress)
    unseen = without_rows(problem, of_solver.model_errors, of_solver.error_priors)
    errors = tuple(error for error in of_solver.model_errors if error not in unseen)
    of_solver = replace(of_solver, progress=progress, model_errors=errors)
    said = tuple(
        f"{option}: no label depends on it, and it is not estimated"
        for option in dict.fromkeys(error.option for error in unseen)
    )
    return SolverSetup(of_solver, solver_factory(options.solver_name)), said


class _Clock:
    """Seconds by step."""

    def __init__(self) -> None:
        self.laps: Dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self.laps[name] = now - self._last
        self._last = now
