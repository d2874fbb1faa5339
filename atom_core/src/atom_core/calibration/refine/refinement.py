"""From a rough solution to the final one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Callable, Mapping, NamedTuple, Optional, Tuple

from atom_core.calibration.options import AUTO, SUGGEST, CalibrationOptions
from atom_core.calibration.prepare.moving_parts import Sigmas
from atom_core.calibration.refine.deeper_minima import with_boards_in_deepest_minima
from atom_core.calibration.refine.held_back import cameras_held_back, held_back_in_words
from atom_core.calibration.refine.intrinsics import with_intrinsics
from atom_core.calibration.refine.model_errors import (
    remarks_on,
    with_shown_errors,
    with_usual_errors,
)
from atom_core.calibration.refine.moving_parts import (
    MovingSolution,
    far_parts,
    settled_again,
    with_moving_parts,
    with_shown_moving_parts,
    with_usual_moving_parts,
)
from atom_core.calibration.refine.rejection import (
    Rejected,
    reject_bad_detections,
    rejection_warnings,
    whole_collections,
)
from atom_core.calibration.refine.settling import settled
from atom_core.calibration.refine.shown_joints import with_shown_joints
from atom_core.calibration.start.starts import RoughSolution
from atom_core.model.transforms import Edge
from atom_core.problem.builder import FreeEdges
from atom_core.problem.problem import Problem
from atom_core.solvers.base import (
    CONVERGED,
    SIGMA,
    Solver,
    SolverOptions,
    SolverSetup,
    SolverSummary,
)
from atom_core.solvers.covariance import Covariance
from atom_core.solvers.reweighting import covariance_of, solve, solve_again


class Earlier(NamedTuple):
    """A solution of nearly the same problem; to begin with its sigmas spares rounds."""

    problem: Problem
    summary: SolverSummary


@dataclass(frozen=True)
class Refined:
    """The solution.

    Attributes:
        solver, summary: of the problem as it is in the end.
        free: what was estimated.
        unused: why a collection was not used, by key.
        rejected: detections that were left out since they contradict the others.
        failure: why what is left cannot be calibrated, or None.
        remarks: what the user should know.
        options: of the solution, with the model errors that it has estimated.
    """

    solver: Solver
    summary: SolverSummary
    free: FreeEdges
    unused: Mapping[str, str]
    rejected: Tuple[Rejected, ...]
    failure: Optional[str]
    remarks: Tuple[str, ...]
    options: SolverOptions

    @cached_property
    def covariance(self) -> Covariance:
        """Of the parameters, as the weights have it."""
        return covariance_of(self.solver, self.summary, self.options)


def refine(
    rough: RoughSolution,
    free: FreeEdges,
    moving: Mapping[Edge, Sigmas],
    options: CalibrationOptions,
    setup: SolverSetup,
    earlier: Optional[Earlier] = None,
) -> Refined:
    """Free the intrinsics, solve, move boards to deeper minima, leave bad detections out.

    Args:
        rough: where to go on from.
        free: what is to be estimated, intrinsics included.
        moving: standard deviations [m, rad] of moving parts, None where they are estimated.
        options: what to keep in any case, and what counts as determined.
        setup: which solver.
        earlier: a solution of nearly the same problem, if there is one.
    """
    start, initial = rough.start, rough.start.initial
    solved = partial(_solved, rough, options=options, setup=setup, earlier=earlier)
    first = _with_room_for_cameras(solved, free, setup)
    arms = with_moving_parts(start, first, moving, setup)
    summary, unsettled = settled(arms.solver, arms.summary, setup)
    arms = replace(arms, summary=summary)
    is_auto = options.model_errors == AUTO
    if is_auto:  # first, since what contradicts the others may do so for that reason
        arms = with_shown_joints(start, arms, setup)
        arms = with_shown_moving_parts(start, arms, setup)
        summary, setup = with_shown_errors(initial, arms.solver, arms.summary, setup)
        arms = replace(arms, summary=summary)
    elif options.model_errors == SUGGEST and not options.moving_edge_sigma:
        arms = with_usual_moving_parts(start, arms, setup)
    rejection = reject_bad_detections(start, arms, options, setup)
    arms = rejection.solution
    if rejected := rejection.rejected:
        arms = settled_again(start, arms, setup)
    solver, summary, free = arms.solver, arms.summary, arms.free
    if is_auto:
        summary, setup = with_shown_errors(initial, solver, summary, setup)
    if rejected or is_auto:
        summary, unsettled = settled(solver, summary, setup)
    if is_auto:
        sigma = options.intrinsics_sigma
        summary, setup = with_usual_errors(initial, solver, summary, setup, sigma)
    remarks = remarks_on(options.estimated_errors(initial), summary, setup.options)
    left = {key.collection for key in solver.problem.detections}
    unused = {**rough.start.unused, **whole_collections(rejected, left)}
    left_out = rejection_warnings(rejected, left)
    told = (*arms.remarks, *remarks, *far_parts(free), *unsettled, *left_out)
    return Refined(solver, summary, free, unused, rejected, rejection.failure, told, setup.options)


def _with_room_for_cameras(
    solved: Callable[[FreeEdges], MovingSolution], free: FreeEdges, setup: SolverSetup
) -> MovingSolution:
    """Return the solution, cameras that contradict what is expected taken to be as far off."""
    first = solved(free)
    if first.summary.status != CONVERGED or not first.free.expected_cameras:
        return first
    covariance = covariance_of(first.solver, first.summary, setup.options)
    parameters, expected = first.solver.problem.parameters, free.expected_cameras
    wider = cameras_held_back(parameters, first.summary.x, covariance)
    if not wider:
        return first
    roomy = {name: e._replace(sigma=wider.get(name, e.sigma)) for name, e in expected.items()}
    again = solved(replace(free, expected_cameras=roomy))
    if again.summary.status != CONVERGED:
        return first
    return replace(again, remarks=(*again.remarks, *held_back_in_words(wider, expected)))


def _solved(
    rough: RoughSolution,
    free: FreeEdges,
    options: CalibrationOptions,
    setup: SolverSetup,
    earlier: Optional[Earlier],
) -> MovingSolution:
    """Return the solution in its deepest minimum, moving parts where the dataset has them."""
    joined = with_intrinsics(rough, free, options.undetermined_limit[1], setup)
    begun, minimum = joined.solver.problem, joined.minimum
    known = {(b.sensor, b.kind) for b in earlier.problem.residual_blocks} if earlier else set()
    if (
        earlier is not None
        and known.issuperset((b.sensor, b.kind) for b in begun.residual_blocks)
        and setup.options.weights == SIGMA
        and not minimum.interrupted
    ):
        before = replace(earlier.summary, iterations=minimum.iterations)
        summary = solve_again(joined.solver, setup.options, earlier.problem, before, minimum.x)
    else:
        summary = solve(joined.solver, setup.options, minimum, guess=rough.first)
    solver, summary = with_boards_in_deepest_minima(
        joined.solver, summary, rough.start.measurements, setup.options, setup.make
    )
    return MovingSolution(solver, summary, joined.free, joined.remarks)
