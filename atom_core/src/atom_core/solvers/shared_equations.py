"""The normal equations of each collection, reduced to what all collections share.

The boards' poses are eliminated, so that what is left of a collection is what it says of the shared
parameters and of the scalars beside them. Collections are independent of one another whatever goes
wrong within one: how much they differ tells how sure the answer is without any model of the noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Dict, Iterable, Iterator, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.problem.blocks import BLOCK_SIZE
from atom_core.problem.camera_blocks import STATE_SIZE, TWIST_SIZE
from atom_core.problem.model_errors import ErrorPriors, ModelError
from atom_core.problem.problem import Problem
from atom_core.solvers.collection_part import CollectionPart
from atom_core.solvers.error_columns import prior_row
from atom_core.solvers.normal_equations import (
    DetectionParts,
    NormalEquations,
    add_prior,
    assembled,
    summed,
)
from atom_core.solvers.scalar_columns import Scalars

_AT_A_TIME, _ENTRIES = 64, 2_000_000  # collections, and numbers, of columns that are in memory
FLOOR = 1e-12  # of a matrix scaled to a unit diagonal: what is below is rounding


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
        parts: (g,) of each collection, of other errors than those.
        gradient: (g, m).
        total: (m, m) information of all, with what is no collection's, such as a prior's.
        held_gradient: (m,) gradient that is no collection's.
        free: (6 blocks,) bool: the numbers of shared blocks that are estimated.
        stated: (6 blocks,) what the user knows of them beforehand, as one over variances.
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
    free: np.ndarray
    stated: np.ndarray

    @property
    def place(self) -> Dict[ModelError, int]:
        """Where each model error stands among the m numbers."""
        return {error: j for j, error in enumerate(self.errors, self.shared)}

    @property
    def total_gradient(self) -> np.ndarray:
        """(m,) of all, with what is no collection's."""
        return np.asarray(self.gradient.sum(axis=0) + self.held_gradient)

    def of_collections(
        self, names: Tuple[str, ...], parts: Tuple[CollectionPart, ...], gradient: np.ndarray
    ) -> SharedEquations:
        """Return the same total, as others say it: by name their parts, and gradient (g, m)."""
        return replace(self, collections=names, parts=parts, gradient=gradient)

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
    priors: ErrorPriors,
    common: Sequence[float],
    repeated: Optional[np.ndarray] = None,
) -> SharedEquations:
    """Return the reduced equations.

    Args:
        problem: whose rows.
        equations: of the problem at the scalars' vector, with the same weights.
        scalars: beside the poses.
        sigmas: for each residual block, (n,).
        priors: of some model errors.
        common: by residual block, standard deviation of what all rows of a detection have in
            common, in its unit; for it a detection counts less than the number of its rows.
        repeated: as of `shares_of`.
    """
    shares = shares_of(problem, sigmas, common, repeated)
    if any(common):
        equations = tempered(problem, equations, shares, scalars.x)
    size = equations.layout.shared * BLOCK_SIZE
    m = size + scalars.count
    total, held_gradient = _of_no_collection(problem, scalars, priors, size)
    total[:size, :size] += equations.shared
    names: List[str] = []
    parts: List[CollectionPart] = []
    gradient = np.zeros((len({key.collection for key in problem.detections}), m))
    for some in _reduced(problem, equations, scalars, shares):
        own = some.numbers[: some.seen.shape[1]]
        total[own[:, None], own] -= some.seen.sum(axis=0)
        total[some.numbers[:, None], some.numbers] += some.information.sum(axis=0)
        gradient[len(names) : len(names) + len(some.names), some.numbers] = some.gradient
        names += some.names
        parts += some.parts(m - scalars.of_fields)
    return SharedEquations(
        tuple(names),
        scalars.errors,
        equations.layout.shared,
        m - len(scalars.errors),
        scalars.of_fields,
        tuple(parts),
        *(gradient, total, held_gradient),
        problem.parameters.free.ravel()[:size],
        problem.parameters.stated_weight.ravel()[:size],
    )


def _of_no_collection(
    problem: Problem, scalars: Scalars, priors: ErrorPriors, size: int
) -> Tuple[np.ndarray, np.ndarray]:
    """Return what priors say of the model errors (m, m), and the priors' gradient (m,).

    Args:
        problem: whose model errors have their values.
        scalars: beside the poses.
        priors: of some model errors.
        size: how many numbers the shared blocks have.
    """
    m = size + scalars.count
    information, gradient = np.zeros((m, m)), np.zeros(m)
    gradient[:size] = problem.parameters.prior_gradient(scalars.x)[:size]
    for j, error in enumerate(scalars.errors, m - len(scalars.errors)):
        value = problem.model_errors.get(error, 0.0)
        information[j, j], gradient[j] = prior_row(error, priors, value)
    return information, gradient


