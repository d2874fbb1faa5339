"""The calibration, step by step: dataset and options in, calibration out."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Dict, List, Mapping, Optional, Sequence, Set, Tuple

import numpy as np

from atom_core.calibration.connectivity import check_connected, floats_freely
from atom_core.calibration.disturb import disturbed
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.weak_directions import WeakDirection, weak_directions
from atom_core.errors import CalibrationError
from atom_core.model.dataset import Dataset, board_edge, is_complete, pose
from atom_core.model.pattern import BoardKey
from atom_core.model.sensor import LIDAR2D
from atom_core.model.transforms import Edge
from atom_core.problem.builder import FreeEdges, build_problem, check_edges, with_boards
from atom_core.problem.initial_boards import Placement, better_boards, estimate_boards
from atom_core.problem.measurements import Measurement, read_measurements
from atom_core.problem.parameters import PATTERN
from atom_core.problem.problem import Problem
from atom_core.solvers.base import (
    CONVERGED,
    Minimum,
    Solver,
    SolverFactory,
    SolverOptions,
    SolverSummary,
)
from atom_core.solvers.choice import solver_factory
from atom_core.solvers.covariance import Covariance
from atom_core.solvers.reweighting import covariance_of, rough_minimum, solve

RANK_DEFICIENT = "rank_deficient"
_BOARD_ROUNDS = 3


@dataclass(frozen=True)
class Calibration:
    """The answer, and all that is needed to judge it.

    Attributes:
        dataset: the input with the calibrated edges and board poses in its transforms.
        initial: the dataset that the solver started from (after any disturbance).
        free: what was estimated and what was held.
        problem, summary, covariance: of the solver.
        status: converged, not_converged, rank_deficient or failed.
        message: one sentence.
        weak_directions: what the data leave open.
        unused: why a collection was not used, by key.
        warnings: what the user should know.
        seconds: time by step.
        seed: of the disturbance.
    """

    dataset: Dataset
    initial: Dataset
    free: FreeEdges
    problem: Problem
    summary: SolverSummary
    covariance: Covariance
    status: str
    message: str
    weak_directions: Tuple[WeakDirection, ...]
    unused: Mapping[str, str]
    warnings: Tuple[str, ...]
    seconds: Mapping[str, float]
    seed: int


def calibrate(dataset: Dataset, options: Optional[CalibrationOptions] = None) -> Calibration:
    """Estimate the selected edges of a dataset, and its board poses.

    Args:
        dataset: already reduced to the selected sensors, collections and patterns.
        options: what to hold, how to solve.

    Raises:
        AtomError: the calibration cannot be posed; one sentence says why and what to do.
    """
    options = options or CalibrationOptions()
    clock = _Clock()
    warnings = list(dataset.warnings)
    check_modalities(dataset)
    check_data_present(dataset)
    free = free_edges(dataset, options)
    check_edges(dataset, free)
    measurements, remarks = read_measurements(dataset)
    measurements, unused = _usable(dataset, measurements, options)
    check_connected(dataset, measurements, free)
    if floats_freely(dataset, measurements, free):
        free, remark = _anchor_first(dataset, free)
        remarks.append(remark)
    clock.lap("build")

    rng = np.random.default_rng(options.seed)
    initial = disturbed(dataset, free, *options.noisy_initial_guess, rng)
    boards = initial_boards(initial, measurements, free)
    measurements = _placed(initial, measurements, boards, unused)
    check_connected(dataset, measurements, free)
    problem = build_problem(initial, measurements, boards, free)
    if problem.parameters.size == 0:
        raise CalibrationError("nothing is left to estimate: every sensor and board is held")
    clock.lap("initialise")

    make_solver = solver_factory(options.solver_name)
    first = make_solver(problem)
    solver, rough = settle_boards(initial, first, measurements, options.solver, make_solver)
    summary = solve(solver, options.solver, rough, guess=first)
    problem = solver.problem
    clock.lap("solve")
    covariance = covariance_of(solver, summary, options.solver)
    weak = weak_directions(
        initial, problem.parameters, summary.x, covariance, *options.undetermined_limit
    )
    clock.lap("covariance")
    status, message = _verdict(summary, weak)
    return Calibration(
        dataset=solved_dataset(initial, problem, summary.x, boards),
        initial=initial,
        free=free,
        problem=problem,
        summary=summary,
        covariance=covariance,
        status=status,
        message=message,
        weak_directions=tuple(weak),
        unused=unused,
        warnings=tuple(warnings + remarks),
        seconds=clock.laps,
        seed=options.seed,
    )


def check_modalities(dataset: Dataset) -> None:
    """Refuse sensors whose residuals do not exist yet, by name."""
    for sensor in dataset.sensors.values():
        if sensor.modality == LIDAR2D:
            raise CalibrationError(
                f"sensor '{sensor.name}': modality lidar2d can be read and written but not "
                f"calibrated yet; leave it out with -ssf '!{sensor.name}'"
            )


def absent_data(dataset: Dataset) -> Dict[str, List[str]]:
    """Return, by range sensor, the collections whose labels refer to absent data files."""
    absent: Dict[str, List[str]] = {}
    for key, _ in dataset.detections():
        is_range = dataset.sensors[key.sensor].is_range
        if is_range and not dataset.data.has_data(key.collection, key.sensor):
            absent.setdefault(key.sensor, []).append(key.collection)
    return absent


def check_data_present(dataset: Dataset) -> None:
    """Refuse a range sensor whose labels refer to data files that are absent."""
    for sensor, collections in absent_data(dataset).items():
        raise CalibrationError(
            f"{dataset.source}: the data files of sensor '{sensor}' are absent (collections "
            f"{', '.join(dict.fromkeys(collections))}); put them beside the dataset, or leave the "
            f"sensor out with -ssf '!{sensor}'"
        )


def free_edges(dataset: Dataset, options: CalibrationOptions) -> FreeEdges:
    """Return what is estimated and what is held, from configuration and options.

    Raises:
        CalibrationError: an anchored sensor that does not exist.
    """
    anchored = list(options.anchor_sensors)
    configured = dataset.config.anchored_sensor
    if configured and not options.ignore_anchored_sensor and configured in dataset.sensors:
        anchored.append(configured)
    for name in options.anchor_sensors:
        if name not in dataset.sensors:
            raise CalibrationError(
                f"anchored sensor '{name}' is not among the sensors used: "
                f"{', '.join(dataset.sensors)}"
            )
    additional = {
        name: Edge(entry.parent_link, entry.child_link)
        for name, entry in dataset.config.additional_tfs.items()
        if options.additional_tfs is None or name in options.additional_tfs
    }
    return FreeEdges(tuple(dict.fromkeys(anchored)), additional, options.anchor_patterns)


def _usable(
    dataset: Dataset, measurements: Sequence[Measurement], options: CalibrationOptions
) -> Tuple[List[Measurement], Dict[str, str]]:
    """Return the measurements that can tie something, and why collections were left out."""
    unused: Dict[str, str] = {}
    seen_by: Dict[Tuple[str, str], Set[Edge]] = {}
    for m in measurements:
        edge = dataset.sensors[m.key.sensor].edge
        seen_by.setdefault((m.key.collection, m.key.pattern), set()).add(edge)
    for key in dataset.collections:
        boards = [s for (collection, _), s in seen_by.items() if collection == key]
        if not boards:
            unused[key] = "no sensor detected a pattern"
        elif options.complete_only and not is_complete(dataset, key):
            unused[key] = "incomplete (--complete_only)"

    def ties(m: Measurement) -> bool:
        if dataset.patterns[m.key.pattern].fixed or options.anchor_patterns:
            return True
        return len(seen_by[(m.key.collection, m.key.pattern)]) > 1

    kept = [m for m in measurements if m.key.collection not in unused and ties(m)]
    used = {m.key.collection for m in kept}
    for key in dataset.collections:
        if key not in used and key not in unused:
            unused[key] = "the board is seen by one sensor only, which ties nothing together"
    return kept, unused


def _anchor_first(dataset: Dataset, free: FreeEdges) -> Tuple[FreeEdges, str]:
    name = next(iter(dataset.sensors))
    remark = (
        f"nothing ties the rig to '{dataset.world}': sensor '{name}' is held where it is, all "
        f"others are relative to it (name one with anchored_sensor or -as)"
    )
    return replace(free, anchored_sensors=(name,)), remark


def initial_boards(
    dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges
) -> Dict[BoardKey, np.ndarray]:
    """Return ``parent_T_pattern`` of every board, from the sensors where they stand now.

    With ``anchor_patterns`` the dataset's own board poses are held.
    """
    if free.anchor_patterns:
        return _held_boards(dataset, measurements)
    return estimate_boards(measurements, _fixed_patterns(dataset), placement(dataset, measurements))


def _fixed_patterns(dataset: Dataset) -> List[str]:
    return [p.name for p in dataset.patterns.values() if p.fixed]


def placement(dataset: Dataset, measurements: Sequence[Measurement]) -> Placement:
    """Return where the sensors and the patterns' parents stand in the dataset's transforms."""
    graph = dataset.graph
    world_T_sensor, world_T_parent = {}, {}
    for m in measurements:
        collection, world = dataset.collections[m.key.collection], dataset.world
        world_T_sensor[(m.key.collection, m.key.sensor)] = pose(
            collection, graph, world, dataset.sensors[m.key.sensor].frame
        )
        world_T_parent[(m.key.collection, m.key.pattern)] = pose(
            collection, graph, world, dataset.patterns[m.key.pattern].parent_frame
        )
    return Placement(world_T_sensor, world_T_parent)


def settle_boards(
    initial: Dataset,
    solver: Solver,
    measurements: Sequence[Measurement],
    options: SolverOptions,
    make_solver: SolverFactory,
) -> Tuple[Solver, Minimum]:
    """Solve roughly, and place boards anew that turn out to stand in the wrong solution.

    Returns:
        The solver of the problem as it is then, and where to go on from.
    """
    rough = rough_minimum(solver, np.zeros(solver.problem.parameters.size), options)
    for _ in range(_BOARD_ROUNDS):
        problem = solver.problem
        poses = problem.parameters.poses(rough.x)
        boards: Dict[BoardKey, int] = {
            (block.names[0], block.collection): i
            for i, block in enumerate(problem.parameters.blocks)
            if block.kind == PATTERN
        }
        better = better_boards(
            [m for m in measurements if _board_key(initial, m) in boards],
            _fixed_patterns(initial),
            placement(solved_dataset(initial, problem, rough.x, {}), measurements),
            {key: poses[i] for key, i in boards.items()},
        )
        if not better:
            break
        replaced = {boards[key]: pose_ for key, pose_ in better.items()}
        solver = make_solver(replace(problem, parameters=problem.parameters.with_initial(replaced)))
        x = rough.x.copy()
        x.reshape(-1, 6)[list(replaced)] = 0.0
        left = replace(options, max_iterations=max(options.max_iterations - rough.iterations, 1))
        again = rough_minimum(solver, x, left)
        rough = replace(again, iterations=rough.iterations + again.iterations)
    return solver, rough


def _board_key(dataset: Dataset, m: Measurement) -> BoardKey:
    return dataset.patterns[m.key.pattern].board_key(m.key.collection)


def carried_boards(
    dataset: Dataset, measurements: Sequence[Measurement]
) -> Dict[BoardKey, np.ndarray]:
    """Return ``parent_T_pattern`` of the boards whose pose stands in the dataset's transforms."""
    boards: Dict[BoardKey, np.ndarray] = {}
    for m in measurements:
        edge = board_edge(dataset.patterns[m.key.pattern])
        transforms = dataset.collections[m.key.collection].transforms
        if edge in transforms:
            boards[(m.key.pattern, m.key.collection)] = transforms[edge]
    return boards


