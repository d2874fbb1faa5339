"""The noise of structured-light depths: the parabola of Nguyen, Izadi, Lovell (2012)."""

import numpy as np
import pytest

from atom_core.geometry.expected_noise import depth_sigma_m


@pytest.mark.parametrize(
    "z_m, sigma_mm",
    [(0.4, 1.2), (1.4, 1.2 + 1.9), (2.4, 1.2 + 1.9 * 4.0), (3.4, 1.2 + 1.9 * 9.0)],
)
def test_sigma_is_that_of_the_paper_in_millimetres(z_m, sigma_mm):
    assert 1000.0 * depth_sigma_m(np.array([z_m]))[0] == pytest.approx(sigma_mm)


def test_sigma_is_least_at_four_decimetres_and_alike_on_both_sides():
    near_m, far_m = depth_sigma_m(np.array([0.2])), depth_sigma_m(np.array([0.6]))
    assert near_m == pytest.approx(far_m)
    assert depth_sigma_m(np.array([0.4])) < near_m


def test_each_depth_has_its_own_sigma():
    z_m = np.array([0.5, 1.0, 4.0])
    alone = [float(depth_sigma_m(z)) for z in z_m]
    np.testing.assert_array_equal(depth_sigma_m(z_m), alone)
