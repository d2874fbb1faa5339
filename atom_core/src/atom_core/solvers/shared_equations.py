"""The normal equations of each collection, reduced to what all collections share.

The boards' poses are eliminated, so that what is left of a collection is what it says of the shared
parameters and of the scalars beside them. Collections are independent of one another whatever goes
wrong within one: how much they differ tells how sure the answer is without any model of the noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Dict, List, Mapping, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.problem.blocks import BLOCK_SIZE
from atom_core.problem.model_errors import ModelError, rows_of
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import BorderBlock
from atom_core.solvers.error_columns import row_weights
from atom_core.solvers.normal_equations import (
    DetectionParts,
    NormalEquations,
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
    """

    collections: Tuple[str, ...]
    errors: Tuple[ModelError, ...]
    blocks: int
    shared: int
    information: np.ndarray
    gradient: np.ndarray
    held: np.ndarray


class _Scalars(NamedTuple):
    """Columns beside the poses, by detection: (d, k, k), (d, k) and, with the states, (d, c, k)."""

    information: np.ndarray
    gradient: np.ndarray
    by_state: np.ndarray
    errors: Tuple[ModelError, ...]


def shared_equations(
    problem: Problem,
    equations: NormalEquations,
    x: np.ndarray,
    sigmas: Sequence[np.ndarray],
    loss: str,
    errors: Sequence[ModelError],
    common: Mapping[str, float] = MappingProxyType({}),
) -> SharedEquations:
    """Return the reduced equations at the vector x.

    Args:
        problem: whose rows.
        equations: of the problem at x, weighted as below.
        x: the vector.
        sigmas: for each residual block, (n,).
        loss: robust loss.
        errors: model errors to have as further numbers, estimated or not; of those that no row
            depends on there is no number.
        common: by kind, standard deviation of what all rows of a detection have in common, in the
            kind's unit; for it a detection counts less than the number of its rows.
    """
    shares = _shares(problem, sigmas, common)
    scalars = _scalars(problem, x, sigmas, loss, errors, shares)
    if common:
        equations = _tempered(problem, equations, shares)
    parts, seen = _by_collection(problem, equations, scalars)
    size = equations.layout.shared * BLOCK_SIZE
    m = size + scalars.gradient.shape[1]
    held = np.zeros((m, m))
    held[:size, :size] = equations.shared - seen
    return SharedEquations(
        tuple(parts),
        scalars.errors,
        equations.layout.shared,
        m - len(scalars.errors),
        np.array([part.information for part in parts.values()]).reshape(-1, m, m),
        np.array([part.gradient for part in parts.values()]).reshape(-1, m),
        held,
    )


def _by_collection(
    problem: Problem, equations: NormalEquations, scalars: _Scalars
) -> Tuple[Dict[str, _Reduced], np.ndarray]:
    """Return what each collection says; and what all say of the shared numbers, boards held."""
    states = equations.state_jacobians.shape[2]
    information, gradient = summed(equations.parts, len(problem.detections), states)
    names, of_detection = np.unique(
        [key.collection for key in problem.detections], return_inverse=True
    )
    parts = {}
    for c, name in enumerate(names):
        mine = np.flatnonzero(of_detection == c)
        part = _of_collection(problem, equations, information, gradient, scalars, mine)
        parts[str(name)] = part
    return parts, sum((part.seen for part in parts.values()), np.zeros_like(equations.shared))


class _Reduced(NamedTuple):
    information: np.ndarray
    gradient: np.ndarray
    seen: np.ndarray


