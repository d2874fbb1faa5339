"""Descriptions, written back with nothing changed but the origins."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))  # descriptions, which the tests share

from descriptions import (  # noqa: E402
    CAMERA,
    LIDAR,
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

from atom_core.errors import OutputError  # noqa: E402
from atom_core.geometry import se3  # noqa: E402
from atom_core.io.urdf import read_description, write_calibrated_description  # noqa: E402
from atom_core.model.transforms import Edge  # noqa: E402


def some_pose(seed):
    rng = np.random.default_rng(seed)
    return se3.transform(se3.random_rotation(rng.uniform(0, 3), rng), rng.uniform(-5, 5, 3))


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


@pytest.mark.parametrize("comment", ["<!-- ---- sensors ---- -->", "<!--\n-- a & b < --->"])
def test_comments_that_xml_forbids_and_urdfdom_reads_stay_as_they_are(tmp_path, comment):
    text = PLAIN.replace("<link", f"{comment}<link", 1)
    pose = se3.from_rpy(np.array([1.5, -2.25, 3.0]), np.array([0.5, 0.0, 0.0]))
    write_calibrated_description(describe(tmp_path, text), {CAMERA: pose}, tmp_path / "out.urdf")
    assert (tmp_path / "out.urdf").read_text().count(comment) == 1
    written = read_description(tmp_path / "out.urdf")
    np.testing.assert_allclose(origin_of(written, CAMERA), pose, atol=1e-14)


def test_a_declaration_behind_blank_lines_is_read_as_ros_does_and_stays(tmp_path):
    text = "\n \r\n" + PLAIN
    pose = se3.from_rpy(np.array([1.5, -2.25, 3.0]), np.array([0.5, 0.0, 0.0]))
    write_calibrated_description(describe(tmp_path, text), {CAMERA: pose}, tmp_path / "out.urdf")
    assert (tmp_path / "out.urdf").read_bytes().startswith(b"\n \r\n<?xml version")
    written = read_description(tmp_path / "out.urdf")
    np.testing.assert_allclose(origin_of(written, CAMERA), pose, atol=1e-14)


def test_what_is_written_reads_back_exactly(tmp_path):
    description = describe(tmp_path, PLAIN)
    for seed in range(20):
        poses = {CAMERA: some_pose(seed), LIDAR: some_pose(seed + 100)}
        report = write_calibrated_description(description, poses, tmp_path / "out.urdf")
        assert report.replaced == (CAMERA, LIDAR)
        written = read_description(tmp_path / "out.urdf")
        for edge, pose in poses.items():
            np.testing.assert_allclose(origin_of(written, edge), pose, atol=1e-14)


@pytest.mark.parametrize("metres", [1e3, 5e5, 4.6e6, 1e8])
def test_places_on_a_map_are_written_to_the_last_digit(tmp_path, metres):
    description = describe(tmp_path, PLAIN)
    pose = some_pose(7)
    pose[:3, 3] = metres * np.array([1.0, 0.123456789123456789, -1.0 / 3.0])
    write_calibrated_description(description, {CAMERA: pose}, tmp_path / "out.urdf")
    written = origin_of(read_description(tmp_path / "out.urdf"), CAMERA)
    np.testing.assert_allclose(written[:3, 3], pose[:3, 3], rtol=0.0, atol=1e-12)


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
