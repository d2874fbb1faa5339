"""Boards whose corners have no ids: cameras that count them from the other end.

Corners of a chessboard are numbered as the picture shows them. A camera that hangs on its head, or
whose labels come from elsewhere, numbers them from the other end: every board that it saw is
turned by half. Where the starts as they are end implausibly, the corners of one camera after the
other are renumbered in all its collections at once, and that is kept which lowers the cost clearly.
Beside a camera that is turned by a quarter, one numbers them from the other end in half of the
collections: single detections are renumbered as the others have the board.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Container, Dict, List, Sequence, Set, Tuple

import numpy as np

from atom_core.calibration.prepare.preparation import Prepared
from atom_core.calibration.start.boards import solved_dataset
from atom_core.calibration.start.starts import (
    AS_GOOD,
    CLEARLY_LOWER,
    ChosenStart,
    RoughSolution,
    Starts,
    initial_problem,
    restarted_from_data,
    rough_solution,
)
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, pose
from atom_core.model.labels import DetectionKey, RgbLabel
from atom_core.model.pattern import CHARUCO, BoardKey
from atom_core.model.transforms import Edge
from atom_core.problem.measurements import Measurement
from atom_core.solvers.base import SolverSetup

_HALF_TURN = np.diag([-1.0, -1.0, 1.0])  # about the board's normal


def with_half_turns(
    chosen: ChosenStart, starts: Starts, prepared: Prepared, setup: SolverSetup
) -> ChosenStart:
    """Return the start with some cameras' corners renumbered, where that explains them.

    A whole camera is tried only where the start as it is ends implausibly.

    Args:
        chosen: the best one with the labels as they are.
        starts: where the solver began.
        prepared: what is estimated.
        setup: which solver.
    """
    left, initial = _cameras_without_ids(prepared), starts.problems[0].initial
    if not left or chosen.solution.minimum.interrupted:
        return chosen
    best = chosen
    turned: Set[DetectionKey] = set()
    while left and _is_implausible(best.solution):
        of_each = [{m.key for m in prepared.measurements if m.key.sensor == name} for name in left]
        trials = [
            _trial(best, _renumbered(initial, turned | keys), keys, prepared, setup)
            for keys in of_each
        ]
        costs = [trial.solution.robust_cost() for trial in trials]
        # Of two cameras that disagree either may be the one; what is held stands last.
        at = next(i for i, cost in enumerate(costs) if cost <= AS_GOOD * min(costs))
        if not costs[at] < CLEARLY_LOWER * best.solution.robust_cost():
            break
        best = trials[at]
        left.pop(at)
        turned = turned | of_each[at]
    whole = turned
    best, turned = _with_single_ones(best, initial, whole, prepared, setup)
    if whole and turned != whole:
        best, turned = _with_fewest((best, turned), chosen, initial, prepared, setup)
    return replace(best, remarks=(*_remarks(prepared, turned), *best.remarks))


def _with_single_ones(
    chosen: ChosenStart,
    initial: Dataset,
    turned: Set[DetectionKey],
    prepared: Prepared,
    setup: SolverSetup,
) -> Tuple[ChosenStart, Set[DetectionKey]]:
    """Return the start with single detections renumbered, as they are beside those of others.

    How they are is told by where the sensors begin, and by where the solution has them.

    Args:
        chosen: the best one so far.
        initial: where the solver began, with the labels as they were given.
        turned: what is renumbered in the chosen one.
        prepared: what is estimated.
        setup: which solver.

    Returns:
        The best one, and what is renumbered in it.
    """
    best, before = chosen, turned
    measurements = chosen.solution.start.measurements
    tried: List[Set[DetectionKey]] = [set()]
    for place in (initial, _solved(chosen)):
        keys = turned_beside_others(place, measurements, prepared.free.held_edges(place))
        if keys in tried or best.solution.minimum.interrupted:
            continue
        tried.append(keys)
        trial = _trial(chosen, _renumbered(initial, before ^ keys), keys, prepared, setup)
        if trial.solution.robust_cost() < CLEARLY_LOWER * best.solution.robust_cost():
            best, turned = trial, before ^ keys
    return best, turned


def _with_fewest(
    best: Tuple[ChosenStart, Set[DetectionKey]],
    chosen: ChosenStart,
    initial: Dataset,
    prepared: Prepared,
    setup: SolverSetup,
) -> Tuple[ChosenStart, Set[DetectionKey]]:
    """Return as good a start with fewer detections renumbered, where there is one.

    Args:
        best: after whole cameras and single detections, and what is renumbered in it.
        chosen: the one with the labels as they are.
        initial: where the solver began, with these labels.
        prepared: what is estimated.
        setup: which solver.
    """
    place, measurements = _solved(best[0]), chosen.solution.start.measurements
    keys = turned_beside_others(place, measurements, prepared.free.held_edges(place))
    if len(keys) >= len(best[1]):
        return best
    trial = _trial(chosen, _renumbered(initial, keys), keys, prepared, setup)
    as_good = trial.solution.robust_cost() <= AS_GOOD * best[0].solution.robust_cost()
    return (trial, keys) if as_good else best


def _solved(chosen: ChosenStart) -> Dataset:
    solution = chosen.solution
    return solved_dataset(solution.start.initial, solution.solver.problem, solution.minimum.x, {})


def turned_beside_others(
    dataset: Dataset, measurements: Sequence[Measurement], held: Container[Edge]
) -> Set[DetectionKey]:
    """Return the detections of boards without ids that are half a turn from most others' board.

    Of two that disagree it is the one whose camera is not held, else the later one.

    Args:
        dataset: its transforms say where the cameras are.
        measurements: all detections.
        held: edges of sensors that stay.
    """
    sensors = dataset.sensors
    boards: Dict[BoardKey, List[Tuple[DetectionKey, np.ndarray]]] = {}
    for m in sorted(measurements, key=lambda m: sensors[m.key.sensor].edge not in held):
        pattern = dataset.patterns[m.key.pattern]
        if not m.identifies_board or pattern.kind == CHARUCO:
            continue
        collection, frame = dataset.collections[m.key.collection], sensors[m.key.sensor].frame
        parent_T_sensor = pose(collection, dataset.graph, pattern.parent_frame, frame)
        turns = [(parent_T_sensor @ likely)[:3, :3] for likely in m.likely_candidates()]
        if turns:
            board = boards.setdefault(pattern.board_key(m.key.collection), [])
            board.append((m.key, np.array(turns)))
    found: Set[DetectionKey] = set()
    for seen in boards.values():
        first = seen[0][1]
        differ = {key for key, turns in seen if _is_turned(first, turns)}
        same = {key for key, _ in seen} - differ
        found |= same if len(differ) > len(same) else differ
    return found


def _is_turned(one: np.ndarray, other: np.ndarray) -> bool:
    """Tell whether two rotations of a board (n, 3, 3), likely ones, agree better half a turn on."""
    between = np.swapaxes(one[:, None], -1, -2) @ other[None]
    as_is, turned = se3.rotation_angle(between), se3.rotation_angle(between @ _HALF_TURN)
    return bool(np.min(turned) < np.min(as_is))


def _remarks(prepared: Prepared, turned: Set[DetectionKey]) -> List[str]:
    remarks = []
    for name in prepared.dataset.sensors:
        mine = {key for key in turned if key.sensor == name}
        if not mine:
            continue
        rest = {m.key for m in prepared.measurements if m.key.sensor == name} - mine
        where = ", ".join(sorted(key.collection for key in mine))
        remarks.append(
            f"the corners of '{name}' are numbered from the other end of the board, in "
            + (
                f"collection {where}, beside those of the other detections: they were renumbered"
                if rest
                else "all of its collections, as by a camera that hangs on its head: they were "
                "renumbered"
            )
        )
    return remarks


def _is_implausible(solution: RoughSolution) -> bool:
    return not solution.minimum.interrupted and solution.is_implausible()


def _trial(
    chosen: ChosenStart,
    initial: Dataset,
    turned: Container[DetectionKey],
    prepared: Prepared,
    setup: SolverSetup,
) -> ChosenStart:
    """Return the best start with some labels as a dataset has them now."""
    start, free = chosen.solution.start, prepared.free.without_intrinsics()
    measurements = [
        (initial.sensors[m.key.sensor].kind.measure(initial, m.key)[0] or m)
        if m.key in turned
        else m
        for m in start.measurements
    ]
    trial = rough_solution(initial_problem(initial, measurements, free, start.unused), setup)
    best, remarks = restarted_from_data(trial, initial, free, setup)
    return ChosenStart(best, (), remarks)


def _cameras_without_ids(prepared: Prepared) -> List[str]:
    """Return the cameras that saw a board without ids, those that are held last."""
    dataset = prepared.dataset
    names = dict.fromkeys(
        m.key.sensor
        for m in prepared.measurements
        if m.identifies_board and dataset.patterns[m.key.pattern].kind != CHARUCO
    )
    held = prepared.free.held_edges(dataset)
    return sorted(names, key=lambda name: dataset.sensors[name].edge in held)


def renumbered(dataset: Dataset, sensor: str) -> Dataset:
    """Return the dataset with a camera's corners of boards without ids counted from the end."""
    return _renumbered(dataset, {key for key, _ in dataset.detections() if key.sensor == sensor})


def _renumbered(dataset: Dataset, keys: Container[DetectionKey]) -> Dataset:
    collections = {}
    for key, collection in dataset.collections.items():
        labels = dict(collection.labels)
        for (name, pattern), label in collection.labels.items():
            board = dataset.patterns[pattern]
            is_one = DetectionKey(key, name, pattern) in keys
            if is_one and board.kind != CHARUCO and isinstance(label, RgbLabel):
                ids = board.corner_count - 1 - label.ids
                order = np.argsort(ids)
                labels[(name, pattern)] = replace(label, ids=ids[order], pixels=label.pixels[order])
        collections[key] = replace(collection, labels=labels)
    return replace(dataset, collections=collections)
