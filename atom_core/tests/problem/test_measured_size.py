"""Boards have the size that their border points show, whatever the configuration says."""

from dataclasses import replace

import pytest

from atom_core.calibration.preflight import preflight
from atom_core.problem.measured_size import measured_sides
from atom_core.problem.measurements import read_measurements
from atom_core.report.check_verdict import check_verdict
from atom_core.report.verdict import WEAK
from atom_core.synthetic import PLAIN, Noise, Sampling, paper_cell, scenes


def sides_of(scene):
    measurements, _ = read_measurements(scene.dataset)
    return measured_sides(measurements)


@pytest.mark.parametrize("scale", [-0.08, 0.0, 0.05])
def test_exact_border_points_give_the_true_size(scale):
    scene = scenes.lidar_only(
        1,
        collections=25,
        noise=Noise.none(),
        sampling=Sampling(exact_border=True),
        realism=replace(PLAIN, board_scale=scale),
    )
    sides = sides_of(scene)
    assert len(sides) >= 3
    for side in sides:
        true_m = (1.0 + scale) * side.configured_m
        assert side.measured_m == pytest.approx(true_m, abs=3e-4), side
        assert side.is_off is (scale != 0.0)


@pytest.mark.parametrize("seed", [0])
def test_a_board_as_configured_is_nothing_to_tell(seed):
    sides = sides_of(paper_cell(seed))
    assert len(sides) >= 6 and not any(side.is_off for side in sides)


@pytest.mark.parametrize("scale", [0.05, -0.1])
def test_a_board_of_another_size_is_told_for_each_sensor_with_both_sizes(scale):
    scene = paper_cell(0, realism=replace(PLAIN, board_scale=scale))
    result = preflight(scene.dataset)
    told = [w for w in result.warnings if "looks" in w]
    assert {w.split("'")[3] for w in told} >= {"depth_1", "lidar_2", "lidar_3"}
    for warning in told:
        assert "pattern 'pattern_1' looks 0." in warning and "the configuration says" in warning
        assert "0.600 m high" in warning
        sensor = check_verdict(scene.dataset, result).sensors[warning.split("'")[3]]
        assert sensor.grade == WEAK and "measure the board" in sensor.advice
