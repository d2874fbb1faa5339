"""The joint variance of two estimates, each wider by Student's t for its few collections."""

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import OFF, CalibrationOptions
from atom_core.evaluation.drift_question import with_common_scatter
from atom_core.evaluation.edge_spread import edge_spread
from atom_core.evaluation.spreads import Spread, joint_variance
from atom_core.evaluation.trust.two_estimates import edge_difference
from atom_core.solvers.robust_covariance import wider_by_students_t
from atom_core.synthetic import scenes


def test_variances_that_nothing_made_wider_are_added():
    found = joint_variance(np.array([[1.0, 4.0], [2.0, 5.0]]), np.array([np.inf, np.inf]))
    np.testing.assert_allclose(found, [3.0, 9.0])


def test_two_alike_have_the_degrees_of_freedom_of_both():
    wide = wider_by_students_t(7.0) ** 2
    found = joint_variance(np.array([[wide], [wide]]), np.array([7.0, 7.0]))
    np.testing.assert_allclose(found, [2.0 * wider_by_students_t(14.0) ** 2])


@pytest.mark.parametrize("scales", [(1.0, 1.0), (1.0, 3.0)])
def test_intervals_of_the_difference_hold_it_in_95_of_100(scales):
    rng, freedom, draws = np.random.default_rng(0), 6, 20_000
    values = [scale * rng.normal(size=draws) for scale in scales]
    told = [scale**2 * rng.chisquare(freedom, draws) / freedom for scale in scales]
    wide = wider_by_students_t(freedom) ** 2 * np.array(told)
    joint = joint_variance(wide, np.full(2, float(freedom)))
    apart = np.abs(values[0] - values[1])
    assert np.mean(apart < 1.96 * np.sqrt(joint)) == pytest.approx(0.95, abs=0.012)
    added = np.mean(apart < 1.96 * np.sqrt(np.sum(wide, axis=0)))
    assert added > np.mean(apart < 1.96 * np.sqrt(joint)) + 0.005


def test_of_an_edge_it_lies_between_the_assumed_noise_and_the_sum():
    dataset = scenes.random_scene(3, rgb=2, depth=0, lidar3d=0, collections=20).dataset
    keys, options = list(dataset.collections), CalibrationOptions(model_errors=OFF)
    halves = [calibrate(dataset.selected(collections=keys[i::2]), options) for i in (0, 1)]
    edge = dataset.sensors["rgb_2"].edge
    numbers, covariance = edge_difference(halves[0], halves[1], edge)
    assert 0.0 < np.linalg.norm(numbers[3:]) < 0.05
    stated = sum(np.diagonal(edge_spread(half, edge)) for half in halves)
    least = sum(np.diagonal(edge_spread(half, edge, half.covariance.of_model)) for half in halves)
    assert np.all(np.diagonal(covariance) <= stated * (1.0 + 1e-9))
    assert np.all(np.diagonal(covariance) >= least * (1.0 - 1e-9))
    assert np.any(np.diagonal(covariance) < 0.99 * stated)


def test_range_sensors_of_a_kind_share_their_scatter_but_those_of_which_nothing_is_known():
    dataset = scenes.random_scene(0, rgb=1, depth=0, lidar3d=3, collections=2).dataset
    one, two, three = (dataset.sensors[f"lidar_{i}"].edge for i in (1, 2, 3))
    none = np.zeros((6, 6))
    spreads = {
        one: Spread(np.eye(6), np.eye(6), 12, 2.0, 9.0),
        two: Spread(np.eye(6), np.eye(6), 12, 4.0, 9.0),
        three: Spread(none, none, 0, 7.0, 9.0),
    }
    found = with_common_scatter(dataset, spreads)
    assert [found[edge].scatter for edge in (one, two, three)] == [3.0, 3.0, 7.0]
    assert found[one].freedom == np.inf and found[three] is spreads[three]