def _of_collection(
    problem: Problem,
    equations: NormalEquations,
    information: np.ndarray,
    gradient: np.ndarray,
    scalars: _Scalars,
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
    crossed = flat.T @ scalars.by_state[mine].reshape(len(flat), -1)
    head = np.block(
        [
            [every[:size, :size], crossed[:size]],
            [crossed[:size].T, scalars.information[mine].sum(axis=0)],
        ]
    )
    own = np.concatenate([slope[:size], scalars.gradient[mine].sum(axis=0)])
    if group >= 0:
        cross = np.concatenate([every[size:, :size], crossed[size:]], axis=1)
        solved = np.linalg.lstsq(
            equations.local[group], np.column_stack([cross, slope[size:]]), rcond=None
        )[0]
        head = head - cross.T @ solved[:, :-1]
        own = own - cross.T @ solved[:, -1]
    return _Reduced(head, own, every[:size, :size])


def _shares(
    problem: Problem, sigmas: Sequence[np.ndarray], common: Mapping[str, float]
) -> List[np.ndarray]:
    """Return for each residual block (n,): the part of its weight that an item has.

    The mean of n rows with noise sigma and a common part c has the variance sigma^2 / n + c^2.
    """
    shares = []
    for block, sigma in zip(problem.residual_blocks, sigmas):
        count = np.bincount(block.detection, minlength=len(problem.detections))[block.detection]
        shares.append(1.0 / (1.0 + count * (common.get(block.kind, 0.0) / sigma) ** 2))
    return shares


def _tempered(
    problem: Problem, equations: NormalEquations, shares: Sequence[np.ndarray]
) -> NormalEquations:
    """Return the equations with the detections of each block weighted by their mean share."""
    parts = []
    for block, part, share in zip(problem.residual_blocks, equations.parts, shares):
        _, starts, counts = np.unique(block.detection, return_index=True, return_counts=True)
        mean = np.add.reduceat(share, starts) / counts
        parts.append(
            DetectionParts(
                part.detection,
                part.information * mean[:, None, None],
                part.gradient * mean[:, None],
            )
        )
    return assembled(problem, equations.layout, equations.state_jacobians, parts)


def _scalars(
    problem: Problem,
    x: np.ndarray,
    sigmas: Sequence[np.ndarray],
    loss: str,
    errors: Sequence[ModelError],
    shares: Sequence[np.ndarray],
) -> _Scalars:
    linearisation, poses = problem.linearise(x), problem.poses(x)
    weights = [w * s for w, s in zip(row_weights(linearisation, sigmas, loss), shares)]
    borders = [i for i, b in enumerate(problem.residual_blocks) if isinstance(b, BorderBlock)]
    states, d, k = linearisation.state_jacobians.shape[2], len(poses), len(borders) + len(errors)
    information, gradient = np.zeros((d, k, k)), np.zeros((d, k))
    by_state, used = np.zeros((d, states, k)), np.zeros(len(errors), dtype=bool)
    for i, block in enumerate(problem.residual_blocks):
        rows = rows_of(block, poses, problem.patterns, linearisation.by_state[i])
        columns = [(len(borders) + j, e, e.derivatives(rows)) for j, e in enumerate(errors)]
        chosen = [(j, e.step * by) for j, e, by in columns if by is not None and np.any(by)]
        used[[j - len(borders) for j, _ in chosen]] = True
        if isinstance(block, BorderBlock):
            chosen.append((borders.index(i), block.by_inset_steps(poses)[:, None]))
        if not chosen:
            continue
        at = np.array([j for j, _ in chosen])
        derivative = np.stack([by for _, by in chosen], axis=2)  # (n, dimension, k of the block)
        weighted = derivative * weights[i][:, None, None]
        present, starts = np.unique(block.detection, return_index=True)
        both = np.einsum("nrk,nrl->nkl", weighted, derivative)
        information[present[:, None, None], at[:, None], at] += np.add.reduceat(both, starts)
        slope = np.einsum("nrk,nr->nk", weighted, linearisation.residuals[i])
        gradient[present[:, None], at] += np.add.reduceat(slope, starts)
        common = np.einsum("nrs,nrk->nsk", linearisation.by_state[i], weighted)
        own = np.arange(common.shape[1])
        by_state[present[:, None, None], own[:, None], at] += np.add.reduceat(common, starts)
    kept = np.concatenate([np.arange(len(borders)), len(borders) + np.flatnonzero(used)])
    return _Scalars(
        information[:, kept[:, None], kept],
        gradient[:, kept],
        by_state[:, :, kept],
        tuple(e for e, is_used in zip(errors, used) if is_used),
    )


def inverse(matrix: np.ndarray) -> np.ndarray:
    """Return the inverse of a symmetric matrix (m, m); what nothing sees gets a huge variance."""
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(matrix), 1e-30))
    values, vectors = np.linalg.eigh(matrix * scale[:, None] * scale)
    return (vectors / np.maximum(values, _FLOOR)) @ vectors.T * scale[:, None] * scale
