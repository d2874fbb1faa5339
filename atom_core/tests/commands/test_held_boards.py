"""Boards are held where a calibration has placed them, and nowhere else (-ap)."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))  # command_line, which the tests share

from command_line import refused, run  # noqa: E402

from atom_core.geometry import se3  # noqa: E402
from atom_core.io.dataset_json import read_dataset  # noqa: E402
from atom_core.io.dataset_writer import write_dataset_folder  # noqa: E402
from atom_core.synthetic import scenes  # noqa: E402

UNSEEN = ("002", "005")  # by the anchored sensor


@pytest.fixture
def scene():
    return scenes.random_scene(3, depth=0, lidar3d=1, collections=9)


@pytest.fixture
def path(scene, tmp_path):
    """Return a dataset whose collector saw all boards 8 cm from where they are."""
    dataset = scene.dataset
    assert dataset.config.anchored_sensor == "rgb_1"
    for key in UNSEEN:
        dataset = dataset.with_labels(key, {("rgb_1", "pattern_1"): None})
    off = se3.transform(np.eye(3), np.array([0.08, 0.0, 0.0]))
    boards = {
        place: ("rgb_2", off @ parent_T_pattern)
        for place, parent_T_pattern in scene.truth.boards.items()
    }
    return write_dataset_folder(dataset, tmp_path / "data", name="held", initial_boards=boards)


def calibrated(path, folder, *options):
    run("calibrate", "-json", path, "-o", folder, "--no_report", *options)
    return folder / "atom_calibration.json", json.loads((folder / "calibration.json").read_text())


@pytest.mark.parametrize("of_dataset", [[], ["-gtpp"]])
def test_boards_that_one_sensor_has_placed_hold_the_others(scene, path, tmp_path, of_dataset):
    """ATOM's recipe: -oas, then -ap on its result, which ATOM also needs -gtpp for."""
    placed, _ = calibrated(path, tmp_path / "one", "-oas")
    result, document = calibrated(placed, tmp_path / "all", "-ap", *of_dataset)
    (told,) = [text for text in document["warnings"] if "(-ap)" in text]
    assert all(key in told for key in UNSEEN) and "000" not in told
    dataset = read_dataset(result)
    for name, sensor in dataset.sensors.items():
        true = scene.truth.edges[sensor.edge]
        apart_m, _ = se3.pose_difference(dataset.first_value(sensor.edge), true)
        assert apart_m < 0.01, name


def test_boards_of_which_none_is_placed_are_held_where_they_were_first_seen(path, tmp_path):
    run("calibrate", "-json", path, "-o", tmp_path / "raw", "--no_report", "-ap", "-ias", code=0)
    document = json.loads((tmp_path / "raw" / "calibration.json").read_text())
    assert any("transforms_initial" in text for text in document["warnings"])


def test_first_places_are_not_the_truth(path, tmp_path, capsys):
    line = refused(capsys, "calibrate", "-json", path, "-o", tmp_path / "raw", "-ap", "-gtpp")
    assert "000" in line and "knows where its boards are" in line
