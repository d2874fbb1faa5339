"""Descriptions: read as ROS reads them, written back with nothing changed but the origins."""

import sys

import numpy as np
import pytest

from atom_core.errors import DescriptionError, OutputError
from atom_core.geometry import se3
from atom_core.io.urdf import parse_urdf, read_description, write_calibrated_description
from atom_core.model.transforms import Edge

XMLNS = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'

PLAIN = """<?xml version="1.0"?>
<!-- the rig of the laboratory -->
<robot name="rig">
  <link name="base"/>   <link name='camera'/>
\t<link name="arm"/><link name="lidar"/>

  <joint name="base_to_camera" type="fixed">   <!-- measured by hand -->
    <origin rpy = "0 0 0"
            xyz='0.1 0.2 0.3'   />
    <parent link="base"/>
    <child link="camera"/>
  </joint>
  <joint name="base_to_arm" type="revolute">
    <parent link="base"/> <child link="arm"/>
    <origin xyz="1 0 0" rpy="0.1 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
  <joint name="arm_to_lidar" type="fixed">
    <parent link="arm"/>
    <child link="lidar"/>
  </joint>
  <transmission name="t"><joint name="base_to_arm"/></transmission>
</robot>
<!-- the end -->
"""

MACROS = f"""<robot name="rig" {XMLNS}>
  <xacro:property name="height" value="0.3"/>
  <xacro:macro name="camera" params="name parent">
    <link name="${{name}}"/>
    <joint name="${{name}}_joint" type="fixed">
      <parent link="${{parent}}"/> <child link="${{name}}"/>
      <origin xyz="0 0 ${{height}}" rpy="0 0 0"/>
    </joint>
  </xacro:macro>
  <link name="base"/> <link name="lidar"/>
  <xacro:camera name="left" parent="base"/>   <!-- two of them -->
  <xacro:camera name="right" parent="base"/>
  <joint name="lidar_joint" type="fixed">
    <parent link="base"/> <child link="lidar"/>
    <origin xyz="${{height * 2}} 0 0" rpy="0 0 ${{pi / 2}}"/>
  </joint>
</robot>
"""

CAMERA, LIDAR = Edge("base", "camera"), Edge("arm", "lidar")


def link(*names):
    return "".join(f'<link name="{name}"/>' for name in names)


def joint(name, parent, child, content="", kind="fixed"):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f"{content}</joint>"
    )


def rig(content):
    return f'<robot name="rig">{content}</robot>'


def describe(tmp_path, text, name="rig.urdf", **more):
    path = tmp_path / name
    path.write_bytes(text.encode("utf-8"))
    if name.endswith(".xacro"):
        pytest.importorskip("xacro", reason="xacro is not installed; `make setup` installs it")
    return read_description(path, **more)


def some_pose(seed):
    rng = np.random.default_rng(seed)
    return se3.transform(se3.random_rotation(rng.uniform(0, 3), rng), rng.uniform(-5, 5, 3))


def origin_of(description, edge):
    return description.robot.joint_between(*edge).parent_T_child_at_zero


def rotation(axis, angle):
    vector = np.zeros(3)
    vector["xyz".index(axis)] = angle
    return se3.rotation_from_rotation_vector(vector)


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


def test_a_flat_file_called_xacro_needs_no_xacro(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)
    (tmp_path / "flat.urdf.xacro").write_text(PLAIN)
    assert not read_description(tmp_path / "flat.urdf.xacro").is_xacro


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


# -------------------------------------------------------------------------------------- writing


def test_only_the_numbers_of_the_origin_change(tmp_path):
    description = describe(tmp_path, PLAIN)
    pose = se3.from_rpy(np.array([1.5, -2.25, 3.0]), np.array([0.5, 0.0, 0.0]))
    report = write_calibrated_description(description, {CAMERA: pose}, tmp_path / "out.urdf")
    expected = PLAIN.replace('rpy = "0 0 0"', 'rpy = "0.5 0.0 0.0"').replace(
        "'0.1 0.2 0.3'", "'1.5 -2.25 3.0'"
    )
    assert (tmp_path / "out.urdf").read_text() == expected
    assert report.replaced == (CAMERA,)
    assert (report.unchanged, report.missing, report.flattened) == ((), (), False)


