"""Boards of a calibration: where they start, when they are placed anew, where they end."""

from __future__ import annotations

from dataclasses import replace
from typing import Dict, List, Mapping, Sequence, Tuple

import numpy as np

from atom_core.errors import CalibrationError
from atom_core.model.dataset import Dataset, board_edge, pose
from atom_core.model.pattern import BoardKey
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import ROTATION
from atom_core.problem.builder import FreeEdges, with_boards
from atom_core.problem.corrections import corrected_cameras
from atom_core.problem.initial_boards import (
    Placement,
    better_boards,
    doubtful_boards,
    estimate_boards,
)
from atom_core.problem.measurements import Measurement
from atom_core.problem.problem import Problem
from atom_core.solvers import losses
from atom_core.solvers.base import Minimum, Solver, SolverFactory, SolverOptions
from atom_core.solvers.reweighting import rough_minimum

_BOARD_ROUNDS = 3
_FAR_RAD = 2.5  # of a rotation vector, which is singular at a full turn


def initial_boards(
    dataset: Dataset,
    measurements: Sequence[Measurement],
    free: FreeEdges,
    of_dataset: bool = False,
) -> Dict[BoardKey, np.ndarray]:
    """Return ``parent_T_pattern`` of every board, from the sensors where they stand now.

    With ``anchor_patterns`` the dataset's own board poses are held; with ``of_dataset`` they are
    where boards begin, if they fit.
    """
    if free.anchor_patterns:
        return _held_boards(dataset, measurements)
    known: Dict[BoardKey, np.ndarray] = {}
    if of_dataset:
        carried = carried_boards(dataset, measurements)
        places = {(m.key.pattern, m.key.collection): _board_key(dataset, m) for m in measurements}
        known = {places[place]: carried[place] for place in places if place in carried}
    stand = placement(dataset, measurements)
    return estimate_boards(measurements, _fixed_patterns(dataset), stand, known)


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
        if rough.interrupted:
            break
        replaced, doubtful = _placed_anew(initial, solver, rough.x, measurements)
        if doubtful and not replaced:
            # Boards that stand wrong have pulled the sensors away; a robust loss lets go of them.
            robust = rough_minimum(solver, rough.x, options, rough.iterations, losses.CAUCHY)
            replaced, _ = _placed_anew(initial, solver, robust.x, measurements)
            rough = replace(robust if replaced else rough, iterations=robust.iterations)
        if not replaced:
            break
        solver, x = restarted(solver, rough.x, replaced, make_solver)
        rough = rough_minimum(solver, x, options, rough.iterations)
    turned = _far_turned(solver.problem, rough.x)
    if turned:
        solver, x = restarted(solver, rough.x, turned, make_solver)
        rough = replace(rough, x=x)
    return solver, rough


def _placed_anew(
    initial: Dataset, solver: Solver, x: np.ndarray, measurements: Sequence[Measurement]
) -> Tuple[Dict[int, np.ndarray], List[int]]:
    """Return better poses of boards by index of their block, and the boards that were doubted."""
    problem = solver.problem
    units = [np.ones(block.count) for block in problem.residual_blocks]
    doubtful = doubtful_boards(problem, solver.squares(x, units))
    if not doubtful:
        return {}, []
    poses = problem.parameters.poses(x)
    blocks = [problem.parameters.blocks[i] for i in doubtful]
    boards = {(b.names[0], b.collection): i for b, i in zip(blocks, doubtful)}
    seen = [m for m in measurements if _board_key(initial, m) in boards]
    better = better_boards(
        seen,
        _fixed_patterns(initial),
        placement(solved_dataset(initial, problem, x, {}), seen),
        {key: poses[i] for key, i in boards.items()},
    )
    return {boards[key]: pose_ for key, pose_ in better.items()}, doubtful


def _far_turned(problem: Problem, x: np.ndarray) -> Dict[int, np.ndarray]:
    """Return the poses of blocks that have turned so far that their numbers become singular."""
    parameters = problem.parameters
    turns = np.linalg.norm(parameters.by_block(x)[:, ROTATION], axis=1)
    poses = parameters.poses(x)
    return {i: poses[i] for i, _ in parameters.pose_blocks() if turns[i] > _FAR_RAD}


def restarted(
    solver: Solver, x: np.ndarray, poses: Mapping[int, np.ndarray], make_solver: SolverFactory
) -> Tuple[Solver, np.ndarray]:
    """Return a solver whose blocks begin at new poses (4, 4), by index, and the vector then."""
    problem = solver.problem
    solver = make_solver(replace(problem, parameters=problem.parameters.with_initial(poses)))
    x = x.copy()
    problem.parameters.by_block(x)[list(poses)] = 0.0
    return solver, x


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


def boards_in(dataset: Dataset, measurements: Sequence[Measurement]) -> Dict[BoardKey, np.ndarray]:
    """Return ``parent_T_pattern`` of every measured board, as a solved dataset carries it."""
    boards: Dict[BoardKey, np.ndarray] = {}
    for m in measurements:
        pattern = dataset.patterns[m.key.pattern]
        transforms = dataset.collections[m.key.collection].transforms
        boards[pattern.board_key(m.key.collection)] = transforms[board_edge(pattern)]
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
                f"'{m.key.pattern}' to hold; calibrate once without -ap and use its result, "
                f"or let `estimate_pattern_poses` add first poses"
            )
    return boards


def placed(
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


def solved_dataset(
    dataset: Dataset, problem: Problem, x: np.ndarray, boards: Mapping[BoardKey, np.ndarray]
) -> Dataset:
    """Return the dataset with the solution's edges and boards in its transforms."""
    changes: Dict[str, Dict[Edge, np.ndarray]] = {key: {} for key in dataset.collections}
    for block, matrix in problem.parameters.edges_at(x):
        for key in dataset.collections if block.collection is None else [block.collection]:
            changes[key][block.edge] = matrix
    # the boards first: held ones keep their value, the others are among the changes
    solved = with_boards(dataset, boards).with_transforms(changes)
    solved = solved.with_joint_parameters(problem.parameters.joints_at(x))
    cameras = {name: pair[1] for name, pair in problem.parameters.cameras_at(x).items()}
    cameras.update(corrected_cameras(problem))
    sensors = {
        name: replace(sensor, camera=cameras[name]) if name in cameras else sensor
        for name, sensor in solved.sensors.items()
    }
    return replace(solved, sensors=sensors) if cameras else solved
