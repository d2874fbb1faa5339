"""What the data say of the model of the sensors, at a solution."""

from __future__ import annotations

from dataclasses import replace
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.calibration.judge.few_stops import few_stops
from atom_core.calibration.judge.misfit import Misfit, misfits
from atom_core.calibration.judge.solved import Solved
from atom_core.calibration.judge.untold_scale import untold_scale
from atom_core.calibration.judge.usual_errors import left_open
from atom_core.calibration.options import AUTO, OFF
from atom_core.calibration.refine.candidates import usual_sizes
from atom_core.calibration.refine.error_words import described, unusual
from atom_core.calibration.refine.held_back import pull_sigma
from atom_core.calibration.refine.joint_candidates import sizes_on_moving_parts
from atom_core.calibration.refine.layer_checks import layer_checks
from atom_core.calibration.refine.model_checks import Hint, ModelCheck
from atom_core.calibration.refine.model_errors import checked, suggestion
from atom_core.calibration.refine.moved_sensors import Motion, moved_sensors
from atom_core.calibration.refine.moving_edges import MovingEdge, moving_edges
from atom_core.calibration.refine.moving_parts import (
    MovingSolution,
    unusual_parts,
    with_moving_parts,
)
from atom_core.calibration.refine.refinement import Refined
from atom_core.calibration.refine.wave_checks import wave_checks
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import BLOCK_SIZE
from atom_core.problem.model_errors import ModelError
from atom_core.problem.residuals import REPROJECTION
from atom_core.solvers.base import CONVERGED, SIGMA, SolverSetup
from atom_core.solvers.covariance import Covariance
from atom_core.solvers.robust_covariance import degrees_of_freedom, sigma_factors

_OF_SCATTER = 0.7  # part of what an arm that is off explains, each collection by itself
_STRONG = 3.0  # sigmas by which what is not estimated may move an edge, and what is be unusual


class Examined(NamedTuple):
    """What the data say of the model.

    Attributes:
        covariance: robust and combined.
        unfit: sensors that fit far worse than by themselves.
        checks: errors of the model that show.
        moving: transforms of moving parts that do not fit.
        moved: a sensor or a board that was moved meanwhile, or is not where its edge puts it.
        remarks: what the user should know of the sigmas.
        size_hints: boards that the data may have of another size.
    """

    covariance: Covariance
    unfit: Tuple[Misfit, ...] = ()
    checks: Tuple[ModelCheck, ...] = ()
    moving: Tuple[MovingEdge, ...] = ()
    moved: Optional[Motion] = None
    remarks: Tuple[str, ...] = ()
    size_hints: Tuple[Hint, ...] = ()


def examined(solved: Solved) -> Examined:
    """Return what the data say of the model; nothing unless the solver has converged."""
    refined, options = solved.refined, solved.options.solver
    summary, make_solver = refined.summary, solved.setup.make
    if summary.status != CONVERGED:
        return Examined(refined.covariance)
    unfit = tuple(misfits(refined.solver, summary.x, summary.sigmas, options.loss, make_solver))
    if options.weights != SIGMA:
        return Examined(refined.covariance, unfit)
    found = _checked(solved)._replace(unfit=unfit)
    moving, moved = _moving(solved, found.checks), found.moved
    scatter = max((edge.gain for edge in moving), default=0.0)
    if moved is not None and moved.gain < _OF_SCATTER * scatter:
        moved = None
    if moved is not None and moved.is_clear:  # what else seems to be wrong may be its trace only
        return found._replace(checks=(), moved=moved)
    return found._replace(moving=tuple(moving), moved=moved)


def beside_moving_parts(found: Examined, solved: Solved) -> Examined:
    """Return the same, with the errors that show where moving parts that do not fit have room.

    What an arm is off by may look like an error of a sensor or a board beside it, or hide one.

    Args:
        found: what the data say where the parts are where the dataset has them.
        solved: the solution.
    """
    if not found.unfit or not found.moving:
        return found
    refined = solved.refined
    parts = {Edge(edge.last_parent, edge.child): None for edge in found.moving}
    before = MovingSolution(refined.solver, refined.summary, refined.free)
    setup = SolverSetup(refined.options, solved.setup.make)
    after = with_moving_parts(solved.start, before, parts, setup)
    if after.solver is before.solver or after.summary.status != CONVERGED:
        return found
    other = replace(refined, solver=after.solver, summary=after.summary, free=after.free)
    return found._replace(checks=_checked(replace(solved, refined=other)).checks)


def of_the_model(solved: Solved, found: Examined) -> List[str]:
    """Return what is wrong with the sensors, and what was moved, the likeliest first."""
    return _with_motion(_contradictions(solved, found), found.moved)