def test_what_is_written_reads_back_exactly(tmp_path):
    description = describe(tmp_path, PLAIN)
    for seed in range(20):
        poses = {CAMERA: some_pose(seed), LIDAR: some_pose(seed + 100)}
        report = write_calibrated_description(description, poses, tmp_path / "out.urdf")
        assert report.replaced == (CAMERA, LIDAR)
        written = read_description(tmp_path / "out.urdf")
        for edge, pose in poses.items():
            np.testing.assert_allclose(origin_of(written, edge), pose, atol=1e-14)


@pytest.mark.parametrize("offset", [0.0, 1e-12, 1e-9, 1e-8, 1e-7, 1e-5, 1e-3])
def test_looking_straight_up_or_down_reads_back_too(tmp_path, offset):
    description = describe(tmp_path, PLAIN)
    for sign in (-1, 1):
        rpy = np.array([0.4, sign * (np.pi / 2 - offset), -1.2])
        pose = se3.from_rpy(np.array([0.0, 0.0, 1.0]), rpy)
        write_calibrated_description(description, {CAMERA: pose}, tmp_path / "out.urdf")
        written = read_description(tmp_path / "out.urdf")
        np.testing.assert_allclose(origin_of(written, CAMERA), pose, atol=1e-14)


def test_a_joint_without_origin_gets_one_in_the_style_of_the_file(tmp_path):
    description = describe(tmp_path, PLAIN)
    pose = se3.transform(np.eye(3), np.array([0.0, 0.0, 0.25]))
    write_calibrated_description(description, {LIDAR: pose}, tmp_path / "out.urdf")
    assert (tmp_path / "out.urdf").read_text() == PLAIN.replace(
        '    <parent link="arm"/>',
        '    <origin xyz="0.0 0.0 0.25" rpy="0.0 0.0 0.0"/>\n    <parent link="arm"/>',
    )


def test_an_origin_with_one_attribute_gets_the_other(tmp_path):
    for origin in ('<origin xyz="1 2 3"/>', "<origin rpy='1 2 3' />", "<origin/>"):
        text = rig(link("a", "b") + joint("j", "a", "b", origin))
        pose = some_pose(1)
        write_calibrated_description(
            describe(tmp_path, text), {("a", "b"): pose}, tmp_path / "out.urdf"
        )
        written = read_description(tmp_path / "out.urdf")
        np.testing.assert_allclose(origin_of(written, ("a", "b")), pose, atol=1e-14)


def test_the_present_value_leaves_the_file_as_it_is(tmp_path):
    description = describe(tmp_path, PLAIN)
    poses = {CAMERA: origin_of(description, CAMERA)}
    report = write_calibrated_description(description, poses, tmp_path / "out.urdf")
    assert (tmp_path / "out.urdf").read_text() == PLAIN
    assert (report.replaced, report.unchanged) == ((), (CAMERA,))


def test_line_ends_marks_and_letters_survive(tmp_path):
    text = "\ufeff" + PLAIN.replace("\n", "\r\n").replace("laboratory", "Präzisionslabor ✓")
    description = describe(tmp_path, text)
    poses = {CAMERA: some_pose(1), LIDAR: some_pose(2)}
    write_calibrated_description(description, poses, tmp_path / "out.urdf", {LIDAR: "± 1 mm"})
    written = (tmp_path / "out.urdf").read_bytes().decode("utf-8")
    assert written.startswith("\ufeff<?xml") and "Präzisionslabor ✓" in written
    assert written.count("\n") == written.count("\r\n") == text.count("\n") + 2
    np.testing.assert_allclose(
        origin_of(read_description(tmp_path / "out.urdf"), LIDAR), poses[LIDAR], atol=1e-14
    )


def test_the_source_can_be_the_target(tmp_path):
    description = describe(tmp_path, PLAIN)
    write_calibrated_description(description, {CAMERA: some_pose(3)}, description.path)
    written = read_description(description.path)
    np.testing.assert_allclose(origin_of(written, CAMERA), some_pose(3), atol=1e-14)


