"""Lines through points: the nearest one, wherever and however the points lie."""

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.geometry.line import LineFit, fit_line

DIRECTION = np.array([2.0, -1.0, 2.0]) / 3.0
ACROSS = np.array([1.0, 2.0, 0.0]) / np.sqrt(5.0)
ORIGIN = np.array([1.0, 2.0, 0.5])


def zigzag(off_m):
    """Return points on both sides of a line by turns, whose fit is the line itself."""
    along = np.array([-2.0, -1.0, 1.0, 2.0])
    sides = np.array([1.0, -1.0, -1.0, 1.0])
    return ORIGIN + along[:, None] * DIRECTION + off_m * sides[:, None] * ACROSS


def test_the_line_goes_along_the_points_and_through_their_middle():
    fit = fit_line(zigzag(0.1))
    np.testing.assert_allclose(fit.centroid, ORIGIN, atol=1e-12)
    assert abs(fit.direction @ DIRECTION) == pytest.approx(1.0)
    assert np.linalg.norm(fit.direction) == pytest.approx(1.0)
    np.testing.assert_allclose(fit.distances, 0.1)


def test_no_turned_or_shifted_line_is_nearer():
    points = np.random.default_rng(0).normal(size=(20, 3)) * [3.0, 0.5, 0.2] + ORIGIN
    fit = fit_line(points)

    def square_m2(origin, direction):
        return np.sum(np.cross(points - origin, direction / np.linalg.norm(direction)) ** 2)

    least = square_m2(fit.centroid, fit.direction)
    assert least == pytest.approx(np.sum(fit.distances**2))
    for change in 0.02 * np.vstack([np.eye(3), -np.eye(3)]):
        assert square_m2(fit.centroid, fit.direction + change) >= least - 1e-12
        assert square_m2(fit.centroid + change, fit.direction) >= least - 1e-12


def test_rms_is_the_root_of_the_mean_square():
    fit = LineFit(np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([3.0, 4.0, 0.0, 5.0]))
    assert fit.rms_m == pytest.approx(np.sqrt(50.0 / 4.0))


def test_distances_do_not_change_with_the_frame():
    points = np.random.default_rng(1).normal(size=(7, 3))
    moved = se3.apply(se3.from_rpy(np.array([1.0, -2.0, 3.0]), np.array([0.3, 0.8, -1.0])), points)
    np.testing.assert_allclose(fit_line(moved).distances, fit_line(points).distances, atol=1e-12)


def test_two_points_lie_on_their_line():
    fit = fit_line(np.array([[0.0, 0.0, 0.0], [0.0, 3.0, 4.0]]))
    assert abs(fit.direction @ [0.0, 0.6, 0.8]) == pytest.approx(1.0)
    assert fit.rms_m == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("count", [0, 1])
def test_less_than_two_points_have_no_line(count):
    with pytest.raises(ValueError, match=rf"^{count} point\(s\) have no line"):
        fit_line(np.ones((count, 3)))


@pytest.mark.parametrize("far_m", [0.1, 1.0, 100.0])
def test_points_are_in_one_place_where_they_differ_by_rounding_only(far_m):
    """The root of the sum of both squared offsets is apart_m / sqrt(2)."""
    limit_m = np.sqrt(2.0) * 1e-9 * max(1.0, far_m)
    beside = np.array([[0.0, -0.5, 0.0], [0.0, 0.5, 0.0]])
    middle = np.array([far_m, 0.0, 0.0])
    with pytest.raises(ValueError, match="in one place"):
        fit_line(middle + 0.99 * limit_m * beside)
    fit = fit_line(middle + 1.01 * limit_m * beside)
    assert abs(fit.direction[1]) == pytest.approx(1.0)


def test_points_exactly_at_the_limit_are_in_one_place():
    with pytest.raises(ValueError, match="in one place"):
        fit_line(np.zeros((2, 3)))
