"""Where the solver starts, and which start leads where it should.

A start is the description's, or is taken from the data alone. The description's is left for the
data's when it ends where residuals are implausible and the data's ends lower.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.calibration.options import DESCRIPTION, NO_GUESS, CalibrationOptions
from atom_core.calibration.prepare.connectivity import check_connected
from atom_core.calibration.prepare.preparation import Prepared, prepare
from atom_core.calibration.start.boards import initial_boards, placed, settle_boards
from atom_core.calibration.start.disturb import disturbed
from atom_core.calibration.start.finite import check_finite
from atom_core.calibration.start.initial_sensors import SensorEstimate, sensors_from_boards
from atom_core.errors import CalibrationError
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset
from atom_core.model.pattern import BoardKey
from atom_core.problem.blocks import SENSOR
from atom_core.problem.builder import FreeEdges, build_problem
from atom_core.problem.measurements import Measurement
from atom_core.problem.problem import Problem
from atom_core.solvers import losses
from atom_core.solvers.base import Minimum, Solver, SolverSetup

# A residual, in units of its expected sigma, that no noise explains, and the share of a sensor's
# residuals that wrong labels do not explain either.
_IMPLAUSIBLE, _TOO_MANY = 10.0, 0.25
AS_GOOD, _ELSEWHERE_M = 1.02, 0.2  # outcomes that nothing but chance decides between
CLEARLY_LOWER = 0.9  # the other start must lower the cost by this factor


@dataclass(frozen=True)
class InitialProblem:
    """A problem that is not solved yet, and where it starts.

    Attributes:
        initial: the dataset whose transforms are the start.
        measurements: those whose board could be placed.
        boards: initial (or held) poses.
        unused: why a collection is left out, by key.
        problem: of these.
    """

    initial: Dataset
    measurements: Sequence[Measurement]
    boards: Mapping[BoardKey, np.ndarray]
    unused: Mapping[str, str]
    problem: Problem


@dataclass(frozen=True)
class Starts:
    """Where the solver may start.

    Attributes:
        problems: one for each start.
        remarks: what the user should know.
    """

    problems: Tuple[InitialProblem, ...]
    remarks: Tuple[str, ...]


class SensorPose(NamedTuple):
    """The sensors on an edge, and its ``parent_T_child`` (4, 4)."""

    names: Tuple[str, ...]
    pose: np.ndarray


@dataclass(frozen=True)
class RoughSolution:
    """A problem solved roughly, every board in its place.

    Attributes:
        start: what it began with.
        first: solver of the problem of the start.
        solver: of the problem as it is now.
        minimum: where to go on from.
    """

    start: InitialProblem
    first: Solver
    solver: Solver
    minimum: Minimum

    def robust_cost(self) -> float:
        """Return the cost with the sensors' initial sigmas, comparable between starts."""
        return sum(losses.cost(losses.CAUCHY, squares) for squares in self._squares())

    def is_implausible(self) -> bool:
        """Tell whether a quarter of some sensor's residuals are larger than noise explains."""
        rows = max(self.solver.problem.row_count, 1)
        if 2.0 * self.minimum.cost < rows:  # no need to look closer
            return False
        shares = [float(np.mean(squares > _IMPLAUSIBLE**2)) for squares in self._squares()]
        return max(shares) > _TOO_MANY

    def sensor_edges(self) -> List[SensorPose]:
        """Return the sensors' estimated edges."""
        parameters = self.solver.problem.parameters
        poses = parameters.poses(self.minimum.x)
        return [
            SensorPose(block.names, poses[i])
            for i, block in enumerate(parameters.blocks)
            if block.kind == SENSOR
        ]

    def _squares(self) -> List[np.ndarray]:
        return self.solver.squares(self.minimum.x, self.solver.problem.initial_sigmas)


@dataclass(frozen=True)
class ChosenStart:
    """The rough solution that led where it should.

    Attributes:
        solution: it.
        rivals: those that are as good and put a sensor elsewhere.
        remarks: what the user should know.
    """

    solution: RoughSolution
    rivals: Tuple[RoughSolution, ...]
    remarks: Tuple[str, ...]


def find_starts(prepared: Prepared, options: CalibrationOptions) -> Starts:
    """Return the starts to try: the description's, or what the data allow; then disturbed.

    Intrinsics are held; they join when the rest stands.

    Raises:
        CalibrationError: nothing is left to estimate, or what is left does not hang together.
    """
    dataset, measurements = prepared.dataset, prepared.measurements
    free = prepared.free.without_intrinsics()
    guesses: List[Dataset] = [dataset]
    remarks: Tuple[str, ...] = ()
    if options.initial_guess == NO_GUESS:
        estimate = sensors_from_boards(dataset, measurements, free)
        guesses, remarks = [estimate.dataset, *estimate.others], estimate.remarks
    problems = []
    for guess in guesses:
        rng = np.random.default_rng(options.seed)
        moved = disturbed(guess, free, *options.noisy_initial_guess, rng)
        of_dataset = options.boards_of_dataset
        problems.append(initial_problem(moved, measurements, free, prepared.unused, of_dataset))
    return Starts(tuple(problems), remarks)


