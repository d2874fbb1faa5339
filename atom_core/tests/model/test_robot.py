"""Joints move as URDF says, and a robot is a tree or an error."""

import numpy as np
import pytest

from atom_core.errors import DescriptionError
from atom_core.geometry import se3
from atom_core.model.robot import Joint, JointMimic, RobotDescription
from atom_core.model.transforms import Edge


def rotation_x(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def rotation_y(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def rotation_z(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def homogeneous(rotation, translation):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    return matrix


ORIGIN = homogeneous(rotation_z(0.7) @ rotation_x(-1.1), [0.3, -0.2, 1.5])


def joint(name="j", kind="fixed", parent="a", child="b", origin=ORIGIN, **more):
    return Joint(name, kind, parent, child, origin, **more)


def robot(*joints, root="a", links=None):
    links = links or sorted({link for item in joints for link in item.edge})
    return RobotDescription("rig", root, tuple(links), {item.name: item for item in joints})


@pytest.mark.parametrize("kind", ["fixed", "revolute", "continuous", "prismatic"])
def test_position_zero_is_the_origin(kind):
    np.testing.assert_array_equal(joint(kind=kind).parent_T_child(0.0), ORIGIN)


def test_fixed_joints_do_not_move():
    np.testing.assert_array_equal(joint().parent_T_child(0.4), ORIGIN)


@pytest.mark.parametrize("kind", ["revolute", "continuous"])
def test_rotation_follows_the_origin(kind):
    moved = joint(kind=kind, axis=[0, 0, 1]).parent_T_child(0.4)
    np.testing.assert_allclose(moved, ORIGIN @ homogeneous(rotation_z(0.4), [0, 0, 0]), atol=1e-15)


def test_rotation_about_a_negative_axis_turns_back():
    back = joint(kind="revolute", axis=[0, -1, 0]).parent_T_child(0.4)
    np.testing.assert_allclose(back, ORIGIN @ homogeneous(rotation_y(-0.4), [0, 0, 0]), atol=1e-15)


def test_rotation_about_an_oblique_axis_leaves_the_axis_in_place():
    axis = np.array([1.0, -2.0, 0.5])
    origin_T_moved = se3.inverse(ORIGIN) @ joint(kind="revolute", axis=axis).parent_T_child(1.3)
    np.testing.assert_allclose(origin_T_moved[:3, :3] @ axis, axis, atol=1e-14)
    np.testing.assert_allclose(np.trace(origin_T_moved[:3, :3]), 1 + 2 * np.cos(1.3), atol=1e-14)


@pytest.mark.parametrize("axis", [[1, 0, 0], [0, -1, 0], [1, 2, -2], [0, 0, 5]])
def test_prismatic_moves_along_any_axis_by_metres(axis):
    moved = joint(kind="prismatic", axis=axis).parent_T_child(0.6)
    direction = np.array(axis) / np.linalg.norm(axis)
    np.testing.assert_allclose(moved, ORIGIN @ homogeneous(np.eye(3), 0.6 * direction), atol=1e-15)


@pytest.mark.parametrize("kind", ["planar", "floating"])
def test_joints_without_one_position_say_so(kind):
    with pytest.raises(DescriptionError, match=f"joint 'j' is {kind}.*from tf"):
        joint(kind=kind).parent_T_child(0.0)


def test_a_joint_cannot_be_changed_behind_its_back():
    origin = ORIGIN.copy()
    item = joint(origin=origin)
    origin[0, 3] = 99.0
    np.testing.assert_array_equal(item.parent_T_child(), ORIGIN)
    with pytest.raises(ValueError):
        item.parent_T_child_at_zero[0, 3] = 99.0


@pytest.mark.parametrize(
    "wrong, message",
    [
        ({"kind": "welded"}, "type 'welded' is unknown"),
        ({"child": "a"}, "link 'a' is its own parent"),
        ({"origin": np.eye(3)}, "no rigid transform"),
        ({"origin": np.diag([1.0, 1.0, -1.0, 1.0])}, "no rigid transform"),
        ({"origin": np.diag([2.0, 2.0, 2.0, 1.0])}, "no rigid transform"),
        ({"origin": np.full((4, 4), np.nan)}, "no rigid transform"),
        ({"kind": "revolute", "axis": [0, 0, 0]}, "axis of a revolute joint"),
        ({"kind": "prismatic", "axis": [1, 0]}, "axis of a prismatic joint"),
        ({"kind": "continuous", "axis": [1, np.inf, 0]}, "axis of a continuous joint"),
    ],
)
def test_a_malformed_joint_is_refused(wrong, message):
    with pytest.raises(DescriptionError, match=message):
        joint(**wrong)


def test_joints_are_found_by_their_links():
    rig = robot(joint("j", child="b"), joint("k", parent="b", child="c"))
    assert rig.joint_between("b", "c").name == "k"
    assert rig.joint_between("a", "c") is None
    assert rig.joint_between("c", "b") is None
    assert rig.joint_above("a") is None
    assert rig.joint_above("c").name == "k"
    assert rig.joint_above("nowhere") is None


def test_transforms_take_positions_by_name_and_zero_otherwise():
    rig = robot(
        joint("j", "revolute", "a", "b", axis=[0, 0, 1]),
        joint("k", "prismatic", "b", "c", axis=[1, 0, 0]),
        joint("m", "floating", "c", "d"),
    )
    transforms = rig.transforms({"j": 0.5})
    assert set(transforms) == {Edge("a", "b"), Edge("b", "c")}
    np.testing.assert_array_equal(transforms["a", "b"], rig.joints["j"].parent_T_child(0.5))
    np.testing.assert_array_equal(transforms["b", "c"], ORIGIN)


def test_mimicking_joints_follow_through_a_chain():
    rig = robot(
        joint("j", "revolute", "a", "b"),
        joint("k", "revolute", "a", "c", mimic=JointMimic("j", -2.0, 0.25)),
        joint("m", "revolute", "a", "d", mimic=JointMimic("k", 3.0, 1.0)),
    )
    transforms = rig.transforms({"j": 0.5})
    np.testing.assert_allclose(
        transforms["a", "d"], rig.joints["m"].parent_T_child(3.0 * (-2.0 * 0.5 + 0.25) + 1.0)
    )
    np.testing.assert_allclose(
        rig.transforms({"j": 0.5, "k": 0.1})["a", "c"], rig.joints["k"].parent_T_child(0.1)
    )


def test_mimicking_in_a_circle_is_an_error():
    rig = robot(
        joint("j", "revolute", "a", "b", mimic=JointMimic("k")),
        joint("k", "revolute", "a", "c", mimic=JointMimic("j")),
    )
    with pytest.raises(DescriptionError, match="mimics"):
        rig.transforms()
    with pytest.raises(DescriptionError, match="joint 'j' mimics 'gone'"):
        robot(joint("j", "revolute", mimic=JointMimic("gone"))).transforms()


def test_one_link_without_joints_is_a_robot():
    assert robot(links=["a"]).transforms() == {}


def test_what_is_no_tree_is_refused():
    with pytest.raises(DescriptionError, match="link 'c' is the child of two joints, 'j' and 'k'"):
        robot(joint("j", child="c"), joint("k", parent="b", child="c"), joint("m", child="b"))
    with pytest.raises(DescriptionError, match="no chain of joints .* 'a' to 'b', 'c'"):
        robot(joint("j", parent="b", child="c"), joint("k", parent="c", child="b"), links="abc")
    with pytest.raises(DescriptionError, match="no chain of joints"):
        robot(joint("j", parent="a", child="b"), joint("k", parent="b", child="a"))


def test_unknown_and_doubled_names_are_refused():
    with pytest.raises(DescriptionError, match="joint 'j': link 'b' does not exist"):
        robot(joint("j"), links=["a"])
    with pytest.raises(DescriptionError, match="root link 'z' is no link"):
        robot(joint("j"), root="z")
    with pytest.raises(DescriptionError, match="two links have the same name"):
        robot(joint("j"), links=["a", "b", "b"])
    with pytest.raises(DescriptionError, match="joint 'j' stands under the name 'k'"):
        RobotDescription("rig", "a", ("a", "b"), {"k": joint("j")})
