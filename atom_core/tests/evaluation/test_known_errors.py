"""Errors that a calibration found, written and read again, and the prior that they become."""

import json
from pathlib import Path

import numpy as np
import pytest

from atom_core import native
from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import OFF, CalibrationOptions
from atom_core.errors import DatasetError
from atom_core.evaluation.known_errors import known_of, parameters_of
from atom_core.geometry.intrinsics import intrinsics_names, intrinsics_values, moved_camera
from atom_core.io.calibration_json import StoredCalibration, StoredCamera, StoredError
from atom_core.problem.board_errors import (
    Bend,
    BoardAspect,
    BoardSize,
    BoardThickness,
    BoardTwist,
    BorderShift,
    BorderSize,
)
from atom_core.problem.direction_errors import (
    AzimuthWave,
    DepthCentre,
    DepthFocalLength,
    ElevationOffset,
)
from atom_core.problem.model_errors import (
    CameraError,
    DepthOffset,
    DepthScale,
    ErrorPrior,
    RangeOffset,
    RangeScale,
)
from atom_core.problem.range_fields import DepthWave, LayerOffset
from atom_core.solvers.choice import SOLVERS
from atom_core.synthetic import scenes
from atom_core.synthetic.mistakes import with_long_ranges


@pytest.fixture(scope="module")
def dataset():
    return scenes.random_scene(1, rgb=1, depth=1, lidar3d=1, collections=8).dataset


def errors_of(dataset):
    camera, depth = (dataset.sensors[name].camera for name in ("rgb_1", "depth_1"))
    return [
        RangeOffset("lidar_1"),
        RangeScale("lidar_1"),
        DepthScale("depth_1"),
        LayerOffset("lidar_1", -0.1, 0.02),
        DepthWave("depth_1", (2, 3), depth),
        DepthOffset("depth_1"),
        AzimuthWave("lidar_1", 1),
        ElevationOffset("lidar_1"),
        DepthFocalLength("depth_1", depth),
        DepthCentre("depth_1", depth, 0),
        BoardSize("pattern_1"),
        BoardAspect("pattern_1"),
        BoardThickness("pattern_1"),
        BorderShift("pattern_1", 0),
        BorderSize("pattern_1", 1),
        *Bend.of_board("pattern_1", dataset.patterns["pattern_1"].border),
        BoardTwist.of_board("pattern_1", dataset.patterns["pattern_1"].border),
        CameraError("rgb_1", "focal_length", (0, 1), camera),
    ]


def stored(errors=(), cameras=(), moving=()):
    path = Path("calibration.json")
    cameras, moving = dict(cameras), dict(moving)
    return StoredCalibration(path, "converged", "", [], tuple(errors), cameras, moving, {})


def written(error, value=0.01, sigma=0.002):
    text = json.dumps(parameters_of(error))
    type_ = type(error).__name__
    return StoredError(error.name, error.target, value, sigma, type_, json.loads(text))


def named(camera):
    return dict(zip(intrinsics_names(camera), intrinsics_values(camera)))


def test_each_is_what_it_was_after_reading(dataset):
    errors = errors_of(dataset)
    known = known_of(stored([written(error) for error in errors]), dataset)
    assert list(known.errors) == errors
    *rest, of_camera = known.errors.values()
    assert set(rest) == {ErrorPrior(0.002, 0.01)} and of_camera == ErrorPrior(0.002, 0.0)


def test_those_of_sensors_and_boards_that_are_not_there_are_left_out(dataset):
    errors = [written(RangeOffset("lidar_9")), written(BoardSize("pattern_9"))]
    known = known_of(stored(errors, moving={"gripper": (0.001, 0.001)}), dataset)
    assert known.errors == {} and known.moving == {} and known.dataset.sensors == dataset.sensors


def test_a_camera_is_taken_as_it_was_found(dataset):
    given = dataset.sensors["rgb_1"].camera
    found = moved_camera(given, np.array([0.01, 0.01, 0.002, 0.0, 0.003, *np.zeros(7)]))
    cameras = {"rgb_1": StoredCamera(named(given), named(found), {"fx": 2.0})}
    known = known_of(stored(cameras=cameras), dataset)
    np.testing.assert_allclose(known.dataset.sensors["rgb_1"].camera.K, found.K)
    np.testing.assert_allclose(known.dataset.sensors["rgb_1"].camera.D, found.D)
    ((error, prior),) = known.errors.items()
    assert error == CameraError("rgb_1", "fx", (0,), found)
    assert prior == ErrorPrior(pytest.approx(2.0 / found.focal_px[0]), 0.0)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("solver", SOLVERS)
def test_what_is_known_is_estimated_about_it(solver):
    """As exactly known as this the offset is held; free, it is found; and nothing else suffers."""
    if solver == "ceres" and not native.available():
        pytest.skip("the compiled core is not built")
    dataset = with_long_ranges(scenes.random_scene(1, collections=8).dataset, "lidar_1", 0.03)
    offset, found = RangeOffset("lidar_1"), {}
    for sigma in (1e-5, 10.0):
        known = {offset: ErrorPrior(sigma, -0.05), RangeScale("lidar_9"): ErrorPrior(0.001, 0.002)}
        options = CalibrationOptions(model_errors=OFF, known_errors=known, solver_name=solver)
        result = calibrate(dataset, options)
        assert result.summary.model_errors[RangeScale("lidar_9")] == pytest.approx(0.002)
        found[sigma] = result.summary.model_errors[offset]
    asked = CalibrationOptions(model_errors=OFF, range_offset=("lidar_1",), solver_name=solver)
    free = calibrate(dataset, asked).summary.model_errors[offset]
    assert found[1e-5] == pytest.approx(-0.05, abs=1e-4)
    assert found[10.0] == pytest.approx(free, abs=1e-4) and free == pytest.approx(-0.03, abs=0.01)


def test_what_contradicts_what_is_known_is_said():
    dataset = with_long_ranges(scenes.random_scene(1, collections=8).dataset, "lidar_1", 0.03)
    known = {RangeOffset("lidar_1"): ErrorPrior(0.002, -0.1)}
    result = calibrate(dataset, CalibrationOptions(known_errors=known))
    assert result.status == "inconsistent"
    assert "what was known before is: lidar_1 reads 100 +- 2 mm long" in result.message


@pytest.mark.parametrize("number", [-1, 12])
def test_a_number_that_no_camera_has_is_refused(dataset, number):
    error = CameraError("rgb_1", "fx", (number,), dataset.sensors["rgb_1"].camera)
    with pytest.raises(DatasetError, match="tell no CameraError of rgb_1"):
        known_of(stored([written(error)]), dataset)