def _contradictions(solved: Solved, found: Examined) -> List[str]:
    """Return what of the model the data contradict, the likeliest cause first."""
    refined, covariance = solved.refined, found.covariance
    shown = strong(found.checks, covariance)
    if found.unfit and not shown:  # the sigmas are as wide as the misfit; what shows explains it
        shown = list(found.checks)
    reasons = [suggestion(check, solved.problem) for check in shown]
    reasons += _unusual(solved, covariance) + unusual_parts(refined.free, solved.options)
    if found.unfit:  # else it is noise that the sigmas know of
        of_parts = [edge.why + _or_of_size(found.size_hints) for edge in found.moving]
        reasons = [*_of_held_boards(refined), *of_parts, *reasons]
    return reasons


def _or_of_size(hints: Sequence[Hint]) -> str:
    """Return what else may be why an arm does not fit: boards of another size."""
    sizes = " and ".join(described(hint.error, hint.value, hint.sigma) for hint in hints)
    return f"; or, as far as the data tell, {sizes}: measure the print" if hints else ""


def _with_motion(reasons: List[str], moved: Optional[Motion]) -> List[str]:
    """Return the reasons with that of a motion: first, or beside an error that tells as much."""
    if moved is not None and moved.is_clear:
        return [moved.why, *reasons]
    if moved is not None and reasons:
        return [f"{reasons[0]}; or {moved.why}", *reasons[1:]]
    return reasons


def _checked(solved: Solved) -> Examined:
    """Return the covariance, robust and combined, the model checks, what moved, what is untold."""
    initial, refined, options = solved.start.initial, solved.refined, solved.options
    loss, estimated = refined.options.loss, tuple(refined.summary.model_errors)
    solution = checked(
        initial,
        refined.solver,
        refined.summary,
        refined.options,
        with_fields=True,
        of_all_motions=options.model_errors == AUTO,
    )
    equations, by_stop = solution.equations, solution.by_stop
    factors = sigma_factors(*by_stop, estimated)
    of_errors = dict(zip(estimated, factors[equations.shared :]))
    freedom = degrees_of_freedom(len(by_stop[0].collections))
    of_blocks = factors[: BLOCK_SIZE * equations.blocks]
    covariance = refined.covariance.robust(of_blocks, of_errors, freedom)
    every = solution.with_fields
    left = (error for error in every.errors if error not in estimated)
    usual = usual_sizes(left, options.intrinsics_sigma)
    usual = sizes_on_moving_parts(usual, initial, refined.free.moving)
    rest = left_open(every, usual)
    follow = None if solution.joint is None else rest.followers(solution.joint, loss)
    covariance = covariance.with_combined(rest.of_blocks(loss), follow)
    cameras = any(b.kind == REPROJECTION for b in refined.solver.problem.residual_blocks)
    untold = few_stops(solution.stops)
    hints = solution.size_hints(refined.summary, loss) if options.model_errors != OFF else []
    untold += untold_scale(every, usual, refined.options.error_priors, cameras, hints)
    found = Examined(covariance, remarks=untold, size_hints=tuple(hints))
    if options.model_errors == OFF:
        return found
    checks = solution.checks(refined.summary, loss)
    checks += layer_checks(
        refined.solver, refined.summary, loss, equations, solution.layers, checks
    )
    checks += wave_checks(initial, refined.solver, refined.summary, refined.options, checks)
    checks = sorted(checks, key=lambda check: -check.gain)
    if refined.free.anchor_patterns:  # boards in a wrong place look like anything
        return found._replace(checks=tuple(checks))
    moved = moved_sensors(initial, refined.solver, refined.summary, loss, solution, checks)
    return found._replace(checks=tuple(checks), moved=moved)


def _moving(solved: Solved, checks: Sequence[ModelCheck]) -> List[MovingEdge]:
    """Return the moving transforms that do not fit, where no single error explains as much."""
    if solved.options.model_errors == OFF:
        return []
    refined = solved.refined
    summary, loss = refined.summary, refined.options.loss
    explained = max((check.gain for check in checks), default=0.0)
    found = moving_edges(solved.dataset, refined.solver, summary.x, summary.sigmas, loss)
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


def _unusual(solved: Solved, covariance: Covariance) -> List[str]:
    """Return why, where an error that was expected to be usual had to be far more.

    Then what was expected decided how it is shared with others, and not the data.
    """
    refined, usual = solved.refined, solved.options.intrinsics_sigma
    values, sigmas = refined.summary.model_errors, covariance.error_sigmas
    priors = {e: prior for e, prior in refined.options.error_priors.items() if e in values}
    # What was given more room, since it is not told from another, is unusual all the same.
    room = usual_sizes([e for e, p in priors.items() if p.mean == 0.0], usual)
    priors = {e: p._replace(sigma=min(p.sigma, room.get(e, p.sigma))) for e, p in priors.items()}
    of_model = covariance.of_model.error_sigmas
    off: Dict[ModelError, float] = {}
    for error, prior in priors.items():
        spread = prior.sigma
        if error in room and abs(values[error]) > prior.sigma:
            spread = pull_sigma(prior.sigma, of_model.get(error, 0.0), sigmas.get(error, 0.0))
        off[error] = abs(values[error] - prior.mean) / spread
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
