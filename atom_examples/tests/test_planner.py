import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.model.sensor import LIDAR3D, RGB
from atom_core.synthetic import depth, lidar
from atom_core.synthetic.cell import SCENARIOS
from atom_examples.cell_simulator.errors import SimulatorError
from atom_examples.cell_simulator.planner import is_open, plan_stops, sight
from atom_examples.cell_simulator.world import World


def detections(world, stop):
    """By sensor: how many corners a camera sees, whether a range sensor detects the board.

    Geometric, in the whole scene: what anything hides does not count.
    """
    scene, pattern = world.scene, world.scene.board.pattern
    scene.place_board(stop.world_T_pattern)
    scene.place_person(stop.person)
    found = {}
    for name, sensor in world.rig.sensors.items():
        line = sight(world, name, stop.world_T_pattern, pattern)
        seen = is_open(world, line)
        sensor_T_pattern = se3.inverse(scene.pose(sensor.frame)) @ stop.world_T_pattern
        if sensor.modality == RGB:
            found[name] = int(seen.sum())
        elif sensor.modality == LIDAR3D:
            model = world.rig.lidars[name]
            beams, _ = lidar.beams_on_board(model, sensor_T_pattern, pattern)
            found[name] = lidar.is_detected(model, beams[seen], sensor_T_pattern, pattern)
        else:
            detected = depth.is_detected(sensor.camera, sensor_T_pattern, pattern)
            found[name] = detected and seen.mean() > 0.9
    return found


def statistics(world, stops):
    """Numbers of partial detections by cameras and of complete collections, and per sensor."""
    corners = world.scene.board.pattern.corner_count
    least = int(np.ceil(0.25 * corners))
    partial = complete = 0
    by_sensor = dict.fromkeys(world.rig.sensors, 0)
    for stop in stops:
        found = detections(world, stop)
        cameras = {n: c for n, c in found.items() if n.startswith("rgb")}
        partial += sum(least <= count < corners for count in cameras.values())
        labeled = {n: (c >= least if n in cameras else bool(c)) for n, c in found.items()}
        complete += all(labeled.values())
        for name, is_labeled in labeled.items():
            by_sensor[name] += is_labeled
    return partial, complete, by_sensor


def assert_like_the_paper(world, scenario, plans):
    wanted = SCENARIOS[scenario]
    stops = plans(world, scenario, wanted.collections)
    partial, complete, by_sensor = statistics(world, stops)
    assert len(stops) == wanted.collections
    assert abs(partial - wanted.partial) <= max(1, 0.2 * wanted.partial)
    assert abs(complete - wanted.complete) <= max(1, 0.2 * wanted.complete)
    assert min(by_sensor.values()) >= 4, by_sensor


@pytest.mark.sampled(1)
@pytest.mark.parametrize("scenario", ["train", "test"])
def test_the_statistics_are_those_of_the_paper(world, scenario, plans):
    assert_like_the_paper(world, scenario, plans)


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_the_statistics_are_those_of_the_paper_for_other_seeds(seed):
    cell = World(seed)
    for scenario in ("train", "test"):
        assert_like_the_paper(cell, scenario, plan_stops)


@pytest.mark.slow
def test_plans_follow_from_seed_and_scenario(world, plans):
    first, again = plans(world, "train", 2), plan_stops(world, "train", 2)
    for a, b in zip(first, again):
        assert np.array_equal(a.world_T_pattern, b.world_T_pattern) and a.person == b.person
    other = plans(world, "test", 1)
    assert not np.array_equal(first[0].world_T_pattern, other[0].world_T_pattern)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("collections", [1, 40])
def test_any_number_of_stops_can_be_planned(world, collections, plans):
    assert len(plans(world, "train", collections)) == collections


def test_person_and_board_stand_in_the_room_and_pierce_nothing(world, plans):
    for stop in plans(world, "train", SCENARIOS["train"].collections):
        border = world.scene.board.pattern.border
        outline = np.column_stack([border.corners, np.zeros(4)])
        corners = se3.apply(stop.world_T_pattern, outline)
        assert corners[:, 2].min() > 0.0
        middle = corners.mean(axis=0)
        away = np.hypot(stop.person.x - middle[0], stop.person.y - middle[1])
        assert 0.75 < away < 1.1


@pytest.mark.long
@pytest.mark.slow
def test_a_seed_whose_camera_was_drawn_inside_a_beam_has_stops():
    cell = World(107)
    assert len(plan_stops(cell, "train", 3)) == 3
    cell.scene.close()


def test_less_than_one_stop_is_refused(world):
    with pytest.raises(SimulatorError, match="--collections is 0; give 1 or more"):
        plan_stops(world, "train", 0)
    with pytest.raises(SimulatorError, match="scenario 'trial' is unknown"):
        plan_stops(world, "trial", 3)
