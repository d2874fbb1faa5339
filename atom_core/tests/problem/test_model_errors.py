"""Model errors: what a row changes by, and that a correction is taken back exactly."""

import numpy as np
import pytest

from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.preparation import free_edges
from atom_core.calibration.start.boards import initial_boards
from atom_core.problem.board_errors import (
    Bend,
    BoardAspect,
    BoardSize,
    BoardThickness,
    BoardTwist,
    BorderShift,
    BorderSize,
    PrintTurn,
)
from atom_core.problem.builder import build_problem
from atom_core.problem.corrections import corrected
from atom_core.problem.direction_errors import (
    AzimuthScale,
    AzimuthWave,
    DepthCentre,
    DepthFocalLength,
    DirectionError,
    ElevationOffset,
    ElevationScale,
)
from atom_core.problem.measurements import read_measurements
from atom_core.problem.model_errors import (
    CameraError,
    DepthOffset,
    DepthScale,
    JointOffset,
    PrismaticOffset,
    RangeOffset,
    RangeScale,
    rows_of,
)
from atom_core.problem.range_fields import DepthWave, DepthWaves, LayerOffset, LayerOffsets
from atom_core.problem.residuals import OrthogonalBlock
from atom_core.solvers.choice import SOLVERS
from atom_core.synthetic import scenes


@pytest.fixture(scope="module")
def dataset():
    return scenes.random_scene(1, collections=5).dataset


@pytest.fixture(scope="module")
def problem(dataset):
    measurements, _ = read_measurements(dataset)
    free = free_edges(dataset, CalibrationOptions())
    boards = initial_boards(dataset, measurements, free)
    return build_problem(dataset, measurements, boards, free)


@pytest.fixture(scope="module")
def errors(dataset):
    (pattern,) = dataset.patterns.values()
    camera, depth = (dataset.sensors[name].camera for name in ("rgb_1", "depth_1"))
    middle, half = pattern.border.centre, pattern.border.half_size
    return {
        "range offset": RangeOffset("lidar_1"),
        "range scale": RangeScale("lidar_1"),
        "board size": BoardSize(pattern.name),
        "shift in x": BorderShift(pattern.name, 0),
        "shift in y": BorderShift(pattern.name, 1),
        "size in x": BorderSize(pattern.name, 0),
        "bend over y": Bend(pattern.name, 1, middle[1], half[1]),
        "focal length": CameraError("rgb_1", "focal_length", (0, 1), camera),
        "first coefficient": CameraError("rgb_1", "k1", (4,), camera),
        "some layers": LayerOffset("lidar_1", -1.5, 0.0),
        "depth wave": DepthWave("depth_1", (3, 2), depth),
        "depth offset": DepthOffset("depth_1"),
        "depth focal length": DepthFocalLength("depth_1", depth),
        "depth centre": DepthCentre("depth_1", depth, 1),
        "azimuth scale": AzimuthScale("lidar_1"),
        "azimuth wave": AzimuthWave("lidar_1", 0),
        "elevation offset": ElevationOffset("lidar_1"),
        "elevation scale": ElevationScale("lidar_1"),
        "board aspect": BoardAspect(pattern.name),
        "print turn": PrintTurn(pattern.name, *middle),
        "board twist": BoardTwist(pattern.name, *middle, *half),
    }


NAMES = [
    *("range offset", "range scale", "board size", "shift in x", "shift in y", "size in x"),
    *("bend over y", "focal length", "first coefficient", "some layers", "depth wave"),
    *("depth offset", "depth focal length", "depth centre", "azimuth scale", "azimuth wave"),
    *("elevation offset", "elevation scale", "board aspect", "print turn"),
    "board twist",
]


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_against_central_differences(problem, errors, name):
    error, h = errors[name], 1e-6
    x = 0.02 * np.random.default_rng(0).standard_normal(problem.parameters.size)
    poses, now = problem.poses(x), problem.linearise(x)
    ahead, behind = (corrected(problem, {error: s * h}, x).residuals(x) for s in (1, -1))
    farther = corrected(problem, {RangeScale(error.target): h}, x).residuals(x)
    by_distance = [(far - here) / h for far, here in zip(farther, now.residuals)]
    checked = 0
    in_units_of_noise = isinstance(error, RangeScale) and not isinstance(error, DepthWave)
    for i, (block, more, less) in enumerate(zip(problem.residual_blocks, ahead, behind)):
        own = now.residuals[i], now.by_state[i]
        found = error.derivatives(rows_of(block, poses, problem.patterns, *own))
        if found is None:
            np.testing.assert_array_equal(more, less)
            continue
        if in_units_of_noise:  # it grows with the ranges
            more, less = more / (1.0 + h), less / (1.0 - h)
        expected = (more - less) / (2 * h)
        if isinstance(error, DirectionError) and isinstance(block, OrthogonalBlock):
            expected = expected * (1.0 - now.residuals[i] / by_distance[i])  # on the board
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)
        checked += np.count_nonzero(found)
    assert checked > 20


def test_all_corrections_are_taken_back_exactly(problem, errors):
    x = np.zeros(problem.parameters.size)
    there = corrected(problem, {error: 2.0 * error.step for error in errors.values()}, x)
    again = corrected(there, {error: -error.step for error in errors.values()}, x)
    back = corrected(again, {}, x)
    moved = 0
    for one, two, three in zip(*(p.residuals(x) for p in (problem, there, back))):
        moved += np.count_nonzero(np.abs(two - one) > 1e-6)
        np.testing.assert_allclose(three, one, atol=1e-9)
    assert moved > 1000 and back.model_errors == {}


def test_both_solvers_see_the_same_corrected_rows(problem, errors):
    pytest.importorskip("atom_core._core", reason="native module is not built: make build")
    sigmas = problem.initial_sigmas
    x = 0.01 * np.random.default_rng(1).standard_normal(problem.parameters.size)
    there = corrected(problem, {error: error.step for error in errors.values()}, x)
    squares = []
    for make in SOLVERS.values():
        solver = make(problem)
        solver.take_rows(there)
        squares.append(np.concatenate(solver.squares(x, sigmas)))
        solver.take_rows(corrected(there, {}, x))
        squares.append(np.concatenate(solver.squares(x, sigmas)))
    np.testing.assert_allclose(squares[0], squares[2], rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(squares[1], squares[3], rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize(
    "error, usual",
    [
        (RangeOffset, 0.020),
        (RangeScale, 0.001),
        (DepthOffset, 0.005),
        (DepthScale, 0.01),
        (AzimuthScale, 0.0005),
        (AzimuthWave, 0.0005),
        (ElevationOffset, 0.0005),
        (ElevationScale, 0.002),
        (DepthFocalLength, 0.001),
        (DepthCentre, 0.001),
        (BoardAspect, 0.001),
        (PrintTurn, 0.003),
        (BoardSize, 0.002),
        (CameraError, 0.005),
        (BorderShift, 0.003),
        (BorderSize, 0.003),
        (Bend, 0.002),
        (BoardTwist, 0.002),
        (BoardThickness, 0.01),
        (JointOffset, 0.001),  # 0.06 deg
        (PrismaticOffset, 0.001),
        (LayerOffset, 0.005),
        (LayerOffsets, 0.005),
        (DepthWaves, 0.004),
    ],
)
def test_what_is_usual_is_what_the_document_says(error, usual):
    """docs/certainty.md, "Combined sigmas"."""
    assert error.usual == pytest.approx(usual)
