import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.model.pattern import pattern_from_config
from atom_core.synthetic.board import charuco
from atom_examples.cell_simulator.planner import Stop
from atom_examples.cell_simulator.scene import Person
from atom_examples.cell_simulator.trajectory import SPEED_M_S, TICK_S, Trajectory, ordered

PATTERN = pattern_from_config("pattern_1", charuco())
OUTLINE = np.column_stack([PATTERN.border.corners, np.zeros(4)])


def random_stops(count, seed=0):
    rng = np.random.default_rng(seed)
    stops = []
    for _ in range(count):
        pose = se3.transform(
            se3.random_rotation(rng.uniform(0, np.pi), rng), rng.uniform(-1, 1, 3) + [0, 0, 1]
        )
        middle = se3.apply(pose, np.append(PATTERN.border.centre, 0.0)[None])[0]
        angle = rng.uniform(0, 2 * np.pi)
        place = middle[:2] + 0.9 * np.array([np.cos(angle), np.sin(angle)])
        stops.append(Stop(pose, Person(*place, 0.0)))
    return stops


@pytest.mark.parametrize("seed", range(5))
def test_no_point_of_the_board_is_faster_than_half_a_metre_in_a_second(seed):
    path = Trajectory(random_stops(5, seed), 0.5, PATTERN)
    outlines = [se3.apply(path.state(tick).world_T_pattern, OUTLINE) for tick in range(path.ticks)]
    speeds = [np.linalg.norm(b - a, axis=1).max() / TICK_S for a, b in zip(outlines, outlines[1:])]
    assert 0.3 < max(speeds) <= SPEED_M_S + 1e-9


def test_the_board_stands_still_at_every_stop_for_its_time():
    stops = random_stops(4)
    path = Trajectory(stops, 1.5, PATTERN)
    for number, stop in enumerate(stops):
        first, after = path.interval(number)
        assert after - first == 15
        for tick in range(first, after):
            state = path.state(tick)
            assert (state.stop, state.tick_of_stop) == (number, tick - first)
            assert np.array_equal(state.world_T_pattern, stop.world_T_pattern)
    assert path.interval(3)[1] == path.ticks
    assert path.state(path.interval(0)[1]).stop is None


def test_the_person_never_walks_through_the_board():
    path = Trajectory(random_stops(8, 3), 0.2, PATTERN)
    middle = np.append(PATTERN.border.centre, 0.0)[None]
    for tick in range(path.ticks):
        state = path.state(tick)
        centre = se3.apply(state.world_T_pattern, middle)[0]
        away = np.hypot(state.person.x - centre[0], state.person.y - centre[1])
        assert away == pytest.approx(0.9, abs=1e-6)


def test_one_stop_is_a_recording_too():
    path = Trajectory(random_stops(1), 1.5, PATTERN)
    assert path.ticks == 15 and path.state(14).stop == 0


def test_two_equal_stops_need_no_way():
    stop = random_stops(1)[0]
    path = Trajectory([stop, stop], 0.3, PATTERN)
    assert path.ticks == 6 and path.state(3).stop == 1


def test_an_ordered_tour_is_shorter_and_has_the_same_stops():
    stops = random_stops(20)

    def length(tour):
        poses = [stop.world_T_pattern for stop in tour]
        return sum(PATTERN.border.way_m(a, b) for a, b in zip(poses, poses[1:]))

    tour = ordered(stops, lambda stop: stop.world_T_pattern, PATTERN)
    assert {id(stop) for stop in tour} == {id(stop) for stop in stops}
    assert length(tour) < 0.7 * length(stops)
    again = ordered(stops, lambda stop: stop.world_T_pattern, PATTERN)
    assert [id(stop) for stop in again] == [id(stop) for stop in tour]
