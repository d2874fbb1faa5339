"""Scalars beside the poses as columns: how the rows depend on them, summed by detection."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from scipy import sparse

from atom_core.problem.model_errors import ModelError, Rows, rows_of
from atom_core.problem.range_fields import RangeField
from atom_core.problem.residuals import BorderBlock, RangeBlock, ResidualBlock
from atom_core.solvers.base import Solver
from atom_core.solvers.error_columns import row_weight


class ScalarPart(NamedTuple):
    """The columns beside the poses that one residual block has, summed by detection.

    Attributes:
        block: index of the residual block.
        detection: (m,) detections that have rows in it.
        columns: (k,) which of all scalars, those of fields last.
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

    def first(self, count: int) -> ScalarPart:
        """Return the part without scalars from number `count` on, which come last."""
        k = int(np.sum(self.columns < count))
        return self._replace(
            columns=self.columns[:k],
            information=self.information[:, :k, :k],
            gradient=self.gradient[:, :k],
            by_state=self.by_state[:, :, :k],
        )


@dataclass(frozen=True)
class Scalars:
    """Insets of all border blocks and model errors, as columns at one vector.

    Attributes:
        x: the vector.
        insets: how many are insets; they come first.
        errors: the model errors that some row depends on.
        of_fields: how many of these are of fields; they come last.
        parts: of every residual block that depends on any.
    """

    x: np.ndarray
    insets: int
    errors: Tuple[ModelError, ...]
    of_fields: int
    parts: Tuple[ScalarPart, ...]

    @property
    def count(self) -> int:
        """How many scalars there are."""
        return self.insets + len(self.errors)

    def error(self, number: int) -> Optional[ModelError]:
        """Return which model error a column is of; None for an inset."""
        return None if number < self.insets else self.errors[number - self.insets]

    def without_fields(self) -> Scalars:
        """Return the columns without those of fields."""
        errors = self.errors[: len(self.errors) - self.of_fields]
        parts = (part.first(self.insets + len(errors)) for part in self.parts)
        kept = tuple(part for part in parts if len(part.columns))
        return Scalars(self.x, self.insets, errors, 0, kept)


def scalars_of(
    solver: Solver,
    x: np.ndarray,
    sigmas: Sequence[np.ndarray],
    loss: str,
    errors: Sequence[ModelError],
    fields: Sequence[RangeField] = (),
) -> Scalars:
    """Return the columns at the vector x.

    Args:
        solver: of the problem whose rows they are.
        x: the vector.
        sigmas: for each residual block, (n,).
        loss: robust loss.
        errors: model errors to have as scalars, estimated or not; those that no row depends on are
            dropped.
        fields: further ones, of one sensor each, summed by cells.
    """
    problem, poses = solver.problem, solver.problem.poses(x)
    borders = [i for i, b in enumerate(problem.residual_blocks) if isinstance(b, BorderBlock)]
    everything = [*errors, *(error for field in fields for error in field.errors)]
    places = len(borders) + len(errors) + np.cumsum([0, *(len(f.errors) for f in fields)])
    parts: List[ScalarPart] = []
    linearised = solver.linearised_blocks(x, poses)  # one block at a time is in memory
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
        mine = [_columns_of_field(rows, f, p) for f, p in zip(fields, places) if _has(block, f)]
        if columns or mine:
            weight = row_weight(residual, sigmas[i], loss)
            field = mine[0] if mine else None
            parts.append(_part(block, i, columns, field, residual, by_state, weight))
    used = sorted({int(n) for part in parts for n in part.columns} | set(range(len(borders))))
    place = {number: new for new, number in enumerate(used)}
    parts = [p._replace(columns=np.array([place[int(n)] for n in p.columns])) for p in parts]
    kept = tuple(everything[n - len(borders)] for n in used[len(borders) :])
    of_fields = sum(n >= places[0] for n in used)
    return Scalars(x, len(borders), kept, of_fields, tuple(parts))


class _FieldColumns(NamedTuple):
    """The columns of a field in one residual block, whose rows are one number each.

    Attributes:
        first: number of the first of its k scalars.
        cell: (n,) which cell each row is in.
        along: (n,) the rows' change where a share is one.
        shares: (cells, k) in units of the errors' steps.
    """

    first: int
    cell: np.ndarray
    along: np.ndarray
    shares: np.ndarray


def _has(block: ResidualBlock, field: RangeField) -> bool:
    return isinstance(block, RangeBlock) and block.sensor == field.sensor


