"""Acceleration must find the same point, in fewer steps."""

import numpy as np
import pytest

from atom_core.solvers.anderson import AndersonAcceleration

FIXED = np.array([0.3, -0.1, 0.5])


def steps_until(change_at, accelerate):
    """Return how many changes are asked for until they are tiny, and where that is."""
    state, plain = AndersonAcceleration(np.zeros(3)), np.zeros(3)
    for step in range(500):
        value = state.value if accelerate else plain
        change = change_at(value)
        if np.max(np.abs(change)) < 1e-9:
            return step, value
        state.advance(change)
        plain = plain + change
    raise AssertionError("the fixed point is not found")


@pytest.mark.parametrize("parts", [(0.6, 0.1, 0.1), (-0.7, 0.1, -0.1), (0.9, 0.9, 0.9)])
def test_the_point_is_the_same_and_found_sooner(parts):
    def change_at(value):
        return (np.array(parts) - 1.0) * (value - FIXED)

    accelerated, found = steps_until(change_at, accelerate=True)
    plain, _ = steps_until(change_at, accelerate=False)
    np.testing.assert_allclose(found, FIXED, atol=1e-7)
    assert accelerated < plain


def test_a_change_that_overshoots_the_point_is_held_back():
    _, found = steps_until(lambda value: -1.8 * np.sin(value - FIXED), accelerate=True)
    np.testing.assert_allclose(found, FIXED, atol=1e-7)


def test_without_a_change_it_stays():
    state = AndersonAcceleration(FIXED)
    for _ in range(3):
        np.testing.assert_array_equal(state.advance(np.zeros(3)), FIXED)
