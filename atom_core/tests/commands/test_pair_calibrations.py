"""One pair of sensors by OpenCV or ICP, as ATOM's commands have it."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("atom_core._core", reason="boards are labeled in clouds")
sys.path.insert(0, str(Path(__file__).parent))  # command_line, which the tests share

from command_line import refused, run  # noqa: E402

from atom_core.geometry import se3  # noqa: E402
from atom_core.geometry.se3 import pose_difference  # noqa: E402
from atom_core.io.dataset_json import read_dataset  # noqa: E402
from atom_core.io.dataset_writer import write_dataset_folder  # noqa: E402
from atom_core.model.dataset import pose  # noqa: E402
from atom_core.synthetic import Noise, scenes  # noqa: E402
from atom_core.synthetic.carried import on_another  # noqa: E402


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return the file of a dataset whose second sensors stand wrong, and the true dataset."""
    scene = scenes.random_scene(1, rgb=2, depth=0, lidar3d=2, collections=5, noise=Noise.none())
    true = scene.dataset.with_transforms(
        dict.fromkeys(scene.dataset.collections, scene.truth.edges)
    )
    off = se3.random_move(0.03, 0.02, np.random.default_rng(0))
    edges = [true.sensors[name].edge for name in ("rgb_2", "lidar_2")]
    moved = {edge: true.first_value(edge) @ off for edge in edges}
    wrong = true.with_transforms(dict.fromkeys(true.collections, moved))
    return write_dataset_folder(wrong, tmp_path_factory.mktemp("made"), name="wrong"), true


def error_of(path, true, source, target):
    """Return how far a sensor is in another one from where it truly is (m, deg)."""
    poses = []
    for dataset in (read_dataset(path), true):
        collection = next(iter(dataset.collections.values()))
        frames = [dataset.sensors[name].frame for name in (target, source)]
        poses.append(pose(collection, dataset.graph, *frames))
    metres, radians = pose_difference(*poses)
    return metres, np.degrees(radians)


@pytest.mark.parametrize(("left", "right"), [("rgb_2", "rgb_1"), ("rgb_1", "rgb_2")])
def test_the_left_camera_is_put_where_opencv_finds_it(left, right, made, capsys, tmp_path):
    path, true = made
    target = tmp_path / "o.json"
    run("cv_stereo_calib", "-json", path, "-lc", left, "-rc", right, "-o", target, "-si")
    metres, degrees = error_of(target, true, left, right)
    assert metres < 1e-3 and degrees < 0.05
    before, after = read_dataset(path), read_dataset(target)
    edge = before.sensors[right].edge
    np.testing.assert_array_equal(after.first_value(edge), before.first_value(edge))
    np.testing.assert_array_equal(after.sensors[left].camera.K, before.sensors[left].camera.K)
    assert f"in {before.sensors[right].frame}" in capsys.readouterr().out


def test_icp_writes_the_average_and_the_best(made, capsys):
    path, true = made
    start = error_of(path, true, "lidar_2", "lidar_1")
    line = ["icp_calibration", "-json", path, "-ss", "lidar_2", "-st", "lidar_1"]
    run(*line)
    for kind in ("average", "best"):
        found = path.with_name(f"ICPCalibration_lidar_2_to_lidar_1_{kind}.json")
        assert error_of(found, true, "lidar_2", "lidar_1") != start
        edge = true.sensors["lidar_1"].edge
        np.testing.assert_allclose(read_dataset(found).first_value(edge), true.first_value(edge))
    assert "exists already" in refused(capsys, *line)
    run(*line, "-ma", "--overwrite")
    average = path.with_name("ICPCalibration_lidar_2_to_lidar_1_average.json")
    assert error_of(average, true, "lidar_2", "lidar_1")[0] < 0.05


def test_a_pair_that_is_none_is_refused(made, capsys):
    path, _ = made
    line = ["cv_stereo_calib", "-json", path, "-rc", "rgb_1", "-lc"]
    assert "no sensor 'lidar_1' of rgb; there are: rgb_1, rgb_2" in refused(
        capsys, *line, "lidar_1"
    )
    assert "is named twice" in refused(capsys, *line, "rgb_1")
    line = ["icp_calibration", "-json", path, "-st", "lidar_1", "-ss"]
    assert "of lidar3d or depth" in refused(capsys, *line, "rgb_1")


def test_of_two_cameras_on_one_another_the_carried_one_is_calibrated(made, capsys, tmp_path):
    path, true = made
    hung = on_another(read_dataset(path), "rgb_2", "rgb_1")
    path = write_dataset_folder(hung, tmp_path / "hung", name="hung")
    line = ["cv_stereo_calib", "-json", path, "-o", tmp_path / "o.json"]
    assert "'rgb_2' hangs below the edge of 'rgb_1', which moves both; calibrate 'rgb_2'" in (
        refused(capsys, *line, "-lc", "rgb_1", "-rc", "rgb_2")
    )
    assert not (tmp_path / "o.json").exists()
    run(*line, "-lc", "rgb_2", "-rc", "rgb_1")
    metres, degrees = error_of(tmp_path / "o.json", true, "rgb_2", "rgb_1")
    assert metres < 1e-3 and degrees < 0.05


def test_icp_far_from_the_truth_is_called_wrong(made, capsys):
    """A third of a metre off, with exit code 0 and no word."""
    path, true = made
    line = ["icp_calibration", "-json", path, "-ss", "lidar_2", "-st", "lidar_1", "--overwrite"]
    run(*line, "-nig", "0.6", "0.6", code=1)
    said = capsys.readouterr().err
    for kind in ("average", "best"):
        found = path.with_name(f"ICPCalibration_lidar_2_to_lidar_1_{kind}.json")
        assert error_of(found, true, "lidar_2", "lidar_1")[0] > 0.3
        assert f"the answer of '{kind}' is wrong: 'lidar_1' does not agree with lidar_2" in said


def test_a_stereo_answer_that_the_labels_refute_is_called_wrong(made, tmp_path, capsys):
    """As where a board is numbered from another side in some pictures of one camera."""
    dataset = read_dataset(made[0])
    collections = dict(dataset.collections)
    for key in list(collections)[::2]:
        labels = dict(collections[key].labels)
        label = labels["rgb_2", "pattern_1"]
        turned = replace(label, pixels=label.pixels[::-1].copy())
        collections[key] = replace(
            collections[key], labels={**labels, ("rgb_2", "pattern_1"): turned}
        )
    path = write_dataset_folder(
        replace(dataset, collections=collections), tmp_path / "d", name="turned"
    )
    run("cv_stereo_calib", "-json", path, "-lc", "rgb_2", "-rc", "rgb_1", code=1)
    assert "cv_stereo_calib: the answer is wrong: 'rgb_1' does not" in capsys.readouterr().err


def test_where_the_rig_itself_is_a_pair_does_not_tell(tmp_path):
    """Cameras before a board on an arm whose places in the world are not calibrated yet."""
    scene = scenes.board_on_arm(2, sensors=2, collections=5)
    dataset, rng = scene.dataset, np.random.default_rng(0)
    edge = dataset.sensors["rgb_1"].edge
    off = dataset.first_value(edge) @ se3.random_move(0.5, 0.5, rng)
    wrong = dataset.with_transforms(dict.fromkeys(dataset.collections, {edge: off}))
    path = write_dataset_folder(wrong, tmp_path / "d", name="d")
    run("cv_stereo_calib", "-json", path, "-lc", "rgb_2", "-rc", "rgb_1")
