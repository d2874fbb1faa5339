"""A description that is not the robot of the data, where the answer is written into it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.description import description_caveats
from atom_core.calibration.prepare.preparation import free_edges
from atom_core.geometry import se3
from atom_core.model.config import EdgeConfig
from atom_core.model.robot import FIXED, Joint, RobotDescription
from atom_core.model.transforms import Edge
from atom_core.synthetic import arm, scenes

ELBOW = {"elbow": {"position_bias": 0.02}}
BASE = Edge("world", "arm_base")


@pytest.fixture(scope="module")
def on_arm():
    """Return a camera on an arm, whose configuration has the elbow estimated."""
    return arm.camera_on_arm(0, errors=ELBOW, collections=6).dataset


def robot_of(dataset):
    """Return the robot of which a dataset's transforms tell, its joints as described."""
    first = next(iter(dataset.collections.values()))
    moving = {state.edge: (name, state) for name, state in first.joints.items()}
    joints = {}
    for edge, pose in first.transforms.items():
        name, kind, axis = f"{edge.child}_joint", FIXED, np.array([1.0, 0.0, 0.0])
        if edge in moving:
            name, state = moving[edge]
            kind, axis, pose = state.type, state.axis, state.origin
        joints[name] = Joint(name, kind, edge.parent, edge.child, pose, axis)
    links = tuple(dict.fromkeys(frame for edge in first.transforms for frame in edge))
    return RobotDescription("robot", "world", links, joints)


def contradicted(dataset, robot, **options):
    """Return what is said of a description, and of which sensors."""
    free = free_edges(dataset, CalibrationOptions(**options))
    found = description_caveats(dataset, free, robot, Path("robot.urdf"))
    return {(caveat.what.split("'")[1], caveat.sensors) for caveat in found}


def shifted(robot, name, metres):
    joint = robot.joints[name]
    pose = se3.transform(np.eye(3), np.array([metres, 0.0, 0.0])) @ joint.parent_T_child_at_zero
    moved = replace(joint, parent_T_child_at_zero=pose)
    return replace(robot, joints={**robot.joints, name: moved})


def test_a_joint_that_an_earlier_calibration_corrected_is_not_where_the_description_has_it(on_arm):
    robot = robot_of(on_arm)
    corrected = on_arm.with_joint_parameters({"elbow": {"position_bias": 0.03}})
    held = {"joints": {"wrist_2": ("position_bias",)}}
    assert contradicted(corrected, robot, **held) == {("boom-forearm", ("rgb_1",))}
    assert contradicted(corrected, robot, joints={}) == {("boom-forearm", ("rgb_1",))}
    assert contradicted(corrected, robot) == set()  # the elbow is estimated, and written
    assert contradicted(on_arm, robot, **held) == set()


def test_a_joint_whose_description_turns_about_another_axis_is_named(on_arm):
    robot = robot_of(on_arm)
    other = replace(robot.joints["wrist_2"], axis=np.array([0.0, 0.0, -1.0]))
    robot = replace(robot, joints={**robot.joints, "wrist_2": other})
    assert contradicted(on_arm, robot) == {("wrist_1_link-wrist_2_link", ("rgb_1",))}


def test_a_joint_that_the_driver_has_elsewhere_than_the_description_is_named(on_arm):
    """As where an arm's driver publishes the kinematics of its factory calibration."""
    robot, edge = robot_of(on_arm), Edge("boom", "forearm")
    own = se3.from_rpy(np.array([0.0, 0.002, 0.0]), np.zeros(3))
    changes = {key: {edge: c.transforms[edge] @ own} for key, c in on_arm.collections.items()}
    found = contradicted(on_arm.with_transforms(changes), robot, joints={})
    assert found == {(str(edge), ("rgb_1",))}


def test_a_position_that_came_late_in_one_collection_is_no_other_description(on_arm):
    robot, (key, *_) = robot_of(on_arm), on_arm.collections
    collection = on_arm.collections[key]
    late = replace(collection.joints["elbow"], position=collection.joints["elbow"].position + 0.1)
    shown = replace(collection, joints={**collection.joints, "elbow": late})
    dataset = replace(on_arm, collections={**on_arm.collections, key: shown})
    assert contradicted(dataset, robot, joints={}) == set()


def test_what_carries_the_board_is_compared_for_those_who_see_it():
    dataset = arm.board_on_arm(0, errors=ELBOW, collections=6).dataset
    robot = robot_of(dataset)
    assert contradicted(dataset, robot) == set()
    assert contradicted(dataset, shifted(robot, "arm_base_joint", 0.2)) == {(str(BASE), ("rgb_1",))}


def test_an_additional_tf_is_compared_where_it_is_not_estimated():
    dataset = scenes.random_scene(0, collections=4).dataset
    post = Edge("rig_base", "rgb_2_post")
    tfs = {"post": EdgeConfig(parent_link=post.parent, child_link=post.child)}
    dataset = replace(dataset, config=replace(dataset.config, additional_tfs=tfs))
    robot = shifted(robot_of(dataset), "rgb_2_post_joint", 0.05)
    assert contradicted(dataset, robot) == set()
    assert contradicted(dataset, robot, additional_tfs=()) == {(str(post), ("rgb_2",))}


def test_the_mount_of_another_sensor_is_compared_where_that_is_not_used():
    dataset = scenes.random_scene(0, collections=4).dataset
    below = Edge("rgb_1_link", "lens")
    sensor = replace(dataset.sensors["depth_1"], edge=below, frame="lens")
    transforms = {key: {below: np.eye(4)} for key in dataset.collections}
    dataset = replace(
        dataset.with_transforms(transforms), sensors={**dataset.sensors, "depth_1": sensor}
    )
    robot = shifted(
        robot_of(scenes.random_scene(0, collections=4).dataset), "rgb_1_link_joint", 0.1
    )
    alone = dataset.selected(sensors=["depth_1"])
    mount = dataset.sensors["rgb_1"].edge
    assert contradicted(dataset, robot) == set()
    assert contradicted(alone, robot) == {(str(mount), ("depth_1",))}


def test_an_edge_that_is_several_joints_of_the_description_is_compared_with_all_of_them(on_arm):
    """As of a RealSense: camera_link, 15 mm beside it the colour frame, turned the optical one."""
    robot, sensor = robot_of(on_arm), on_arm.sensors["rgb_1"]
    whole = robot.joints[f"{sensor.frame}_joint"]
    beside = se3.transform(np.eye(3), np.array([0.0, 0.015, 0.0]))
    for first, different in ((np.eye(4), False), (beside, True)):
        one = replace(whole, name="one", child_link="colour_frame", parent_T_child_at_zero=first)
        other = replace(whole, parent_link="colour_frame")
        joints = {**robot.joints, one.name: one, other.name: other}
        two = replace(robot, links=(*robot.links, "colour_frame"), joints=joints)
        edge = str(whole.edge)
        assert contradicted(on_arm, two) == ({(edge, ("rgb_1",))} if different else set())
