"""Layers of a LiDAR and waves of a depth image: found where they are, and functions of the ray."""

import numpy as np
import pytest

pytest.importorskip("atom_core._core", reason="the problem is made by a calibration")

from atom_core.calibration.calibrate import calibrate
from atom_core.problem.corrections import corrected
from atom_core.problem.range_fields import DepthWave, depth_waves, elevations, layer_offsets
from atom_core.problem.residuals import RangeBlock
from atom_core.synthetic import paper_cell


@pytest.fixture(scope="module")
def solved():
    return calibrate(paper_cell(0).dataset)


def blocks_of(problem, sensor):
    return [
        block
        for block in problem.residual_blocks
        if isinstance(block, RangeBlock) and block.sensor == sensor
    ]


def waves_of(solved):
    return depth_waves("depth_1", solved.dataset.sensors["depth_1"].camera)


def test_layers_are_those_of_the_lidar_and_each_point_is_in_one(solved):
    layers = layer_offsets(solved.problem, "lidar_1")
    assert 2 <= len(layers) <= 16
    for layer in layers:  # two degrees apart, from -15 on
        assert (layer.elevation_deg + 15.0) / 2.0 == pytest.approx(
            round((layer.elevation_deg + 15.0) / 2.0), abs=0.2
        )
    for block in blocks_of(solved.problem, "lidar_1"):
        assert np.all(sum(layer.share(block.points) for layer in layers) == 1.0)


def test_points_that_are_in_no_layers_have_none(solved):
    """The pixels of a depth camera, say."""
    assert layer_offsets(solved.problem, "depth_1") == []


def test_waves_are_orthogonal_over_the_image_and_none_is_constant(solved):
    camera = solved.dataset.sensors["depth_1"].camera
    row, column = np.mgrid[0 : camera.height : 8, 0 : camera.width : 8]
    pixels = np.column_stack([column.ravel(), row.ravel()]) + 3.5
    ahead = (pixels - camera.centre_px) / camera.focal_px
    points = np.column_stack([ahead, np.ones(len(ahead))])
    heights = np.array([wave.share(points) for wave in waves_of(solved)])
    second = heights @ heights.T / len(points)
    assert np.allclose(second, np.diag(np.diagonal(second)), atol=1e-6)
    assert np.allclose(heights.mean(axis=1), 0.0, atol=1e-6)


@pytest.mark.parametrize("sensor", ["lidar_1", "depth_1"])
def test_corrections_are_taken_back_to_rounding(solved, sensor):
    problem, x = solved.problem, solved.summary.x
    errors = layer_offsets(problem, sensor) or waves_of(solved)
    moved = corrected(problem, {e: 1e-3 * (i + 1) for i, e in enumerate(errors)}, x)
    back = corrected(moved, {}, x)
    for before, there, after in zip(*(blocks_of(p, sensor) for p in (problem, moved, back))):
        assert np.max(np.abs(there.points - before.points)) > 1e-3
        assert np.allclose(after.points, before.points, atol=1e-6)
        assert np.allclose(elevations(there.points), elevations(before.points), atol=1e-6)


def test_a_wave_has_the_name_of_both_its_directions():
    assert DepthWave("depth_1", (3, 2), None).name == "depth_wave_3_2"
