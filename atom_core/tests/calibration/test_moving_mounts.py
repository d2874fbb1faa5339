"""A sensor's edge has one pose in all collections; one that a joint moves is refused by name."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.preflight import preflight
from atom_core.errors import CalibrationError
from atom_core.geometry import se3
from atom_core.model.joints import JointState
from atom_core.solvers.base import CONVERGED
from atom_core.synthetic import scenes
from atom_core.synthetic.driving import ODOMETRY, vehicle_before_a_board


def on_a_moving_edge():
    dataset = vehicle_before_a_board(anchored=None).dataset
    sensors = {**dataset.sensors, "rgb_1": replace(dataset.sensors["rgb_1"], edge=ODOMETRY)}
    return replace(dataset, sensors=sensors)


def panned(dataset, name, positions, joint=None):
    """Return a dataset in which a sensor's edge is turned in each collection by so much [rad]."""
    edge, collections = dataset.sensors[name].edge, {}
    axis = np.array([0.0, 0.0, 1.0])
    for (key, c), position in zip(dataset.collections.items(), positions):
        turn = se3.transform(se3.rotation_from_rotation_vector(axis * position), np.zeros(3))
        states = {joint: JointState(edge, "revolute", axis, position)} if joint else {}
        collections[key] = replace(
            c,
            transforms={**c.transforms, edge: c.transforms[edge] @ turn},
            joints={**c.joints, **states},
        )
    return replace(dataset, collections=collections)


@pytest.fixture(scope="module")
def still():
    return scenes.two_cameras(0, collections=6).dataset


def test_an_edge_that_moves_all_the_time_is_refused_before_solving():
    dataset = on_a_moving_edge()
    says = r"'rgb_1': edge 'world-base', .* moves by [\d.]+ mm and .* 11 times in 12 of them; let"
    with pytest.raises(CalibrationError, match=says):
        calibrate(dataset)
    (problem,) = preflight(dataset).problems
    assert "edge 'world-base', of which one pose is estimated, moves" in problem


def test_one_that_is_held_may_move():
    dataset = on_a_moving_edge()
    result = calibrate(dataset, CalibrationOptions(anchor_sensors=("rgb_1",)))
    assert result.status == CONVERGED


def test_one_that_moves_with_a_joint_is_refused_however_seldom(still):
    dataset = panned(still, "rgb_2", [0.0, 0.0, 0.0, 0.05, 0.05, 0.05], joint="pan")
    with pytest.raises(CalibrationError, match="'rgb_2': .* 2.86 deg .* as joint 'pan' does; let"):
        calibrate(dataset)


def test_one_of_a_joint_s_type_moves(still):
    edge = still.sensors["rgb_2"].edge
    dataset = panned(still, "rgb_2", [0.0, 0.0, 0.0, 0.05, 0.05, 0.05])
    dataset = replace(dataset, edge_types={**dataset.edge_types, edge: "revolute"})
    with pytest.raises(CalibrationError, match="'rgb_2': .* as a revolute joint does; let"):
        calibrate(dataset)


@pytest.mark.parametrize("joint", [None, "pan"])
def test_a_guess_that_was_improved_between_collections_is_remarked(still, joint):
    dataset = panned(still, "rgb_2", [0.0, 0.0, 0.0, 0.05, 0.05, 0.05])
    if joint:  # beside a joint that stood where it was
        edge, axis = still.sensors["rgb_2"].edge, np.array([0.0, 0.0, 1.0])
        state = JointState(edge, "revolute", axis, 0.3)
        collections = {
            key: replace(c, joints={joint: state}) for key, c in dataset.collections.items()
        }
        dataset = replace(dataset, collections=collections)
    result = calibrate(dataset)
    assert result.status == CONVERGED
    (remark,) = [w for w in result.warnings if "one pose" in w]
    assert "2.86 deg apart), as where the first guess was improved between them" in remark
    assert remark in preflight(dataset).warnings


def test_an_edge_that_is_the_same_is_not_remarked(still):
    dataset = panned(still, "rgb_2", np.linspace(0.0, 1e-4, 6))
    assert not any("one pose" in w for w in calibrate(dataset).warnings)
