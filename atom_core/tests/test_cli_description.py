"""The calibrated edges in a robot's description."""

import json

import pytest

from atom_core.cli import main
from atom_core.commands import calibrated_descriptions
from atom_core.errors import DescriptionError
from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.io.urdf import read_description
from atom_core.synthetic import driving, scenes


def test_a_description_is_written_with_the_calibrated_edges(tmp_path):
    pytest.importorskip("atom_core._core", reason="native module is not built: make build")
    scene = scenes.random_scene(0, collections=8, disturbance=(0.05, 0.05))
    dataset = read_dataset(write_dataset_folder(scene.dataset, tmp_path / "data", name="train"))
    urdf = tmp_path / "rig.urdf"
    urdf.write_text(_urdf_of(dataset))
    output = tmp_path / "out"
    assert (
        main(
            [
                "calibrate",
                "--dataset",
                str(dataset.source),
                "--output",
                str(output),
                "--description",
                str(urdf),
            ]
        )
        == 0
    )
    robot = read_description(output / "optimized.urdf.xacro").robot
    document = json.loads((output / "calibration.json").read_text())
    for edge in document["edges"].values():
        joint = robot.joint_between(edge["parent"], edge["child"])
        assert list(joint.parent_T_child()[:3, 3]) == pytest.approx(edge["translation_m"], abs=1e-9)
    # The rig that was calibrated has moved from where the old description has it.
    assert main(["check", "-json", str(dataset.source), "--against", str(urdf)]) == 0
    assert (
        main(
            [
                "check",
                "-json",
                str(output / "atom_calibration.json"),
                "--against",
                str(urdf),
                "-ssf",
                "rgb_*",
            ]
        )
        == 1
    )


def _urdf_of(dataset):
    transforms = next(iter(dataset.collections.values())).transforms
    links = dict.fromkeys(f for edge in transforms for f in edge)
    lines = ['<robot name="rig">', "  <!-- a comment that stays -->"]
    lines += [f'  <link name="{name}"/>' for name in links]
    for edge, matrix in transforms.items():
        xyz = " ".join(repr(float(v)) for v in matrix[:3, 3])
        rpy = " ".join(repr(float(v)) for v in se3.rpy_from_rotation(matrix[:3, :3]))
        lines.append(
            f'  <joint name="{edge.parent}_to_{edge.child}" type="fixed">\n'
            f'    <parent link="{edge.parent}"/>\n    <child link="{edge.child}"/>\n'
            f'    <origin xyz="{xyz}" rpy="{rpy}"/>\n  </joint>'
        )
    return "\n".join(lines + ["</robot>", ""])


def test_a_transform_with_a_pose_in_each_collection_is_not_one_of_the_description(tmp_path):
    pytest.importorskip("atom_core._core", reason="native module is not built: make build")
    scene = driving.vehicle_before_a_board(0, odometry=True, off=0.05)
    dataset = read_dataset(write_dataset_folder(scene.dataset, tmp_path / "data", name="train"))
    (tmp_path / "rig.urdf").write_text(_urdf_of(dataset))  # the vehicle at its first place
    words = ["--dataset", dataset.source, "--description", tmp_path / "rig.urdf"]
    assert main(["calibrate", *map(str, words), "--output", str(tmp_path / "out")]) == 0
    before, after = (
        read_description(path).robot.joint_between(*driving.ODOMETRY)
        for path in (tmp_path / "rig.urdf", tmp_path / "out" / "optimized.urdf.xacro")
    )
    assert (before.parent_T_child_at_zero == after.parent_T_child_at_zero).all()
    warnings = json.loads((tmp_path / "out" / "calibration.json").read_text())["warnings"]
    assert any("'world-base' is not written to optimized" in warning for warning in warnings)
    parameters = (tmp_path / "out" / "atom_calibration_params.yml").read_text()
    assert "# 'odom' has a pose of its own in each collection: here is the first." in parameters


def test_a_description_that_cannot_be_written_costs_no_other_result(tmp_path, monkeypatch):
    pytest.importorskip("atom_core._core", reason="native module is not built: make build")
    scene = scenes.random_scene(0, depth=0, lidar3d=0, collections=6)
    dataset = read_dataset(write_dataset_folder(scene.dataset, tmp_path / "data", name="train"))
    (tmp_path / "rig.urdf").write_text(_urdf_of(dataset))
    words = ["--dataset", dataset.source, "--description", tmp_path / "rig.urdf", "-ow"]
    line = ["calibrate", *map(str, words), "--output", str(tmp_path / "out")]
    assert main(line) == 0 and (tmp_path / "out" / "optimized.urdf.xacro").exists()

    def refuse(*_):
        raise DescriptionError("rig.urdf: it is as it is")

    monkeypatch.setattr(calibrated_descriptions, "write_calibrated_description", refuse)
    assert main(line) == 0
    assert not (tmp_path / "out" / "optimized.urdf.xacro").exists()  # nor that of before
    document = json.loads((tmp_path / "out" / "calibration.json").read_text())
    said = "optimized.urdf.xacro is not written: rig.urdf: it is as it is"
    assert document["status"] == "converged" and said in document["warnings"]
