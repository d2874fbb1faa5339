"""A rig is calibrated in parts: what only the other parts tell of stays where it is."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.preflight import preflight
from atom_core.model.config import EdgeConfig, JointConfig
from atom_core.model.joints import REVOLUTE, joint_from_pose
from atom_core.model.transforms import Edge
from atom_core.synthetic import scenes

POST = Edge("rig_base", "rgb_2_post")  # below it rgb_2 alone
OTHERS = ["rgb_1", "depth_1"]


@pytest.fixture(scope="module")
def rig():
    return scenes.random_scene(0, collections=6).dataset


def with_tf(dataset, edge=POST):
    tfs = {"post": EdgeConfig(parent_link=edge.parent, child_link=edge.child)}
    return replace(dataset, config=replace(dataset.config, additional_tfs=tfs))


def with_joint(dataset):
    joint = joint_from_pose(
        POST,
        REVOLUTE,
        np.array([0.0, 0.0, 1.0]),
        dataset.first_value(POST),
        dataset.first_value(POST),
    )
    joints = {"post": JointConfig(("position_bias",))}
    collections = {
        key: replace(collection, joints={"post": joint})
        for key, collection in dataset.collections.items()
    }
    return replace(dataset, collections=collections, config=replace(dataset.config, joints=joints))


@pytest.mark.parametrize("extended", [with_tf, with_joint])
def test_what_only_a_sensor_that_is_left_out_tells_of_is_held_and_named(rig, extended):
    part = rig.selected(sensors=OTHERS)
    plain, result = calibrate(part), calibrate(extended(part))
    assert result.status == plain.status == "converged"
    assert not result.free.additional_tfs and not result.free.joints
    (remark,) = set(result.warnings) - set(plain.warnings)
    assert remark == "'post' is not estimated: what hangs on it is left out (-ssf, -psf)"
    assert remark in preflight(extended(part)).warnings
    for sensor in part.sensors.values():
        pair = [r.dataset.first_value(sensor.edge) for r in (plain, result)]
        np.testing.assert_allclose(pair[0], pair[1], atol=1e-12)


def test_what_is_left_out_takes_along_nothing_that_others_hang_on(rig):
    part = with_tf(rig.selected(sensors=OTHERS), Edge("rig_base", "depth_1_post"))
    result = calibrate(part, CalibrationOptions(anchor_sensors=("depth_1",)))
    assert set(result.free.additional_tfs) == {"post"}
    assert not any("left out" in warning for warning in result.warnings)


def test_what_nothing_at_all_hangs_on_is_still_a_mistake_of_the_configuration(rig):
    stray = Edge("world", "gps")
    there = rig.with_transforms({key: {stray: np.eye(4)} for key in rig.collections})
    result = calibrate(with_tf(there.selected(sensors=OTHERS), stray))
    assert result.status == "rank_deficient"
    assert "no sensor and no board that was seen hangs on 'post'" in result.weak_directions[0].why