def shares_of(
    problem: Problem,
    sigmas: Sequence[np.ndarray],
    common: Iterable[float],
    repeated: Optional[np.ndarray] = None,
) -> List[np.ndarray]:
    """Return for each residual block (m,): the part of its weight that each detection has.

    The mean of n rows with noise sigma and a common part c has the variance sigma^2 / n + c^2, and
    so has that of k detections with one c, of n rows together, if c^2 is k times as large in each.

    Args:
        problem: whose rows.
        sigmas: for each residual block, (n,).
        common: by residual block, c.
        repeated: (d,) k of each detection; None: c is its own.
    """
    shares = []
    for block, sigma, part in zip(problem.residual_blocks, sigmas, common):
        detection, excess = block.sums((part / sigma) ** 2)
        shares.append(1.0 / (1.0 + excess * (1.0 if repeated is None else repeated[detection])))
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
        to, at = group[detection], part.columns
        information = part.information[mine] * share[:, None]
        slope = part.gradient[mine] * share
        if len(np.unique(to)) == len(to):  # no two of a group: far faster
            result.information[to[:, None, None], at[:, None], at] += information
            result.gradient[to[:, None], at] += slope
        else:
            np.add.at(result.information, (to[:, None, None], at[:, None], at), information)
            np.add.at(result.gradient, (to[:, None], at), slope)
        by_state = part.by_state[mine] * share[:, None]
        own = np.arange(part.by_state.shape[1])
        result.by_state[detection[:, None, None], own[:, None], at] += by_state
    return result


class _Reduced(NamedTuple):
    """What g collections say, their own blocks eliminated.

    Attributes:
        names: (g,) their keys.
        numbers: (k,) those shared numbers that any of them depends on, ascending.
        information: (g, k, k).
        gradient: (g, k).
        seen: (g, s, s) of those s numbers that are of shared blocks, which come first; what the
            collections say of them while their own blocks are held.
    """

    names: Tuple[str, ...]
    numbers: np.ndarray
    information: np.ndarray
    gradient: np.ndarray
    seen: np.ndarray

    def parts(self, end: int) -> Iterator[CollectionPart]:
        """Yield what each says of numbers below `end`, of those that it depends on."""
        below = int(np.searchsorted(self.numbers, end))
        for information in self.information[:, :below, :below]:
            kept = np.flatnonzero(np.diagonal(information))
            yield CollectionPart.of(self.numbers[kept], information[np.ix_(kept, kept)])


