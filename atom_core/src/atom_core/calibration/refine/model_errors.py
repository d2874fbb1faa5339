"""Model errors that the data show: looked for, and estimated in turn where that is asked for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Collection, Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_core.calibration.refine.candidates import (
    candidates,
    nuisances,
    range_fields,
    usual_sizes,
)
from atom_core.calibration.refine.error_words import UNESTIMATED, described, remedy
from atom_core.calibration.refine.layer_checks import LayerSums, layer_sums
from atom_core.calibration.refine.model_checks import (
    UNUSUAL,
    Hint,
    ModelCheck,
    hints,
    model_checks,
    sigma_beside,
)
from atom_core.model.dataset import Dataset
from atom_core.problem.blocks import ADDITIONAL_TF
from atom_core.problem.board_errors import BoardSize, SeenBorder
from atom_core.problem.model_errors import (
    WITH_ALL,
    ErrorPrior,
    ErrorPriors,
    JointPositionError,
    ModelError,
)
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import BORDER, ORTHOGONAL, REPROJECTION, RangeBlock
from atom_core.solvers.base import (
    CONVERGED,
    SIGMA,
    Solver,
    SolverOptions,
    SolverSetup,
    SolverSummary,
)
from atom_core.solvers.detection_noise import weighted_by_detections
from atom_core.solvers.normal_equations import NormalEquations
from atom_core.solvers.reweighting import solve_again
from atom_core.solvers.scalar_columns import Scalars, scalars_of
from atom_core.solvers.scalars import JointScalars, joint_of
from atom_core.solvers.shared_equations import (
    SharedEquations,
    shared_equations,
    shares_of,
    tempered,
)
from atom_core.solvers.stops import by_stop, repeats, stops_of

_MOST = 12
_SURE = 3.0  # sigmas by which an error differs from what a moving part may be off by
_STILL = 1e-4  # entries of a transform [m, 1] that does not move
# What the rows of a detection may have in common, be the sensor and the labels ever so good: what
# is less than that is called no error of the model [px, m, m].
COMMON = {REPROJECTION: 0.05, ORTHOGONAL: 0.001, BORDER: 0.002}


@dataclass(frozen=True)
class CheckedSolution:
    """The equations of a solution, with all model errors that it may have.

    Attributes:
        equations: as it was weighted.
        common: by residual block, what the rows of a detection may have in common.
        cautious: with that.
        with_fields: as it was weighted, with the errors that differ from ray to ray as well, where
            they were asked for.
        layers: what the data say of LiDARs' layers, likewise.
        stops: the first collection of its stop by collection.
        repeated: (d,) how often each detection's stop has it.
        joint: of all scalars beside the poses, where fields were asked for and a transform has a
            value in each collection; else None.
    """

    equations: SharedEquations
    common: Tuple[float, ...]
    cautious: SharedEquations
    with_fields: SharedEquations
    layers: Tuple[LayerSums, ...]
    stops: Mapping[str, str]
    repeated: np.ndarray
    joint: Optional[JointScalars]

    def checks(self, summary: SolverSummary, loss: str) -> List[ModelCheck]:
        """Return the model errors that the data show, what explains most first."""
        return model_checks(*self.by_stop, tuple(summary.model_errors), loss)

    def size_hints(self, summary: SolverSummary, loss: str) -> List[Hint]:
        """Return the boards that the data may have of another size."""
        return hints(self.by_stop[0], tuple(summary.model_errors), BoardSize, loss)

    def may_be_of_motions(self, check: ModelCheck, known: Collection[ModelError]) -> bool:
        """Tell whether moving parts that are off explain an error, none ten times as unusual.

        As the scale of an arm does that of a board before a camera alone.

        Args:
            check: what the data show.
            known: errors that the solution has estimated.
        """
        rest = [e for e in self.equations.errors if e not in known]
        rest = [e for e in rest if not isinstance(e, SeenBorder)]
        of_motions = [e for e in rest if isinstance(e, JointPositionError)]
        if not of_motions or check.error in of_motions:
            return False
        room = UNUSUAL * max(abs(check.value) / check.error.usual, 1.0)
        sizes = usual_sizes(rest, None)
        sizes.update({error: room * error.usual for error in of_motions})
        return abs(check.value) < _SURE * sigma_beside(self.equations, check.error, sizes)

    @property
    def by_stop(self) -> Tuple[SharedEquations, SharedEquations]:
        """The equations, as weighted and cautious, of stops instead of collections."""
        return by_stop(self.equations, self.stops), by_stop(self.cautious, self.stops)


def checked(
    dataset: Dataset,
    solver: Solver,
    summary: SolverSummary,
    options: SolverOptions,
    with_fields: bool = False,
    of_all_motions: bool = False,
) -> CheckedSolution:
    """Return the equations of a solution.

    Args:
        dataset: with the intrinsics as given.
        solver: of the problem.
        summary: its solution.
        options: robust loss, and priors of the model errors that it has estimated.
        with_fields: with the errors that differ from ray to ray.
        of_all_motions: with those of all moving parts, as of `candidates`.
    """
    problem, x, sigmas, loss = solver.problem, summary.x, summary.sigmas, options.loss
    known: List[ModelError] = [*summary.model_errors]
    others = candidates(dataset, problem, x, of_all_motions)
    errors = known + [e for e in others if e not in known]
    # Corrected points have other elevations, by their rounding, and so have their layers.
    sorts = {(error.kind, error.target) for error in known}
    every = range_fields(dataset, problem) if with_fields else []
    fields = [field for field in every if (field.kind, field.sensor) not in sorts]
    errors += nuisances(problem)
    scalars = scalars_of(solver, x, sigmas, loss, errors, fields)
    equations = solver.equations(x, sigmas, loss)
    blocks, priors = problem.residual_blocks, options.error_priors
    common = summary.common or [0.0] * len(blocks)
    at_least = [max(part, COMMON[block.kind]) for part, block in zip(common, blocks)]
    whole = shared_equations(problem, equations, scalars, sigmas, priors, common)
    shares = shares_of(problem, sigmas, common)
    few, stops = scalars.without_fields(), stops_of(problem, x)
    repeated = repeats(problem, stops)
    return CheckedSolution(
        whole.without_fields(),
        tuple(at_least),
        shared_equations(problem, equations, few, sigmas, priors, at_least, repeated),
        whole,
        layer_sums(problem, scalars, shares),
        stops,
        repeated,
        _joint(problem, equations, scalars, shares, priors) if with_fields else None,
    )


def _joint(
    problem: Problem,
    equations: NormalEquations,
    scalars: Scalars,
    shares: Sequence[np.ndarray],
    priors: ErrorPriors,
) -> Optional[JointScalars]:
    """Return all scalars beside the poses; None where no transform has a value in each collection.

    Arguments as of `joint_of`, but for the equations, whose detections have their full weights.
    """
    blocks = problem.parameters.pose_blocks()
    if not any(b.kind == ADDITIONAL_TF and b.collection is not None for _, b in blocks):
        return None
    weighted = tempered(problem, equations, shares, scalars.x)
    return joint_of(problem, weighted, scalars, shares, priors)


def with_shown_errors(
    dataset: Dataset, solver: Solver, summary: SolverSummary, setup: SolverSetup
) -> Tuple[SolverSummary, SolverSetup]:
    """Estimate the model errors that the data show, one after the other, until none is left.

    What cannot be told from another error is left alone, and so is what an arm may be off by.

    Args:
        dataset: with the intrinsics as given.
        solver: of the problem; it goes on from there.
        summary: its solution.
        setup: with the model errors that are estimated already.
    """
    for _ in range(_MOST):
        if summary.status != CONVERGED or setup.options.weights != SIGMA:
            break
        solution = checked(dataset, solver, summary, setup.options, of_all_motions=True)
        checks, known = solution.checks(summary, setup.options.loss), summary.model_errors
        found = [c for c in checks if not c.rivals and not solution.may_be_of_motions(c, known)]
        if not found or not found[0].error.is_scalar:
            break
        before = setup
        summary, setup = _with_more(solver, summary, setup, found[0].error)
        if setup is before:
            break
    return summary, setup


def with_usual_errors(
    dataset: Dataset,
    solver: Solver,
    summary: SolverSummary,
    setup: SolverSetup,
    intrinsics_sigma: Optional[float],
) -> Tuple[SolverSummary, SolverSetup]:
    """Estimate what the data do not show, too, and what detections have in common.

    It may be there all the same: it is held to what is usual by a prior, so that the sigmas know
    of it. Errors that the data show and cannot tell from one another have so much more room that
    the least unusual of them has what it would need alone. The arguments are those of
    `with_shown_errors`, and how far cameras' numbers are expected from those given, in parts of
    the focal length (None: as far as is usual).
    """
    if summary.status != CONVERGED or setup.options.weights != SIGMA:
        return summary, setup
    problem, known = solver.problem, summary.model_errors
    rest = [e for e in candidates(dataset, problem, summary.x) if e not in known and e.is_scalar]
    small = [error for field in range_fields(dataset, problem) for error in field.errors]
    rest += [e for e in small if e not in known]
    rest = list(scalars_of(solver, summary.x, summary.sigmas, setup.options.loss, rest).errors)
    options, sizes = setup.options, usual_sizes(rest, intrinsics_sigma)
    for alike in _not_told_apart(dataset, solver, summary, options):
        unusual = {e: abs(value) / sizes[e] for e, value in alike.items() if e in sizes}
        room = max(min(unusual.values(), default=1.0), 1.0)
        sizes.update({error: room * sizes[error] for error in unusual})
    usual = {error: ErrorPrior(size) for error, size in sizes.items()}
    setup = replace(
        setup,
        options=replace(
            options,
            model_errors=(*options.model_errors, *rest),
            error_priors={**options.error_priors, **usual},
        ),
    )
    return weighted_by_detections(solver, summary, setup.options), setup


def _not_told_apart(
    dataset: Dataset, solver: Solver, summary: SolverSummary, options: SolverOptions
) -> List[Dict[ModelError, float]]:
    """Return errors that the data show but do not tell apart, and what each would be alone."""
    return [
        {check.error: check.value, **dict(zip(check.rivals, check.rival_values))}
        for check in checked(dataset, solver, summary, options).checks(summary, options.loss)
        if check.rivals
    ]


def _with_more(
    solver: Solver,
    summary: SolverSummary,
    setup: SolverSetup,
    error: ModelError,
) -> Tuple[SolverSummary, SolverSetup]:
    """Return the solution with a further model error; the one before where there is none."""
    options, before, problem = setup.options, summary, solver.problem
    more = replace(options, model_errors=(*options.model_errors, error))
    after = solve_again(solver, more, problem, before, before.x)
    if after.status == CONVERGED:
        return after, replace(setup, options=more)
    solver.take_rows(problem)
    return before, setup


def remarks_on(
    asked: Sequence[ModelError], summary: SolverSummary, options: SolverOptions
) -> List[str]:
    """Return what was estimated without being asked for by name, at most two sentences.

    Args:
        asked: the errors that the user named.
        summary: the solution.
        options: of the solution, with the priors of what the data do not show.
    """
    priors = options.error_priors
    shown = [e.title for e in summary.model_errors if e not in asked and e not in priors]
    remarks = []
    if shown:
        remarks.append(f"estimated, since the data show it: {', '.join(shown)}")
    count = sum(error in priors for error in summary.model_errors)
    if count:
        remarks.append(
            f"{count} more errors of sensors and boards are estimated near zero, as they usually "
            f"are, so that the sigmas know of them (calibration.json, model_errors)"
        )
    return remarks


def suggestion(check: ModelCheck, problem: Optional[Problem] = None) -> str:
    """Return one sentence: what the data show, and which option estimates it.

    Args:
        check: what they show.
        problem: whose data; None: nothing moves in it.
    """
    sentence = described(check.error, check.value, check.sigma)
    if isinstance(check.error, BoardSize) and problem and _scaled_by_motions(problem):
        told = "long" if check.value > 0 else "short"
        sentence += f" (or /tf tells motions that much too {told}: wheels, an arm's links)"
    if check.rivals:
        others = ", ".join(rival.title for rival in check.rivals)
        scalars = all(error.is_scalar for error in (check.error, *check.rivals))
        room = f" ({WITH_ALL} leaves room for all of them)" if scalars else ""
        sentence = f"{sentence}; these boards cannot tell it from: {others}{room}"
        return sentence if check.error.option else f"{sentence}; {UNESTIMATED}"
    return f"{sentence}: {remedy(check.error.option)}"


def _scaled_by_motions(problem: Problem) -> bool:
    """Tell whether what moves tells the scale, and no range sensor does."""
    if any(isinstance(block, RangeBlock) for block in problem.residual_blocks):
        return False
    held: Dict[Tuple[str, str], List[np.ndarray]] = {}
    for key, constants in zip(problem.detections, problem.chains.constants):
        held.setdefault((key.sensor, key.pattern), []).append(constants)
    return any(float(np.max(np.ptp(each, axis=0))) > _STILL for each in held.values())
