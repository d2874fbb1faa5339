"""The signed distance to a rectangle, against dense samples of its border."""

import numpy as np
import pytest

from atom_core.geometry.rectangle import Rectangle

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
