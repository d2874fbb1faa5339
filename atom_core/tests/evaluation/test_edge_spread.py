"""Covariances of edges: their axes, what was held, what widens them."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import OFF, CalibrationOptions
from atom_core.evaluation.edge_errors import pose_error
from atom_core.evaluation.edge_spread import edge_spread, known_spread
from atom_core.evaluation.spreads import NO_SPREAD
from atom_core.model.dataset import board_edge
from atom_core.model.transforms import Edge
from atom_core.synthetic import scenes

QUIET = CalibrationOptions(model_errors=OFF)


@pytest.fixture(scope="module")
def solved():
    """Two cameras of which the second one begins far off."""
    return calibrate(scenes.two_cameras(1, collections=6, disturbance=(0.05, 0.2)).dataset, QUIET)


def block_of(calibration, edge):
    parameters = calibration.problem.parameters
    return next((i, block) for i, block in parameters.pose_blocks() if block.edge == edge)


def slopes(block, x, h=1e-6):
    """Return (6, 6) turns and shifts in the parent's axes by the numbers of a pose."""
    columns = []
    for axis in np.eye(6):
        error = pose_error(block.pose(x - h * axis), block.pose(x + h * axis))
        columns.append(np.concatenate([error.turn_rad, error.shift_m]) / (2.0 * h))
    return np.array(columns).T


def expected_of(calibration, edge, covariance):
    index, block = block_of(calibration, edge)
    x = calibration.summary.x[calibration.problem.parameters.slice_of(index)]
    assert np.linalg.norm(x[:3]) > 0.05  # else all axes would do
    slope = slopes(block, x)
    return slope @ covariance.block(index) @ slope.T


def test_it_is_the_covariance_of_turns_and_shifts_in_the_parent_s_axes(solved):
    edge = solved.dataset.sensors["rgb_2"].edge
    found = edge_spread(solved, edge)
    sigma = np.sqrt(np.diagonal(found))
    off = (found - expected_of(solved, edge, solved.covariance)) / np.outer(sigma, sigma)
    assert np.max(np.abs(off)) < 1e-4
    assert np.all(sigma > 0.0)


def test_boards_have_a_spread_too(solved):
    (pattern,) = solved.dataset.patterns.values()
    sigma = np.sqrt(np.diagonal(edge_spread(solved, board_edge(pattern))))
    assert np.all((sigma > 1e-5) & (sigma < 0.05))


def test_what_was_held_or_is_unknown_has_none(solved):
    for edge in (solved.dataset.sensors["rgb_1"].edge, Edge("world", "nowhere")):
        assert edge_spread(solved, edge) is None
        assert known_spread(solved, edge) is NO_SPREAD


def widened(calibration, factor, freedom):
    """Return the calibration with all sigmas larger by a factor than the assumed noise has them."""
    plain = calibration.covariance.of_model
    wide = plain.robust(np.full(len(plain.shared), factor), {}, freedom)
    return replace(calibration, covariance=wide)


def test_sigmas_three_times_as_large_are_nine_times_the_covariance(solved):
    wide, edge = widened(solved, 3.0, 7.0), solved.dataset.sensors["rgb_2"].edge
    found = known_spread(wide, edge)
    np.testing.assert_allclose(found.stated, 9.0 * found.of_model)
    np.testing.assert_allclose(found.stated, edge_spread(wide, edge))
    np.testing.assert_allclose(
        found.of_model, edge_spread(solved, edge, solved.covariance.of_model)
    )
    assert found.freedom == 7.0


def test_another_covariance_than_the_calibration_s_may_be_asked_for(solved):
    edge, wide = solved.dataset.sensors["rgb_2"].edge, widened(solved, 2.0, np.inf)
    plain = solved.covariance.of_model
    np.testing.assert_allclose(edge_spread(wide, edge), 4.0 * edge_spread(wide, edge, plain))


def test_detections_are_those_of_the_edge_s_own_sensor(solved):
    keys = [key.sensor for key in solved.problem.detections]
    found = known_spread(solved, solved.dataset.sensors["rgb_2"].edge)
    assert 0 < found.detections == keys.count("rgb_2") < len(keys)


def test_detections_of_all_sensors_on_an_edge_count():
    dataset = scenes.shared_edge(0, collections=4).dataset
    calibration = calibrate(dataset, QUIET)
    keys = [key.sensor for key in calibration.problem.detections]
    found = known_spread(calibration, dataset.sensors["rgb_2"].edge)
    assert found.detections == keys.count("rgb_2") + keys.count("depth_1")
    assert found.detections != keys.count("rgb_1") and "depth_1" in keys and "rgb_2" in keys


def test_where_nothing_more_is_known_usual_errors_add_nothing(solved):
    plain = replace(solved, covariance=solved.covariance.of_model)
    assert not plain.covariance.has_combined
    found = known_spread(plain, solved.dataset.sensors["rgb_2"].edge)
    np.testing.assert_array_equal(found.usual, np.zeros((6, 6)))


def test_usual_errors_are_what_combined_variances_have_beyond_the_stated_ones(solved):
    plain, edge = solved.covariance.of_model, solved.dataset.sensors["rgb_2"].edge
    shift_m = 0.002
    variances = np.array([0.0, 0.0, 0.0, *[shift_m**2] * 3])
    columns = solved.problem.parameters.slice_of(block_of(solved, edge)[0])
    systematic = np.zeros(plain.shared.shape)
    systematic[columns, columns] = np.diag(variances)
    combined = replace(solved, covariance=plain.with_combined(systematic))
    found = known_spread(combined, edge)
    np.testing.assert_allclose(np.diagonal(found.usual)[3:], shift_m**2, rtol=1e-6)
    np.testing.assert_allclose(found.usual - np.diag(np.diagonal(found.usual)), 0.0)
    np.testing.assert_allclose(np.diagonal(found.usual)[:3], 0.0, atol=1e-12)
    np.testing.assert_allclose(found.stated, edge_spread(solved, edge, plain))
