"""Joints whose positions the data show to be off are estimated, one after another."""

from __future__ import annotations

from dataclasses import replace

from atom_core.calibration.refine.model_errors import checked
from atom_core.calibration.refine.moving_parts import MovingSolution, rebuilt
from atom_core.calibration.start.starts import InitialProblem
from atom_core.model.joints import POSITION_BIAS
from atom_core.problem.model_errors import JointOffset
from atom_core.solvers.base import CONVERGED, SIGMA, SolverSetup
from atom_core.solvers.reweighting import solve_again

_MOST = 7


def with_shown_joints(
    start: InitialProblem,
    solution: MovingSolution,
    setup: SolverSetup,
) -> MovingSolution:
    """Return the solution with offsets of joints, as long as one explains most.

    What cannot be told from another error is left alone.

    Args:
        start: what the problem was built from, with intrinsics and joints as given.
        solution: without them.
        setup: which solver.
    """
    for _ in range(_MOST):
        solver, summary, loss = solution.solver, solution.summary, setup.options.loss
        if summary.status != CONVERGED or setup.options.weights != SIGMA:
            break
        if not start.initial.joints:
            break
        checks = checked(start.initial, solver, summary, setup.options).checks(summary, loss)
        shown = [check for check in checks if not check.rivals]
        if not shown or not isinstance(shown[0].error, JointOffset) or not shown[0].error.option:
            break
        name, before = shown[0].error.target, solver.problem
        joints = {**solution.free.joints, name: (POSITION_BIAS,)}
        free = replace(solution.free, joints=joints)
        solver = setup.make(rebuilt(start, before, summary.x, free))
        summary = solve_again(solver, setup.options, before, summary)
        if summary.status != CONVERGED:
            break
        remark = f"estimated, since the data show it: {shown[0].error.title}"
        remarks = (*solution.remarks, remark)
        solution = MovingSolution(solver, summary, free, remarks)
    return solution
