"""Boards that stay where they are stand in optimized_w_pattern.urdf.xacro, beside the robot."""

import json
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))  # described_rigs, which the tests share

from described_rigs import urdf_of_edges  # noqa: E402

from atom_core.cli import main  # noqa: E402
from atom_core.io.dataset_json import read_dataset  # noqa: E402
from atom_core.io.dataset_writer import write_dataset_folder  # noqa: E402
from atom_core.io.urdf import read_description  # noqa: E402
from atom_core.io.urdf_boards import BoardLink, with_boards  # noqa: E402
from atom_core.model.dataset import board_edge  # noqa: E402
from atom_core.model.transforms import Edge  # noqa: E402
from atom_core.synthetic import scenes  # noqa: E402

pytest.importorskip("atom_core._core", reason="native module is not built: make build")

FIRST, SECOND = "optimized.urdf.xacro", "optimized_w_pattern.urdf.xacro"
MESH = "package://boards/meshes/board & frame.dae"


def described(dataset, folder, boards=False, root="world"):
    """Write the dataset's tree as a description, with a name for its root; boards are at it."""
    edges = dict(next(iter(dataset.collections.values())).transforms)
    for edge in (board_edge(pattern) for pattern in dataset.patterns.values()):
        edges.pop(edge, None)
        if boards:
            edges[edge] = np.eye(4)
    comment = "  <!-- a comment that stays, with </robot> in it -->"
    first, rest = urdf_of_edges(edges).split("\n", 1)
    path = folder / "rig.urdf"
    path.write_text(f"{first}\n{comment}\n{rest}\n".replace('"world', f'"{root}'))
    return path


def calibrated(tmp_path, fixed=True, mesh=MESH, **options):
    """Calibrate a hand-eye rig whose board stays; return the folder of results."""
    scene = scenes.hand_eye(0, collections=10)
    path = write_dataset_folder(scene.dataset, tmp_path / "data", name="train")
    document = json.loads(path.read_text())
    for entry in document["calibration_config"]["calibration_patterns"].values():
        entry.update(fixed=fixed, mesh_file=mesh)
    path.write_text(json.dumps(document))
    urdf = described(read_dataset(path), tmp_path, **options)
    words = ["--dataset", str(path), "--output", str(tmp_path / "out"), "--description", str(urdf)]
    assert main(["calibrate", *words, "-ow"]) == 0
    return tmp_path / "out"


def board_of(folder):
    dataset = read_dataset(folder / "atom_calibration.json")
    (pattern,) = dataset.patterns.values()
    return board_edge(pattern), dataset.first_value(board_edge(pattern))


def test_a_board_that_stays_is_a_link_with_its_mesh_where_it_was_calibrated(tmp_path, capsys):
    out = calibrated(tmp_path)
    first, second = (read_description(out / name) for name in (FIRST, SECOND))
    edge, pose = board_of(out)
    joint = second.robot.joint_between(*edge)
    assert joint.name == str(edge) and joint.type == "fixed"
    np.testing.assert_allclose(joint.parent_T_child_at_zero, pose, atol=1e-9)
    assert set(second.robot.links) - set(first.robot.links) == {edge.child}
    for name, other in first.robot.joints.items():
        same = second.robot.joints[name].parent_T_child_at_zero
        np.testing.assert_array_equal(same, other.parent_T_child_at_zero)
    (link,) = [
        link
        for link in ElementTree.fromstring(second.urdf).findall("link")
        if link.get("name") == edge.child
    ]
    assert link.find("visual/geometry/mesh").get("filename") == MESH
    assert "a comment that stays" in second.text
    assert SECOND not in capsys.readouterr().out


@pytest.mark.parametrize("mesh", ["", None])
def test_a_board_without_a_mesh_is_a_frame(tmp_path, mesh):
    out = calibrated(tmp_path, mesh=mesh)
    assert read_description(out / SECOND).robot.joint_between(*board_of(out)[0])
    assert "visual" not in (out / SECOND).read_text()


def test_a_board_that_moves_stands_in_no_description(tmp_path, capsys):
    scene = scenes.random_scene(0, collections=8)
    path = write_dataset_folder(scene.dataset, tmp_path / "data", name="train")
    urdf, out = described(scene.dataset, tmp_path), tmp_path / "out"
    out.mkdir()
    (out / SECOND).write_text("of an earlier run")
    words = ["--dataset", str(path), "--output", str(out), "--description", str(urdf), "-ow"]
    assert main(["calibrate", *words]) == 0
    assert (out / FIRST).is_file() and not (out / SECOND).exists()
    assert SECOND not in capsys.readouterr().out


def test_a_board_that_the_robot_has_already_gets_its_place(tmp_path):
    out = calibrated(tmp_path, boards=True)
    edge, pose = board_of(out)
    joint = read_description(out / SECOND).robot.joint_between(*edge)
    assert joint.name == f"{edge.parent}_to_{edge.child}"
    np.testing.assert_allclose(joint.parent_T_child_at_zero, pose, atol=1e-9)


def test_a_board_on_a_frame_that_the_robot_lacks_is_told(tmp_path, capsys):
    out = calibrated(tmp_path, root="hall")
    assert (out / FIRST).is_file() and not (out / SECOND).exists()
    told = capsys.readouterr().out
    assert f"{SECOND} is not written: the robot has no link 'world'" in told


def test_boards_stand_in_a_xacro_whose_text_stays(tmp_path):
    path = tmp_path / "rig.urdf.xacro"
    path.write_text(
        '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">\r\n'
        '<xacro:property name="n" value="base"/><link name="${n}"/></robot>'
    )
    board = BoardLink(Edge("base", "board"), "package://p/m.dae")
    found = with_boards(read_description(path), [board, BoardLink(Edge("nowhere", "other"))])
    assert set(found.robot.links) == {"base", "board"}
    assert '<link name="${n}"/>' in found.text and "<xacro:property" in found.text
    assert "${n}" not in found.urdf and "m.dae" in found.urdf
    assert with_boards(found, [board]) is found