def test_comments_stand_beside_the_origin_and_are_renewed(tmp_path):
    description = describe(tmp_path, PLAIN)
    out = tmp_path / "out.urdf"
    poses = {CAMERA: some_pose(1), LIDAR: some_pose(2)}
    comments = {CAMERA: "sigma 1 mm -- 0.1 deg-", LIDAR: "not\ndetermined"}
    write_calibrated_description(description, poses, out, comments)
    text = out.read_text()
    assert "    <!-- calibration: sigma 1 mm - - 0.1 deg -->\n    <origin rpy" in text
    assert "    <!-- calibration: not determined -->\n    <origin xyz" in text
    assert "<!-- measured by hand -->" in text

    write_calibrated_description(read_description(out), poses, out, {CAMERA: "better"})
    text = out.read_text()
    assert text.count("calibration:") == 1 and "<!-- calibration: better -->" in text
    assert "<!-- measured by hand -->" in text


def test_edges_that_the_file_lacks_are_reported_with_the_reason(tmp_path):
    description = describe(tmp_path, PLAIN)
    edges = [
        ("base", "pattern"),
        ("camera", "base"),
        ("base", "lidar"),
        ("lidar", "base"),
        ("base", "arm"),
    ]
    poses = {Edge(*edge): np.eye(4) for edge in edges}
    report = write_calibrated_description(description, poses, tmp_path / "out.urdf")
    reasons = dict(report.missing)
    assert set(reasons) == set(edges)
    assert "no link 'pattern'" in reasons["base", "pattern"]
    assert "goes the other way" in reasons["camera", "base"]
    assert "'lidar' hangs on 'arm'" in reasons["base", "lidar"]
    assert "root" in reasons["lidar", "base"]
    assert "'base_to_arm' is revolute" in reasons["base", "arm"]
    assert (tmp_path / "out.urdf").read_text() == PLAIN


def test_the_origin_of_a_moving_joint_is_written_by_its_name(tmp_path):
    description = describe(tmp_path, PLAIN)
    origins = {"base_to_arm": some_pose(5), "gone": np.eye(4)}
    report = write_calibrated_description(
        description, {}, tmp_path / "out.urdf", joint_origins=origins
    )
    assert report.replaced == (Edge("base", "arm"),)
    assert [name for name, _ in report.missing_joints] == ["gone"]
    arm = read_description(tmp_path / "out.urdf").robot.joints["base_to_arm"]
    np.testing.assert_allclose(arm.parent_T_child(0.0), some_pose(5), atol=1e-14)
    assert arm.type == "revolute"


def test_a_matrix_that_is_no_pose_is_refused_before_writing(tmp_path):
    description = describe(tmp_path, PLAIN)
    for matrix in (np.diag([2.0, 2.0, 2.0, 1.0]), np.full((4, 4), np.nan), np.eye(3)):
        with pytest.raises(ValueError, match="base-camera.*no rigid transform"):
            write_calibrated_description(description, {CAMERA: matrix}, tmp_path / "out.urdf")
    assert not (tmp_path / "out.urdf").exists()


def test_a_folder_that_is_not_there_is_an_output_error(tmp_path):
    description = describe(tmp_path, PLAIN)
    with pytest.raises(OutputError):
        write_calibrated_description(description, {CAMERA: np.eye(4)}, tmp_path / "no" / "out.urdf")


# -------------------------------------------------------------------------------- writing xacro


def test_a_literal_joint_is_edited_in_place_and_macros_stay(tmp_path):
    description = describe(tmp_path, MACROS, "rig.urdf.xacro")
    edge = Edge("base", "lidar")
    pose = se3.transform(rotation("z", 0.5), np.array([1.0, 2.0, 3.0]))
    out = tmp_path / "out.urdf.xacro"
    report = write_calibrated_description(description, {edge: pose}, out)
    assert (report.replaced, report.flattened, report.reason) == ((edge,), False, "")
    assert out.read_text() == MACROS.replace(
        'xyz="${height * 2} 0 0" rpy="0 0 ${pi / 2}"', 'xyz="1.0 2.0 3.0" rpy="0.0 0.0 0.5"'
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "out.urdf.xacro",
        "rig.urdf.xacro",
    ]


