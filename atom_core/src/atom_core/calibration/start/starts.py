"""Where the solver starts, and which start leads where it should.

A start is the description's, or is taken from the data alone. The description's is left for the
data's when it ends where residuals are implausible and the data's ends lower.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.connectivity import check_connected
from atom_core.calibration.prepare.preparation import prepare
from atom_core.calibration.start.boards import initial_boards, placed, settle_boards
from atom_core.calibration.start.finite import check_finite
from atom_core.calibration.start.initial_sensors import sensors_from_boards
from atom_core.errors import CalibrationError
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset
from atom_core.model.pattern import BoardKey
from atom_core.problem.blocks import SENSOR
from atom_core.problem.builder import FreeEdges, build_problem
from atom_core.problem.measurements import Measurement
from atom_core.problem.problem import Problem
from atom_core.solvers import losses
from atom_core.solvers.base import Minimum, Solver, SolverFactory, SolverOptions

# A residual, in units of its expected sigma, that no noise explains, and the share of a sensor's
# residuals that wrong labels do not explain either.
_IMPLAUSIBLE, _TOO_MANY = 10.0, 0.25
_AS_GOOD, _ELSEWHERE_M = 1.02, 0.2  # outcomes that nothing but chance decides between
_CLEARLY_LOWER = 0.9  # the other start must lower the cost by this factor


@dataclass(frozen=True)
class Posed:
    """A problem and where it starts.

    Attributes:
        initial: the dataset whose transforms are the start.
        measurements: those whose board could be placed.
        boards: initial (or held) poses.
        unused: why a collection is left out, by key.
        problem: not solved yet.
    """

    initial: Dataset
    measurements: Sequence[Measurement]
    boards: Mapping[BoardKey, np.ndarray]
    unused: Mapping[str, str]
    problem: Problem


class SensorPose(NamedTuple):
    """The sensors on an edge, and its ``parent_T_child`` (4, 4)."""

    names: Tuple[str, ...]
    pose: np.ndarray


@dataclass(frozen=True)
class Settled:
    """A problem solved roughly, every board in its place.

    Attributes:
        posed: the start.
        first: solver of the problem as it was posed.
        solver: of the problem as it is now.
        rough: where to go on from.
    """

    posed: Posed
    first: Solver
    solver: Solver
    rough: Minimum

    def robust_cost(self) -> float:
        """Return the cost with the sensors' initial sigmas, comparable between starts."""
        return sum(losses.cost(losses.CAUCHY, squares) for squares in self._squares())

    def is_implausible(self) -> bool:
        """Tell whether a quarter of some sensor's residuals are larger than noise explains."""
        rows = max(self.solver.problem.row_count, 1)
        if 2.0 * self.rough.cost < rows:  # no need to look closer
            return False
        shares = [float(np.mean(squares > _IMPLAUSIBLE**2)) for squares in self._squares()]
        return max(shares) > _TOO_MANY

    def sensor_edges(self) -> List[SensorPose]:
        """Return the sensors' estimated edges."""
        parameters = self.solver.problem.parameters
        poses = parameters.poses(self.rough.x)
        return [
            SensorPose(block.names, poses[i])
            for i, block in enumerate(parameters.blocks)
            if block.kind == SENSOR
        ]

    def _squares(self) -> List[np.ndarray]:
        sigmas = [block.sigma for block in self.solver.problem.residual_blocks]
        return self.solver.squares(self.rough.x, sigmas)


def pose_problem(
    initial: Dataset,
    measurements: Sequence[Measurement],
    free: FreeEdges,
    unused: Optional[Mapping[str, str]] = None,
) -> Posed:
    """Place the boards and build the problem of a start.

    Raises:
        CalibrationError: nothing is left to estimate, or what is left does not hang together.
    """
    left_out: Dict[str, str] = dict(unused or {})
    boards = initial_boards(initial, measurements, free)
    kept = placed(initial, measurements, boards, left_out)
    check_connected(initial, kept, free)
    problem = build_problem(initial, kept, boards, free)
    if problem.parameters.size == 0:
        raise CalibrationError("nothing is left to estimate: every sensor and board is held")
    return Posed(initial, kept, boards, left_out, problem)


