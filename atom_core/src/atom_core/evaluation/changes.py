"""Whether a rig is another one than before: calibrated edges against one another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, NamedTuple, Sequence, Tuple

import numpy as np
from scipy import special

from atom_core.evaluation.edge_errors import PoseError, pose_error
from atom_core.evaluation.spreads import LEAST_VARIANCE, NUMBERS, joint_covariance, spread_of
from atom_core.model.edge_state import EdgeState
from atom_core.model.transforms import Edge

FALSE_ALARMS = 0.01  # of rigs that did not move
TOLD_M, TOLD_RAD = 0.02, float(np.radians(1.0))  # what is not noticed at this size is not told
_NOTICED = 5.6  # standard deviations that are beyond the limit in 95 % of cases


class EdgeChange(NamedTuple):
    """An edge in two calibrations.

    Attributes:
        edge: parent and child.
        sensors: that stand on it.
        change: the second one minus the first.
        sigma: (6,) joint standard deviations, turns [rad] and shifts [m].
        chi_square: of the six numbers in their joint covariance.
        moved: that is more than the limit.
        beyond_usual: it is even with the usual errors of sensors and boards in both.
    """

    edge: Edge
    sensors: Tuple[str, ...]
    change: PoseError
    sigma: np.ndarray
    chi_square: float
    moved: bool
    beyond_usual: bool

    @property
    def told(self) -> bool:
        """Whether a change that matters would be noticed."""
        largest = _NOTICED * np.max(self.sigma.reshape(2, -1), axis=1)  # of turns, of shifts
        return bool(largest[0] <= TOLD_RAD and largest[1] <= TOLD_M)


@dataclass(frozen=True)
class Changes:
    """All edges of two calibrations.

    Attributes:
        edges: those that both have and that were estimated in both.
        limit: of the chi-squares: of rigs that did not move, a hundredth has any edge beyond.
        only_in_one: edges that one of them lacks.
        held: edges that both hold.
    """

    edges: Tuple[EdgeChange, ...]
    limit: float
    only_in_one: Tuple[Edge, ...]
    held: Tuple[Edge, ...]

    @property
    def moved(self) -> Tuple[EdgeChange, ...]:
        """The edges that moved."""
        return tuple(change for change in self.edges if change.moved)

    @property
    def untold(self) -> Tuple[EdgeChange, ...]:
        """The edges of which a change that matters would not be noticed."""
        return tuple(change for change in self.edges if not (change.moved or change.told))


def limit_of(edges: int) -> float:
    """Return the chi-square of six numbers that one of some edges exceeds once in a hundred."""
    return float(special.chdtri(NUMBERS, FALSE_ALARMS / max(edges, 1)))


def chi_square(change: PoseError, covariance: np.ndarray) -> float:
    """Return the square of a change's six numbers in their covariance (6, 6)."""
    numbers = np.concatenate([change.turn_rad, change.shift_m])
    scale = np.sqrt(np.maximum(np.diagonal(covariance), LEAST_VARIANCE))
    correlation = covariance / np.outer(scale, scale) + 1e-12 * np.eye(NUMBERS)
    return float(numbers / scale @ np.linalg.solve(correlation, numbers / scale))


def changes(before: Sequence[EdgeState], after: Sequence[EdgeState]) -> Changes:
    """Compare two calibrations edge by edge.

    Args:
        before: edges of the first one.
        after: of the second one.
    """
    first, second = ({state.edge: state for state in states} for states in (before, after))
    common = [edge for edge in first if edge in second]
    held = [edge for edge in common if first[edge].anchored and second[edge].anchored]
    estimated = [edge for edge in common if edge not in held]
    limit = limit_of(len(estimated))
    only = [edge for edge in (*first, *second) if edge not in common]
    compared = tuple(_change(first[edge], second[edge], limit) for edge in estimated)
    return Changes(compared, limit, tuple(only), tuple(held))


def _change(first: EdgeState, second: EdgeState, limit: float) -> EdgeChange:
    change = pose_error(first.parent_T_child, second.parent_T_child)
    spreads = spread_of(first), spread_of(second)
    covariance = joint_covariance(*spreads)
    square = chi_square(change, covariance)
    usual = chi_square(change, covariance + sum(spread.usual for spread in spreads))
    names = tuple(dict.fromkeys([*first.sensors, *second.sensors]))
    sigma = np.sqrt(np.diagonal(covariance))
    moved = square > limit
    return EdgeChange(first.edge, names, change, sigma, square, moved, moved and usual > limit)


def held_apart(before: Sequence[EdgeState], after: Sequence[EdgeState]) -> List[Edge]:
    """Return the edges that one calibration holds and the other estimates."""
    first = {state.edge: state.anchored for state in before}
    return [s.edge for s in after if s.edge in first and first[s.edge] != s.anchored]
