"""Scalars beside the poses as columns: sums by detection, and fields cell by cell."""

from types import SimpleNamespace

import numpy as np
import pytest

from atom_core.problem.model_errors import RangeOffset, RangeScale
from atom_core.solvers.scalar_columns import ScalarPart, Scalars, _FieldColumns, _part

OFFSET, SCALE, WAVE = RangeOffset("a"), RangeScale("a"), RangeOffset("wave")
DETECTION = np.array([2, 2, 2, 5, 5, 9, 9, 9, 9])
SEGMENTS = ((2, slice(0, 3)), (5, slice(3, 5)), (9, slice(5, 9)))


def block(dimension):
    return SimpleNamespace(
        dimension=dimension,
        segments=SEGMENTS,
        segment_of_items=np.array([0, 0, 0, 1, 1, 2, 2, 2, 2]),
    )


def rows(dimension, seed=0):
    """Return columns by number, residuals, derivatives by state and weights."""
    rng, shape = np.random.default_rng(seed), (len(DETECTION), dimension)
    columns = {number: rng.standard_normal(shape) for number in (3, 1)}
    by_state = rng.standard_normal((*shape, 6))
    return columns, rng.standard_normal(shape), by_state, rng.uniform(0.5, 2.0, len(DETECTION))


def field(count=4, shares=3):
    rng = np.random.default_rng(1)
    cell = np.array([0, 3, 0, 2, 2, 3, 1, 3, 0])
    return _FieldColumns(7, cell, rng.standard_normal(9), rng.standard_normal((count, shares)))


@pytest.mark.parametrize("dimension", [1, 2])
def test_a_part_has_the_weighted_sums_of_each_detection(dimension):
    columns, residual, by_state, weight = rows(dimension)
    part = _part(block(dimension), 4, columns, None, residual, by_state, weight)
    assert part.block == 4
    np.testing.assert_array_equal(part.columns, [3, 1])
    np.testing.assert_array_equal(part.detection, [2, 5, 9])
    for d, detection in enumerate(part.detection):
        mine = np.flatnonzero(detection == DETECTION)
        information, gradient, common = np.zeros((2, 2)), np.zeros(2), np.zeros((6, 2))
        for i in mine:
            for r in range(dimension):
                row = np.array([columns[3][i, r], columns[1][i, r]])
                information += weight[i] * np.outer(row, row)
                gradient += weight[i] * row * residual[i, r]
                common += weight[i] * np.outer(by_state[i, r], row)
        np.testing.assert_allclose(part.information[d], information)
        np.testing.assert_allclose(part.gradient[d], gradient)
        np.testing.assert_allclose(part.by_state[d], common)


@pytest.mark.parametrize("with_others", [True, False])
def test_a_field_is_what_its_columns_written_out_are(with_others):
    columns, residual, by_state, weight = rows(1)
    columns, waves = columns if with_others else {}, field()
    found = _part(block(1), 0, columns, waves, residual, by_state, weight)
    written = dict(columns)
    for j in range(3):
        written[7 + j] = (waves.along * waves.shares[waves.cell, j])[:, None]
    expected = _part(block(1), 0, written, None, residual, by_state, weight)
    np.testing.assert_array_equal(found.columns, expected.columns)
    np.testing.assert_array_equal(found.detection, expected.detection)
    for name in ("information", "gradient", "by_state"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-12)


def test_information_is_symmetric_with_a_field():
    columns, residual, by_state, weight = rows(1)
    part = _part(block(1), 0, columns, field(), residual, by_state, weight)
    np.testing.assert_array_equal(part.information, np.swapaxes(part.information, 1, 2))


# --- which scalar is which -----------------------------------------------------------------------


def part_of(columns, index=0):
    columns = np.array(columns)
    k, rng = len(columns), np.random.default_rng(2)
    arrays = rng.standard_normal((2, k, k)), rng.standard_normal((2, k))
    return ScalarPart(index, np.array([0, 1]), columns, *arrays, rng.standard_normal((2, 6, k)))


@pytest.mark.parametrize("count, kept", [(0, 0), (2, 1), (3, 2), (4, 2), (5, 3)])
def test_the_first_of_a_part_are_those_below_a_number(count, kept):
    part = part_of([0, 2, 4])
    first = part.first(count)
    np.testing.assert_array_equal(first.columns, [0, 2, 4][:kept])
    np.testing.assert_array_equal(first.information, part.information[:, :kept, :kept])
    np.testing.assert_array_equal(first.gradient, part.gradient[:, :kept])
    np.testing.assert_array_equal(first.by_state, part.by_state[:, :, :kept])
    np.testing.assert_array_equal(first.detection, part.detection)


def test_insets_come_before_errors():
    scalars = Scalars(np.zeros(6), 2, (OFFSET, SCALE), 0, ())
    assert scalars.count == 4
    assert [scalars.error(i) for i in range(4)] == [None, None, OFFSET, SCALE]


def test_without_fields_their_errors_and_columns_are_gone():
    parts = part_of([0, 2]), part_of([3], index=1), part_of([1, 3], index=2)
    scalars = Scalars(np.zeros(6), 2, (OFFSET, WAVE), 1, parts)
    without = scalars.without_fields()
    assert without.errors == (OFFSET,) and without.of_fields == 0 and without.count == 3
    assert [part.block for part in without.parts] == [0, 2]
    np.testing.assert_array_equal(without.parts[1].columns, [1])
    assert without.x is scalars.x


def test_without_fields_a_solution_that_has_none_is_the_same():
    scalars = Scalars(np.zeros(6), 1, (OFFSET,), 0, (part_of([0, 1]),))
    without = scalars.without_fields()
    assert without.errors == (OFFSET,)
    np.testing.assert_array_equal(without.parts[0].columns, [0, 1])
