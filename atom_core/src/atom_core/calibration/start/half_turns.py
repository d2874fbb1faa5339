"""Boards whose corners have no ids: cameras that count them from the other end.

Corners of a chessboard are numbered as the picture shows them. A camera that hangs on its head, or
whose labels come from elsewhere, numbers them from the other end: every board that it saw is
turned by half. Where the starts as they are end implausibly, the corners of one camera after the
other are renumbered in all its collections at once, and that is kept which lowers the cost clearly.
"""

from __future__ import annotations

from dataclasses import replace
from typing import List, Sequence

import numpy as np

from atom_core.calibration.prepare.preparation import Prepared
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
from atom_core.model.dataset import Dataset
from atom_core.model.labels import RgbLabel
from atom_core.model.pattern import CHARUCO
from atom_core.problem.measurements import Measurement
from atom_core.solvers.base import SolverSetup


def with_half_turns(
    chosen: ChosenStart, starts: Starts, prepared: Prepared, setup: SolverSetup
) -> ChosenStart:
    """Return the start with some cameras' corners renumbered, where that explains them.

    One that ends plausibly stays as it is.

    Args:
        chosen: the best one with the labels as they are.
        starts: where the solver began.
        prepared: what is estimated.
        setup: which solver.
    """
    left, now = _cameras_without_ids(prepared), starts.problems[0].initial
    turned: List[str] = []
    while left and _is_implausible(chosen.solution):
        trials = [_trial(chosen, renumbered(now, name), name, prepared, setup) for name in left]
        costs = [trial.solution.robust_cost() for trial in trials]
        # Of two cameras that disagree either may be the one; what is held stands last.
        at = next(i for i, cost in enumerate(costs) if cost <= AS_GOOD * min(costs))
        if not costs[at] < CLEARLY_LOWER * chosen.solution.robust_cost():
            break
        chosen = trials[at]
        turned.append(left.pop(at))
        now = renumbered(now, turned[-1])
    remarks = tuple(
        f"the corners of '{name}' are numbered from the other end of the board, in all of its "
        f"collections, as by a camera that hangs on its head: they were renumbered"
        for name in turned
    )
    return replace(chosen, remarks=remarks + chosen.remarks)


def _is_implausible(solution: RoughSolution) -> bool:
    return not solution.minimum.interrupted and solution.is_implausible()


def _trial(
    chosen: ChosenStart, initial: Dataset, sensor: str, prepared: Prepared, setup: SolverSetup
) -> ChosenStart:
    """Return the best start with a camera's labels as a dataset has them now."""
    start, free = chosen.solution.start, prepared.free.without_intrinsics()
    measurements = _measured_again(initial, start.measurements, sensor)
    trial = rough_solution(initial_problem(initial, measurements, free, start.unused), setup)
    best, remarks = restarted_from_data(trial, initial, free, setup)
    return ChosenStart(best, (), remarks)


def _measured_again(
    dataset: Dataset, measurements: Sequence[Measurement], sensor: str
) -> List[Measurement]:
    again = []
    for m in measurements:
        new = (
            dataset.sensors[sensor].kind.measure(dataset, m.key)[0] if m.key.sensor == sensor else m
        )
        again.append(m if new is None else new)
    return again


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
    collections = {}
    for key, collection in dataset.collections.items():
        labels = dict(collection.labels)
        for (name, pattern), label in collection.labels.items():
            board = dataset.patterns[pattern]
            if name == sensor and board.kind != CHARUCO and isinstance(label, RgbLabel):
                ids = board.corner_count - 1 - label.ids
                order = np.argsort(ids)
                labels[(name, pattern)] = replace(label, ids=ids[order], pixels=label.pixels[order])
        collections[key] = replace(collection, labels=labels)
    return replace(dataset, collections=collections)
