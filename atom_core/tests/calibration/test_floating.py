"""A rig, or a part of it, that nothing ties is held, whoever carries it about."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.preflight import preflight
from atom_core.errors import CalibrationError
from atom_core.geometry import se3
from atom_core.model.config import PriorConfig
from atom_core.model.dataset import board_edge
from atom_core.model.transforms import Edge
from atom_core.report.calibration_results import calibration_results
from atom_core.solvers.base import CONVERGED
from atom_core.solvers.choice import SOLVERS
from atom_core.synthetic import scenes
from atom_core.synthetic.driving import (
    ODOMETRY,
    arm_between_boards,
    vehicle_before_a_board,
    vehicle_with_its_board,
)

CARRIED = [
    {},
    {"board_parent": "world"},
    {"jitter": 1e-6},
    {"jitter": 1e-6, "board_parent": "world"},
]


def far_m(scene, result, edge):
    """How far an edge is from the truth."""
    return se3.pose_difference(scene.truth.edges[edge], result.dataset.first_value(edge))[0]


@pytest.mark.parametrize("options", CARRIED)
def test_a_rig_that_is_carried_as_a_whole_is_held_by_its_first_sensor(options):
    scene = vehicle_with_its_board(**options)
    checked = preflight(scene.dataset)
    assert checked.problems == () and checked.open_motion == ""
    assert any("sensor 'rgb_1' is held where it is" in w for w in checked.warnings)
    result = calibrate(scene.dataset)
    assert result.status == CONVERGED and result.weak_directions == ()
    assert any("sensor 'rgb_1' is held where it is" in w for w in result.warnings)
    assert far_m(scene, result, scene.dataset.sensors["rgb_2"].edge) < 2e-3


def test_a_rig_that_is_carried_and_has_an_anchor_needs_no_other():
    result = calibrate(vehicle_with_its_board(anchored="rgb_2").dataset)
    assert result.status == CONVERGED and result.free.anchored_sensors == ("rgb_2",)
    assert not any("is held where it is" in w for w in result.warnings)


def test_a_board_that_is_fixed_to_what_carries_the_rig_ties_nothing():
    scene = vehicle_with_its_board()
    first = next(iter(scene.dataset.collections))
    board = board_edge(scene.dataset.patterns["pattern_1"])
    assert board.parent == "base"
    patterns = {n: replace(p, fixed=True) for n, p in scene.dataset.patterns.items()}
    one = replace(
        scene.dataset,
        patterns=patterns,
        collections={first: scene.dataset.collections[first]},
    )
    assert calibrate(one).free.anchored_sensors == ("rgb_1",)
    with pytest.raises(CalibrationError, match="stands still, sees it in places up to"):
        calibrate(replace(scene.dataset, patterns=patterns))


@pytest.mark.parametrize("solver_name", sorted(SOLVERS))
@pytest.mark.parametrize("anchored", ["rgb_1", None])
def test_odometry_of_all_collections_and_a_fixed_board_are_held_by_the_first(anchored, solver_name):
    scene = vehicle_before_a_board(anchored=anchored, odometry=True, off=0.03)
    result = calibrate(scene.dataset, CalibrationOptions(solver_name=solver_name))
    assert result.status == CONVERGED and result.weak_directions == ()
    assert any("'odom' is held where the first collection has it" in w for w in result.warnings)
    assert result.free.anchored_sensors == ("rgb_1",)
    assert far_m(scene, result, scene.dataset.sensors["rgb_2"].edge) < 2e-3
    first, *others = scene.dataset.collections
    said, true = scene.dataset.collections, vehicle_before_a_board(anchored=anchored).dataset
    found = {key: result.dataset.collections[key].transforms[ODOMETRY] for key in said}
    assert np.array_equal(found[first], said[first].transforms[ODOMETRY])
    moved = said[first].transforms[ODOMETRY] @ se3.inverse(
        true.collections[first].transforms[ODOMETRY]
    )
    for key in others:
        exact = moved @ true.collections[key].transforms[ODOMETRY]
        assert se3.pose_difference(exact, found[key])[0] < 0.02
    assert calibration_results(result, "").edges


def test_odometry_that_is_known_to_so_much_needs_nothing_held():
    dataset = vehicle_before_a_board(odometry=True, off=0.03).dataset
    known = replace(dataset.config, priors={"odom": PriorConfig(0.03, 0.03)})
    result = calibrate(replace(dataset, config=known))
    assert result.status == CONVERGED and result.free.held_first == frozenset()


def test_motion_before_a_fixed_board_ties_the_rig():
    dataset = scenes.hand_eye(0, collections=6).dataset
    result = calibrate(dataset)
    assert result.free.anchored_sensors == () and result.free.held_first == frozenset()


def test_sensors_before_fixed_boards_of_their_own_are_tied_by_the_motion():
    scene = arm_between_boards()
    assert preflight(scene.dataset).problems == ()
    result = calibrate(scene.dataset)
    assert result.status == CONVERGED and result.free.anchored_sensors == ()
    for sensor in scene.dataset.sensors.values():
        assert far_m(scene, result, sensor.edge) < 2e-3


def test_one_of_them_may_be_anchored():
    dataset = arm_between_boards().dataset
    result = calibrate(dataset, CalibrationOptions(anchor_sensors=("rgb_2",)))
    assert result.status == CONVERGED


@pytest.mark.parametrize("anchored", [(), ("rgb_1",)])
def test_without_motion_they_are_not(anchored):
    dataset = arm_between_boards(moving=False).dataset
    with pytest.raises(CalibrationError, match=r"components \{rgb_1\}; \{rgb_2\}"):
        calibrate(dataset, CalibrationOptions(anchor_sensors=anchored))


def test_without_motion_before_one_of_the_boards_its_sensor_is_refused():
    dataset = arm_between_boards().dataset
    flange, rear = Edge("world", "flange"), dataset.patterns["rear"]
    on_flange = replace(rear, parent_frame=flange.child)
    collections = {}
    for key, c in dataset.collections.items():
        tfs = {e: T for e, T in c.transforms.items() if e != board_edge(rear)}
        collections[key] = replace(c, transforms=tfs)
    dataset = replace(
        dataset, patterns={**dataset.patterns, "rear": on_flange}, collections=collections
    )
    with pytest.raises(CalibrationError, match=r"components \{rgb_1\}; \{rgb_2\}"):
        calibrate(dataset)
