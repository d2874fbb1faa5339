"""The normal equations of each collection, reduced to what all collections share.

The boards' poses are eliminated, so that what is left of a collection is what it says of the shared
parameters and of the scalars beside them. Collections are independent of one another whatever goes
wrong within one: how much they differ tells how sure the answer is without any model of the noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Iterable, Iterator, List, Mapping, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.problem.blocks import BLOCK_SIZE
from atom_core.problem.camera_blocks import STATE_SIZE, TWIST_SIZE
from atom_core.problem.model_errors import ModelError
from atom_core.problem.problem import Problem
from atom_core.solvers.error_columns import prior_information
from atom_core.solvers.normal_equations import (
    DetectionParts,
    NormalEquations,
    add_prior,
    assembled,
    summed,
)
from atom_core.solvers.scalar_columns import Scalars

_AT_A_TIME, _ENTRIES = 64, 2_000_000  # collections, and numbers, of columns that are in memory
_FLOOR = 1e-12  # of a matrix scaled to a unit diagonal: what is below is rounding


class CollectionPart(NamedTuple):
    """What a collection says of those k shared numbers that it depends on.

    Attributes:
        numbers: (k,) which.
        upper: (k (k + 1) / 2,) upper triangle of its information, row by row.
    """

    numbers: np.ndarray
    upper: np.ndarray

    @classmethod
    def of(cls, numbers: np.ndarray, information: np.ndarray) -> CollectionPart:
        """Return the part that information (k, k) makes."""
        return cls(numbers, information[_triangle(len(numbers))])

    @property
    def information(self) -> np.ndarray:
        """(k, k)."""
        k = len(self.numbers)
        full = np.empty((k, k))
        row, column = _triangle(k)
        full[row, column] = self.upper
        full[column, row] = self.upper
        return full


@lru_cache(maxsize=4)
def _triangle(size: int) -> Tuple[np.ndarray, np.ndarray]:
    row, column = np.triu_indices(size)
    return row, column


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
        of_fields: how many of the errors are of fields; they come last.
        parts: (g,) of each collection, of other errors than those; none where they were not asked
            for.
        gradient: (g, m).
        total: (m, m) information of all, with what is no collection's, such as a prior's.
        held_gradient: (m,) gradient that is no collection's.
    """

    collections: Tuple[str, ...]
    errors: Tuple[ModelError, ...]
    blocks: int
    shared: int
    of_fields: int
    parts: Tuple[CollectionPart, ...]
    gradient: np.ndarray
    total: np.ndarray
    held_gradient: np.ndarray

    def without_fields(self) -> SharedEquations:
        """Return what is said where the errors of fields are held."""
        m = len(self.total) - self.of_fields
        return replace(
            self,
            errors=self.errors[: m - self.shared],
            of_fields=0,
            gradient=self.gradient[:, :m],
            total=self.total[:m, :m],
            held_gradient=self.held_gradient[:m],
        )


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
        kept = int(np.sum(part.numbers < m - scalars.of_fields)) if with_parts else 0
        parts[name] = CollectionPart.of(part.numbers[:kept], part.information[:kept, :kept])
    for j, error in enumerate(scalars.errors, m - len(scalars.errors)):
        prior = prior_information(error, priors)
        total[j, j] += prior
        held_gradient[j] = prior * problem.model_errors.get(error, 0.0) / error.step
    return SharedEquations(
        tuple(parts),
        scalars.errors,
        equations.layout.shared,
        m - len(scalars.errors),
        scalars.of_fields,
        tuple(parts.values()) if with_parts else (),
        *(np.array(gradients).reshape(-1, m), total, held_gradient),
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
        slope = part.gradient[mine] * share
        if len(np.unique(to)) == len(to):  # no two of a group: far faster
            result.information[to[:, None, None], at[:, None], at] += information
            result.gradient[to[:, None], at] += slope
        else:
            np.add.at(result.information, (to[:, None, None], at[:, None], at), information)
            np.add.at(result.gradient, (to[:, None], at), slope)
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
    at_a_time = int(np.clip(_ENTRIES // max(scalars.count, 1) ** 2, 1, _AT_A_TIME))
    for c, name in enumerate(names):
        at = c % at_a_time
        if at == 0:
            group = np.where(of_detection < c + at_a_time, of_detection - c, -1)
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
