"""The normal equations of each collection, reduced to what all collections share.

The boards' poses are eliminated, so that what is left of a collection is what it says of the shared
parameters and of the scalars beside them. Collections are independent of one another whatever goes
wrong within one: how much they differ tells how sure the answer is without any model of the noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, Iterable, List, Mapping, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.problem.blocks import BLOCK_SIZE
from atom_core.problem.camera_blocks import STATE_SIZE, TWIST_SIZE
from atom_core.problem.model_errors import ModelError, rows_of
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import BorderBlock, ResidualBlock
from atom_core.solvers.error_columns import prior_information, row_weight
from atom_core.solvers.normal_equations import (
    DetectionParts,
    NormalEquations,
    add_prior,
    assembled,
    summed,
)

_FLOOR = 1e-12  # of a matrix scaled to a unit diagonal: what is below is rounding


@dataclass(frozen=True)
class SharedEquations:
    """What each of g collections says of m shared numbers.

    The numbers are those of the shared blocks, then the insets of the border blocks in steps, then
    the model errors in units of their steps.

    Attributes:
        collections: their keys.
        errors: the model errors.
        blocks: how many shared blocks there are.
        shared: how many numbers are not model errors.
        information: (g, m, m).
        gradient: (g, m).
        held: (m, m) information that is no collection's, such as a prior's.
        held_gradient: (m,) likewise.
    """

    collections: Tuple[str, ...]
    errors: Tuple[ModelError, ...]
    blocks: int
    shared: int
    information: np.ndarray
    gradient: np.ndarray
    held: np.ndarray
    held_gradient: np.ndarray


class ScalarPart(NamedTuple):
    """The columns beside the poses that one residual block has, summed by detection.

    Attributes:
        block: index of the residual block.
        detection: (m,) detections that have rows in it.
        columns: (k,) which of all scalars.
        information: (m, k, k).
        gradient: (m, k).
        by_state: (m, c, k) what they and the detections' states have in common.
    """

    block: int
    detection: np.ndarray
    columns: np.ndarray
    information: np.ndarray
    gradient: np.ndarray
    by_state: np.ndarray


@dataclass(frozen=True)
class Scalars:
    """Insets of all border blocks and model errors, as columns at one vector.

    Attributes:
        x: the vector.
        insets: how many are insets; they come first.
        errors: the model errors that some row depends on.
        parts: of every residual block that depends on any.
    """

    x: np.ndarray
    insets: int
    errors: Tuple[ModelError, ...]
    parts: Tuple[ScalarPart, ...]

    @property
    def count(self) -> int:
        """How many scalars there are."""
        return self.insets + len(self.errors)


def scalars_of(
    problem: Problem,
    x: np.ndarray,
    sigmas: Sequence[np.ndarray],
    loss: str,
    errors: Sequence[ModelError],
) -> Scalars:
    """Return the columns at the vector x.

    Args:
        problem: whose rows.
        x: the vector.
        sigmas: for each residual block, (n,).
        loss: robust loss.
        errors: model errors to have as scalars, estimated or not; those that no row depends on are
            dropped.
    """
    poses = problem.poses(x)
    borders = [i for i, b in enumerate(problem.residual_blocks) if isinstance(b, BorderBlock)]
    parts: List[ScalarPart] = []
    linearised = problem.linearised_blocks(x, poses)  # one block at a time is in memory
    for i, (block, (residual, by_state)) in enumerate(zip(problem.residual_blocks, linearised)):
        rows = rows_of(block, poses, problem.patterns, residual, by_state)
        columns: Dict[int, np.ndarray] = {}
        if isinstance(block, BorderBlock):
            across = np.abs(rows.outward) * block.steps_across(poses)
            columns[borders.index(i)] = np.sum(across, axis=1, keepdims=True)
        for number, error in enumerate(errors, len(borders)):
            change = error.derivatives(rows)
            if change is not None and np.any(change):
                columns[number] = error.step * change
        if columns:
            weight = row_weight(residual, sigmas[i], loss)
            parts.append(_part(block, i, columns, residual, by_state, weight))
    used = sorted({int(n) for part in parts for n in part.columns} | set(range(len(borders))))
    place = {number: new for new, number in enumerate(used)}
    parts = [p._replace(columns=np.array([place[int(n)] for n in p.columns])) for p in parts]
    kept = tuple(errors[n - len(borders)] for n in used[len(borders) :])
    return Scalars(x, len(borders), kept, tuple(parts))


def _part(
    block: ResidualBlock,
    index: int,
    columns: Mapping[int, np.ndarray],
    residual: np.ndarray,
    by_state: np.ndarray,
    weight: np.ndarray,
) -> ScalarPart:
    """Return the columns (n, dimension) of a block, by number, summed by detection."""
    k, root = len(columns), np.sqrt(weight)[:, None]
    rows = np.empty((*residual.shape, k + by_state.shape[2]))
    for j, change in enumerate(columns.values()):
        rows[:, :, j] = root * change
    rows[:, :, k:] = root[:, :, None] * by_state
    flat, values = rows.reshape(-1, rows.shape[2]), (residual * root).ravel()
    detection, starts = np.unique(block.detection, return_index=True)
    ends = block.dimension * np.append(starts[1:], block.count)
    both = np.empty((len(detection), k, rows.shape[2]))
    gradient = np.empty((len(detection), k))
    for d, (start, end) in enumerate(zip(block.dimension * starts, ends)):
        own = flat[start:end]
        both[d] = own[:, :k].T @ own
        gradient[d] = own[:, :k].T @ values[start:end]
    common = np.swapaxes(both[:, :, k:], 1, 2)
    return ScalarPart(index, detection, np.array(list(columns)), both[:, :, :k], gradient, common)


def shared_equations(
    problem: Problem,
    equations: NormalEquations,
    scalars: Scalars,
    sigmas: Sequence[np.ndarray],
    priors: Mapping[ModelError, float],
    common: Sequence[float],
) -> SharedEquations:
    """Return the reduced equations.

    Args:
        problem: whose rows.
        equations: of the problem at the scalars' vector, with the same weights.
        scalars: beside the poses.
        sigmas: for each residual block, (n,).
        priors: standard deviations of some model errors about zero, in their units.
        common: for each residual block, standard deviation of what all its rows of a detection
            have in common, in its unit; for it a detection counts less than the number of its rows.
    """
    shares = shares_of(problem, sigmas, common)
    if any(common):
        equations = tempered(problem, equations, shares, scalars.x)
    parts, seen = _by_collection(problem, equations, of_detections(problem, scalars, shares))
    size = equations.layout.shared * BLOCK_SIZE
    m = size + scalars.count
    held, held_gradient = np.zeros((m, m)), np.zeros(m)
    held_gradient[:size] = problem.parameters.prior_gradient(scalars.x)[:size]
    held[:size, :size] = equations.shared - seen
    for j, error in enumerate(scalars.errors, m - len(scalars.errors)):
        held[j, j] = prior_information(error, priors)
        held_gradient[j] = held[j, j] * problem.model_errors.get(error, 0.0) / error.step
    return SharedEquations(
        tuple(parts),
        scalars.errors,
        equations.layout.shared,
        m - len(scalars.errors),
        np.array([part.information for part in parts.values()]).reshape(-1, m, m),
        np.array([part.gradient for part in parts.values()]).reshape(-1, m),
        held,
        held_gradient,
    )


def shares_of(
    problem: Problem, sigmas: Sequence[np.ndarray], common: Iterable[float]
) -> List[np.ndarray]:
    """Return for each residual block (m,): the part of its weight that each detection has.

    The mean of n rows with noise sigma and a common part c has the variance sigma^2 / n + c^2.
    """
    shares = []
    for block, sigma, part in zip(problem.residual_blocks, sigmas, common):
        starts = np.unique(block.detection, return_index=True)[1]
        shares.append(1.0 / (1.0 + np.add.reduceat((part / sigma) ** 2, starts)))
    return shares


def tempered(
    problem: Problem, equations: NormalEquations, shares: Sequence[np.ndarray], x: np.ndarray
) -> NormalEquations:
    """Return the equations at the vector x, each block's detections weighted by their shares."""
    parts = [
        DetectionParts(
            part.detection,
            part.information * share[:, None, None],
            part.gradient * share[:, None],
        )
        for part, share in zip(equations.parts, shares)
    ]
    result = assembled(problem, equations.layout, equations.state_jacobians, parts)
    add_prior(result, problem.parameters, x)
    return result