def _columns_of_field(rows: Rows, field: RangeField, first: int) -> _FieldColumns:
    assert isinstance(rows.block, RangeBlock)
    along = field.errors[0].along_rays(rows)[:, 0]
    steps = np.array([error.step for error in field.errors])
    return _FieldColumns(first, field.cells(rows.block.on_own_rays), along, field.shares * steps)


def _part(
    block: ResidualBlock,
    index: int,
    columns: Mapping[int, np.ndarray],
    field: Optional[_FieldColumns],
    residual: np.ndarray,
    by_state: np.ndarray,
    weight: np.ndarray,
) -> ScalarPart:
    """Return the columns (n, dimension) of a block, by number, summed by detection."""
    k, root = len(columns), np.sqrt(weight)[:, None]
    q = k + by_state.shape[2]
    of_field = 0 if field is None else field.shares.shape[1]
    rows = np.empty((*residual.shape, q + 1))  # the residuals come last
    for j, change in enumerate(columns.values()):
        np.multiply(root, change, out=rows[:, :, j])
    np.multiply(root[:, :, None], by_state, out=rows[:, :, k:q])
    np.multiply(root, residual, out=rows[:, :, q])
    flat = rows.reshape(-1, q + 1)
    both = np.zeros((len(block.segments), k + of_field, q + of_field))
    gradient = np.zeros((len(both), k + of_field))
    for d, (_, items) in enumerate(block.segments):
        own = flat[block.dimension * items.start : block.dimension * items.stop]
        products = own[:, :k].T @ own
        both[d, :k, :q], gradient[d, :k] = products[:, :q], products[:, q]
    numbers = np.array(list(columns), dtype=int)
    if field is not None:
        _add_field(field, _summed_by_cell(block, field, root[:, 0], flat), both, gradient, k)
        numbers = np.concatenate([numbers, field.first + np.arange(of_field)])
    scalar = [*range(k), *range(q, both.shape[2])]
    common = np.swapaxes(both[:, :, k:q], 1, 2).copy()  # a view would keep all in memory
    detection = np.array([d for d, _ in block.segments], dtype=int)
    return ScalarPart(index, detection, numbers, both[:, :, scalar], gradient, common)


class _CellSums(NamedTuple):
    """Of each pair of a detection and a cell: sums of what the rows' change is multiplied with.

    Attributes:
        detection, cell: (p,) counted from zero; by detection first.
        curvature: (p,) with itself.
        slope: (p,) with the residuals.
        others: (p, q) with the other columns.
    """

    detection: np.ndarray
    cell: np.ndarray
    curvature: np.ndarray
    slope: np.ndarray
    others: np.ndarray


def _summed_by_cell(
    block: ResidualBlock, field: _FieldColumns, root: np.ndarray, flat: np.ndarray
) -> _CellSums:
    """Return the sums of weighted rows (n, q + 1), the residuals last."""
    count, q = len(field.shares), flat.shape[1] - 1
    key = block.segment_of_items * count + field.cell
    pairs = np.flatnonzero(np.bincount(key))
    place = np.zeros(int(pairs[-1]) + 1, dtype=int)
    place[pairs] = np.arange(len(pairs))
    along = root * field.along
    one_of_each_row = np.arange(len(key) + 1)
    to_pair = sparse.csc_matrix((along, place[key], one_of_each_row), (len(pairs), len(key)))
    sums, own = to_pair @ flat, to_pair @ along
    return _CellSums(pairs // count, pairs % count, own, sums[:, q], sums[:, :q])


def _add_field(
    field: _FieldColumns, sums: _CellSums, both: np.ndarray, gradient: np.ndarray, k: int
) -> None:
    """Add a field's columns after the k others: to (m, k + f, k + c + f) and (m, k + f)."""
    q = sums.others.shape[1]
    ends = np.searchsorted(sums.detection, np.arange(len(both) + 1))
    for d, (start, end) in enumerate(zip(ends[:-1], ends[1:])):
        shares = field.shares[sums.cell[start:end]]
        crossed = shares.T @ sums.others[start:end]
        both[d, k:, :q] = crossed
        both[d, :k, q:] = crossed[:, :k].T
        weighted = np.sqrt(sums.curvature[start:end, None]) * shares
        both[d, k:, q:] = weighted.T @ weighted  # of one array: half the work
        gradient[d, k:] = shares.T @ sums.slope[start:end]
