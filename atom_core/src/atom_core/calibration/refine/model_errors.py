"""Model errors that the data show: looked for, and estimated in turn where that is asked for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import List, Sequence, Tuple

from atom_core.calibration.refine.candidates import candidates, nuisances
from atom_core.calibration.refine.error_words import described
from atom_core.calibration.refine.model_checks import ModelCheck, model_checks
from atom_core.model.dataset import Dataset
from atom_core.problem.model_errors import ModelError
from atom_core.problem.residuals import BORDER, ORTHOGONAL, REPROJECTION
from atom_core.solvers.base import CONVERGED, SIGMA, Solver, SolverSetup, SolverSummary
from atom_core.solvers.reweighting import solve_again
from atom_core.solvers.shared_equations import SharedEquations, scalars_of, shared_equations

_MOST = 12
# What the rows of a detection may have in common, be the sensor and the labels ever so good: what
# is less than that is called no error of the model [px, m, m].
COMMON = {REPROJECTION: 0.05, ORTHOGONAL: 0.001, BORDER: 0.002}


@dataclass(frozen=True)
class CheckedSolution:
    """The equations of a solution, with all model errors that it may have.

    Attributes:
        equations: as it was weighted.
        cautious: with what the rows of a detection may have in common.
    """

    equations: SharedEquations
    cautious: SharedEquations

    def checks(self, summary: SolverSummary, loss: str) -> List[ModelCheck]:
        """Return the model errors that the data show, what explains most first."""
        return model_checks(self.equations, self.cautious, tuple(summary.model_errors), loss)


def checked(dataset: Dataset, solver: Solver, summary: SolverSummary, loss: str) -> CheckedSolution:
    """Return the equations of a solution.

    Args:
        dataset: with the intrinsics as given.
        solver: of the problem.
        summary: its solution.
        loss: robust loss.
    """
    problem, x, sigmas = solver.problem, summary.x, summary.sigmas
    errors: List[ModelError] = [*summary.model_errors]
    errors += [e for e in candidates(dataset, problem) if e not in summary.model_errors]
    scalars = scalars_of(problem, x, sigmas, loss, [*errors, *nuisances(problem)])
    equations = solver.equations(x, sigmas, loss)
    return CheckedSolution(
        shared_equations(problem, equations, scalars, sigmas),
        shared_equations(problem, equations, scalars, sigmas, COMMON),
    )


def checks_of(
    dataset: Dataset, solver: Solver, summary: SolverSummary, setup: SolverSetup
) -> List[ModelCheck]:
    """Return the model errors that a solution shows, what explains most first.

    None where the solver did not converge, or the weights are no variances.
    """
    if summary.status != CONVERGED or setup.options.weights != SIGMA:
        return []
    loss = setup.options.loss
    return checked(dataset, solver, summary, loss).checks(summary, loss)


def with_model_errors(
    dataset: Dataset, solver: Solver, summary: SolverSummary, setup: SolverSetup
) -> Tuple[SolverSummary, SolverSetup]:
    """Estimate the model errors that the data show, one after the other, until none is left.

    What cannot be told from another error is left alone.

    Args:
        dataset: with the intrinsics as given.
        solver: of the problem; it goes on from there.
        summary: its solution.
        setup: with the model errors that are estimated already.
    """
    for _ in range(_MOST):
        found = [c for c in checks_of(dataset, solver, summary, setup) if not c.rivals]
        if not found:
            break
        errors = (*setup.options.model_errors, found[0].error)
        more = replace(setup, options=replace(setup.options, model_errors=errors))
        before, problem = summary, solver.problem
        summary = solve_again(solver, more.options, problem, before, before.x)
        if summary.status != CONVERGED:
            solver.take_rows(problem)
            return solve_again(solver, setup.options, problem, before, before.x), setup
        setup = more
    return summary, setup


def remarks_on(estimated: Sequence[ModelError], summary: SolverSummary) -> List[str]:
    """Return a sentence for each model error that was estimated without being asked for."""
    return [
        f"estimated, since the data show it: {error.title}"
        for error in summary.model_errors
        if error not in estimated
    ]


def suggestion(check: ModelCheck) -> str:
    """Return one sentence: what the data show, and which option estimates it."""
    sentence = described(check.error, check.value, check.sigma)
    if check.rivals:
        others = ", ".join(rival.title for rival in check.rivals)
        return f"{sentence}; these boards cannot tell it from: {others}"
    return f"{sentence}: {check.error.option} estimates it"
