"""Numbers beside the poses, as each collection has them once its own poses are eliminated."""

from __future__ import annotations

from typing import NamedTuple, Sequence

import numpy as np

from atom_core.problem.blocks import BLOCK_SIZE
from atom_core.problem.problem import Problem
from atom_core.solvers.normal_equations import NormalEquations


class DetectionColumns(NamedTuple):
    """What d detections say of k numbers, summed over their rows.

    Attributes:
        information: (d, k, k); or (d, k) of numbers that no row has two of.
        gradient: (d, k).
        by_state: (d, k, 6) what they and the detections' poses have in common; or (d, k, 18), with
            the cameras' numbers.
    """

    information: np.ndarray
    gradient: np.ndarray
    by_state: np.ndarray


class CollectionColumns(NamedTuple):
    """What g collections say of k numbers, their own poses following these.

    Attributes:
        cross: (g, s, k) with the numbers of the shared blocks.
        information: (g, k, k).
        gradient: (g, k).
    """

    cross: np.ndarray
    information: np.ndarray
    gradient: np.ndarray


def collection_columns(
    problem: Problem,
    equations: NormalEquations,
    collections: Sequence[str],
    columns: DetectionColumns,
) -> CollectionColumns:
    """Return the columns by collection.

    Args:
        problem: whose detections.
        equations: of the problem, weighted as the columns are.
        collections: which, g of them.
        columns: of all detections.
    """
    names = np.array([key.collection for key in problem.detections])
    information = columns.information
    seen = np.any(information.reshape(len(information), -1) != 0, axis=1)
    found = [
        _of_collection(problem, equations, columns, np.flatnonzero((names == name) & seen))
        for name in collections
    ]
    return CollectionColumns(*(np.array(values) for values in zip(*found)))


def _of_collection(
    problem: Problem, equations: NormalEquations, columns: DetectionColumns, mine: np.ndarray
) -> CollectionColumns:
    """Return the columns of one collection, without the axis g, from some of its detections."""
    layout, count = equations.layout, columns.gradient.shape[1]
    size = BLOCK_SIZE * layout.shared
    cross, group = np.zeros((size + BLOCK_SIZE * layout.width, count)), -1
    for d in mine:
        for k, block in enumerate(problem.dependencies[d]):
            if block < 0:
                continue
            local = layout.group[block] >= 0
            group = int(layout.group[block]) if local else group
            start = BLOCK_SIZE * int(layout.position[block]) + (size if local else 0)
            jacobian = equations.state_jacobians[d, k][: columns.by_state.shape[2]]
            cross[start : start + BLOCK_SIZE] += jacobian.T @ columns.by_state[d].T
    own, gradient = columns.information[mine].sum(axis=0), columns.gradient[mine].sum(axis=0)
    own = np.diag(own) if own.ndim == 1 else own
    with_shared = cross[:size]
    if group >= 0:
        right = np.column_stack([cross[size:], equations.gradient_local[group]])
        solved = np.linalg.lstsq(equations.local[group], right, rcond=None)[0]
        own = own - cross[size:].T @ solved[:, :-1]
        gradient = gradient - cross[size:].T @ solved[:, -1]
        with_shared = with_shared - equations.cross[group].T @ solved[:, :-1]
    return CollectionColumns(with_shared, own, gradient)
