"""What every solver takes and gives: options, summary, and the minimiser's contract."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Callable, List, NamedTuple, Protocol, Sequence, Tuple

import numpy as np

from atom_core.problem.problem import Problem
from atom_core.solvers.assessment import Assessment
from atom_core.solvers.losses import CAUCHY, LOSSES
from atom_core.solvers.normal_equations import NormalEquations

SIGMA, ATOM = "sigma", "atom"
CONVERGED, NOT_CONVERGED, FAILED = "converged", "not_converged", "failed"


class Tolerance(NamedTuple):
    """When a minimiser has done enough.

    Attributes:
        decrease: what a Newton step would lower the cost by at most, in squared sigmas.
        relative: or what two steps in a row lowered the cost by at most, relative to it.
    """

    decrease: float
    relative: float


# EXACT moves no parameter by more than 1e-5 of its standard deviation any more. ROUGH, by a
# tenth, is enough while weights or boards are still to change; it does not follow a valley that
# the data hardly see, which in a wrong basin may lead metres away.
EXACT, ROUGH = Tolerance(1e-11, 0.0), Tolerance(1e-2, 1e-3)
SETTLING = Tolerance(1e-5, 0.0)  # in between: while the last digits of the weights settle


@dataclass(frozen=True)
class SolverOptions:
    """How to solve.

    Attributes:
        weights: ``sigma`` divides by standard deviations, re-estimated from the residuals;
            ``atom`` by each modality's mean residual at the start, as ATOM does.
        loss: none, huber or cauchy, its width in units of sigma.
        max_iterations: over all rounds of reweighting.
        reweighting_rounds: at most so many estimates of the sigmas.
    """

    weights: str = SIGMA
    loss: str = CAUCHY
    max_iterations: int = 200
    reweighting_rounds: int = 10

    def __post_init__(self) -> None:
        if self.weights not in (SIGMA, ATOM):
            raise ValueError(f"weights '{self.weights}' are unknown; use {SIGMA} or {ATOM}")
        if self.loss not in LOSSES:
            raise ValueError(f"loss '{self.loss}' is unknown; use {', '.join(LOSSES)}")
        if self.max_iterations < 1:
            raise ValueError("max_iterations must be at least 1")


@dataclass(frozen=True)
class Minimum:
    """Where a minimiser ended.

    Attributes:
        x: the vector.
        cost: half the sum of rho at x.
        iterations: accepted and refused steps.
        converged: True only when a Newton step from x would move it by far less than a sigma.
        message: why it ended.
    """

    x: np.ndarray
    cost: float
    iterations: int
    converged: bool
    message: str


class Solver(Protocol):
    """Minimises one problem; made once for it, used for every round of weights.

    Sigmas are given for each residual block, (n,) in its unit. A solver must return a cost that
    is not higher than that of the start, and may claim convergence only when it is true.
    """

    problem: Problem

    def take_insets(self, problem: Problem) -> None:
        """Go on with a problem that differs from the present one in its insets only."""
        ...

    def minimise(
        self,
        x: np.ndarray,
        sigmas: Sequence[np.ndarray],
        loss: str,
        max_iterations: int,
        tolerance: Tolerance = EXACT,
    ) -> Minimum:
        """Minimise half the sum of rho from the vector x (p,)."""
        ...

    def equations(self, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str) -> NormalEquations:
        """Return the weighted normal equations at x."""
        ...

    def assess(self, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str) -> Assessment:
        """Return the equations at x, and how the border rows depend on their insets."""
        ...

    def squares(self, x: np.ndarray, sigmas: Sequence[np.ndarray]) -> List[np.ndarray]:
        """Return, for each residual block, squared norms (n,) at x in units of sigma."""
        ...


SolverFactory = Callable[[Problem], Solver]


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
        robust_weights: for each residual block, (n,) in 0..1.
        inset_steps: for each residual block, how many steps of sampling the limit points are
            expected inside the border; 0 for other kinds.
    """

    x: np.ndarray
    status: str
    message: str
    iterations: int
    cost_initial: float
    cost_final: float
    sigmas: Tuple[np.ndarray, ...]
    scales: Tuple[float, ...]
    robust_weights: Tuple[np.ndarray, ...]
    inset_steps: Tuple[float, ...]
