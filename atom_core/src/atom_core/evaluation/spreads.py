"""How exactly edges are known, and differences of edges that were found apart from each other."""

from __future__ import annotations

from typing import Mapping, NamedTuple, Sequence

import numpy as np

from atom_core.model.edge_state import EdgeState
from atom_core.model.transforms import Edge
from atom_core.solvers.robust_covariance import wider_by_students_t

NUMBERS = 6
LEAST_VARIANCE = 1e-18  # of an edge that is held


class Spread(NamedTuple):
    """How exactly an edge is known.

    Attributes:
        stated, of_model: covariances (6, 6), as stated and as the assumed noise has it.
        detections: that told it; 0: not known.
        scatter: by which detections vary beyond their noise at least.
        freedom: degrees of freedom of Student's t by which the stated one is wider; infinite: it is
            not.
        usual: what usual errors of sensors and boards have beyond the stated one.
    """

    stated: np.ndarray
    of_model: np.ndarray
    detections: int = 0
    scatter: float = 1.0
    freedom: float = np.inf
    usual: np.ndarray = np.zeros((NUMBERS, NUMBERS))

    def __add__(self, other: tuple) -> Spread:
        """Return what is known of the difference of two independent edges."""
        counts = [count for count in (self.detections, other[2]) if count > 0]
        scatter, freedom = max(self.scatter, other[3]), min(self.freedom, other[4])
        stated, of_model = self.stated + other[0], self.of_model + other[1]
        usual = self.usual + other[5]
        return Spread(stated, of_model, min(counts, default=0), scatter, freedom, usual)


NO_SPREAD = Spread(np.zeros((NUMBERS, NUMBERS)), np.zeros((NUMBERS, NUMBERS)))


def spread_of(state: EdgeState) -> Spread:
    """Return how exactly an edge is known; what was held exactly."""
    if state.anchored:
        return NO_SPREAD
    smaller = state.model_sigma / np.maximum(state.sigma, np.sqrt(LEAST_VARIANCE))
    of_model = state.covariance * np.outer(smaller, smaller)
    combined = state.sigma if state.combined_sigma is None else state.combined_sigma
    usual = beyond(combined**2, state.sigma**2)
    return Spread(state.covariance, of_model, state.detections, freedom=state.freedom, usual=usual)


def beyond(combined: np.ndarray, stated: np.ndarray) -> np.ndarray:
    """Return (6, 6) what combined variances (6,) have beyond the stated ones."""
    return np.diag(np.maximum(combined - stated, 0.0))


def spreads_of(states: Sequence[EdgeState]) -> Mapping[Edge, Spread]:
    """Return how exactly each edge is known; what was held exactly."""
    return {state.edge: spread_of(state) for state in states}


def joint_covariance(one: Spread, other: Spread) -> np.ndarray:
    """Return the covariance (6, 6) of the difference of two independent estimates of an edge.

    The standard deviation of an edge is wider by Student's t, since its few collections tell their
    scatter badly. The collections of two estimates together tell it better: the quantile of their
    difference is that of Welch and Satterthwaite's degrees of freedom (Welch 1947). The noise that
    is assumed is the least.
    """
    stated = one.stated + other.stated
    most, least = np.diagonal(stated), np.diagonal(one.of_model + other.of_model)
    variances = np.array([np.diagonal(spread.stated) for spread in (one, other)])
    variance = joint_variance(variances, np.array([one.freedom, other.freedom]))
    wanted = np.minimum(np.maximum(variance, least), most)
    factors = np.sqrt(wanted / np.maximum(most, 1e-30))
    return stated * np.outer(factors, factors)


def joint_variance(variances: np.ndarray, freedoms: np.ndarray) -> np.ndarray:
    """Return (n,) those of differences, by the variances (2, n) that Student's t made wider."""
    wider = np.array([1.0 if np.isinf(f) else wider_by_students_t(f) for f in freedoms])
    scatter = variances / wider[:, None] ** 2
    total = np.sum(scatter, axis=0)
    unsure = np.sum(scatter**2 / freedoms[:, None], axis=0)
    joint = [
        wider_by_students_t(whole**2 / part) if part > 0.0 else 1.0
        for whole, part in zip(total, unsure)
    ]
    return total * np.array(joint) ** 2
