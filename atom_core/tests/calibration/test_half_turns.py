"""Boards without ids: a camera on its head numbers all of them from the other end."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.start.half_turns import renumbered
from atom_core.io.dataset_json import read_dataset, write_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes


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
