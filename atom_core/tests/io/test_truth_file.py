"""A truth may be a simulation's file, a dataset, or a description; all say the same."""

import json

import numpy as np
import pytest

from atom_core import cli
from atom_core.errors import AtomError, DatasetError
from atom_core.geometry import se3
from atom_core.io.dataset_entries import transform_document
from atom_core.io.dataset_json import document_of, read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.io.truth_file import read_any_truth
from atom_core.io.truth_json import write_truth
from atom_core.model.dataset import board_edge
from atom_core.model.truth import Truth, truth_of, with_truth
from atom_core.synthetic import Noise, arm, scenes

pytest.importorskip("atom_core._core", reason="descriptions are read by the compiled module")

URDF = """<?xml version="1.0"?>
<robot name="rig">{links}
{joints}
</robot>
"""


@pytest.fixture(scope="module")
def rig():
    return scenes.two_cameras(0, collections=2, noise=Noise.none())


@pytest.fixture
def dataset(rig, tmp_path):
    return write_dataset_folder(rig.dataset, tmp_path / "data", name="rig")


def as_urdf(truth, path):
    """Write the true edges as fixed joints of one robot, and a joint that turns."""
    frames = list(dict.fromkeys(frame for e in truth.edges for frame in (e.parent, e.child)))
    roots = [frame for frame in frames if frame not in {e.child for e in truth.edges}]
    links = "".join(f'<link name="{name}"/>' for name in ("root", *frames, "lid"))
    joints = [joint(f"to_{root}", "fixed", "root", root, np.eye(4)) for root in roots]
    joints += [joint(str(e), "fixed", e.parent, e.child, m) for e, m in truth.edges.items()]
    limits = '<limit lower="-1" upper="1" effort="1" velocity="1"/><axis xyz="0 0 1"/>'
    origin = se3.from_rpy(np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.0, 0.5]))
    joints.append(joint("hinge", "revolute", "root", "lid", origin, limits))
    path.write_text(URDF.format(links=links, joints="".join(joints)))
    return path


def joint(name, kind, parent, child, matrix, more=""):
    xyz = " ".join(map(repr, matrix[:3, 3].tolist()))
    rpy = " ".join(map(repr, se3.rpy_from_rotation(matrix[:3, :3]).tolist()))
    return (
        f'<joint name="{name}" type="{kind}"><origin xyz="{xyz}" rpy="{rpy}"/>'
        f'<parent link="{parent}"/><child link="{child}"/>{more}</joint>'
    )


def edges_agree(found, wanted):
    for edge, matrix in wanted.edges.items():
        np.testing.assert_allclose(found.edges[edge], matrix, atol=1e-9)


def test_all_forms_say_the_same(rig, dataset, tmp_path):
    write_truth(rig.truth, tmp_path / "truth.json")
    forms = [dataset, tmp_path / "truth.json", as_urdf(rig.truth, tmp_path / "rig.urdf")]
    for form in forms:
        edges_agree(read_any_truth(form), rig.truth)
    hinge = read_any_truth(forms[-1]).joints["hinge"]
    assert (hinge["origin_z"], hinge["position_bias"]) == (3.0, 0.0)
    assert hinge["origin_yaw"] == pytest.approx(0.5)


def test_true_transforms_that_a_tool_has_put_beside_are_taken_first(rig, dataset):
    document = json.loads(dataset.read_text())
    for collection in document["collections"].values():
        collection["transforms_ground_truth"] = json.loads(json.dumps(collection["transforms"]))
        for transform in collection["transforms"].values():
            transform["trans"][0] += 0.5
    dataset.write_text(json.dumps(document))
    edges_agree(read_any_truth(dataset), rig.truth)
    document["collections"]["000"]["transforms_ground_truth"] = {"a-b": {"parent": "a"}}
    dataset.write_text(json.dumps(document))
    with pytest.raises(AtomError, match="transforms_ground_truth is malformed"):
        read_any_truth(dataset)


def with_true_transforms(dataset, path, true, keys=None):
    """Write a dataset that has the transforms of another one beside it, in some collections."""
    document = json.loads(json.dumps(document_of(dataset)))
    for key in true.collections if keys is None else keys:
        document["collections"][key]["transforms_ground_truth"] = {
            str(edge): transform_document(edge, matrix)
            for edge, matrix in true.collections[key].transforms.items()
        }
    path.write_text(json.dumps(document))
    return path


def test_boards_that_a_calibration_has_estimated_are_no_truth(rig, dataset):
    before = read_dataset(dataset)
    (pattern,), (first, *_) = before.patterns.values(), before.collections
    edge = board_edge(pattern)
    calibrated = before.with_transforms({key: {edge: np.eye(4)} for key in before.collections})
    assert len(read_any_truth(with_true_transforms(calibrated, dataset, calibrated)).boards) == 2
    assert read_any_truth(with_true_transforms(calibrated, dataset, before)).boards == {}
    known = before.with_transforms({first: {edge: np.eye(4)}})
    found = read_any_truth(with_true_transforms(calibrated, dataset, known)).boards
    assert list(found) == [(pattern.name, first)]


def test_collections_without_true_transforms_say_nothing_where_others_have_them(rig, dataset):
    true = read_dataset(dataset)
    edge, (first, _) = true.sensors["rgb_2"].edge, true.collections
    off = true.with_transforms({key: {edge: np.eye(4)} for key in true.collections})
    found = read_any_truth(with_true_transforms(off, dataset, true, keys=[first]))
    edges_agree(found, rig.truth)
    assert found.moving == {}


