"""Boards without ids: a camera on its head numbers all of them from the other end."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.start.half_turns import renumbered
from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset, write_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.model.pattern import pattern_from_config
from atom_core.solvers.base import CONVERGED
from atom_core.synthetic import scenes
from atom_core.synthetic.board import chessboard, held_before
from atom_core.synthetic.dataset import disturbed, make_dataset
from atom_core.synthetic.mistakes import with_renumbered_corners
from atom_core.synthetic.noise import Noise
from atom_core.synthetic.rig import COLOUR_CAMERA, assemble, camera_mount, looking_at


def cameras(seed, rgb=2, lidar3d=0):
    """Return a scene of cameras (and LiDARs) before an 8 x 6 chessboard."""
    return scenes.without_ids(seed, rgb=rgb, lidar3d=lidar3d, disturbance=(0.05, 0.05))


def errors_mm(result, scene):
    transforms = next(iter(result.dataset.collections.values())).transforms
    off = [transforms[e][:3, 3] - true[:3, 3] for e, true in scene.truth.edges.items()]
    return 1000.0 * np.max(np.linalg.norm(off, axis=1))


def test_renumbered_twice_is_as_before():
    dataset = cameras(0).dataset
    once = renumbered(dataset, "rgb_2")
    twice = renumbered(once, "rgb_2")
    for key, label in dataset.detections():
        again, turned = twice.label(key), once.label(key)
        np.testing.assert_array_equal(again.pixels, label.pixels)
        np.testing.assert_array_equal(again.ids, label.ids)
        if key.sensor == "rgb_2":
            np.testing.assert_array_equal(turned.pixels, label.pixels[::-1])
        else:
            np.testing.assert_array_equal(turned.pixels, label.pixels)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("guess", ["description", "none"])
@pytest.mark.parametrize(("rgb", "lidar3d"), [(2, 0), (3, 1)])
def test_a_camera_on_its_head_is_found_and_its_corners_renumbered(rgb, lidar3d, guess):
    scene = cameras(1, rgb, lidar3d)
    options = CalibrationOptions(initial_guess=guess)
    healthy = calibrate(scene.dataset, options)
    result = calibrate(renumbered(scene.dataset, "rgb_2"), options)
    assert (healthy.status, result.status) == ("converged", "converged")
    assert not any("renumbered" in w for w in healthy.warnings)
    assert sum("'rgb_2' are numbered from the other end" in w for w in result.warnings) == 1
    assert errors_mm(result, scene) == pytest.approx(errors_mm(healthy, scene), abs=0.01)
    assert errors_mm(result, scene) < 5.0


def test_what_was_renumbered_is_written_so(tmp_path):
    """The dataset that was calibrated says which corner is which, and starts right."""
    dataset = renumbered(cameras(2).dataset, "rgb_2")
    write_dataset_folder(dataset, tmp_path / "data", name="data")
    read = read_dataset(tmp_path / "data" / "dataset.json")
    result = calibrate(read)
    assert {key.sensor for key in result.relabeled} == {"rgb_2"}
    write_dataset(result.dataset, tmp_path / "calibrated.json", result.relabeled)
    again = calibrate(read_dataset(tmp_path / "calibrated.json"))
    assert again.relabeled == () and again.status == "converged"
    assert errors_mm(again, cameras(2)) == pytest.approx(errors_mm(result, cameras(2)), abs=0.01)


def test_wrong_intrinsics_turn_no_board():
    scene = cameras(3)
    sensor = scene.dataset.sensors["rgb_2"]
    camera = replace(sensor.camera, K=sensor.camera.K * [[1.3, 1, 1], [1, 1.3, 1], [1, 1, 1]])
    sensors = {**scene.dataset.sensors, "rgb_2": replace(sensor, camera=camera)}
    result = calibrate(replace(scene.dataset, sensors=sensors))
    assert result.relabeled == () and result.status != "converged"


def before_a_chessboard(rolls_rad, seed=4):
    """Return cameras that are turned about their axes, with labels as collectors number them.

    The x axis of a board points to the right in each image.
    """
    rng, config = np.random.default_rng(seed), chessboard(dimension=(8, 6))
    mounts = []
    for i, roll_rad in enumerate(rolls_rad):
        eye = np.array([0.0, 0.3 - 0.3 * i, 1.0])
        place = looking_at(eye, np.array([2.0, 0.0, 1.0]), roll_rad)
        mounts.append(camera_mount(f"rgb_{i + 1}", "rgb", "world", place, COLOUR_CAMERA))
    rig = assemble("world", {}, mounts, anchored="rgb_1")
    middles = np.array([2.0, 0.0, 1.0]) + rng.uniform(-0.3, 0.3, (16, 3))
    border, eye = pattern_from_config("", config).border, np.array([0.0, 0.0, 1.0])
    boards = [held_before(eye, middle, border, rng, tilt_rad=0.4) for middle in middles]
    patterns = {"pattern_1": config}
    scene = make_dataset(rig, {"pattern_1": boards}, Noise(), rng, patterns=patterns)
    scene = disturbed(scene, (0.05, 0.05), rng)
    dataset = scene.dataset
    for key, _ in scene.dataset.detections():
        sensor = scene.dataset.sensors[key.sensor]
        sensor_T_board = se3.inverse(rig.pose(sensor.frame)) @ boards[int(key.collection)]
        ends = se3.apply(sensor_T_board, np.array([[0.0, 0.0, 0.0], [0.05, 0.0, 0.0]]))
        start, end = sensor.camera.project(ends)
        if end[0] < start[0]:
            dataset = with_renumbered_corners(dataset, key.collection, key.sensor, "turned")
    return replace(scene, dataset=dataset)


@pytest.mark.parametrize("guess", ["description", "none"])
@pytest.mark.parametrize("rolls_rad", [(0.0, np.pi / 2), (np.pi / 2, 0.0), (0.0, np.pi / 2, 0.0)])
def test_a_portrait_camera_beside_landscape_ones_is_renumbered_where_they_differ(rolls_rad, guess):
    scene = before_a_chessboard(rolls_rad)
    result = calibrate(scene.dataset, CalibrationOptions(initial_guess=guess))
    assert result.status == CONVERGED and errors_mm(result, scene) < 5.0
    turned = {key.sensor for key in result.relabeled}
    assert 0 < len(result.relabeled) < 16 and "rgb_2" in turned
    for name in turned:
        (said,) = [w for w in result.warnings if f"corners of '{name}' are numbered" in w]
        for key in result.relabeled:
            assert key.sensor != name or key.collection in said


@pytest.mark.parametrize("seed", [4, 5])
def test_cameras_that_stand_alike_need_no_renumbering(seed):
    result = calibrate(before_a_chessboard((0.0, 0.0), seed).dataset)
    assert result.status == CONVERGED and result.relabeled == ()


@pytest.mark.parametrize("count", [1, 4, 7])
def test_single_detections_from_the_other_end_are_renumbered(count):
    scene = cameras(0, lidar3d=1)
    dataset, keys = scene.dataset, [k for k, _ in scene.dataset.detections() if k.sensor == "rgb_2"]
    for key in keys[:count]:
        dataset = with_renumbered_corners(dataset, key.collection, key.sensor, "turned")
    result, healthy = calibrate(dataset), calibrate(scene.dataset)
    assert result.status == healthy.status
    shared = {k.collection for k, _ in dataset.detections() if k.sensor == "rgb_1"}
    assert set(result.relabeled) == {key for key in keys[:count] if key.collection in shared}
    assert errors_mm(result, scene) == pytest.approx(errors_mm(healthy, scene), abs=0.1)