def _reduced(
    problem: Problem, equations: NormalEquations, scalars: Scalars, shares: Sequence[np.ndarray]
) -> Iterator[_Reduced]:
    """Yield what collections say, some of them at a time."""
    layout, states = equations.layout, equations.state_jacobians.shape[2]
    normal = summed(equations.parts, len(problem.detections), states)
    keys = [key.collection for key in problem.detections]
    names, of_detection = np.unique(keys, return_inverse=True)
    rounding = equations.local.shape[-1] * np.finfo(float).eps
    inverses = np.linalg.pinv(equations.local, rcond=rounding, hermitian=True)
    size = BLOCK_SIZE * layout.shared
    at_a_time = int(np.clip(_ENTRIES // (size + scalars.count + 1) ** 2, 1, _AT_A_TIME))
    for first in range(0, len(names), at_a_time):
        some = (of_detection >= first) & (of_detection < first + at_a_time)
        collection = np.where(some, of_detection - first, -1)
        columns = summed_columns(problem, scalars, shares, collection)
        beside = np.flatnonzero(np.any(np.diagonal(columns.information, axis1=1, axis2=2), axis=0))
        which = beside if len(beside) < scalars.count else slice(None)  # of all no copy is made
        chosen = np.flatnonzero(some)
        chosen = chosen[np.argsort(collection[chosen], kind="stable")]
        columns = Columns(
            columns.information[:, which][:, :, which],
            columns.gradient[:, which],
            columns.by_state[chosen][:, :, which],
        )
        stacked = _stacked(problem, equations, normal, columns.by_state, chosen, collection[chosen])
        numbers = np.concatenate([stacked.numbers, size + beside])
        yield _Reduced(
            tuple(names[first : first + at_a_time].tolist()),
            numbers,
            *_eliminated(equations, inverses, stacked, columns),
        )


class _Stacked(NamedTuple):
    """The detections of g collections, beside one another; n states, zeros where there are fewer.

    Attributes:
        numbers: (s,) those numbers of shared blocks that any depends on.
        group: (g,) whose own blocks each collection has, -1 for none.
        jacobian: (g, n, s + w) of the states, by those numbers and by the collections' own.
        weighted: (g, n, s + w) the states' information times it.
        gradient: (g, n) by the states.
        by_state: (g, n, k) what the columns and the states have in common.
    """

    numbers: np.ndarray
    group: np.ndarray
    jacobian: np.ndarray
    weighted: np.ndarray
    gradient: np.ndarray
    by_state: np.ndarray


def _stacked(
    problem: Problem,
    equations: NormalEquations,
    normal: Tuple[np.ndarray, np.ndarray],
    by_state: np.ndarray,
    chosen: np.ndarray,
    collection: np.ndarray,
) -> _Stacked:
    """Return the detections of some collections.

    Args:
        problem: whose detections.
        equations: of the problem.
        normal: information (d, c, c) and gradient (d, c) of the detections.
        by_state: (m, c, k) what the columns and the states of those detections have in common.
        chosen: (m,) the detections of the collections, in their order.
        collection: (m,) which of the g collections each is of.
    """
    place = collection, np.arange(len(chosen)) - np.searchsorted(collection, collection)
    jacobian, numbers, group = _jacobian(problem, equations, chosen)

    def stacked(values: np.ndarray) -> np.ndarray:
        padded = np.zeros((collection[-1] + 1, place[1].max() + 1, *values.shape[1:]))
        padded[place] = values
        return padded.reshape(len(padded), padded.shape[1] * values.shape[1], *values.shape[2:])

    groups = np.full(collection[-1] + 1, -1)
    np.maximum.at(groups, collection, group)
    weighted = normal[0][chosen] @ jacobian
    arrays = jacobian, weighted, normal[1][chosen], by_state
    return _Stacked(numbers, groups, *(stacked(values) for values in arrays))


def _jacobian(
    problem: Problem, equations: NormalEquations, chosen: np.ndarray
) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the Jacobians of some detections (m,), their shared numbers (s,), and groups (m,).

    The Jacobians (m, c, s + w) are those of the states, by shared numbers and by own ones.
    """
    layout, index = equations.layout, problem.dependencies[chosen]
    position, group = layout.position[index], np.where(index >= 0, layout.group[index], -1)
    positions = np.unique(position[(index >= 0) & (group < 0)])
    size = BLOCK_SIZE * len(positions)
    start = BLOCK_SIZE * np.searchsorted(positions, position)
    start = np.where(group >= 0, size + BLOCK_SIZE * position, start)
    states, width = equations.state_jacobians.shape[2], layout.width * BLOCK_SIZE
    jacobian = np.zeros((len(chosen), states, size + width))
    row, own = np.arange(states)[:, None], np.arange(BLOCK_SIZE)
    for k in range(index.shape[1]):
        m = np.flatnonzero(index[:, k] >= 0)
        column = start[m, k, None, None] + own
        jacobian[m[:, None, None], row, column] += equations.state_jacobians[chosen[m], k]
    numbers = (BLOCK_SIZE * positions[:, None] + own).ravel()
    return jacobian, numbers, group.max(axis=1)


def _eliminated(
    equations: NormalEquations, inverses: np.ndarray, stacked: _Stacked, columns: Columns
) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return collections' information and gradient, own blocks eliminated; and their part.

    Their part is what they say of the shared blocks' numbers while their own are held.
    """
    size = len(stacked.numbers)
    transposed = np.swapaxes(stacked.jacobian, 1, 2)
    every = transposed @ stacked.weighted
    slope = (transposed @ stacked.gradient[:, :, None])[:, :, 0]
    crossed = transposed @ stacked.by_state
    head = np.empty((len(every), *(size + crossed.shape[2],) * 2))
    head[:, :size, :size], head[:, :size, size:] = every[:, :size, :size], crossed[:, :size]
    head[:, size:, :size] = np.swapaxes(crossed[:, :size], 1, 2)
    head[:, size:, size:] = columns.information
    gradient = np.concatenate([slope[:, :size], columns.gradient], axis=1)
    has_own = stacked.group >= 0
    if np.any(has_own):
        cross = np.concatenate([every[:, size:, :size], crossed[:, size:]], axis=2)
        solved = (inverses[stacked.group] * has_own[:, None, None]) @ cross
        for one, by_own, solution in zip(head, cross, solved):  # all at once needs more memory
            one -= by_own.T @ solution
        # With what is expected of them, which is this collection's, too.
        expected = equations.gradient_local[stacked.group][:, :, None]
        gradient -= (np.swapaxes(solved, 1, 2) @ expected)[:, :, 0]
    return head, gradient, every[:, :size, :size]


def inverse(matrix: np.ndarray) -> np.ndarray:
    """Return the inverse of a symmetric matrix (m, m); what nothing sees gets a huge variance."""
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(matrix), 1e-30))
    values, vectors = np.linalg.eigh(matrix * scale[:, None] * scale)
    return (vectors / np.maximum(values, FLOOR)) @ vectors.T * scale[:, None] * scale
