"""What the solution is worth: its covariance, what the data leave open, and the status."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import List, Sequence, Tuple

import numpy as np

from atom_core.calibration.judge.ambiguity import ambiguity
from atom_core.calibration.judge.examination import (
    beside_moving_parts,
    examined,
    of_the_model,
)
from atom_core.calibration.judge.exclusion import Exclusion, exclusions
from atom_core.calibration.judge.misfit import Misfit
from atom_core.calibration.judge.places import Displaced, displaced, exchanged
from atom_core.calibration.judge.priors import (
    HeldDirection,
    PriorResult,
    contradictions,
    held_directions,
    prior_results,
)
from atom_core.calibration.judge.released import Tried, released
from atom_core.calibration.judge.released import why as why_released
from atom_core.calibration.judge.solved import Solved
from atom_core.calibration.judge.stated_places import StatedPlaces, stated_places
from atom_core.calibration.judge.weak_directions import (
    WeakDirection,
    weak_directions,
    weak_model_errors,
)
from atom_core.calibration.options import DESCRIPTION
from atom_core.calibration.refine.model_checks import ModelCheck
from atom_core.calibration.refine.moving_edges import MovingEdge
from atom_core.calibration.refine.refinement import Refined
from atom_core.errors import quoted
from atom_core.model.dataset import Dataset
from atom_core.problem.problem import Problem
from atom_core.solvers.base import CONVERGED, FAILED, NOT_CONVERGED
from atom_core.solvers.covariance import Covariance
from atom_core.solvers.reweighting import covariance_of

RANK_DEFICIENT, INCONSISTENT = "rank_deficient", "inconsistent"


@dataclass(frozen=True)
class Judgement:
    """What a solution is worth.

    Attributes:
        dataset: with the calibrated edges and board poses in its transforms.
        covariance: of the parameters.
        weak_directions: what the data leave open.
        held_directions: what they leave open and priors hold.
        priors: how far the solution is from each prior.
        misfits: sensors that the joint solution fits far worse than they fit by themselves.
        exclusions: sensors of which too much was left out, or all of one sort.
        checks: errors of the model that the data show, and that were not estimated.
        moving: transforms of moving parts that do not fit.
        displaced: edges that end far from where the description has them, where that was to be
            the start.
        stated: sensors whose place was stated though the data could tell it.
        status: converged, not_converged, rank_deficient, inconsistent or failed.
        message: one sentence.
        contradictions: sentences on what of the model the data contradict, the likeliest cause
            first; also where they leave something open.
        remarks: what the user should know of the sigmas.
    """

    dataset: Dataset
    covariance: Covariance
    weak_directions: Tuple[WeakDirection, ...]
    held_directions: Tuple[HeldDirection, ...]
    priors: Tuple[PriorResult, ...]
    misfits: Tuple[Misfit, ...]
    exclusions: Tuple[Exclusion, ...]
    checks: Tuple[ModelCheck, ...]
    moving: Tuple[MovingEdge, ...]
    displaced: Tuple[Displaced, ...]
    stated: StatedPlaces
    status: str
    message: str
    contradictions: Tuple[str, ...]
    remarks: Tuple[str, ...]


def judge(solved: Solved) -> Judgement:
    """Judge a solution."""
    start, refined, dataset, problem = solved.start, solved.refined, solved.dataset, solved.problem
    weak = _weak(solved)
    found = beside_moving_parts(examined(solved), solved)
    known = tuple(prior_results(problem.parameters, refined.summary.x, found.covariance))
    out = exclusions(start.initial, start.measurements, refined.rejected)
    places = solved.given if solved.options.initial_guess == DESCRIPTION else dataset
    reasons = exchanged(places, dataset) + of_the_model(solved, found)
    reasons += contradictions(known) + [m.why for m in found.unfit] + [e.why for e in out]
    also = _if_a_fixed_board_moved(dataset, problem) if found.unfit or found.moving or out else ""
    contradicted = tuple(why + also for why in reasons) if _is_answer(refined) else ()
    stated = stated_places(dataset, problem, refined.free)
    why_held = _why_held(solved, stated, reasons)
    cause = "" if why_held else stated.likely_cause
    status, message = _verdict(refined, weak, why_held + contradicted, cause)
    return Judgement(
        dataset,
        found.covariance,
        weak_directions=tuple(weak),
        held_directions=_held(solved, found.covariance),
        priors=known,
        misfits=found.unfit,
        exclusions=tuple(out),
        checks=tuple(c for c in found.checks if not why_held or c.error.target in stated.held),
        moving=found.moving,
        displaced=tuple(displaced(places, dataset)),
        stated=stated,
        status=status,
        message=message,
        contradictions=why_held + contradicted,
        remarks=found.remarks,
    )


def _why_held(solved: Solved, stated: StatedPlaces, reasons: Sequence[str]) -> Tuple[str, ...]:
    """Return the sensors that are held and of which each, if it were free, leaves nothing amiss.

    In a sentence; () where there are none, or no reasons why something is amiss.
    """
    if not reasons or not _is_answer(solved.refined):
        return ()
    elsewhere = released(solved, stated.held, _tried)
    return (why_released(elsewhere, reasons[0]),) if elsewhere else ()


def _tried(solved: Solved) -> Tried:
    """Return what another solution is worth."""
    limits = solved.options.undetermined_limit
    weak = weak_directions(solved.solution, solved.refined.covariance, *limits)
    found = examined(solved)
    amiss = found.unfit or of_the_model(solved, found)
    return Tried(not amiss, bool(weak))


def _weak(solved: Solved) -> List[WeakDirection]:
    """Return what the data leave open."""
    chosen, refined, limits = solved.chosen, solved.refined, solved.options.undetermined_limit
    weak = ambiguity(chosen.solution, chosen.rivals)
    weak += weak_directions(solved.solution, refined.covariance, *limits)
    weak += weak_model_errors(refined.covariance, limits[0])
    summary = refined.summary
    if not weak and summary.status == NOT_CONVERGED and not summary.interrupted:
        return _weak_at_the_start(solved)
    return weak


def _held(solved: Solved, covariance: Covariance) -> Tuple[HeldDirection, ...]:
    """Return the directions that priors alone hold."""
    refined, limits = solved.refined, solved.options.undetermined_limit
    if not any(True for _ in solved.problem.parameters.priors()):
        return ()
    solver = solved.setup.make(solved.problem.without_priors())
    of_data = covariance_of(solver, refined.summary, refined.options)
    return tuple(held_directions(solved.solution, covariance, of_data, *limits))


def _if_a_fixed_board_moved(dataset: Dataset, problem: Problem) -> str:
    """Return the rest of a sentence about what does not fit; '' where each board may move."""
    patterns = sorted({key.pattern for key in problem.detections})
    names = [name for name in patterns if dataset.patterns[name].fixed]
    if not names:
        return ""
    parents = dict.fromkeys(dataset.patterns[name].parent_frame for name in patterns)
    return (
        f"; if board {quoted(names)}, configured `fixed: true`, was moved between collections, "
        f"use those of one place (-csf), or set `fixed: false`; if it does not stand in its "
        f"parent_link ({', '.join(parents)}), correct that"
    )


def _weak_at_the_start(solved: Solved) -> List[WeakDirection]:
    """Return what was undetermined where the solver began.

    A solver that finds no rest may have drifted along such a direction until something stopped it,
    as the corner of a board does with an end of a 2D LiDAR's cut; there it looks determined.
    """
    summary, limits = solved.refined.summary, solved.options.undetermined_limit
    x = np.zeros_like(summary.x)
    began = replace(solved.refined, summary=replace(summary, x=x))
    return weak_directions(solved.at(x), began.covariance, *limits)


def _is_answer(refined: Refined) -> bool:
    """Tell whether there is anything that can be contradicted."""
    summary = refined.summary
    # What contradicts may be why the weights did not settle, unless the run was stopped.
    unsettled = not summary.settled and not summary.interrupted
    return refined.failure is None and (summary.status == CONVERGED or unsettled)


def _verdict(
    refined: Refined,
    weak: Sequence[WeakDirection],
    contradicted: Sequence[str],
    likely_cause: str,
) -> Tuple[str, str]:
    """Return status and message; the likely cause ends what is contradicted or failed."""
    summary = refined.summary
    if refined.failure is not None:
        return FAILED, refined.failure + likely_cause
    if summary.interrupted:  # what is open or contradicted there may not be so at the end
        return NOT_CONVERGED, summary.message
    restless = "" if summary.status == CONVERGED else f"; the solver: {summary.message}"
    if weak and summary.status != FAILED:
        opened = f"{len(weak)} undetermined direction(s): {weak[0].why}{restless}"
        if not contradicted:
            return RANK_DEFICIENT, opened
        also = f"; and the data contradict the rest: {contradicted[0]}{likely_cause}"
        return RANK_DEFICIENT, opened + also
    if contradicted:
        return INCONSISTENT, contradicted[0] + restless + likely_cause
    return summary.status, summary.message + (likely_cause if summary.status == FAILED else "")
