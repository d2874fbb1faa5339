"""The normal equations of each collection, reduced to what all collections share.

The boards' poses are eliminated, so that what is left of a collection is what it says of the shared
parameters and of the scalars beside them. Collections are independent of one another whatever goes
wrong within one: how much they differ tells how sure the answer is without any model of the noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, Iterable, Iterator, List, Mapping, NamedTuple, Sequence, Tuple

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

_AT_A_TIME = 64  # collections whose columns are in memory
_NOTHING = np.zeros((0, 0))
_FLOOR = 1e-12  # of a matrix scaled to a unit diagonal: what is below is rounding


class CollectionPart(NamedTuple):
    """What a collection says of those k shared numbers that it depends on.

    Attributes:
        numbers: (k,) which.
        information: (k, k).
    """

    numbers: np.ndarray
    information: np.ndarray


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
        parts: (g,) of each collection; none where they were not asked for.
        gradient: (g, m).
        total: (m, m) information of all, with what is no collection's, such as a prior's.
        held_gradient: (m,) gradient that is no collection's.
    """

    collections: Tuple[str, ...]
    errors: Tuple[ModelError, ...]
    blocks: int
    shared: int
    parts: Tuple[CollectionPart, ...]
    gradient: np.ndarray
    total: np.ndarray
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
    with_parts: bool = True,
) -> SharedEquations:
    """Return the reduced equations.

    Args:
        problem: whose rows.
        equations: of the problem at the scalars' vector, with the same weights.
        scalars: beside the poses.
        sigmas: for each residual block, (n,).
        priors: standard deviations of some model errors about zero, in their units.
        common: by residual block, standard deviation of what all rows of a detection have in
            common, in its unit; for it a detection counts less than the number of its rows.
        with_parts: keep what each collection says, not only the sum.
    """
    shares = shares_of(problem, sigmas, common)
    if any(common):
        equations = tempered(problem, equations, shares, scalars.x)
    size = equations.layout.shared * BLOCK_SIZE
    m = size + scalars.count
    total, held_gradient = np.zeros((m, m)), np.zeros(m)
    held_gradient[:size] = problem.parameters.prior_gradient(scalars.x)[:size]
    total[:size, :size] = equations.shared
    parts, gradients = {}, []
    for name, part in _by_collection(problem, equations, scalars, shares):
        shared = part.numbers[: len(part.seen)]
        total[shared[:, None], shared] -= part.seen
        total[part.numbers[:, None], part.numbers] += part.information
        gradients.append(np.bincount(part.numbers, part.gradient, m))
        parts[name] = CollectionPart(part.numbers, part.information if with_parts else _NOTHING)
    for j, error in enumerate(scalars.errors, m - len(scalars.errors)):
        prior = prior_information(error, priors)
        total[j, j] += prior
        held_gradient[j] = prior * problem.model_errors.get(error, 0.0) / error.step
    return SharedEquations(
        tuple(parts),
        scalars.errors,
        equations.layout.shared,
        m - len(scalars.errors),
        tuple(parts.values()) if with_parts else (),
        np.array(gradients).reshape(-1, m),
        total,
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
    """Columns beside the poses.

    Attributes:
        information: (g, k, k) by group of detections.
        gradient: (g, k) likewise.
        by_state: (d, c, k) by detection, with its state.
    """

    information: np.ndarray
    gradient: np.ndarray
    by_state: np.ndarray


def summed_columns(
    problem: Problem, scalars: Scalars, shares: Sequence[np.ndarray], group: np.ndarray
) -> Columns:
    """Return the columns, those of a block's detections weighted by their shares.

    Args:
        problem: whose rows.
        scalars: the columns.
        shares: for each residual block, (m,) the part of its weight that a detection has.
        group: (d,) of each detection; those below zero are left out.
    """
    d, k, groups = len(problem.detections), scalars.count, int(group.max(initial=-1)) + 1
    states = STATE_SIZE if problem.parameters.cameras else TWIST_SIZE
    result = Columns(np.zeros((groups, k, k)), np.zeros((groups, k)), np.zeros((d, states, k)))
    for part in scalars.parts:
        mine = group[part.detection] >= 0
        detection, share = part.detection[mine], shares[part.block][mine, None]
        to, at, own = group[detection], part.columns, np.arange(part.by_state.shape[1])
        information = part.information[mine] * share[:, None]
        np.add.at(result.information, (to[:, None, None], at[:, None], at), information)
        np.add.at(result.gradient, (to[:, None], at), part.gradient[mine] * share)
        by_state = part.by_state[mine] * share[:, None]
        result.by_state[detection[:, None, None], own[:, None], at] += by_state
    return result


class _Reduced(NamedTuple):
    numbers: np.ndarray
    information: np.ndarray
    gradient: np.ndarray
    seen: np.ndarray  # of those numbers that are of shared blocks, which come first; boards held


def _by_collection(
    problem: Problem, equations: NormalEquations, scalars: Scalars, shares: Sequence[np.ndarray]
) -> Iterator[Tuple[str, _Reduced]]:
    """Yield what each collection says, by its key."""
    states = equations.state_jacobians.shape[2]
    information, gradient = summed(equations.parts, len(problem.detections), states)
    names, of_detection = np.unique(
        [key.collection for key in problem.detections], return_inverse=True
    )
    columns = Columns(*(np.zeros((0, 0, 0)),) * 3)
    rounding = equations.local.shape[-1] * np.finfo(float).eps
    inverses = np.linalg.pinv(equations.local, rcond=rounding, hermitian=True)
    for c, name in enumerate(names):
        at = c % _AT_A_TIME
        if at == 0:
            group = np.where(of_detection < c + _AT_A_TIME, of_detection - c, -1)
            columns = summed_columns(problem, scalars, shares, group)
        mine = np.flatnonzero(of_detection == c)
        beside = np.flatnonzero(np.diagonal(columns.information[at]))
        own = Columns(
            columns.information[at][np.ix_(beside, beside)],
            columns.gradient[at, beside],
            columns.by_state[mine][:, :, beside],
        )
        jacobian, shared, of_own = _jacobian(problem, equations, mine)
        normal = information[mine] @ jacobian, gradient[mine].ravel()
        head, slope, seen = _eliminated(equations, inverses, jacobian, normal, own, of_own)
        numbers = np.concatenate([shared, equations.layout.shared * BLOCK_SIZE + beside])
        yield str(name), _Reduced(numbers, head, slope, seen)


def _jacobian(
    problem: Problem, equations: NormalEquations, mine: np.ndarray
) -> Tuple[np.ndarray, np.ndarray, int]:
    """Return a collection's Jacobian, its shared numbers (k,), and which group is its own.

    The Jacobian (n, c, k + w) is that of its detections' states, by shared and own numbers.
    """
    layout, index, group = equations.layout, problem.dependencies[mine], -1
    used = np.unique(index[index >= 0])
    positions = np.sort(layout.position[used[layout.group[used] < 0]])
    size = BLOCK_SIZE * len(positions)
    states, width = equations.state_jacobians.shape[2], layout.width * BLOCK_SIZE
    jacobian = np.zeros((len(mine), states, size + width))
    for row, blocks in enumerate(index):
        for k, block in enumerate(blocks):
            if block < 0:
                continue
            position = int(layout.position[block])
            if layout.group[block] >= 0:
                group, start = int(layout.group[block]), size + BLOCK_SIZE * position
            else:
                start = BLOCK_SIZE * int(np.searchsorted(positions, position))
            jacobian[row, :, start : start + BLOCK_SIZE] += equations.state_jacobians[mine[row], k]
    numbers = (BLOCK_SIZE * positions[:, None] + np.arange(BLOCK_SIZE)).ravel()
    return jacobian, numbers, group


def _eliminated(
    equations: NormalEquations,
    inverses: np.ndarray,
    jacobian: np.ndarray,
    normal: Tuple[np.ndarray, np.ndarray],
    columns: Columns,
    group: int,
) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a collection's information and gradient, its own blocks eliminated; and its part.

    Its part is what it says of the shared blocks' numbers while its own are held.
    """
    wide = jacobian.shape[2]
    size = wide - equations.layout.width * BLOCK_SIZE
    flat = jacobian.reshape(-1, wide)
    every, slope = flat.T @ normal[0].reshape(-1, wide), flat.T @ normal[1]
    crossed = flat.T @ columns.by_state.reshape(len(flat), -1)
    head = np.block(
        [[every[:size, :size], crossed[:size]], [crossed[:size].T, columns.information]]
    )
    own = np.concatenate([slope[:size], columns.gradient])
    if group >= 0:
        cross = np.concatenate([every[size:, :size], crossed[size:]], axis=1)
        # With what is expected of them, which is this collection's, too.
        right = np.column_stack([cross, equations.gradient_local[group]])
        solved = inverses[group] @ right
        head = head - cross.T @ solved[:, :-1]
        own = own - cross.T @ solved[:, -1]
    return head, own, every[:size, :size]


def inverse(matrix: np.ndarray) -> np.ndarray:
    """Return the inverse of a symmetric matrix (m, m); what nothing sees gets a huge variance."""
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(matrix), 1e-30))
    values, vectors = np.linalg.eigh(matrix * scale[:, None] * scale)
    return (vectors / np.maximum(values, _FLOOR)) @ vectors.T * scale[:, None] * scale