def choose_start(
    starts: Starts, prepared: Prepared, options: CalibrationOptions, setup: SolverSetup
) -> ChosenStart:
    """Solve the problem of every start roughly, and return the best one.

    Where the description's cannot be right, it is compared with starts from the data.
    """
    best, rivals = best_rough_solution(starts.problems, setup)
    remarks: Tuple[str, ...] = ()
    if options.initial_guess == DESCRIPTION:
        free = prepared.free.without_intrinsics()
        best, remarks = restarted_from_data(best, prepared.dataset, free, setup)
    return ChosenStart(best, tuple(rivals), remarks)


def initial_problem(
    initial: Dataset,
    measurements: Sequence[Measurement],
    free: FreeEdges,
    unused: Optional[Mapping[str, str]] = None,
    boards_of_dataset: bool = False,
) -> InitialProblem:
    """Place the boards and build the problem of a start.

    Raises:
        CalibrationError: nothing is left to estimate, or what is left does not hang together.
    """
    left_out: Dict[str, str] = dict(unused or {})
    boards = initial_boards(initial, measurements, free, boards_of_dataset)
    kept = placed(initial, measurements, boards, left_out)
    check_connected(initial, kept, free)
    problem = build_problem(initial, kept, boards, free)
    if problem.parameters.size == 0:
        raise CalibrationError("nothing is left to estimate: every sensor and board is held")
    return InitialProblem(initial, kept, boards, left_out, problem)


def rough_solution(start: InitialProblem, setup: SolverSetup) -> RoughSolution:
    """Solve roughly, boards placed anew where they stand wrong; with half of the iterations."""
    first = setup.make(start.problem)
    check_finite(first)
    half = replace(setup.options, max_iterations=max(setup.options.max_iterations // 2, 1))
    measurements = start.measurements
    solver, minimum = settle_boards(start.initial, first, measurements, half, setup.make)
    return RoughSolution(start, first, solver, minimum)


def best_rough_solution(
    starts: Sequence[InitialProblem], setup: SolverSetup
) -> Tuple[RoughSolution, List[RoughSolution]]:
    """Solve the problem of every start roughly.

    Returns:
        The solution of the lowest cost, and those that are as good and put a sensor elsewhere.
    """
    solutions: List[RoughSolution] = []
    for start in starts:
        solutions.append(rough_solution(start, setup))
        if solutions[-1].minimum.interrupted:
            break
    if len(solutions) == 1:
        return solutions[0], []
    costs = [s.robust_cost() for s in solutions]
    best = solutions[int(np.argmin(costs))]
    rivals = [s for s, cost in zip(solutions, costs) if cost <= AS_GOOD * min(costs)]
    return best, [s for s in rivals if s is not best and moved_sensors(best, s)]


def moved_sensors(one: RoughSolution, other: RoughSolution) -> Dict[str, float]:
    """Return the sensors that stand elsewhere in the other outcome, and by how much [m].

    A sensor that only turned counts with the length of the arc one metre away.
    """
    moved = {}
    for a, b in zip(one.sensor_edges(), other.sensor_edges()):
        apart = max(se3.pose_difference(a.pose, b.pose))
        if apart > _ELSEWHERE_M:
            moved["+".join(a.names)] = apart
    return moved


def restarted_from_data(
    solution: RoughSolution, dataset: Dataset, free: FreeEdges, setup: SolverSetup
) -> Tuple[RoughSolution, Tuple[str, ...]]:
    """Return the solution of a start from the data where it is better, with a warning.

    It is tried only when that of the description's start is implausible, or has not converged.
    """
    lost = not solution.minimum.converged
    if solution.minimum.interrupted or not (lost or solution.is_implausible()):
        return solution, ()
    start = solution.start
    estimate = sensors_from_boards(dataset, start.measurements, free)
    starts = [
        initial_problem(guess, start.measurements, free, start.unused)
        for guess in (estimate.dataset, *estimate.others)
    ]
    other, _ = best_rough_solution(starts, setup)
    enough = AS_GOOD if lost and other.minimum.converged else CLEARLY_LOWER
    if not other.robust_cost() < enough * solution.robust_cost():
        return solution, ()
    remark = (
        f"the initial guess of the description {'is far off' if lost else 'ends implausibly'}: the "
        f"sensors were placed from the shared boards instead (as with --initial_guess none); "
        f"correct the description, or look whether it is the right one"
    )
    return other, (remark, *estimate.remarks)


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
    return sensors_from_data(dataset, options).dataset


def sensors_from_data(
    dataset: Dataset, options: Optional[CalibrationOptions] = None
) -> SensorEstimate:
    """Do what ``estimate_sensors`` does, and say which sensors are not placed."""
    prepared = prepare(dataset, options or CalibrationOptions())
    return sensors_from_boards(prepared.dataset, prepared.measurements, prepared.free)
