"""What every solver takes and gives: options, summary, and the minimiser's contract."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import (
    Callable,
    Dict,
    Iterator,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Protocol,
    Sequence,
    Tuple,
)

import numpy as np

from atom_core.model.transforms import Edge
from atom_core.problem.model_errors import ErrorPriors, ModelError
from atom_core.problem.problem import Problem
from atom_core.solvers.assessment import Assessment
from atom_core.solvers.criteria import EXACT, Tolerance
from atom_core.solvers.losses import CAUCHY, LOSSES
from atom_core.solvers.normal_equations import NormalEquations

SIGMA, ATOM = "sigma", "atom"
CONVERGED, NOT_CONVERGED, FAILED = "converged", "not_converged", "failed"
_MOST_ITERATIONS = 1_000_000  # beyond any patience, and within what Ceres counts


class Iteration(NamedTuple):
    """Where a solver stands, for live views.

    Attributes:
        number: of the iteration, counted over all rounds.
        cost: half the sum of rho, with the weights of the present round.
        x: the vector; the solver goes on using it, so copy what is to be kept.
        problem: that the vector belongs to.
    """

    number: int
    cost: float
    x: np.ndarray
    problem: Problem

    def edges(self) -> Dict[Edge, np.ndarray]:
        """Return ``parent_T_child`` (4, 4) of the edges that hold for all collections."""
        edges = self.problem.parameters.edges_at(self.x)
        return {block.edge: pose for block, pose in edges if block.collection is None}


# Called after every iteration; False stops with the best state so far. What it raises goes
# through the solver to the caller.
Progress = Callable[[Iteration], Optional[bool]]
# The same within one round.
RoundProgress = Callable[[int, float, np.ndarray], Optional[bool]]


@dataclass(frozen=True)
class SolverOptions:
    """How to solve.

    Attributes:
        weights: ``sigma`` divides by standard deviations, re-estimated from the residuals;
            ``atom`` by each modality's mean residual at the start, as ATOM does.
        loss: none, huber or cauchy, its width in units of sigma.
        max_iterations: over all rounds of reweighting.
        reweighting_rounds: at most so many estimates of the sigmas.
        model_errors: those that are estimated.
        error_priors: what is known of some of them beforehand; the others are free.
        progress: told of every iteration.
        corner_divisor: with ATOM's weights, corners are divided by so many times more; below 1
            they weigh more.
    """

    weights: str = SIGMA
    loss: str = CAUCHY
    max_iterations: int = 200
    reweighting_rounds: int = 10
    model_errors: Tuple[ModelError, ...] = ()
    error_priors: ErrorPriors = field(default_factory=dict)
    progress: Optional[Progress] = field(default=None, compare=False, repr=False)
    corner_divisor: float = 1.0

    def __post_init__(self) -> None:
        if self.weights not in (SIGMA, ATOM):
            raise ValueError(f"weights '{self.weights}' are unknown; use {SIGMA} or {ATOM}")
        if not np.isfinite(self.corner_divisor) or self.corner_divisor <= 0.0:
            raise ValueError(f"-rnm {self.corner_divisor:g}: a multiplier is a number above 0")
        if self.loss not in LOSSES:
            raise ValueError(f"loss '{self.loss}' is unknown; use {', '.join(LOSSES)}")
        if not 1 <= self.max_iterations <= _MOST_ITERATIONS:
            raise ValueError(f"max_iterations must be from 1 to {_MOST_ITERATIONS}")


@dataclass(frozen=True)
class Minimum:
    """Where a minimiser ended.

    Attributes:
        x: the vector.
        cost: half the sum of rho at x.
        iterations: accepted and refused steps.
        converged: True only when a Newton step from x would move it by far less than a sigma.
        message: why it ended.
        interrupted: True when it was stopped from outside.
    """

    x: np.ndarray
    cost: float
    iterations: int
    converged: bool
    message: str
    interrupted: bool = False

    @classmethod
    def interrupted_at(cls, x: np.ndarray, cost: float, iterations: int) -> Minimum:
        """Return the best state of a minimiser that was stopped."""
        return cls(x, cost, iterations, False, "interrupted", interrupted=True)


class Solver(Protocol):
    """Minimises one problem; made once for it, used for every round of weights.

    Sigmas are given for each residual block, (n,) in its unit. A solver must return a cost that
    is not higher than that of the start, and may claim convergence only when it is true.
    """

    problem: Problem

    def take_insets(self, problem: Problem) -> None:
        """Go on with a problem that differs from the present one in its insets only."""
        ...

    def take_rows(self, problem: Problem) -> None:
        """Go on with a problem that differs from the present one in its model errors only."""
        ...

    def minimise(
        self,
        x: np.ndarray,
        sigmas: Sequence[np.ndarray],
        loss: str,
        max_iterations: int,
        tolerance: Tolerance = EXACT,
        progress: Optional[RoundProgress] = None,
    ) -> Minimum:
        """Minimise half the sum of rho from the vector x (p,).

        ``progress`` is called with iteration, cost and vector, before the first step too; where
        it returns False, or at Ctrl-C, the best state so far is the result.
        """
        ...

    def equations(self, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str) -> NormalEquations:
        """Return the weighted normal equations at x."""
        ...

    def assess(self, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str) -> Assessment:
        """Return the equations at x, and how the border rows depend on their insets."""
        ...

    def linearised_blocks(
        self, x: np.ndarray, poses: np.ndarray
    ) -> Iterator[Tuple[np.ndarray, np.ndarray]]:
        """Yield residuals and ``Linearisation.by_state`` of one block after the other.

        Args:
            x: the vector.
            poses: (d, 4, 4) of the detections at it.
        """
        ...

    def squares(self, x: np.ndarray, sigmas: Sequence[np.ndarray]) -> List[np.ndarray]:
        """Return, for each residual block, squared norms (n,) at x in units of sigma."""
        ...


SolverFactory = Callable[[Problem], Solver]


@dataclass(frozen=True)
class SolverSetup:
    """Which solver works, and how.

    Attributes:
        options: weights, loss, limits, who is told of iterations.
        make: makes the solver of a problem.
    """

    options: SolverOptions
    make: SolverFactory


@dataclass(frozen=True)
class SolverSummary:
    """The answer and how it came about.

    Attributes:
        x: the solution.
        status: converged, not_converged or failed.
        message: one sentence.
        iterations: of all rounds.
        cost_initial, cost_final: with the final weights and loss.
        sigmas: for each residual block, (n,) standard deviations in its unit, as used last.
        scales: for each residual block, the factor on its initial sigmas.
        inset_steps: for each residual block, how many steps of sampling the limit points are
            expected inside the border; 0 for other kinds.
        interrupted: True when it was stopped from outside.
        common: for each residual block, standard deviation of what its rows of a detection have in
            common, in its unit; empty where it was not estimated.
        model_errors: those estimated, in their units; the problem is corrected by them.
        settled: False when the rounds of reweighting ended before the sigmas stood still.
    """

    x: np.ndarray
    status: str
    message: str
    iterations: int
    cost_initial: float
    cost_final: float
    sigmas: Tuple[np.ndarray, ...]
    scales: Tuple[float, ...]
    inset_steps: Tuple[float, ...]
    interrupted: bool = False
    common: Tuple[float, ...] = ()
    model_errors: Mapping[ModelError, float] = field(default_factory=dict)
    settled: bool = True