class Columns(NamedTuple):
    """Columns beside the poses, by detection: (d, k, k), (d, k) and, with the states, (d, c, k)."""

    information: np.ndarray
    gradient: np.ndarray
    by_state: np.ndarray


def of_detections(problem: Problem, scalars: Scalars, shares: Sequence[np.ndarray]) -> Columns:
    """Return the columns, those of a block's detections weighted by their shares."""
    d, k = len(problem.detections), scalars.count
    states = STATE_SIZE if problem.parameters.cameras else TWIST_SIZE
    result = Columns(np.zeros((d, k, k)), np.zeros((d, k)), np.zeros((d, states, k)))
    for part in scalars.parts:
        share, at, own = shares[part.block], part.columns, np.arange(part.by_state.shape[1])
        rows, columns = part.detection[:, None, None], at[:, None]
        result.information[rows, columns, at] += part.information * share[:, None, None]
        result.gradient[part.detection[:, None], at] += part.gradient * share[:, None]
        result.by_state[rows, own[:, None], at] += part.by_state * share[:, None, None]
    return result


def _by_collection(
    problem: Problem, equations: NormalEquations, columns: Columns
) -> Tuple[Dict[str, _Reduced], np.ndarray]:
    """Return what each collection says; and what all say of the shared numbers, boards held."""
    states = equations.state_jacobians.shape[2]
    information, gradient = summed(equations.parts, len(problem.detections), states)
    names, of_detection = np.unique(
        [key.collection for key in problem.detections], return_inverse=True
    )
    rounding = equations.local.shape[-1] * np.finfo(float).eps
    inverses = np.linalg.pinv(equations.local, rcond=rounding, hermitian=True)
    parts = {}
    for c, name in enumerate(names):
        mine = np.flatnonzero(of_detection == c)
        part = _of_collection(problem, equations, inverses, information, gradient, columns, mine)
        parts[str(name)] = part
    return parts, sum((part.seen for part in parts.values()), np.zeros_like(equations.shared))


