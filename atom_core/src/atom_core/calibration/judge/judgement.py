"""What the solution is worth: its covariance, what the data leave open, and the status."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.calibration.judge.ambiguity import ambiguity
from atom_core.calibration.judge.exclusion import Exclusion, exclusions
from atom_core.calibration.judge.few_stops import few_stops
from atom_core.calibration.judge.misfit import Misfit, misfits
from atom_core.calibration.judge.places import Displaced, displaced, exchanged
from atom_core.calibration.judge.priors import (
    HeldDirection,
    PriorResult,
    contradictions,
    held_directions,
    prior_results,
)
from atom_core.calibration.judge.reasons import Solution
from atom_core.calibration.judge.released import Released, Tried, released
from atom_core.calibration.judge.released import why as why_released
from atom_core.calibration.judge.stated_places import StatedPlaces, stated_places
from atom_core.calibration.judge.untold_scale import untold_scale
from atom_core.calibration.judge.usual_errors import left_open
from atom_core.calibration.judge.weak_directions import (
    WeakDirection,
    weak_directions,
    weak_model_errors,
)
from atom_core.calibration.options import DESCRIPTION, OFF, CalibrationOptions
from atom_core.calibration.refine.candidates import usual_sizes
from atom_core.calibration.refine.error_words import unusual
from atom_core.calibration.refine.layer_checks import layer_checks
from atom_core.calibration.refine.model_checks import ModelCheck
from atom_core.calibration.refine.model_errors import checked, suggestion
from atom_core.calibration.refine.moved_sensors import Motion, moved_sensors
from atom_core.calibration.refine.moving_edges import MovingEdge, moving_edges
from atom_core.calibration.refine.moving_parts import unusual_parts
from atom_core.calibration.refine.refinement import Refined
from atom_core.calibration.refine.wave_checks import wave_checks
from atom_core.calibration.start.boards import solved_dataset
from atom_core.calibration.start.starts import ChosenStart, InitialProblem
from atom_core.model.dataset import Dataset
from atom_core.model.pattern import BoardKey
from atom_core.problem.blocks import BLOCK_SIZE
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import REPROJECTION
from atom_core.solvers.base import (
    CONVERGED,
    FAILED,
    NOT_CONVERGED,
    SIGMA,
    SolverFactory,
)
from atom_core.solvers.covariance import Covariance
from atom_core.solvers.reweighting import covariance_of
from atom_core.solvers.robust_covariance import degrees_of_freedom, sigma_factors
from atom_core.solvers.stops import stops_of

_OF_SCATTER = 0.7  # part of what an arm that is off explains, each collection by itself
_STRONG = 3.0  # sigmas by which what is not estimated may move an edge, and what is be unusual
RANK_DEFICIENT, INCONSISTENT = "rank_deficient", "inconsistent"


class Examined(NamedTuple):
    """What the data say of the model.

    Attributes:
        covariance: robust and combined.
        unfit: sensors that fit far worse than by themselves.
        checks: errors of the model that show.
        moving: transforms of moving parts that do not fit.
        moved: a sensor or a board that was moved meanwhile, or is not where its edge puts it.
        remarks: what the user should know of the sigmas.
    """

    covariance: Covariance
    unfit: Sequence[Misfit] = ()
    checks: Sequence[ModelCheck] = ()
    moving: Sequence[MovingEdge] = ()
    moved: Optional[Motion] = None
    remarks: Tuple[str, ...] = ()


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
        checks: errors of the model that the data show.
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


def answer(chosen: ChosenStart, refined: Refined) -> Dataset:
    """Return the dataset with the calibrated edges and board poses in its transforms."""
    start, problem = chosen.solution.start, refined.solver.problem
    boards = _of_use(start.initial, start.boards, problem)
    return solved_dataset(start.initial, problem, refined.summary.x, boards)


def judge(
    described: Dataset,
    chosen: ChosenStart,
    refined: Refined,
    options: CalibrationOptions,
    make_solver: SolverFactory,
) -> Judgement:
    """Judge a solution.

    Args:
        described: the dataset as it was given.
        chosen: the start that it goes back to, with its rivals.
        refined: the solution.
        options: what counts as undetermined.
        make_solver: which solver.
    """
    start, summary, problem = chosen.solution.start, refined.summary, refined.solver.problem
    covariance = covariance_of(refined.solver, summary, refined.options)
    solution = Solution(answer(chosen, refined), problem, summary.x)
    dataset = solution.dataset
    weak = _weak(chosen, refined, solution, covariance, options)
    found = _examined(dataset, start.initial, refined, options, covariance, make_solver)
    covariance, unfit, checks, moving, moved, remarks = found
    known = tuple(prior_results(problem.parameters, summary.x, covariance))
    out = exclusions(start.initial, start.measurements, refined.rejected)
    places = described if options.initial_guess == DESCRIPTION else dataset
    of_model = _contradictions(refined, options, covariance, unfit, checks, moving)
    reasons = exchanged(places, dataset) + _with_motion(of_model, moved)
    reasons += contradictions(known) + [m.why for m in unfit] + [e.why for e in out]
    also = _if_a_fixed_board_moved(dataset, problem) if unfit or moving or out else ""
    contradicted = tuple(why + also for why in reasons) if _is_answer(refined) else ()
    stated = stated_places(dataset, problem, refined.free)
    likely_cause = stated.likely_cause
    elsewhere = _released(chosen, refined, options, make_solver, stated) if contradicted else ()
    if elsewhere:
        contradicted = (why_released(elsewhere, reasons[0]), *contradicted)
        likely_cause, checks = "", [c for c in checks if c.error.target in stated.held]
    status, message = _verdict(refined, weak, contradicted, likely_cause)
    return Judgement(
        dataset,
        covariance,
        weak_directions=tuple(weak),
        held_directions=_held(solution, refined, covariance, options, make_solver),
        priors=known,
        misfits=tuple(unfit),
        exclusions=tuple(out),
        checks=tuple(checks),
        moving=tuple(moving),
        displaced=tuple(displaced(places, dataset)),
        stated=stated,
        status=status,
        message=message,
        contradictions=contradicted,
        remarks=remarks,
    )


def _examined(
    dataset: Dataset,
    initial: Dataset,
    refined: Refined,
    options: CalibrationOptions,
    covariance: Covariance,
    make_solver: SolverFactory,
) -> Examined:
    """Return what the data say of the model; nothing unless the solver has converged."""
    summary, loss = refined.summary, options.solver.loss
    if summary.status != CONVERGED:
        return Examined(covariance)
    unfit = misfits(refined.solver, summary.x, summary.sigmas, loss, make_solver)
    if options.solver.weights != SIGMA:
        return Examined(covariance, unfit)
    covariance, checks, moved, sizes = _checked(initial, refined, options, covariance)
    moving = _moving(dataset, refined, options, checks)
    scatter = max((edge.gain for edge in moving), default=0.0)
    if moved is not None and moved.gain < _OF_SCATTER * scatter:
        moved = None
    if moved is not None and moved.is_clear:  # what else seems to be wrong may be its trace only
        checks, moving = [], []
    remarks = (*few_stops(stops_of(refined.solver.problem, summary.x)), *sizes)
    return Examined(covariance, unfit, checks, moving, moved, remarks)


def _released(
    chosen: ChosenStart,
    refined: Refined,
    options: CalibrationOptions,
    make_solver: SolverFactory,
    stated: StatedPlaces,
) -> Tuple[Released, ...]:
    """Return the sensors that are held and of which each, if it were free, leaves nothing amiss."""
    start = chosen.solution.start

    def look_at(other: Refined) -> Tried:
        covariance = covariance_of(other.solver, other.summary, other.options)
        dataset, x = answer(chosen, other), other.summary.x
        solution = Solution(dataset, other.solver.problem, x)
        weak = weak_directions(solution, covariance, *options.undetermined_limit)
        found = _examined(dataset, start.initial, other, options, covariance, make_solver)
        covariance, unfit, checks, moving, moved, _ = found
        of_model = _contradictions(other, options, covariance, unfit, checks, moving)
        return Tried(not unfit and not _with_motion(of_model, moved), bool(weak))

    return released(start.initial, start.measurements, refined, stated.held, make_solver, look_at)


def _contradictions(
    refined: Refined,
    options: CalibrationOptions,
    covariance: Covariance,
    unfit: Sequence[Misfit],
    checks: Sequence[ModelCheck],
    moving: Sequence[MovingEdge],
) -> List[str]:
    """Return what of the model the data contradict, the likeliest cause first."""
    reasons = [suggestion(c, refined.solver.problem) for c in strong(checks, covariance)]
    reasons += _unusual(refined, options, covariance) + unusual_parts(refined.free, options)
    if unfit:  # else it is noise that the sigmas know of
        reasons = [*_of_held_boards(refined), *(edge.why for edge in moving), *reasons]
    return reasons


def _with_motion(reasons: List[str], moved: Optional[Motion]) -> List[str]:
    """Return the reasons with that of a motion: first, or beside an error that tells as much."""
    if moved is not None and moved.is_clear:
        return [moved.why, *reasons]
    if moved is not None and reasons:
        return [f"{reasons[0]}; or {moved.why}", *reasons[1:]]
    return reasons


def _weak(
    chosen: ChosenStart,
    refined: Refined,
    solution: Solution,
    covariance: Covariance,
    options: CalibrationOptions,
) -> List[WeakDirection]:
    """Return what the data leave open."""
    weak = ambiguity(chosen.solution, chosen.rivals)
    weak += weak_directions(solution, covariance, *options.undetermined_limit)
    weak += weak_model_errors(covariance, options.undetermined_limit[0])
    summary = refined.summary
    if not weak and summary.status == NOT_CONVERGED and not summary.interrupted:
        return _weak_at_the_start(chosen.solution.start, refined, options)
    return weak


def _held(
    solution: Solution,
    refined: Refined,
    covariance: Covariance,
    options: CalibrationOptions,
    make_solver: SolverFactory,
) -> Tuple[HeldDirection, ...]:
    """Return the directions that priors alone hold."""
    if not any(True for _ in solution.problem.parameters.priors()):
        return ()
    solver = make_solver(solution.problem.without_priors())
    of_data = covariance_of(solver, refined.summary, refined.options)
    return tuple(held_directions(solution, covariance, of_data, *options.undetermined_limit))


def _checked(
    initial: Dataset, refined: Refined, options: CalibrationOptions, covariance: Covariance
) -> Tuple[Covariance, List[ModelCheck], Optional[Motion], Tuple[str, ...]]:
    """Return the covariance, robust and combined, the model checks, what moved, what is untold."""
    loss, estimated = refined.options.loss, tuple(refined.summary.model_errors)
    solution = checked(initial, refined.solver, refined.summary, refined.options, with_fields=True)
    equations, by_stop = solution.equations, solution.by_stop
    factors = sigma_factors(*by_stop, estimated)
    of_errors = dict(zip(estimated, factors[equations.shared :]))
    freedom = degrees_of_freedom(len(by_stop[0].collections))
    of_blocks = factors[: BLOCK_SIZE * equations.blocks]
    covariance = covariance.robust(of_blocks, of_errors, freedom)
    every = solution.with_fields
    left = (error for error in every.errors if error not in estimated)
    usual = usual_sizes(left, options.intrinsics_sigma)
    rest = left_open(every, usual)
    follow = None if solution.joint is None else rest.followers(solution.joint, loss)
    covariance = covariance.with_combined(rest.of_blocks(loss), follow)
    cameras = any(b.kind == REPROJECTION for b in refined.solver.problem.residual_blocks)
    untold = untold_scale(every, usual, refined.options.error_priors, cameras)
    if options.model_errors == OFF:
        return covariance, [], None, untold
    checks = solution.checks(refined.summary, loss)
    checks += layer_checks(
        refined.solver, refined.summary, loss, equations, solution.layers, checks
    )
    checks += wave_checks(initial, refined.solver, refined.summary, refined.options, checks)
    checks = sorted(checks, key=lambda check: -check.gain)
    if refined.free.anchor_patterns:  # boards in a wrong place look like anything
        return covariance, checks, None, untold
    moved = moved_sensors(initial, refined.solver, refined.summary, loss, solution, checks)
    return covariance, checks, moved, untold


def _moving(
    dataset: Dataset, refined: Refined, options: CalibrationOptions, checks: Sequence[ModelCheck]
) -> List[MovingEdge]:
    """Return the moving transforms that do not fit, where no single error explains as much."""
    if options.model_errors == OFF:
        return []
    summary, loss = refined.summary, refined.options.loss
    explained = max((check.gain for check in checks), default=0.0)
    found = moving_edges(dataset, refined.solver, summary.x, summary.sigmas, loss)
    return [edge for edge in found if edge.gain > 2.0 * explained]


def strong(checks: Sequence[ModelCheck], covariance: Covariance) -> List[ModelCheck]:
    """Return the checks that would move any edge by more than three of its sigmas.

    All of them where none does so by itself, but all together do.
    """
    limits = _STRONG * np.sqrt(np.maximum(np.diagonal(covariance.shared), 1e-30))
    moves = [check.moves[: len(limits)] for check in checks]
    alone = [check for check, move in zip(checks, moves) if np.any(np.abs(move) > limits)]
    if alone or not checks:
        return alone
    return list(checks) if np.any(np.abs(np.sum(moves, axis=0)) > limits) else []


def _unusual(refined: Refined, options: CalibrationOptions, covariance: Covariance) -> List[str]:
    """Return why, where an error that was expected to be usual had to be far more.

    Then what was expected decided how it is shared with others, and not the data.
    """
    values, sigmas = refined.summary.model_errors, covariance.error_sigmas
    priors = {e: prior for e, prior in refined.options.error_priors.items() if e in values}
    # What was given more room, since it is not told from another, is unusual all the same.
    room = usual_sizes([e for e, p in priors.items() if p.mean == 0.0], options.intrinsics_sigma)
    priors = {e: p._replace(sigma=min(p.sigma, room.get(e, p.sigma))) for e, p in priors.items()}
    off = {e: abs(values[e] - prior.mean) / prior.sigma for e, prior in priors.items()}
    far = [e for e in off if e.stands_alone and off[e] > _STRONG]
    far.sort(key=lambda e: -off[e])
    return [unusual(e, values[e], sigmas.get(e, 0.0), priors[e]) for e in far]


def _of_held_boards(refined: Refined) -> Tuple[str, ...]:
    """Return a sentence where boards are held: their wrong place looks like any other error."""
    if not refined.free.anchor_patterns:
        return ()
    return (
        "the sensors do not fit the boards where these are held (--anchor_patterns); leave the "
        "option out, and the boards are estimated",
    )


def _if_a_fixed_board_moved(dataset: Dataset, problem: Problem) -> str:
    """Return the rest of a sentence about what does not fit; '' where each board may move."""
    patterns = sorted({key.pattern for key in problem.detections})
    names = [f"'{name}'" for name in patterns if dataset.patterns[name].fixed]
    if not names:
        return ""
    parents = dict.fromkeys(dataset.patterns[name].parent_frame for name in patterns)
    return (
        f"; if board {', '.join(names)}, configured `fixed: true`, was moved between collections, "
        f"use those of one place (-csf), or set `fixed: false`; if it does not stand in its "
        f"parent_link ({', '.join(parents)}), correct that"
    )


def _weak_at_the_start(
    start: InitialProblem, refined: Refined, options: CalibrationOptions
) -> List[WeakDirection]:
    """Return what was undetermined where the solver began.

    A solver that finds no rest may have drifted along such a direction until something stopped it,
    as the corner of a board does with an end of a 2D LiDAR's cut; there it looks determined.
    """
    problem = refined.solver.problem
    x = np.zeros_like(refined.summary.x)
    summary = replace(refined.summary, x=x)
    covariance = covariance_of(refined.solver, summary, refined.options)
    boards = _of_use(start.initial, start.boards, problem)
    solution = Solution(solved_dataset(start.initial, problem, x, boards), problem, x)
    return weak_directions(solution, covariance, *options.undetermined_limit)


def _of_use(
    dataset: Dataset, boards: Mapping[BoardKey, np.ndarray], problem: Problem
) -> Dict[BoardKey, np.ndarray]:
    """Return the boards that some detection of the problem is of."""
    used = {dataset.patterns[k.pattern].board_key(k.collection) for k in problem.detections}
    return {key: pose for key, pose in boards.items() if key in used}


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
