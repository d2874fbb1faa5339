"""Boards that stand in a local minimum of the solution, moved to a deeper one.

A robust loss lets a board stand where a part of its labels contradicts it: turned in its plane, or
on the wrong side of its camera's corners. What a board costs depends on its own detections only,
as long as the sensors stay. So each board in question is solved from every pose that its
detections allow; where one ends lower, the board goes there, and all is solved again. The total
cost falls each time.
"""

from __future__ import annotations

from typing import Dict, List, Sequence, Set, Tuple

import numpy as np

from atom_core.calibration.refine.board_fit import BoardFits
from atom_core.calibration.start.boards import restarted
from atom_core.model.labels import DetectionKey
from atom_core.problem.blocks import PATTERN
from atom_core.problem.initial_boards import doubtful_boards
from atom_core.problem.measurements import Measurement
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import REPROJECTION
from atom_core.solvers.base import (
    FAILED,
    SIGMA,
    Solver,
    SolverFactory,
    SolverOptions,
    SolverSummary,
)
from atom_core.solvers.reweighting import solve_again

_ROUNDS = 3
_LOWER = 0.01  # half a chi-square; less is rounding, or the same pose of a symmetric board


def with_boards_in_deepest_minima(
    solver: Solver,
    summary: SolverSummary,
    measurements: Sequence[Measurement],
    options: SolverOptions,
    make_solver: SolverFactory,
) -> Tuple[Solver, SolverSummary]:
    """Move boards to deeper minima and solve again, until none is found.

    Args:
        solver: of the problem.
        summary: its solution.
        measurements: at least those of the problem's detections.
        options: of the solution; with ATOM's weights nothing is done.
        make_solver: which solver.

    Returns:
        Solver and solution, the given ones where every board stands well.
    """
    by_key = {m.key: m for m in measurements}
    for _ in range(_ROUNDS if options.weights == SIGMA else 0):
        if summary.interrupted or summary.status == FAILED:
            break
        moved = _deeper(solver, summary, by_key, options.loss, make_solver)
        if not moved:
            break
        before = solver.problem
        solver, x = restarted(solver, summary.x, moved, make_solver)
        summary = solve_again(solver, options, before, summary, x)
    return solver, summary


def _deeper(
    solver: Solver,
    summary: SolverSummary,
    measurements: Dict[DetectionKey, Measurement],
    loss: str,
    make_solver: SolverFactory,
) -> Dict[int, np.ndarray]:
    """Return the poses of deeper minima, by the index of the board's parameter block."""
    problem, x = solver.problem, summary.x
    moved = {}
    for block, detections in _in_question(solver, summary).items():
        seen = {d: measurements[problem.detections[d]] for d in detections}
        fits = BoardFits(problem, x, summary.sigmas, block, seen, loss, make_solver)
        best = fits.fit(detections)
        if best.cost < fits.cost_now(detections) - _LOWER:
            moved[block] = best.parent_T_pattern
    return moved


def _in_question(solver: Solver, summary: SolverSummary) -> Dict[int, List[int]]:
    """Return the detections of boards that fit badly, or that no camera sees."""
    problem = solver.problem
    units = [np.ones(block.count) for block in problem.residual_blocks]
    doubtful = set(doubtful_boards(problem, solver.squares(summary.x, units)))
    with_corners = _with_corners(problem)
    detections: Dict[int, List[int]] = {}
    corners: Set[int] = set()
    for d, row in enumerate(problem.chains.block):
        for i in row[row >= 0]:
            if problem.parameters.blocks[i].kind == PATTERN:
                detections.setdefault(int(i), []).append(d)
                if d in with_corners:
                    corners.add(int(i))
    return {i: mine for i, mine in detections.items() if i in doubtful or i not in corners}


def _with_corners(problem: Problem) -> Set[int]:
    blocks = [b.detection for b in problem.residual_blocks if b.kind == REPROJECTION]
    return set(np.concatenate(blocks).tolist()) if blocks else set()
