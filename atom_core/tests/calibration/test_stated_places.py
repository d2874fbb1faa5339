"""A sensor that is held, or has a prior, where it does not stand: never good, and named as a cause.

Something else gives way: its intrinsics, an error of its ranges, the sensors beside it.
"""

import re
from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.geometry import se3
from atom_core.report.calibration_results import calibration_results
from atom_core.report.calibration_verdict import calibration_verdict
from atom_core.report.verdict import GOOD, WEAK, WRONG
from atom_core.synthetic import mistakes, scenes
from atom_core.synthetic.driving import vehicle_before_a_board

OFF = se3.from_rpy(np.array([0.008, 0.0, 0.0]), np.radians([0.0, 0.3, 0.0]))
NEAR = (0.001, 0.001)  # how well a prior says that a place is known [m], [rad]


def off(dataset, truth, sensor, move=OFF):
    """Return the dataset with one sensor described elsewhere, and all others where they are."""
    changes = {}
    for name, entry in dataset.sensors.items():
        pose = truth.edges[entry.edge]
        changes[entry.edge] = pose @ move if name == sensor else pose
    return dataset.with_transforms(dict.fromkeys(dataset.collections, changes))


def answered(dataset, **options):
    calibration = calibrate(dataset, CalibrationOptions(**options))
    return calibration, calibration_verdict(calibration_results(calibration, "any"))


@pytest.fixture(scope="module")
def hand():
    scene = scenes.hand_eye(3, collections=16)
    return off(scene.dataset, scene.truth, "rgb_1")


@pytest.fixture(scope="module")
def rig():
    scene = scenes.random_scene(2, rgb=2, depth=0, lidar3d=1, collections=10)
    dataset = scene.dataset
    return replace(dataset, config=replace(dataset.config, anchored_sensor="rgb_1")), scene.truth


def test_a_camera_that_is_held_on_an_arm_is_named_as_a_cause(hand):
    calibration, verdict = answered(hand, anchor_sensors=("rgb_1",))
    assert verdict.grade == WRONG
    assert "rgb_1 is held where the description has it" in calibration.message
    assert "leave it out of -as" in calibration.message  # -ias does not release what -as holds
    free, verdict = answered(hand)
    assert verdict.grade == GOOD and not free.stated.names


def test_intrinsics_that_make_up_for_it_are_not_good(hand):
    _, verdict = answered(hand, anchor_sensors=("rgb_1",), model_errors="auto")
    assert verdict.sensors["rgb_1"].grade == verdict.grade == WEAK
    assert "it is held where the description has it" in verdict.sensors["rgb_1"].sentence
    assert "release it" in verdict.sensors["rgb_1"].advice


def test_whoever_is_held_for_the_others_to_be_related_to_is_not(rig):
    dataset, truth = rig
    calibration, verdict = answered(off(dataset, truth, "rgb_1"), intrinsics=("rgb_1",))
    assert calibration.stated.names == () and verdict.sensors["rgb_1"].grade == GOOD


def test_two_that_are_held_are_named_where_they_contradict_each_other(rig):
    dataset, truth = rig
    far = se3.from_rpy(np.array([0.03, 0.0, 0.0]), np.zeros(3))
    dataset = off(dataset, truth, "rgb_2", far)
    calibration, verdict = answered(dataset, anchor_sensors=("rgb_2",))
    assert verdict.grade == WRONG and set(calibration.stated.held) == {"rgb_1", "rgb_2"}
    assert "are held where the description has them" in calibration.message
    assert "hold one of them alone" in calibration.message


def test_a_range_offset_that_makes_up_for_a_wrong_prior_is_not_good(rig):
    dataset, truth = rig
    far = se3.from_rpy(np.array([0.015, 0.0, 0.0]), np.zeros(3))
    dataset = off(dataset, truth, "lidar_1", far)
    options = {"priors": {"lidar_1": NEAR}, "range_offset": ("lidar_1",)}
    calibration, verdict = answered(dataset, **options)
    assert calibration.stated.with_prior == ("lidar_1",)
    assert verdict.sensors["lidar_1"].grade != GOOD
    assert "its prior" in verdict.sensors["lidar_1"].sentence
    _, verdict = answered(off(dataset, truth, ""), priors={"lidar_1": NEAR})
    assert verdict.sensors["lidar_1"].grade == GOOD


@pytest.fixture(scope="module")
def vehicle():
    return vehicle_before_a_board(0, anchored="rgb_1")


def turned(dataset, truth, degrees):
    return off(dataset, truth, "rgb_1", se3.from_rpy(np.zeros(3), np.radians([0.0, degrees, 0.0])))


@pytest.mark.parametrize("degrees", [0.5, 2.0])
def test_who_is_held_elsewhere_is_named_first_with_how_far(vehicle, degrees):
    """Its image centre, and motions of the vehicle, were named instead."""
    calibration, verdict = answered(turned(vehicle.dataset, vehicle.truth, degrees))
    assert verdict.grade == WRONG
    assert calibration.message.startswith("rgb_1 is held where the description has it")
    assert f"and {degrees:.2g} deg from there: as some direction is open" in calibration.message
    free, _ = answered(vehicle.dataset, ignore_anchored_sensor=True)
    assert free.status == "rank_deficient"  # it drives on a floor: heights are open
    assert {check.error.target for check in calibration.checks} <= {"rgb_1"}
    assert calibration.contradictions[0] in calibration.message
    assert len(calibration.contradictions) > 1


def test_who_is_held_on_an_arm_is_named_first(hand):
    calibration, _ = answered(hand, anchor_sensors=("rgb_1",))
    assert calibration.message.startswith("rgb_1 is held where the description has it")
    assert re.search(r", (7\.9|8)\d* mm and 0\.3 deg from there: release it", calibration.message)


def test_what_is_wrong_elsewhere_is_not_blamed_on_who_is_held(vehicle):
    wrong = {
        "rgb_2": mistakes.with_scaled_focal_length(vehicle.dataset, "rgb_2", 1.01),
        "pattern_1": mistakes.with_scaled_boards(vehicle.dataset, 1.03),
        "rgb_1": mistakes.with_shifted_centre(vehicle.dataset, "rgb_1", 10.0),
    }
    for name, dataset in wrong.items():
        calibration, _ = answered(dataset)
        assert name in calibration.message.partition(";")[0], calibration.message
        assert not calibration.message.startswith("rgb_1 is held"), name
