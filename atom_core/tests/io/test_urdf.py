"""Descriptions, read as ROS reads them."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))  # descriptions, which the tests share

from descriptions import (  # noqa: E402
    CAMERA,
    MACROS,
    PLAIN,
    XMLNS,
    describe,
    joint,
    link,
    origin_of,
    rig,
    rotation,
)

from atom_core.errors import DescriptionError  # noqa: E402
from atom_core.io import xacro_text  # noqa: E402
from atom_core.io.urdf import parse_urdf, read_description  # noqa: E402

# ------------------------------------------------------------------------------------ reading


def test_reads_links_joints_and_texts(tmp_path):
    description = describe(tmp_path, PLAIN)
    robot = description.robot
    assert (robot.name, robot.root_link) == ("rig", "base")
    assert set(robot.links) == {"base", "camera", "arm", "lidar"}
    assert robot.joints["base_to_arm"].type == "revolute"
    assert robot.joints["base_to_arm"].limits.lower == -1.0
    np.testing.assert_array_equal(robot.joints["base_to_arm"].axis, [0, 0, 1])
    np.testing.assert_array_equal(origin_of(description, CAMERA)[:3, 3], [0.1, 0.2, 0.3])
    assert description.text == description.urdf == PLAIN
    assert not description.is_xacro


def test_tags_too_deep_for_a_parser_and_devices_are_refused(tmp_path):
    deep = tmp_path / "deep.urdf"
    deep.write_text("<a>" * 100_000 + "</a>" * 100_000)
    with pytest.raises(DescriptionError, match="more than 250 tags within one another"):
        read_description(deep)
    with pytest.raises(DescriptionError, match="no file but a device"):
        read_description("/dev/zero")


def test_what_urdfdom_reads_and_no_xml_parser_does_is_refused_before_it_is_needed(tmp_path):
    path = tmp_path / "rig.urdf"
    path.write_text(PLAIN.replace("</robot>", "R & D</robot>"))
    with pytest.raises(DescriptionError, match="not well-formed XML.*mend the file"):
        read_description(path)


def test_rpy_is_about_fixed_axes():
    roll, pitch, yaw = 0.3, -1.1, 2.0
    text = joint("j", "a", "b", f'<origin rpy="{roll} {pitch} {yaw}"/>')
    origin = parse_urdf(rig(link("a", "b") + text))[0].joints["j"].parent_T_child()
    expected = rotation("z", yaw) @ rotation("y", pitch) @ rotation("x", roll)
    np.testing.assert_allclose(origin[:3, :3], expected, atol=1e-14)


def test_a_prismatic_joint_with_an_oblique_axis_moves_along_it():
    content = (
        '<origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/><axis xyz="0 -3 4"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
    )
    text = rig(link("a", "b") + joint("j", "a", "b", content, "prismatic"))
    moved = parse_urdf(text)[0].joints["j"].parent_T_child(0.5)
    np.testing.assert_allclose(moved[:3, 3], [1 + 0.3, 2, 3 + 0.4], atol=1e-15)
    np.testing.assert_allclose(moved[:3, :3], rotation("z", np.pi / 2), atol=1e-15)


def test_mimic_and_remarks_are_kept():
    content = '<limit effort="1" velocity="1"/><mimic joint="k" multiplier="2" offset="0.5"/>'
    text = rig(
        '<link name="a"><visual><geometry><box size="1 1"/></geometry></visual></link>'
        + link("b", "c")
        + joint("j", "a", "b", content, "continuous")
        + joint("k", "b", "c", "", "continuous")
    )
    robot, remarks = parse_urdf(text)
    assert robot.joints["j"].mimic.joint == "k"
    assert robot.joints["j"].mimic.multiplier == 2.0
    assert any("visual" in remark for remark in remarks)


BROKEN = {
    "empty": ("", "document empty"),
    "not XML": ("hello", "not well-formed XML: syntax error: line 1"),
    "cut off": ("<robot name='r'>\n<link name='a'>\n<joint", "line 3"),
    "another document": ("<sdf/>", "Could not find the 'robot' element"),
    "no links": (rig(""), "No link elements found"),
    "missing link": (rig(link("a") + joint("j", "a", "b")), "child link .b. of joint .j."),
    "two roots": (rig(link("a", "b")), "Two root links found: .a. and .b."),
    "all in a circle": (
        rig(link("a", "b") + joint("j", "a", "b") + joint("k", "b", "a")),
        "No root link found",
    ),
    "a circle beside the tree": (
        rig(link("a", "b", "c") + joint("j", "a", "b") + joint("k", "b", "a")),
        "no chain of joints leads from the root link 'c' to 'a', 'b'",
    ),
    "two parents": (
        rig(
            link("a", "b", "c") + joint("j", "a", "c") + joint("k", "b", "c") + joint("m", "a", "b")
        ),
        "link 'c' is the child of two joints, 'j' and 'k'",
    ),
    "bad number": (
        rig(link("a", "b") + joint("j", "a", "b", '<origin xyz="1 2 3,5"/>')),
        "Unable to parse component .3,5. to a double.*joint .j.",
    ),
    "too few numbers": (
        rig(link("a", "b") + joint("j", "a", "b", '<origin rpy="1 2"/>')),
        "2 elements but 3 expected",
    ),
    "not a number": (
        rig(link("a", "b") + joint("j", "a", "b", '<origin xyz="nan 0 0"/>')),
        "Unable to parse component .nan.",
    ),
    "two joints of one name": (
        rig(link("a", "b", "c") + joint("j", "a", "b") + joint("j", "b", "c")),
        "joint 'j' is not unique",
    ),
    "unknown type": (rig(link("a", "b") + joint("j", "a", "b", "", "welded")), "no known type"),
    "no axis": (
        rig(link("a", "b") + joint("j", "a", "b", '<axis xyz="0 0 0"/>', "continuous")),
        "axis of a continuous joint",
    ),
}


@pytest.mark.parametrize("flaw", BROKEN)
def test_a_broken_urdf_gives_one_clear_line(tmp_path, flaw):
    text, message = BROKEN[flaw]
    with pytest.raises(DescriptionError, match=message) as error:
        describe(tmp_path, text)
    line = str(error.value)
    assert "\n" not in line
    assert line.startswith(str(tmp_path / "rig.urdf"))
    assert "mend the file" in line


def test_nothing_is_printed_when_a_urdf_is_refused(tmp_path, capfd):
    with pytest.raises(DescriptionError):
        describe(tmp_path, rig(""))
    assert capfd.readouterr() == ("", "")


def test_an_absent_file_and_a_folder_are_named(tmp_path):
    with pytest.raises(DescriptionError, match="gone.urdf: there is no such robot description"):
        read_description(tmp_path / "gone.urdf")
    with pytest.raises(DescriptionError, match="cannot be read"):
        read_description(tmp_path)
    (tmp_path / "latin.urdf").write_bytes(b"<robot name='\xe9'/>")
    with pytest.raises(DescriptionError, match="not UTF-8"):
        read_description(tmp_path / "latin.urdf")


def test_a_package_url_is_resolved(tmp_path):
    describe(tmp_path, PLAIN)
    description = read_description("package://rig/rig.urdf", {"rig": tmp_path}.__getitem__)
    assert description.path == tmp_path / "rig.urdf"
    with pytest.raises(DescriptionError, match="package 'gone' is not found"):
        read_description("package://gone/rig.urdf", {}.__getitem__)


# -------------------------------------------------------------------------------- reading xacro


def test_xacro_is_expanded(tmp_path):
    description = describe(tmp_path, MACROS, "rig.urdf.xacro")
    assert description.is_xacro
    assert description.text == MACROS
    assert "xacro:macro" not in description.urdf
    np.testing.assert_array_equal(origin_of(description, ("base", "left"))[:3, 3], [0, 0, 0.3])
    rotation_of_lidar = origin_of(description, ("base", "lidar"))[:3, :3]
    np.testing.assert_allclose(rotation_of_lidar, rotation("z", np.pi / 2), atol=1e-15)


@pytest.mark.parametrize(
    "expression, limit, message",
    [
        ("9**9**9", ("LONGEST_S", 0.5), "has not expanded this file within"),
        ("len(' ' * 10**11)", ("MOST_BYTES", 1 << 28), "wants more than .* of memory"),
    ],
)
def test_a_xacro_without_end_is_ended(tmp_path, monkeypatch, expression, limit, message):
    monkeypatch.setattr(xacro_text, *limit)
    text = f'<robot name="rig" {XMLNS}><link name="a${{{expression}}}"/></robot>'
    with pytest.raises(DescriptionError, match=rf"rig\.xacro: xacro {message}.*does not end"):
        describe(tmp_path, text, "rig.xacro")


def test_a_flat_file_called_xacro_needs_no_xacro(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)
    (tmp_path / "flat.urdf.xacro").write_text(PLAIN)
    assert not read_description(tmp_path / "flat.urdf.xacro").is_xacro


def test_what_xacro_made_is_a_plain_urdf_whatever_its_comments_hold(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)
    named = PLAIN.replace('<robot name="rig">', f'<robot name="rig" {XMLNS}>')
    comment = "<!-- <xacro:camera parent='${base}'/> made\n the links <!-- below -->"
    description = describe(tmp_path, named.replace("<link", f"{comment}<link", 1))
    assert not description.is_xacro and description.urdf == description.text
    used = named.replace("<link", f"{comment}<xacro:camera/><link", 1)
    with pytest.raises(DescriptionError, match="xacro is absent"):
        describe(tmp_path, used)


def test_the_absence_of_xacro_is_said_with_the_remedy(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)
    (tmp_path / "rig.urdf.xacro").write_text(MACROS)
    with pytest.raises(DescriptionError, match="xacro is absent; install it .*xacro==2.1.1"):
        read_description(tmp_path / "rig.urdf.xacro")


def test_packages_are_found_by_the_resolver_also_in_included_files(tmp_path):
    package = tmp_path / "package"
    package.mkdir()
    (package / "inner.xacro").write_text(rig(link("camera")))
    (package / "outer.xacro").write_text(
        f'<robot {XMLNS}><xacro:include filename="$(find parts)/inner.xacro"/></robot>'
    )
    text = (
        f'<robot name="rig" {XMLNS}>{link("base")}{joint("j", "base", "camera")}'
        f'<xacro:include filename="$(find parts)/outer.xacro"/></robot>'
    )
    description = describe(
        tmp_path, text, "rig.xacro", resolve_package={"parts": package}.__getitem__
    )
    assert description.robot.joint_between("base", "camera").name == "j"
    with pytest.raises(DescriptionError, match="rig.xacro.*package 'parts' is not found") as error:
        describe(tmp_path, text, "rig.xacro", resolve_package={}.__getitem__)
    assert "\n" not in str(error.value)


def test_xacro_arguments_are_passed(tmp_path):
    pytest.importorskip("roslaunch", reason="roslaunch, which xacro asks for arguments, is absent")
    text = (
        f'<robot name="rig" {XMLNS}><xacro:arg name="root" default="base"/>'
        f'<link name="$(arg root)"/></robot>'
    )
    assert describe(tmp_path, text, "rig.xacro").robot.root_link == "base"
    other = describe(tmp_path, text, "rig.xacro", xacro_arguments={"root": "world"})
    assert other.robot.root_link == "world"


@pytest.mark.parametrize(
    "content, message",
    [
        ("\n<link name='a'/>\n<link name='${nothing}'/>", "line 3: .*nothing.*mend the xacro"),
        ("\n<xacro:unknown/>", "line 2: unknown macro name: xacro:unknown"),
        ("\n<xacro:include filename='gone.xacro'/>", "No such file or directory.*gone.xacro"),
        ("\n<link name='${1'>", "line 2.*not well-formed XML"),
        ("\n<link name='${1 +}'/>", "line 2: .*1 \\+"),
        ("\n<link name='a'/><link name='${1}'/>", "Two root links.*mend the xacro"),
    ],
)
def test_a_broken_xacro_gives_file_and_line(tmp_path, content, message):
    with pytest.raises(DescriptionError, match=message) as error:
        describe(tmp_path, f'<robot name="rig" {XMLNS}>{content}</robot>', "rig.xacro")
    assert str(error.value).startswith(str(tmp_path / "rig.xacro"))
    assert "\n" not in str(error.value)


def test_a_flaw_in_an_included_file_names_that_file(tmp_path):
    (tmp_path / "part.xacro").write_text(f"<robot {XMLNS}>\n\n<link name='${{nothing}}'/></robot>")
    text = f'<robot name="rig" {XMLNS}><xacro:include filename="part.xacro"/></robot>'
    with pytest.raises(DescriptionError, match="rig.xacro: included file .*part.xacro, line 3"):
        describe(tmp_path, text, "rig.xacro")