def test_a_joint_made_by_a_macro_flattens_and_is_named(tmp_path):
    description = describe(tmp_path, MACROS, "rig.urdf.xacro")
    poses = {Edge("base", "left"): some_pose(1), Edge("base", "lidar"): some_pose(2)}
    out = tmp_path / "out.urdf.xacro"
    report = write_calibrated_description(description, poses, out, {Edge("base", "left"): "1 mm"})
    assert report.flattened
    assert report.replaced == tuple(poses)
    assert "'left_joint'" in report.reason and "lidar_joint" not in report.reason
    assert "xacro:macro" not in out.read_text()
    assert "<!-- calibration: 1 mm -->" in out.read_text()
    written = read_description(out)
    for edge, pose in poses.items():
        np.testing.assert_allclose(origin_of(written, edge), pose, atol=1e-14)
    right = Edge("base", "right")
    np.testing.assert_array_equal(origin_of(written, right), origin_of(description, right))


@pytest.mark.parametrize(
    "made, what",
    [
        (
            '<xacro:macro name="pose"><origin xyz="1 0 0"/></xacro:macro>'
            + joint("j", "a", "b", "<xacro:pose/>"),
            "origin by a macro",
        ),
        (
            '<xacro:property name="on" value="true"/>'
            f'<xacro:if value="${{on}}">{joint("j", "a", "b")}</xacro:if>'
            f'<xacro:unless value="${{on}}">{joint("k", "a", "b")}</xacro:unless>',
            "one of two",
        ),
        (
            '<xacro:property name="p" value="a"/>' + joint("j", "${p}", "b"),
            "name by a property",
        ),
    ],
)
def test_other_joints_that_are_not_literal_flatten(tmp_path, made, what):
    text = f'<robot name="rig" {XMLNS}>{link("a", "b")}{made}</robot>'
    description = describe(tmp_path, text, "rig.xacro")
    out = tmp_path / "out.xacro"
    report = write_calibrated_description(description, {Edge("a", "b"): some_pose(1)}, out)
    assert report.flattened and "'j'" in report.reason, what
    np.testing.assert_allclose(
        origin_of(read_description(out), ("a", "b")), some_pose(1), atol=1e-14
    )


def test_one_joint_in_a_condition_is_edited_in_place(tmp_path):
    text = (
        f'<robot name="rig" {XMLNS}>{link("a", "b")}'
        f'<xacro:if value="true">{joint("j", "a", "b")}</xacro:if></robot>'
    )
    description = describe(tmp_path, text, "rig.xacro")
    report = write_calibrated_description(
        description, {Edge("a", "b"): some_pose(1)}, tmp_path / "out.xacro"
    )
    assert not report.flattened and "xacro:if" in (tmp_path / "out.xacro").read_text()


def test_relative_includes_flatten_only_where_they_would_break(tmp_path):
    (tmp_path / "part.xacro").write_text(rig(link("b")))
    text = (
        f'<robot name="rig" {XMLNS}>{link("a")}<xacro:include filename="part.xacro"/>'
        f"{joint('j', 'a', 'b')}</robot>"
    )
    description = describe(tmp_path, text, "rig.xacro")
    poses = {Edge("a", "b"): some_pose(1)}
    beside = write_calibrated_description(description, poses, tmp_path / "out.xacro")
    assert not beside.flattened
    (tmp_path / "results").mkdir()
    elsewhere = tmp_path / "results" / "out.xacro"
    report = write_calibrated_description(description, poses, elsewhere)
    assert report.flattened and "part.xacro" in report.reason
    assert [path.name for path in elsewhere.parent.iterdir()] == ["out.xacro"]
    np.testing.assert_allclose(
        origin_of(read_description(elsewhere), ("a", "b")), some_pose(1), atol=1e-14
    )


def test_an_output_called_urdf_is_a_plain_urdf(tmp_path):
    description = describe(tmp_path, MACROS, "rig.urdf.xacro")
    report = write_calibrated_description(
        description, {Edge("base", "lidar"): some_pose(1)}, tmp_path / "out.urdf"
    )
    assert report.flattened and "plain URDF" in report.reason
    assert not read_description(tmp_path / "out.urdf").is_xacro
