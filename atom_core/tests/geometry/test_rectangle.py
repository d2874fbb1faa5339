"""The signed distance to a rectangle, against dense samples of its border."""

import numpy as np
import pytest

from atom_core.geometry.rectangle import Rectangle, blended_distance_to_rectangles

BOARD = Rectangle(-0.04, -0.03, 0.76, 0.57)


def test_distance_is_that_to_the_nearest_border_sample():
    points = np.random.default_rng(0).uniform([-0.3, -0.3], [1.0, 0.9], (500, 2))
    distance, _ = BOARD.signed_distance(points)
    samples = BOARD.sample(1e-4)
    nearest = np.min(np.linalg.norm(points[:, None] - samples, axis=2), axis=1)
    np.testing.assert_allclose(np.abs(distance), nearest, atol=1e-4)


def test_sign_is_negative_inside():
    distance, _ = BOARD.signed_distance(np.array([[0.3, 0.3], [0.9, 0.3], [-0.1, -0.1]]))
    assert distance[0] < 0 and distance[1] > 0 and distance[2] > 0


def test_gradient_against_central_differences():
    points = np.random.default_rng(1).uniform([-0.3, -0.3], [1.0, 0.9], (500, 2))
    _, gradient = BOARD.signed_distance(points)
    h = 1e-7
    for i in range(2):
        step = np.zeros(2)
        step[i] = h
        above, below = (BOARD.signed_distance(points + s)[0] for s in (step, -step))
        numeric = (above - below) / (2 * h)
        np.testing.assert_allclose(gradient[:, i], numeric, atol=1e-6)


def test_a_point_on_the_border_has_distance_zero():
    distance, gradient = BOARD.signed_distance(BOARD.sample(0.02))
    np.testing.assert_allclose(distance, 0.0, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(gradient, axis=1), 1.0)


def test_an_empty_rectangle_is_refused():
    with pytest.raises(ValueError, match="x_max > x_min"):
        Rectangle(0, 0, 0, 1)


def blended(points):
    return blended_distance_to_rectangles(points, BOARD.centre, BOARD.half_size)


def test_blended_distance_is_the_exact_one_but_near_the_ridges():
    points = np.random.default_rng(2).uniform([-0.3, -0.3], [1.0, 0.9], (5000, 2))
    (distance, _), (exact, _) = blended(points), BOARD.signed_distance(points)
    beyond = np.abs(points - BOARD.centre) - BOARD.half_size
    depths = np.sort(-beyond, axis=1)
    on_ridge = (depths[:, 0] > 0) & (depths[:, 1] < 3.0 * depths[:, 0])
    np.testing.assert_allclose(distance[~on_ridge], exact[~on_ridge], atol=1e-15)
    share = distance[on_ridge] / exact[on_ridge]
    assert 0.75 <= np.min(share) < 0.76 and np.max(share) <= 1.0
    np.testing.assert_allclose(blended(BOARD.sample(0.02))[0], 0.0, atol=1e-15)


def test_blended_gradient_is_that_of_the_distance_and_never_jumps():
    points = np.random.default_rng(3).uniform([-0.1, -0.1], [0.85, 0.65], (5000, 2))
    _, gradient = blended(points)
    h = 1e-7
    for i in range(2):
        step = np.zeros(2)
        step[i] = h
        numeric = (blended(points + step)[0] - blended(points - step)[0]) / (2 * h)
        np.testing.assert_allclose(gradient[:, i], numeric, atol=1e-6)
    # along a line through the ridge, 1 cm inside the corner
    line = np.array([-0.03, -0.02]) + np.linspace(-0.009, 0.009, 1001)[:, None] * [1.0, -1.0]
    jumps = np.max(np.abs(np.diff(blended(line)[1], axis=0)))
    assert jumps < 0.01
    assert np.max(np.abs(np.diff(BOARD.signed_distance(line)[1], axis=0))) == 1.0


def test_a_point_near_a_corner_is_held_at_one_place_by_a_few_others():
    """The distance to the nearest side holds it at two."""
    shifts = np.linspace(-0.01, 0.01, 2001)
    corner = np.array([-0.035, -0.025]) + shifts[:, None] * [1.0, -1.0]
    minima = {}
    for name, distance in (("exact", BOARD.signed_distance), ("blended", blended)):
        cost = distance(corner)[0] ** 2 + 0.8 * 2.0 * shifts**2  # 0.8: along the shift, of one
        minima[name] = np.sum((cost[1:-1] < cost[:-2]) & (cost[1:-1] < cost[2:]))
    assert minima == {"exact": 2, "blended": 1}
