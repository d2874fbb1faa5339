"""Moving parts that are off from collection to collection, estimated in the solution.

Each has six numbers in each collection, which are expected near zero; how near is given, or
estimated with them in turns until it stands still (`solvers/moving_spread.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Dict, List, Mapping, Tuple

import numpy as np

from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.moving_parts import Sigmas, telling_collections
from atom_core.calibration.refine.model_errors import checked
from atom_core.calibration.refine.moving_edges import moving_edges
from atom_core.calibration.start.boards import boards_in, solved_dataset
from atom_core.calibration.start.starts import InitialProblem
from atom_core.model.transforms import Edge
from atom_core.problem.builder import FreeEdges, build_problem
from atom_core.problem.moving_blocks import MovingPart
from atom_core.problem.problem import Problem
from atom_core.solvers.base import CONVERGED, SIGMA, Solver, SolverSetup, SolverSummary
from atom_core.solvers.moving_spread import estimated_spreads, is_near
from atom_core.solvers.reweighting import solve_again

FEWEST = 4  # collections that tell; fewer do not tell a spread
_MOST = 3
_ROUNDS, _STILL = 12, 0.01
_UNUSUAL_M, _UNUSUAL_RAD = 0.03, float(np.radians(3.0))
_FIRST = (0.003, float(np.radians(0.3)))
# What a good arm's own calibration, its gears and its bending leave. What is farther off may be a
# scale or a joint, which is not by chance from collection to collection, as is assumed here.
USUAL = (0.0008, float(np.radians(0.1)))
_ANYTHING = (np.inf, np.inf)


@dataclass(frozen=True)
class MovingSolution:
    """A solution with moving parts.

    Attributes:
        solver, summary: of the problem as it is now.
        free: what is estimated.
        remarks: what the user should know.
    """

    solver: Solver
    summary: SolverSummary
    free: FreeEdges
    remarks: Tuple[str, ...] = ()


def with_moving_parts(
    start: InitialProblem,
    solution: MovingSolution,
    parts: Mapping[Edge, Sigmas],
    setup: SolverSetup,
    first: Tuple[float, float] = _FIRST,
) -> MovingSolution:
    """Return the solution with further moving parts.

    Where too few collections tell how far a part is off, it is left where the dataset has it, and
    a remark says so.

    Args:
        start: what the problem was built from, with the parts as the dataset has them.
        solution: without them.
        parts: standard deviations [m, rad] by edge; None: to be estimated.
        setup: which solver.
        first: where the estimated ones begin.
    """
    initial, used = start.initial, {*solution.solver.problem.detections}
    measurements = [m for m in start.measurements if m.key in used]
    moving, remarks = dict(solution.free.moving), list(solution.remarks)
    for edge, sigmas in parts.items():
        told = len(telling_collections(initial, measurements, solution.free, edge))
        if sigmas is None and told < FEWEST:
            remarks.append(_too_few(edge, told))
            continue
        given = {k: c.transforms[edge] for k, c in initial.collections.items()}
        moving[edge] = MovingPart(*(sigmas or first), given, is_estimated=sigmas is None)
    if len(moving) == len(solution.free.moving) or solution.summary.interrupted:
        return replace(solution, remarks=tuple(remarks))
    found = _settled(start, solution, moving, setup)
    return replace(found, remarks=tuple(remarks))


def with_shown_moving_parts(
    start: InitialProblem,
    solution: MovingSolution,
    setup: SolverSetup,
    limit: Tuple[float, float] = _ANYTHING,
) -> MovingSolution:
    """Return the solution with those moving parts that the data show to be off, one after another.

    One is taken where no single error that can be estimated explains half as much.

    Args:
        start: what the problem was built from, with the parts as the dataset has them.
        solution: without them.
        setup: which solver.
        limit: metres and radians; a part that is farther off is left where the dataset has it.
    """
    for _ in range(_MOST):
        solver, summary, loss = solution.solver, solution.summary, setup.options.loss
        if summary.status != CONVERGED or setup.options.weights != SIGMA:
            break
        dataset = solved_dataset(start.initial, solver.problem, summary.x, {})
        found = moving_edges(dataset, solver, summary.x, summary.sigmas, loss)
        if not found:
            break
        best = found[0]
        checks = checked(start.initial, solver, summary, setup.options).checks(summary, loss)
        if best.gain < 2.0 * max((c.gain for c in checks if c.error.option), default=0.0):
            break
        if best.sigma_m > limit[0] or best.sigma_rad > limit[1]:
            break
        first = max(best.sigma_m, _FIRST[0]), max(best.sigma_rad, _FIRST[1])
        edge = Edge(best.last_parent, best.child)
        more = with_moving_parts(start, solution, {edge: None}, setup, first)
        if more.solver is solver or more.summary.status != CONVERGED:
            break
        part = more.free.moving[edge]
        if part.sigma_m > limit[0] or part.sigma_rad > limit[1]:
            break
        solution = more
    return solution


def with_usual_moving_parts(
    start: InitialProblem,
    solution: MovingSolution,
    setup: SolverSetup,
) -> MovingSolution:
    """Return the solution with moving parts that are shown to be off as good arms are; said so."""
    before = solution.free.moving
    found = with_shown_moving_parts(start, solution, setup, USUAL)
    taken = tuple(_taken(edge) for edge in found.free.moving if edge not in before)
    return replace(found, remarks=(*found.remarks, *taken))


def settled_again(
    start: InitialProblem,
    solution: MovingSolution,
    setup: SolverSetup,
) -> MovingSolution:
    """Return the solution with spreads estimated anew, when detections were left out."""
    if not any(part.is_estimated for part in solution.free.moving.values()):
        return solution
    moving = dict(solution.free.moving)
    found = _settled(start, solution, moving, setup)
    return replace(found, remarks=solution.remarks)


def _settled(
    start: InitialProblem,
    solution: MovingSolution,
    moving: Dict[Edge, MovingPart],
    setup: SolverSetup,
) -> MovingSolution:
    """Solve, estimate the spreads, and solve again until they stand still."""
    solver, summary = solution.solver, solution.summary
    for _ in range(_ROUNDS):
        free = replace(solution.free, moving=dict(moving))
        before = solver.problem
        solver = setup.make(rebuilt(start, before, summary.x, free))
        summary = solve_again(solver, setup.options, before, summary)
        estimated = {edge: part for edge, part in moving.items() if part.is_estimated}
        if not estimated or summary.status != CONVERGED:
            break
        loss = setup.options.loss
        found = estimated_spreads(solver, summary.x, summary.sigmas, loss, estimated)
        if all(is_near(part, moving[edge], _STILL) for edge, part in found.items()):
            break
        moving.update(found)
    return MovingSolution(solver, summary, free)


def rebuilt(start: InitialProblem, before: Problem, x: np.ndarray, free: FreeEdges) -> Problem:
    """Return the problem of the same detections, from a solution on, with something else free.

    Args:
        start: what the problem before was built from.
        before: the problem before.
        x: its solution.
        free: what is estimated now.
    """
    base, used = solved_dataset(start.initial, before, x, {}), {*before.detections}
    kept = [m for m in start.measurements if m.key in used]
    return build_problem(base, kept, boards_in(base, kept), free)


def _taken(edge: Edge) -> str:
    return (
        f"the poses of '{edge.child}' in '{edge.parent}' contradict the boards, and no error of a "
        f"sensor or a board explains it: how far they are off was estimated, as with "
        f"--moving_edge_sigma {edge.child}; look at the arm's own calibration, and at whether it "
        f"stood still (--model_errors off believes its poses)"
    )


def _too_few(edge: Edge, told: int) -> str:
    return (
        f"'{edge.child}' is taken to be where the dataset has it: {told} "
        f"collection{' tells' if told == 1 else 's tell'} how far it is off, and {FEWEST} are "
        f"needed; give its standard deviation (--moving_edge_sigma {edge.child} MM DEG)"
    )


def unusual_parts(free: FreeEdges, options: CalibrationOptions) -> List[str]:
    """Return why, where a part that the user did not name is farther off than any robot's is."""
    return [
        f"the poses of '{edge.child}' in '{edge.parent}' would have to be off by "
        f"{1e3 * part.sigma_m:.2g} mm and {np.degrees(part.sigma_rad):.2g} deg along and about "
        f"each axis; look whether they are of the right robot, and of the right time"
        for edge, part in free.moving.items()
        if edge.child not in options.moving_edge_sigma
        and (part.sigma_m > _UNUSUAL_M or part.sigma_rad > _UNUSUAL_RAD)
    ]


def moving_sentences(free: FreeEdges) -> List[str]:
    """Return what was assumed or found of each moving part."""
    return [
        moving_sentence(edge, (part.sigma_m, part.sigma_rad), part.is_estimated)
        for edge, part in free.moving.items()
    ]


def moving_sentence(edge: Edge, sigmas: Tuple[float, float], is_estimated: bool) -> str:
    """Return what was assumed or found of a moving part.

    Args:
        edge: whose poses are off.
        sigmas: standard deviations along each axis [m] and about it [rad].
        is_estimated: they were found; else given.
    """
    return (
        f"the poses of '{edge.child}' in '{edge.parent}' are off by {1e3 * sigmas[0]:.2g} mm and "
        f"{np.degrees(sigmas[1]):.2g} deg along and about each axis "
        f"({'estimated' if is_estimated else 'as given'}); the solution and its sigmas contain it"
    )


def far_parts(free: FreeEdges) -> List[str]:
    """Return in which collections a part is so far off that it is not relied on."""
    return [
        f"the pose of '{edge.child}' in '{edge.parent}' is far off in collection "
        f"{', '.join(sorted(part.far))}, beside all others: it is not relied on there"
        for edge, part in free.moving.items()
        if part.far
    ]
