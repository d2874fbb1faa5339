"""What priors did: directions that they alone hold, and priors that the data contradict."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, List, Sequence, Tuple

import numpy as np
from scipy.special import chdtrc  # scipy.stats has it as chi2.sf, and takes long to load

from atom_core.calibration.judge.reasons import Solution
from atom_core.calibration.judge.weak_directions import (
    WeakDirection,
    largest_variances,
    weak_directions,
)
from atom_core.problem.blocks import BLOCK_SIZE, ROTATION, TRANSLATION
from atom_core.problem.parameters import Parameters
from atom_core.problem.priors import Prior
from atom_core.solvers.covariance import Covariance

_CHANCE = 1e-4  # of a prior that agrees with the data to look as if it did not
_LEAST = 1e-3  # part of a prior's variance by which data move it; less is rounding


@dataclass(frozen=True)
class HeldDirection:
    """A direction that the data leave open, and a prior holds.

    Attributes:
        parameters: the named ones move together along it, e.g. ``rgb_1 z``.
        sigma: standard deviation of the one that moves most, with the prior.
        unit: m or rad.
        priors: names of those that hold it.
        why: one sentence.
    """

    parameters: Tuple[str, ...]
    sigma: float
    unit: str
    priors: Tuple[str, ...]
    why: str


@dataclass(frozen=True)
class PriorResult:
    """A prior beside the solution.

    Attributes:
        prior: it.
        deviation: how far the solution is from what was described, in standard deviations of the
            prior: the largest of its numbers.
        contradicted: whether the data put it farther off than prior and sigmas explain.
        why: one sentence.
    """

    prior: Prior
    deviation: float
    contradicted: bool
    why: str


def held_directions(
    solution: Solution,
    covariance: Covariance,
    of_data: Covariance,
    limit_m: float,
    limit_rad: float,
) -> List[HeldDirection]:
    """Return the directions that are undetermined without the priors and are not with them.

    Args:
        solution: the solved problem.
        covariance: of its parameters.
        of_data: likewise, without the priors.
        limit_m: a larger standard deviation of a length is undetermined.
        limit_rad: likewise of an angle.
    """
    parameters = solution.problem.parameters
    variances = largest_variances(solution, covariance)
    limits = {"rad": limit_rad, "m": limit_m}
    every = (parameters.component(i) for i in range(parameters.size))
    unit_of = {component.name: component.unit for component in every}
    found = []
    for weak in weak_directions(solution, of_data, limit_m, limit_rad):
        units = [unit_of[name] for name in weak.parameters]
        sigmas = [float(np.sqrt(max(variances[name], 0.0))) for name in weak.parameters]
        if any(sigma > limits.get(unit, limit_rad) for sigma, unit in zip(sigmas, units)):
            continue  # it is open with them, too
        sigma = max(s for s, unit in zip(sigmas, units) if unit == weak.unit)
        found.append(_held(parameters, weak, sigma))
    return found


def _held(parameters: Parameters, weak: WeakDirection, sigma: float) -> HeldDirection:
    every = list(parameters.priors())
    moving = {name.rsplit(" ", 1)[0] for name in weak.parameters}
    mine = [prior.name for i, prior in every if parameters.blocks[i].title in moving]
    names = tuple(dict.fromkeys(mine or [prior.name for _, prior in every]))
    return HeldDirection(weak.parameters, sigma, weak.unit, names, weak.why)


def prior_results(
    parameters: Parameters, x: np.ndarray, covariance: Covariance
) -> List[PriorResult]:
    """Return how far the solution x is from each prior."""
    groups: Dict[str, List[int]] = {}
    by_name: Dict[str, Prior] = {}
    for i, prior in parameters.priors():
        groups.setdefault(prior.name, []).append(i)
        by_name[prior.name] = prior
    return [_result(parameters, x, covariance, by_name[n], groups[n]) for n in groups]


def contradictions(results: Sequence[PriorResult]) -> List[str]:
    """Return why, of priors that the data contradict."""
    return [result.why for result in results if result.contradicted]


def _result(
    parameters: Parameters,
    x: np.ndarray,
    covariance: Covariance,
    prior: Prior,
    blocks: Sequence[int],
) -> PriorResult:
    off = parameters.by_block(x) - parameters.prior_mean
    largest, chances = 0.0, []
    for i in blocks:
        known = parameters.prior_weight[i] > 0.0
        of_model, combined = (c.block(i) for c in (covariance.of_model, covariance.combined))
        more = combined - of_model
        for part in (ROTATION, TRANSLATION):
            at = np.arange(BLOCK_SIZE)[part][known[part]]
            if len(at) == 0:
                continue
            root = np.sqrt(parameters.prior_weight[i, at])
            deviation = root * off[i, at]
            largest = max(largest, float(np.max(np.abs(deviation))))
            scale = root[:, None] * root
            spread = np.eye(len(at)) - scale * (of_model - more)[np.ix_(at, at)]
            chances.append(_chance(deviation, spread))
    contradicted = min(chances, default=1.0) < _CHANCE / max(len(chances), 1)
    why = (
        f"the data put '{prior.name}' {largest:.1f} standard deviations from where its prior has "
        f"it ({1e3 * prior.sigma_m:g} mm, {np.rad2deg(prior.sigma_rad):.3g} deg): one of the two "
        f"is wrong; look at the description, or state the prior as wide as it is known"
    )
    return PriorResult(prior, largest, contradicted, why)


def _chance(deviation: np.ndarray, spread: np.ndarray) -> float:
    """Return how often chance alone puts the solution so far from the prior.

    Args:
        deviation: (n,) of the solution from the prior, in its standard deviations.
        spread: (n, n) covariance of it: of the prior less that of the solution (what no data move
            stays where it is), with what the solution is less sure of than its model says.
    """
    values, vectors = np.linalg.eigh(spread)
    seen = values > _LEAST
    if not np.any(seen):
        return 1.0
    along = vectors[:, seen].T @ deviation
    return float(chdtrc(int(np.sum(seen)), np.sum(along**2 / values[seen])))
