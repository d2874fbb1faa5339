"""The calibration, step by step: dataset and options in, calibration out."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_core.calibration.judge.ambiguity import ambiguity
from atom_core.calibration.judge.reasons import Solution
from atom_core.calibration.judge.weak_directions import (
    WeakDirection,
    weak_directions,
    weak_range_offsets,
)
from atom_core.calibration.options import DESCRIPTION, NO_GUESS, CalibrationOptions
from atom_core.calibration.prepare.preparation import Prepared, check_range_offsets, prepare
from atom_core.calibration.refine.deeper_minima import with_boards_in_deepest_minima
from atom_core.calibration.refine.intrinsics import join_intrinsics
from atom_core.calibration.refine.rejection import (
    Rejected,
    reject_bad_detections,
    rejection_warnings,
    whole_collections,
)
from atom_core.calibration.start.boards import solved_dataset
from atom_core.calibration.start.disturb import disturbed
from atom_core.calibration.start.initial_sensors import sensors_from_boards
from atom_core.calibration.start.starts import Posed, best_settled, pose_problem, rescued
from atom_core.model.dataset import Dataset
from atom_core.model.pattern import BoardKey
from atom_core.problem.builder import FreeEdges
from atom_core.problem.problem import Problem
from atom_core.solvers.base import CONVERGED, FAILED, SolverSummary
from atom_core.solvers.choice import solver_factory
from atom_core.solvers.covariance import Covariance
from atom_core.solvers.interrupt import Interrupt
from atom_core.solvers.reweighting import covariance_of, solve

RANK_DEFICIENT = "rank_deficient"


@dataclass(frozen=True)
class Calibration:
    """The answer, and all that is needed to judge it.

    Attributes:
        dataset: the input with the calibrated edges and board poses in its transforms.
        initial: the dataset that the solver started from (after any disturbance).
        free: what was estimated and what was held.
        problem, summary, covariance: of the solver.
        status: converged, not_converged, rank_deficient or failed.
        message: one sentence.
        weak_directions: what the data leave open.
        unused: why a collection was not used, by key.
        rejected: detections that were left out since they contradict the others.
        warnings: what the user should know.
        seconds: time by step.
        seed: of the disturbance.
    """

    dataset: Dataset
    initial: Dataset
    free: FreeEdges
    problem: Problem
    summary: SolverSummary
    covariance: Covariance
    status: str
    message: str
    weak_directions: Tuple[WeakDirection, ...]
    unused: Mapping[str, str]
    rejected: Tuple[Rejected, ...]
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
    options = options or CalibrationOptions()
    options = replace(options, solver=replace(options.solver, range_offsets=options.range_offset))
    clock = _Clock()
    check_range_offsets(dataset, options)
    ready = prepare(dataset, options)
    free, dataset = ready.free, ready.dataset
    warnings = list(dataset.warnings) + ready.remarks
    clock.lap("build")

    held = replace(free, intrinsics={})  # they join when the rest stands
    starts, remarks = _starts(dataset, replace(ready, free=held), options)
    warnings += remarks
    clock.lap("initialise")

    make_solver = solver_factory(options.solver_name)
    with Interrupt() as interrupt:
        how = replace(options.solver, progress=interrupt.watching(options.solver.progress))
        settled, rivals = best_settled(starts, how, make_solver)
        if options.initial_guess == DESCRIPTION and not settled.rough.interrupted:
            settled, remarks = rescued(settled, dataset, held, how, make_solver)
            warnings += remarks
        initial, solver, posed = settled.posed.initial, settled.solver, settled.posed
        rough = settled.rough
        if free.intrinsics and not rough.interrupted:
            limit_rad = options.undetermined_limit[1]
            solver, rough, free, remarks = join_intrinsics(
                settled, free, how, limit_rad, make_solver
            )
            warnings += remarks
        summary = solve(solver, how, rough, guess=settled.first)
        solver, summary = with_boards_in_deepest_minima(
            solver, summary, posed.measurements, how, make_solver
        )
        told = replace(options, solver=how)
        purged = reject_bad_detections(
            initial, solver, summary, posed.measurements, free, told, make_solver
        )
    solver, summary, problem = purged.solver, purged.summary, purged.solver.problem
    left = {key.collection for key in problem.detections}
    unused = {**posed.unused, **whole_collections(purged.rejected, left)}
    warnings += rejection_warnings(purged.rejected, left)
    clock.lap("solve")
    covariance = covariance_of(solver, summary, options.solver)
    solved = solved_dataset(initial, problem, summary.x, _of_use(dataset, posed.boards, problem))
    weak = ambiguity(settled, rivals) + weak_directions(
        Solution(solved, problem, summary.x), covariance, *options.undetermined_limit
    )
    weak += weak_range_offsets(covariance, options.undetermined_limit[0])
    clock.lap("covariance")
    status, message = _verdict(summary, weak, purged.failure)
    return Calibration(
        dataset=solved,
        initial=initial,
        free=free,
        problem=problem,
        summary=summary,
        covariance=covariance,
        status=status,
        message=message,
        weak_directions=tuple(weak),
        unused=unused,
        rejected=purged.rejected,
        warnings=tuple(warnings),
        seconds=clock.laps,
        seed=options.seed,
    )


def _starts(
    dataset: Dataset, ready: Prepared, options: CalibrationOptions
) -> Tuple[List[Posed], List[str]]:
    """Return the starts to try: the description's, or what the data allow; then disturbed."""
    measurements, free = ready.measurements, ready.free
    if options.initial_guess == NO_GUESS:
        estimate = sensors_from_boards(dataset, measurements, free)
        guesses, remarks = [estimate.dataset, *estimate.others], list(estimate.remarks)
    else:
        guesses, remarks = [dataset], []
    posed = []
    for guess in guesses:
        rng = np.random.default_rng(options.seed)
        moved = disturbed(guess, free, *options.noisy_initial_guess, rng)
        posed.append(pose_problem(moved, measurements, free, ready.unused))
    return posed, remarks


def _of_use(
    dataset: Dataset, boards: Mapping[BoardKey, np.ndarray], problem: Problem
) -> Dict[BoardKey, np.ndarray]:
    """Return the boards that some detection of the problem is of."""
    used = {dataset.patterns[k.pattern].board_key(k.collection) for k in problem.detections}
    return {key: pose for key, pose in boards.items() if key in used}


def _verdict(
    summary: SolverSummary, weak: Sequence[WeakDirection], failure: Optional[str]
) -> Tuple[str, str]:
    if failure is not None:
        return FAILED, failure
    if weak and summary.status != FAILED:
        restless = "" if summary.status == CONVERGED else f"; the solver: {summary.message}"
        return RANK_DEFICIENT, f"{len(weak)} undetermined direction(s): {weak[0].why}{restless}"
    return summary.status, summary.message


class _Clock:
    """Seconds by step."""

    def __init__(self) -> None:
        self.laps: Dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self.laps[name] = now - self._last
        self._last = now