def settle(posed: Posed, options: SolverOptions, make_solver: SolverFactory) -> Settled:
    """Solve roughly, boards placed anew where they stand wrong; with half of the iterations."""
    first = make_solver(posed.problem)
    check_finite(first)
    half = replace(options, max_iterations=max(options.max_iterations // 2, 1))
    solver, rough = settle_boards(posed.initial, first, posed.measurements, half, make_solver)
    return Settled(posed, first, solver, rough)


def best_settled(
    starts: Sequence[Posed], options: SolverOptions, make_solver: SolverFactory
) -> Tuple[Settled, List[Settled]]:
    """Settle every start.

    Returns:
        The one with the lowest cost, and those that are as good and put a sensor elsewhere.
    """
    settled: List[Settled] = []
    for posed in starts:
        settled.append(settle(posed, options, make_solver))
        if settled[-1].rough.interrupted:
            break
    if len(settled) == 1:
        return settled[0], []
    costs = [s.robust_cost() for s in settled]
    best = settled[int(np.argmin(costs))]
    rivals = [s for s, cost in zip(settled, costs) if cost <= _AS_GOOD * min(costs)]
    return best, [s for s in rivals if s is not best and moved_sensors(best, s)]


def moved_sensors(one: Settled, other: Settled) -> Dict[str, float]:
    """Return the sensors that stand elsewhere in the other outcome, and by how much [m].

    A sensor that only turned counts with the length of the arc one metre away.
    """
    moved = {}
    for a, b in zip(one.sensor_edges(), other.sensor_edges()):
        turned = float(se3.rotation_angle(a.pose[:3, :3].T @ b.pose[:3, :3]))
        apart = max(float(np.linalg.norm(a.pose[:3, 3] - b.pose[:3, 3])), turned)
        if apart > _ELSEWHERE_M:
            moved["+".join(a.names)] = apart
    return moved


def rescued(
    settled: Settled,
    dataset: Dataset,
    free: FreeEdges,
    options: SolverOptions,
    make_solver: SolverFactory,
) -> Tuple[Settled, List[str]]:
    """Return the outcome of a start from the data where it is better, with a warning.

    It is tried only when the outcome of the description's start is implausible, or none.
    """
    lost = not settled.rough.converged
    if settled.rough.interrupted or not (lost or settled.is_implausible()):
        return settled, []
    posed = settled.posed
    estimate = sensors_from_boards(dataset, posed.measurements, free)
    starts = [
        pose_problem(guess, posed.measurements, free, posed.unused)
        for guess in (estimate.dataset, *estimate.others)
    ]
    other, _ = best_settled(starts, options, make_solver)
    enough = _AS_GOOD if lost and other.rough.converged else _CLEARLY_LOWER
    if not other.robust_cost() < enough * settled.robust_cost():
        return settled, []
    remark = (
        f"the initial guess of the description {'is far off' if lost else 'ends implausibly'}: the "
        f"sensors were placed from the shared boards instead (as with --initial_guess none); "
        f"correct the description, or look whether it is the right one"
    )
    return other, [remark, *estimate.remarks]


def estimate_sensors(dataset: Dataset, options: Optional[CalibrationOptions] = None) -> Dataset:
    """Return the dataset with its sensors placed from the data alone, before any solve.

    What the dataset's transforms say about the edges to be found is not used. Positions are good
    to centimetres, enough to start a calibration from or to show as a first guess. To get the
    calibration itself use ``calibrate`` with ``initial_guess="none"``.

    Args:
        dataset: already reduced to the selected sensors, collections and patterns.
        options: what is held; defaults as in ``calibrate``.

    Raises:
        AtomError: sensors that no shared board connects, or data that cannot be read.
    """
    ready = prepare(dataset, options or CalibrationOptions())
    return sensors_from_boards(ready.dataset, ready.measurements, ready.free).dataset
