"""The width of a LiDAR's beams: estimated from boards that look too large, used by the labeler."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from lidar_scenes import BORDER, Scene, board_facing, pose, scan

from atom_core import native
from atom_core.calibration.preflight import preflight
from atom_core.geometry.rectangle import Rectangle
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.io.pcd import read_pcd
from atom_core.labeling.base import labeler_for
from atom_core.labeling.beam_width import estimate_beam_width
from atom_core.labeling.lidar3d import Cloud, find_boards
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import LIDAR3D, Sensor
from atom_core.model.transforms import Edge
from atom_core.synthetic import PLAIN, charuco, scenes
from atom_core.synthetic.lidar_models import LIDAR_MODELS

pytestmark = pytest.mark.skipif(not native.available(), reason="the compiled core is not built")

EYE = (0.0, 0.0, 1.5)
SENSOR = Sensor("lidar", LIDAR3D, "lidar", Edge("world", "lidar"))


def seen_by_wide_beams(width_rad, count=6):
    """Return clouds and seeds: a board is enlarged by half a beam on each side."""
    boards = []
    for k, away in enumerate(np.linspace(1.8, 3.0, count)):
        more = np.full(2, 0.5 * width_rad * away)
        low, high = BORDER.centre - BORDER.half_size - more, BORDER.centre + BORDER.half_size + more
        wide = Rectangle(*low, *high)
        board = board_facing(EYE, (away, 0.1, 1.5), 25.0 * k, 15.0, border=wide)
        scene = Scene(pose(EYE), board, model=LIDAR_MODELS["ouster_64"])
        cloud = scan(scene, k, border=wide, mixed_within_rad=0.0)
        boards.append((Cloud(cloud.points, cloud.ring), cloud.seed))
    return boards


@pytest.mark.parametrize("width_rad", [0.006, 0.012])
def test_the_width_is_what_enlarges_boards(width_rad):
    found = estimate_beam_width(seen_by_wide_beams(width_rad), BORDER)
    assert found.boards == 6
    assert found.width_rad == pytest.approx(width_rad, abs=0.0015)
    assert found.sigma_rad < 0.0015


def test_narrow_beams_and_few_boards_tell_no_width():
    narrow = estimate_beam_width(seen_by_wide_beams(0.0), BORDER)
    assert narrow is None or narrow.width_rad < 0.002
    assert estimate_beam_width(seen_by_wide_beams(0.012)[:2], BORDER) is None


def test_the_labeler_takes_the_width_of_its_sensor():
    boards = seen_by_wide_beams(0.012, 2)
    config = charuco()
    pattern = pattern_from_config("pattern_1", config)
    wide = replace(SENSOR, beam_width_rad=0.012)
    for cloud, seed in boards:
        looks = [
            labeler_for(sensor, pattern, config).label(cloud, seed).quality["measured_width_m"]
            for sensor in (SENSOR, wide)
        ]
        assert looks[0] > 0.81
        assert looks[1] == pytest.approx(0.8, abs=0.008)


def test_the_configuration_and_the_dataset_keep_it(tmp_path):
    dataset = scenes.lidar_only(1, collections=3).dataset
    entries = {n: replace(e, beam_width=0.0134) for n, e in dataset.config.sensors.items()}
    assert "beam_width" not in dataset.config.to_document()["sensors"]["lidar_1"]
    told = replace(dataset, config=replace(dataset.config, sensors=entries))
    read = read_dataset(write_dataset_folder(told, tmp_path / "told", name="told"))
    assert read.config.sensors["lidar_1"].beam_width == 0.0134
    assert {sensor.beam_width_rad for sensor in read.sensors.values()} == {0.0134}


def test_check_names_the_width_that_would_explain_a_board_that_looks_too_large():
    large = scenes.lidar_only(1, collections=12, realism=replace(PLAIN, board_scale=0.04))
    (warning,) = [w for w in preflight(large.dataset).warnings if "to sensor 'lidar_1'" in w]
    assert "measure the board" in warning
    assert "(2.0 to 2.5 m away) do not tell a larger board from wide beams" in warning
    assert "If the board is right, the sensor's beams are 0.0" in warning
    assert "write beam_width: 0.0" in warning
    small = scenes.lidar_only(1, collections=12, realism=replace(PLAIN, board_scale=-0.1))
    assert not any("beam" in warning for warning in preflight(small.dataset).warnings)


@pytest.mark.parametrize("number", [2, 4])
def test_a_real_board_that_beams_enlarge_by_6_percent_is_found_without_a_seed(real_data, number):
    file = read_pcd(real_data("ouster_board") / f"pointcloud{number}.pcd")
    side_m = 1.016
    border = Rectangle(-side_m / 2.0, -side_m / 2.0, side_m / 2.0, side_m / 2.0)
    data = Cloud(file.xyz, file.fields["ring"], file.width, file.height)
    (found,) = find_boards(data, border)  # the beams' width is not known
    quality = found.labeled.quality
    assert max(quality["measured_width_m"], quality["measured_height_m"]) > 1.06 * side_m
