"""Whether a rig is another one than before: calibrated edges against one another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, NamedTuple, Sequence, Tuple, Union

import numpy as np
from scipy import special

from atom_core.evaluation.edge_errors import PoseError, pose_error
from atom_core.evaluation.spreads import LEAST_VARIANCE, NUMBERS, joint_covariance, spread_of
from atom_core.model.edge_state import EdgeState, ParameterState
from atom_core.model.transforms import Edge

FALSE_ALARMS = 0.01  # of rigs that did not move
TOLD_M, TOLD_RAD = 0.02, float(np.radians(1.0))  # what is not noticed at this size is not told
_ONE_PLACE = 1e-4  # m, rad: digits that a description rounds
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
    def name(self) -> str:
        """The sensors on the edge, or the edge."""
        return ", ".join(self.sensors) or str(self.edge)

    @property
    def told(self) -> bool:
        """Whether a change that matters would be noticed."""
        largest = _NOTICED * np.max(self.sigma.reshape(2, -1), axis=1)  # of turns, of shifts
        return bool(largest[0] <= TOLD_RAD and largest[1] <= TOLD_M)


class JointChange(NamedTuple):
    """A parameter of a joint in two calibrations, in its unit.

    Attributes:
        name: of the joint, and of the parameter.
        unit: m or rad.
        change: the second one minus the first.
        sigma: joint standard deviation.
        chi_square: of the one number.
        moved: that is more than the limit.
        beyond_usual: it is even with the usual errors of sensors and boards in both.
    """

    name: str
    unit: str
    change: float
    sigma: float
    chi_square: float
    moved: bool
    beyond_usual: bool

    @property
    def told(self) -> bool:
        """Whether a change that matters would be noticed."""
        return _NOTICED * self.sigma <= (TOLD_RAD if self.unit == "rad" else TOLD_M)


@dataclass(frozen=True)
class Changes:
    """All edges and joints of two calibrations.

    Attributes:
        edges: those that both have and that were estimated in both.
        joints: likewise parameters of joints.
        limit: of the edges' chi-squares: of rigs that did not move, a hundredth has anything
            beyond.
        joint_limit: likewise of those of joints' parameters.
        only_in_one: edges and parameters of joints that one of them lacks.
        held: edges that both hold.
        lacking: sensors that one of them lacks, and parameters of joints.
        reference: sensors that both hold.
        by_collection: edges with a value for each collection, which are other ones elsewhere.
    """

    edges: Tuple[EdgeChange, ...]
    limit: float
    only_in_one: Tuple[str, ...]
    held: Tuple[Edge, ...]
    joints: Tuple[JointChange, ...] = ()
    by_collection: Tuple[Edge, ...] = ()
    joint_limit: float = np.inf
    lacking: Tuple[str, ...] = ()
    reference: Tuple[str, ...] = ()

    @property
    def compared(self) -> Tuple[Union[EdgeChange, JointChange], ...]:
        """All that both have."""
        return (*self.edges, *self.joints)

    @property
    def moved(self) -> Tuple[Union[EdgeChange, JointChange], ...]:
        """What moved."""
        return tuple(change for change in self.compared if change.moved)

    @property
    def untold(self) -> Tuple[Union[EdgeChange, JointChange], ...]:
        """That of which a change that matters would not be noticed."""
        return tuple(change for change in self.compared if not (change.moved or change.told))


def limit_of(count: int, numbers: int = NUMBERS) -> float:
    """Return the chi-square of some numbers that one of so many exceeds once in a hundred."""
    return float(special.chdtri(numbers, FALSE_ALARMS / max(count, 1)))


def chi_square(change: PoseError, covariance: np.ndarray) -> float:
    """Return the square of a change's six numbers in their covariance (6, 6)."""
    numbers = np.concatenate([change.turn_rad, change.shift_m])
    scale = np.sqrt(np.maximum(np.diagonal(covariance), LEAST_VARIANCE))
    correlation = covariance / np.outer(scale, scale) + 1e-12 * np.eye(NUMBERS)
    return float(numbers / scale @ np.linalg.solve(correlation, numbers / scale))


def changes(
    before: Sequence[EdgeState],
    after: Sequence[EdgeState],
    joints_before: Sequence[ParameterState] = (),
    joints_after: Sequence[ParameterState] = (),
) -> Changes:
    """Compare two calibrations edge by edge, and parameter by parameter of joints.

    Args:
        before: edges of the first one.
        after: of the second one.
        joints_before: parameters of joints that were estimated in the first one.
        joints_after: likewise in the second one.
    """
    first, second = ({state.edge: state for state in states} for states in (before, after))
    common = [edge for edge in first if edge in second]
    held = [edge for edge in common if first[edge].anchored and second[edge].anchored]
    many = [e for e in common if first[e].collection or second[e].collection]
    estimated = [edge for edge in common if edge not in (*held, *many)]
    old, new = ({str(joint): joint for joint in joints} for joints in (joints_before, joints_after))
    both = [name for name in old if name in new]
    tests = len(estimated) + len(both)
    limit, joint_limit = limit_of(tests), limit_of(tests, 1)
    edges = [edge for edge in (*first, *second) if edge not in common]
    parameters = [name for name in (*old, *new) if name not in both]
    alone = [first.get(edge) or second[edge] for edge in edges]
    sensors = [name for state in alone for name in state.sensors or (str(state.edge),)]
    only = [*map(str, edges), *parameters]
    return Changes(
        tuple(_change(first[edge], second[edge], limit) for edge in estimated),
        limit,
        tuple(only),
        tuple(edge for edge in held if edge not in many),
        tuple(_joint_change(old[name], new[name], joint_limit) for name in both),
        tuple(many),
        joint_limit,
        tuple(dict.fromkeys([*sensors, *parameters])),
        tuple(name for edge in held for name in first[edge].sensors),
    )


def _joint_change(first: ParameterState, second: ParameterState, limit: float) -> JointChange:
    change = second.value - first.value
    if first.unit == "rad":
        change = float(np.arctan2(np.sin(change), np.cos(change)))
    sigma = np.hypot(first.sigma, second.sigma)
    usual = np.hypot(first.combined_sigma or first.sigma, second.combined_sigma or second.sigma)
    square, by_usual = (float(change**2 / max(s**2, LEAST_VARIANCE)) for s in (sigma, usual))
    moved = square > limit
    names = str(first), first.unit, change
    return JointChange(*names, float(sigma), square, moved, moved and by_usual > limit)


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


def held_elsewhere(
    before: Sequence[EdgeState], after: Sequence[EdgeState]
) -> List[Tuple[EdgeState, PoseError]]:
    """Return the edges that both calibrations hold, but not in one place, and how far apart."""
    first = {state.edge: state for state in before}
    both = [(first[s.edge], s) for s in after if s.edge in first]
    apart = [(s, pose_error(f.parent_T_child, s.parent_T_child)) for f, s in both if s.anchored]
    return [
        (state, error)
        for state, error in apart
        if state.collection is None and max(error.translation_m, error.rotation_rad) > _ONE_PLACE
    ]