def test_joints_are_true_only_where_they_give_the_true_transforms(tmp_path):
    scene = arm.camera_on_arm(0, errors={"elbow": {"position_bias": 0.0}}, collections=2)
    true = read_dataset(write_dataset_folder(scene.dataset, tmp_path / "arm", name="arm"))
    estimated = true.with_joint_parameters({"elbow": {"position_bias": 0.01}})
    truth = read_any_truth(with_true_transforms(estimated, tmp_path / "arm" / "gt.json", true))
    assert set(truth.joints) == set(arm.JOINT_NAMES) - {"elbow"}
    edge = true.joint("elbow").edge
    for key, collection in with_truth(estimated, truth).collections.items():
        expected = true.collections[key].transforms[edge]
        np.testing.assert_allclose(collection.transforms[edge], expected, atol=1e-12)
    truth = read_any_truth(with_true_transforms(true, tmp_path / "arm" / "gt.json", true))
    assert set(truth.joints) == set(arm.JOINT_NAMES)


def test_an_edge_with_a_value_for_each_collection_stays_so(rig):
    edge = rig.dataset.sensors["rgb_2"].edge
    values = {key: {edge: np.diag([1.0, 1, 1, 1])} for key in rig.dataset.collections}
    for number, key in enumerate(values):
        values[key][edge][0, 3] = number
    truth = truth_of(rig.dataset.with_transforms(values))
    assert edge not in truth.edges
    true = with_truth(rig.dataset, truth)
    for number, collection in enumerate(true.collections.values()):
        assert collection.transforms[edge][0, 3] == number


def test_evaluate_takes_a_description_as_the_truth(rig, dataset, tmp_path):
    urdf = as_urdf(rig.truth, tmp_path / "rig.urdf")
    line = [
        "evaluate",
        "--train",
        dataset,
        "--test",
        dataset,
        "--truth",
        urdf,
        "-o",
        tmp_path / "e",
    ]
    assert cli.main([str(word) for word in line]) == 0
    mean = json.loads((tmp_path / "e" / "evaluation.json").read_text())["ground_truth"]["mean"]
    assert mean["translation_error_m"] < 1e-9


@pytest.mark.parametrize(("name", "text"), [("a.json", "{"), ("a.urdf", "<robot"), ("a.txt", "7")])
def test_what_is_no_truth_is_refused_by_name(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    with pytest.raises(AtomError, match=name):
        read_any_truth(tmp_path / name)


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_a_link_of_which_a_description_does_not_say_where_it_is_is_passed_over(
    kind, rig, dataset, tmp_path
):
    urdf = as_urdf(rig.truth, tmp_path / "rig.urdf")
    adrift = '<link name="adrift"/>' + joint("sways", kind, "root", "adrift", np.eye(4))
    urdf.write_text(urdf.read_text().replace("</robot>", adrift + "</robot>"))
    edges_agree(read_any_truth(urdf), rig.truth)
    assert not any(edge.child == "adrift" for edge in read_any_truth(urdf).edges)
    assert cli.main(["check", "-json", str(dataset), "--against", str(urdf)]) == 0


def test_a_truth_without_a_sensors_edge_is_refused(rig, tmp_path, dataset, capsys):
    other = as_urdf(scenes.hand_eye(0, collections=2).truth, tmp_path / "other.urdf")
    line = ["calibrate", "-json", str(dataset), "--truth", str(other), "-o", str(tmp_path / "out")]
    assert cli.main(line) == 2
    assert "the truth lacks edge" in capsys.readouterr().err
    assert read_dataset(dataset).sensors


def test_only_joints_that_are_off_move_to_their_truth():
    """What tf says of the others stays, though their positions may say a little else."""
    dataset = arm.camera_on_arm(0, errors={"elbow": {"position_bias": 0.0}}, collections=2).dataset
    elbow, wrist = dataset.joint("elbow").edge, dataset.joint("wrist_1").edge
    truth = truth_of(dataset)
    shaken = {key: {wrist: np.eye(4)} for key in dataset.collections}
    off = dataset.with_joint_parameters({"elbow": {"position_bias": 0.1}}).with_transforms(shaken)
    found = with_truth(off, truth)
    for key, collection in dataset.collections.items():
        np.testing.assert_allclose(
            found.collections[key].transforms[elbow], collection.joints["elbow"].parent_T_child
        )
        np.testing.assert_array_equal(found.collections[key].transforms[wrist], np.eye(4))


def test_joints_of_a_truth_file_come_back(tmp_path):
    path, joints = tmp_path / "truth.json", {"elbow": {"position_bias": 0.0123}}
    write_truth(Truth({}, joints=joints), path)
    assert read_any_truth(path).joints == joints
    write_truth(Truth({}), path)
    assert "joints" not in json.loads(path.read_text()) and read_any_truth(path).joints == {}


@pytest.mark.parametrize("joints", [{"elbow": 1.0}, {"elbow": {"position_bias": None}}, [1]])
def test_malformed_joints_of_a_truth_file_are_refused(tmp_path, joints):
    path = tmp_path / "truth.json"
    path.write_text(json.dumps({"edges": {}, "joints": joints}))
    with pytest.raises(DatasetError, match="not a truth file"):
        read_any_truth(path)
