"""Normal equations in blocks: shared parameters dense, each collection's own eliminated.

The rows of a detection depend on the parameters through one six-vector, the twist of its pose, and
through the numbers of its camera where its intrinsics are estimated. So each detection is first
reduced to a matrix and a vector of this state (6, or 18), which are then distributed to the
parameter blocks. Blocks of different collections never meet in a detection: they are
eliminated one collection at a time (Schur complement), and the cost grows linearly with the
collections. Triggs et al., "Bundle adjustment - a modern synthesis" (2000), section 6.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from scipy import linalg

from atom_core.problem.blocks import BLOCK_SIZE
from atom_core.problem.parameters import Parameters
from atom_core.problem.problem import Linearisation, Problem
from atom_core.problem.residuals import ResidualBlock


class Layout:
    """Where each parameter block stands: among the shared ones, or in a collection's group."""

    def __init__(self, parameters: Parameters):
        """Lay out the blocks of the parameters."""
        groups = parameters.local_groups()
        self.shared = parameters.shared_count
        self.groups = len(groups)
        self.width = max([len(g) for g in groups] + [1])
        # Numbers that do not exist get a unit diagonal; they are all in shared blocks.
        self.idle = np.flatnonzero(~parameters.free[: self.shared].ravel())
        self.group = np.full(len(parameters.blocks), -1)
        self.position = np.arange(len(parameters.blocks))
        for g, members in enumerate(groups):
            self.group[members] = g
            self.position[members] = np.arange(len(members))

    def split(self, x: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return the shared part (s,) and the groups' part (g, w) of a vector, zero-padded."""
        local = np.zeros((self.groups, self.width, BLOCK_SIZE))
        mine = self.group >= 0
        steps = Parameters.by_block(x)
        local[self.group[mine], self.position[mine]] = steps[mine]
        return steps[: self.shared].ravel(), local.reshape(self.groups, BLOCK_SIZE * self.width)

    def join(self, shared: np.ndarray, local: np.ndarray) -> np.ndarray:
        """Return the vector of its two parts."""
        steps = np.zeros((len(self.group), BLOCK_SIZE))
        mine = self.group >= 0
        steps[: self.shared] = Parameters.by_block(shared)
        by_position = local.reshape(self.groups, self.width, BLOCK_SIZE)
        steps[mine] = by_position[self.group[mine], self.position[mine]]
        return steps.ravel()


class DetectionParts(NamedTuple):
    """The rows of one residual block, summed detection by detection, by its state.

    Attributes:
        detection: (m,) the detections that have rows in the block.
        information: (m, 6, 6) by the twist, or (m, 18, 18) with the camera's numbers.
        gradient: (m, 6), or (m, 18).
    """

    detection: np.ndarray
    information: np.ndarray
    gradient: np.ndarray


@dataclass
class NormalEquations:
    """``H`` and ``g`` of the weighted rows, in blocks.

    Attributes:
        layout: where the blocks stand.
        shared: (s, s) of the shared parameters.
        cross: (g, w, s) between a collection's parameters and the shared ones.
        local: (g, w, w) of each collection's own; unit diagonal where it is padded.
        gradient_shared: (s,).
        gradient_local: (g, w).
        parts: for each residual block, its rows by detection.
        state_jacobians: (d, k, 6 or 18, 6), see ``Linearisation``.
    """

    layout: Layout
    shared: np.ndarray
    cross: np.ndarray
    local: np.ndarray
    gradient_shared: np.ndarray
    gradient_local: np.ndarray
    parts: List[DetectionParts]
    state_jacobians: np.ndarray

    @property
    def diagonal(self) -> Tuple[np.ndarray, np.ndarray]:
        """The diagonals of the shared part (s,) and the groups' part (g, w)."""
        return np.diagonal(self.shared), np.diagonal(self.local, axis1=1, axis2=2)

    def solve(self, damping: float) -> Tuple[np.ndarray, float]:
        """Return the step of ``(H + damping * diag H) step = -g`` and the predicted decrease.

        Raises:
            numpy.linalg.LinAlgError: the damped matrix is not positive definite.
        """
        shared_diagonal, local_diagonal = (_floored(d) for d in self.diagonal)
        step_shared, step_local = Factor(self, damping).solve(
            -self.gradient_shared, -self.gradient_local
        )
        step = self.layout.join(step_shared, step_local)
        gradient = self.layout.join(self.gradient_shared, self.gradient_local)
        damped = float(shared_diagonal @ step_shared**2 + np.sum(local_diagonal * step_local**2))
        return step, 0.5 * float(damping * damped - gradient @ step)

    def newton_decrease(self) -> float:
        """Return how much an undamped step would lower the cost; infinite where it is unknown."""
        for damping in (0.0, 1e-12, 1e-9):
            try:
                _, predicted = self.solve(damping)
            except np.linalg.LinAlgError:
                continue
            if np.isfinite(predicted):
                return abs(predicted)
        return np.inf


class Factor:
    """``H + damping * diag H``, factored: the collections' own blocks are eliminated."""

    def __init__(self, equations: NormalEquations, damping: float):
        """Factor the matrix.

        Raises:
            numpy.linalg.LinAlgError: it is not positive definite.
        """
        shared_diagonal, local_diagonal = (_floored(d) for d in equations.diagonal)
        local = equations.local.copy()
        local[:, range(local.shape[1]), range(local.shape[1])] += damping * local_diagonal
        self._inverse = _inverse_positive(local)
        self._solved_cross = self._inverse @ equations.cross
        reduced = equations.shared + damping * np.diag(shared_diagonal)
        reduced -= np.tensordot(equations.cross, self._solved_cross, axes=((0, 1), (0, 1)))
        self._scale = 1.0 / np.sqrt(_floored(np.diagonal(reduced)))
        if len(reduced):
            scaled = reduced * self._scale[:, None] * self._scale
            self._factor = linalg.cho_factor(scaled, lower=True)

    def solve(self, shared: np.ndarray, local: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return the solution's shared part (s,) and groups' part (g, w), of a right side's."""
        own = np.einsum("gvw,gw->gv", self._inverse, local)
        right = shared - np.einsum("gws,gw->s", self._solved_cross, local)
        if len(right):
            right = self._scale * linalg.cho_solve(self._factor, self._scale * right)
        return right, own - self._solved_cross @ right


def least_damped(equations: NormalEquations) -> Optional[Factor]:
    """Return ``H``, factored, damped where the data leave directions open; None where it cannot."""
    for damping in (0.0, 1e-12, 1e-9, 1e-6):
        try:
            return Factor(equations, damping)
        except np.linalg.LinAlgError:
            continue
    return None


def _inverse_positive(matrices: np.ndarray) -> np.ndarray:
    if len(matrices) == 0:
        return matrices
    np.linalg.cholesky(matrices)  # raises LinAlgError where one is not positive definite
    return np.linalg.inv(matrices)


def _floored(diagonal: np.ndarray) -> np.ndarray:
    return np.maximum(diagonal, 1e-12)


def normal_equations(
    problem: Problem,
    layout: Layout,
    linearisation: Linearisation,
    weights: Sequence[np.ndarray],
) -> NormalEquations:
    """Return the normal equations of a linearised problem.

    Args:
        problem: whose rows.
        layout: where its parameter blocks stand.
        linearisation: residuals and derivatives.
        weights: for each residual block, (n,): robust weight over sigma squared.
    """
    parts = [
        _reduce_detections(block, residual, by_state, weight)
        for block, residual, by_state, weight in zip(
            problem.residual_blocks, linearisation.residuals, linearisation.by_state, weights
        )
    ]
    return assembled(problem, layout, linearisation.state_jacobians, parts)


def _reduce_detections(
    block: ResidualBlock, residual: np.ndarray, by_state: np.ndarray, weight: np.ndarray
) -> DetectionParts:
    """Sum the rows of each detection."""
    root, columns = np.sqrt(weight), by_state.shape[2]
    rows = (by_state * root[:, None, None]).reshape(-1, columns)
    values = (residual * root[:, None]).ravel()
    detections, starts = np.unique(block.detection, return_index=True)
    ends = np.append(starts[1:], len(block.detection)) * block.dimension
    information = np.zeros((len(detections), columns, columns))
    gradient = np.zeros((len(detections), columns))
    for i, (start, end) in enumerate(zip(starts * block.dimension, ends)):
        mine = rows[start:end]
        information[i] = mine.T @ mine
        gradient[i] = mine.T @ values[start:end]
    return DetectionParts(detections, information, gradient)


def assembled(
    problem: Problem, layout: Layout, state_jacobians: np.ndarray, parts: List[DetectionParts]
) -> NormalEquations:
    """Return the normal equations of reduced detections.

    Args:
        problem: whose detections.
        layout: where its parameter blocks stand.
        state_jacobians: (d, k, 6 or 18, 6), see ``Linearisation``.
        parts: for each residual block, its rows by detection.
    """
    jacobians, index = state_jacobians, problem.dependencies
    information, gradient = summed(parts, len(jacobians), jacobians.shape[2])
    n, s, g, w = BLOCK_SIZE, layout.shared, layout.groups, layout.width
    sums = _PairSums(
        layout,
        shared=np.zeros((s, s, n, n)),
        cross=np.zeros((g, w, s, n, n)),
        local=np.zeros((g, w, w, n, n)),
    )
    for k in range(index.shape[1]):
        reached = information @ jacobians[:, k]
        for m in range(index.shape[1]):
            both = (index[:, k] >= 0) & (index[:, m] >= 0)
            values = np.swapaxes(jacobians[both, m], 1, 2) @ reached[both]
            sums.add(index[both, m], index[both, k], values)
    _pad(layout, sums.local)
    every = np.arange(len(jacobians))
    gradient_shared, gradient_local = pulled_back(problem, layout, jacobians, every, gradient)
    dense = sums.shared.swapaxes(1, 2).reshape(n * s, n * s)
    dense[layout.idle, layout.idle] = 1.0
    return NormalEquations(
        layout,
        dense,
        sums.cross.swapaxes(2, 3).reshape(g, n * w, n * s),
        sums.local.swapaxes(2, 3).reshape(g, n * w, n * w),
        gradient_shared,
        gradient_local,
        parts,
        jacobians,
    )


def add_prior(equations: NormalEquations, parameters: Parameters, x: np.ndarray) -> None:
    """Add what is expected of the parameters, at the vector x, to the equations."""
    if not parameters.has_prior:
        return
    shared, local = equations.layout.split(parameters.prior_weight.ravel())
    slope_shared, slope_local = equations.layout.split(parameters.prior_gradient(x))
    equations.shared[range(len(shared)), range(len(shared))] += shared
    equations.gradient_shared += slope_shared
    equations.local[:, range(local.shape[1]), range(local.shape[1])] += local
    equations.gradient_local += slope_local


def summed(
    parts: Sequence[DetectionParts], count: int, columns: int
) -> Tuple[np.ndarray, np.ndarray]:
    """Return information (count, columns, columns) and gradient (count, columns) by detection."""
    information, gradient = np.zeros((count, columns, columns)), np.zeros((count, columns))
    for part in parts:  # a detection stands once in each
        own = part.gradient.shape[1]
        information[part.detection, :own, :own] += part.information
        gradient[part.detection, :own] += part.gradient
    return information, gradient


def pulled_back(
    problem: Problem,
    layout: Layout,
    state_jacobians: np.ndarray,
    detection: np.ndarray,
    by_state: np.ndarray,
) -> Tuple[np.ndarray, np.ndarray]:
    """Return gradients by states as one by parameters: shared (s,), by collection (g, w).

    Args:
        problem: whose detections.
        layout: where its parameter blocks stand.
        state_jacobians: (d, k, 6 or 18, 6), see ``Linearisation``.
        detection: (m,) the detections that have a gradient.
        by_state: (m, 6) by the twist, or (m, 18) by the whole state.
    """
    shared = np.zeros((layout.shared, BLOCK_SIZE))
    local = np.zeros((layout.groups, layout.width, BLOCK_SIZE))
    index = problem.dependencies[detection]
    for k in range(index.shape[1]):
        used = index[:, k] >= 0
        reached = state_jacobians[detection[used], k, : by_state.shape[1]]
        pulled = np.einsum("dij,di->dj", reached, by_state[used])
        _add_vectors(layout, index[used, k], pulled, shared, local)
    return shared.ravel(), local.reshape(layout.groups, BLOCK_SIZE * layout.width)


class _PairSums(NamedTuple):
    """Information of pairs of parameter blocks, (6, 6) each, where a layout has them.

    Attributes:
        layout: with s shared blocks, and g collections of w blocks at most.
        shared: (s, s, 6, 6) of two shared blocks.
        cross: (g, w, s, 6, 6) of a collection's block and a shared one.
        local: (g, w, w, 6, 6) of two blocks of a collection.
    """

    layout: Layout
    shared: np.ndarray
    cross: np.ndarray
    local: np.ndarray

    def add(self, row: np.ndarray, column: np.ndarray, values: np.ndarray) -> None:
        """Add values (m, 6, 6) of the blocks with these indices (m,) each."""
        layout = self.layout
        group_row, group_column = layout.group[row], layout.group[column]
        at_row, at_column = layout.position[row], layout.position[column]
        both = (group_row < 0) & (group_column < 0)
        _add(self.shared, layout.shared * at_row[both] + at_column[both], values[both])
        mixed = (group_row >= 0) & (group_column < 0)
        place = layout.width * group_row[mixed] + at_row[mixed]
        _add(self.cross, layout.shared * place + at_column[mixed], values[mixed])
        own = (group_row >= 0) & (group_column >= 0)
        place = layout.width * group_row[own] + at_row[own]
        _add(self.local, layout.width * place + at_column[own], values[own])


def _add_vectors(
    layout: Layout,
    index: np.ndarray,
    values: np.ndarray,
    gradient_shared: np.ndarray,
    gradient_local: np.ndarray,
) -> None:
    group, position = layout.group[index], layout.position[index]
    _add(gradient_shared, position[group < 0], values[group < 0])
    own = group >= 0
    _add(gradient_local, layout.width * group[own] + position[own], values[own])


def _add(to: np.ndarray, place: np.ndarray, values: np.ndarray) -> None:
    """Add (n, ...) to places (n,) of an array of such, whatever its leading axes.

    ``np.add.at`` does the same, several times slower.

    Args:
        to: contiguous.
        place: as if the leading axes were one; the same may stand there several times.
        values: what is added.
    """
    size = math.prod(values.shape[1:])
    at = (size * place[:, None] + np.arange(size)).ravel()
    to += np.bincount(at, values.ravel(), to.size).reshape(to.shape)


def _pad(layout: Layout, local: np.ndarray) -> None:
    """Put a unit diagonal where a collection has fewer blocks than the widest."""
    filled = np.zeros((layout.groups, layout.width), dtype=bool)
    mine = layout.group >= 0
    filled[layout.group[mine], layout.position[mine]] = True
    group, position = np.nonzero(~filled)
    local[group, position, position] = np.eye(BLOCK_SIZE)
