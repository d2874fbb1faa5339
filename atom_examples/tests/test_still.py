"""Sensors look again when something moved, and only then; what they noise stays as it was seen."""

import cell_boards as boards
import numpy as np
import pytest

from atom_core.geometry import se3
from atom_examples.cell_simulator.scene import Person
from atom_examples.cell_simulator.still import WhileStill

HERE = se3.from_rpy(np.array([0.1, -0.4, 1.0]), np.array([-2.1, 0.2, 3.1]))
BESIDE = se3.from_rpy(np.array([0.15, -0.4, 1.0]), np.array([-2.1, 0.2, 3.1]))


@pytest.fixture
def scene(world):
    world.scene.place_person(boards.AWAY)
    world.scene.place_board(HERE)
    return world.scene


@pytest.fixture(params=["rgb_1", "depth_1", "lidar_1"])
def sensor(world, request):
    of_all = {**world.colours, **world.depths, **world.lidars}
    return of_all[request.param]


def points_of(seen):
    return getattr(seen, "points", seen)


def test_the_same_arrangement_is_looked_at_once():
    looks = []
    still = WhileStill()
    answers = [still.seen(standing, lambda: looks.append(1) or len(looks)) for standing in "aabba"]
    assert answers == [1, 1, 2, 2, 3]


def test_only_what_moves_makes_another_arrangement(scene):
    first = scene.arrangement
    scene.place_board(HERE.copy())
    scene.place_person(boards.AWAY)
    assert scene.arrangement is first
    scene.place_board(BESIDE)
    moved = scene.arrangement
    assert moved is not first
    scene.place_person(Person(boards.AWAY.x, boards.AWAY.y, boards.AWAY.heading + 0.1))
    assert scene.arrangement is not moved


def test_what_is_kept_is_what_would_be_seen_anew_and_noise_does_not_spoil_it(scene, sensor):
    exact = points_of(sensor.capture(scene)).copy()
    noisy = points_of(sensor.capture(scene, np.random.default_rng(1))).copy()
    np.testing.assert_array_equal(points_of(sensor.capture(scene)), exact)
    sensor._still = WhileStill()
    again = points_of(sensor.capture(scene, np.random.default_rng(1)))
    np.testing.assert_array_equal(again, noisy)


def test_what_a_caller_changes_is_not_kept(scene, sensor):
    seen = points_of(sensor.capture(scene))
    before = seen.copy()
    seen[:] = 0
    np.testing.assert_array_equal(points_of(sensor.capture(scene)), before)


def test_a_board_that_moved_is_seen_where_it_is(scene, sensor):
    before = points_of(sensor.capture(scene)).copy()
    scene.place_board(BESIDE)
    after = points_of(sensor.capture(scene))
    assert after.shape != before.shape or not np.array_equal(after, before, equal_nan=True)