class _Reduced(NamedTuple):
    information: np.ndarray
    gradient: np.ndarray
    seen: np.ndarray


def _of_collection(
    problem: Problem,
    equations: NormalEquations,
    inverses: np.ndarray,
    information: np.ndarray,
    gradient: np.ndarray,
    columns: Columns,
    mine: np.ndarray,
) -> _Reduced:
    """Return what one collection says, its own blocks eliminated; and its part of the shared."""
    layout, size = equations.layout, equations.layout.shared * BLOCK_SIZE
    width = layout.width * BLOCK_SIZE
    states = equations.state_jacobians.shape[2]
    jacobian = np.zeros((len(mine), states, size + width))
    index, group = problem.dependencies[mine], -1
    for row, blocks in enumerate(index):
        for k, block in enumerate(blocks):
            if block < 0:
                continue
            local = layout.group[block] >= 0
            group = int(layout.group[block]) if local else group
            start = BLOCK_SIZE * int(layout.position[block]) + (size if local else 0)
            jacobian[row, :, start : start + BLOCK_SIZE] += equations.state_jacobians[mine[row], k]
    weighted = (information[mine] @ jacobian).reshape(-1, size + width)
    flat = jacobian.reshape(-1, size + width)
    every, slope = flat.T @ weighted, flat.T @ gradient[mine].ravel()
    crossed = flat.T @ columns.by_state[mine].reshape(len(flat), -1)
    head = np.block(
        [
            [every[:size, :size], crossed[:size]],
            [crossed[:size].T, columns.information[mine].sum(axis=0)],
        ]
    )
    own = np.concatenate([slope[:size], columns.gradient[mine].sum(axis=0)])
    if group >= 0:
        cross = np.concatenate([every[size:, :size], crossed[size:]], axis=1)
        # With what is expected of them, which is this collection's, too.
        right = np.column_stack([cross, equations.gradient_local[group]])
        solved = inverses[group] @ right
        head = head - cross.T @ solved[:, :-1]
        own = own - cross.T @ solved[:, -1]
    return _Reduced(head, own, every[:size, :size])


def inverse(matrix: np.ndarray) -> np.ndarray:
    """Return the inverse of a symmetric matrix (m, m); what nothing sees gets a huge variance."""
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(matrix), 1e-30))
    values, vectors = np.linalg.eigh(matrix * scale[:, None] * scale)
    return (vectors / np.maximum(values, _FLOOR)) @ vectors.T * scale[:, None] * scale
