"""Columns of insets, errors and fields of a problem: which there are, and that they agree."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from problems import problem_of  # noqa: E402

from atom_core.problem.model_errors import RangeOffset  # noqa: E402
from atom_core.solvers import losses  # noqa: E402
from atom_core.solvers.levenberg_marquardt import LevenbergMarquardt  # noqa: E402
from atom_core.solvers.scalar_columns import scalars_of  # noqa: E402
from atom_core.synthetic import scenes  # noqa: E402

OFFSET, NOBODY = RangeOffset("lidar_1"), RangeOffset("nobody")


@pytest.fixture(scope="module")
def solver():
    return LevenbergMarquardt(problem_of(scenes.random_scene, rgb=1, depth=0, lidar3d=1))


def found(solver, errors=(), fields=()):
    x = np.full(solver.problem.parameters.size, 2e-3)
    return scalars_of(solver, x, solver.problem.initial_sigmas, losses.CAUCHY, errors, fields)


def field_of(sensor, errors=(OFFSET,)):
    """Return a field of one cell, of which each error has a whole share."""
    return SimpleNamespace(
        sensor=sensor,
        errors=errors,
        cells=lambda points: np.zeros(len(points), dtype=int),
        shares=np.ones((1, len(errors))),
    )


def test_a_field_of_one_cell_is_a_range_offset(solver):
    alone, as_field = found(solver, [OFFSET]), found(solver, fields=[field_of("lidar_1")])
    assert alone.errors == as_field.errors == (OFFSET,)
    assert (alone.of_fields, as_field.of_fields) == (0, 1)
    assert len(alone.parts) == len(as_field.parts) == 2
    for one, other in zip(alone.parts, as_field.parts):
        np.testing.assert_array_equal(one.columns, other.columns)
        np.testing.assert_allclose(one.information, other.information, rtol=1e-9, atol=1e-6)
        np.testing.assert_allclose(one.gradient, other.gradient, rtol=1e-9, atol=1e-6)
        np.testing.assert_allclose(one.by_state, other.by_state, rtol=1e-9, atol=1e-6)


def test_a_field_of_another_sensor_has_no_columns(solver):
    scalars = found(solver, [OFFSET], [field_of("rgb_1")])
    assert scalars.errors == (OFFSET,) and scalars.of_fields == 0


def test_errors_that_no_row_depends_on_are_dropped_and_numbers_close_up(solver):
    wave = RangeOffset("wave")
    scalars = found(solver, [NOBODY, OFFSET], [field_of("lidar_1", (wave, wave))])
    assert scalars.insets == 1 and scalars.errors == (OFFSET, wave, wave)
    assert scalars.of_fields == 2 and scalars.count == 4
    heights, border = scalars.parts
    np.testing.assert_array_equal(heights.columns, [1, 2, 3])
    np.testing.assert_array_equal(border.columns, [0, 1, 2, 3])
    assert scalars.without_fields().errors == (OFFSET,)


def test_the_column_of_an_inset_is_that_of_the_assessment(solver):
    x = np.full(solver.problem.parameters.size, 2e-3)
    (column,) = solver.assess(x, solver.problem.initial_sigmas, losses.CAUCHY).columns
    (part,) = found(solver).parts
    assert part.block == column.block
    np.testing.assert_array_equal(part.detection, column.detection)
    assert part.information.sum() == pytest.approx(column.curvature)
    assert part.gradient.sum() == pytest.approx(column.slope)
    np.testing.assert_allclose(part.by_state[:, :, 0], column.by_twist, rtol=1e-6, atol=1e-6)


def test_without_any_scalar_only_insets_are_left(solver):
    scalars = found(solver, [NOBODY])
    assert scalars.errors == () and scalars.insets == scalars.count == 1