def _held_boards(
    dataset: Dataset, measurements: Sequence[Measurement]
) -> Dict[BoardKey, np.ndarray]:
    boards = carried_boards(dataset, measurements)
    for m in measurements:
        if (m.key.pattern, m.key.collection) not in boards:
            edge = board_edge(dataset.patterns[m.key.pattern])
            raise CalibrationError(
                f"--anchor_patterns: collection {m.key.collection} has no pose '{edge}' of pattern "
                f"'{m.key.pattern}' to hold; calibrate once without -ap, and use its result"
            )
    return boards


def _placed(
    dataset: Dataset,
    measurements: Sequence[Measurement],
    boards: Mapping[BoardKey, np.ndarray],
    unused: Dict[str, str],
) -> List[Measurement]:
    """Return the measurements whose board has a pose; note the collections that lose theirs."""
    kept = []
    for m in measurements:
        if (m.key.pattern, None) in boards or (m.key.pattern, m.key.collection) in boards:
            kept.append(m)
    used = {m.key.collection for m in kept}
    for key in dataset.collections:
        if key not in used and key not in unused:
            unused[key] = "no detection is good enough to place the board"
    return kept


def _verdict(summary: SolverSummary, weak: Sequence[WeakDirection]) -> Tuple[str, str]:
    if summary.status == CONVERGED and weak:
        return RANK_DEFICIENT, f"{len(weak)} undetermined direction(s): {weak[0].why}"
    return summary.status, summary.message


def solved_dataset(
    dataset: Dataset, problem: Problem, x: np.ndarray, boards: Mapping[BoardKey, np.ndarray]
) -> Dataset:
    """Return the dataset with the solution's edges and boards in its transforms."""
    changes: Dict[str, Dict[Edge, np.ndarray]] = {key: {} for key in dataset.collections}
    for block, matrix in zip(problem.parameters.blocks, problem.parameters.poses(x)):
        for key in dataset.collections if block.collection is None else [block.collection]:
            changes[key][block.edge] = matrix
    # the boards first: held ones keep their value, the others are among the changes
    return with_boards(dataset, boards).with_transforms(changes)


class _Clock:
    """Seconds by step."""

    def __init__(self) -> None:
        self.laps: Dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self.laps[name] = now - self._last
        self._last = now
