"""Joints of a dataset are read as their program wrote them, and written as in URDF."""

import json

import numpy as np
import pytest

from atom_core.evaluation.mixed import mixed_dataset
from atom_core.geometry import se3
from atom_core.io.dataset_json import document_of, dumps, read_dataset
from atom_core.io.dataset_writer import new_document
from atom_core.model.joints import ORIGIN_PARAMETERS
from atom_core.model.transforms import Edge
from atom_core.synthetic import Noise, arm

ANGLES = ORIGIN_PARAMETERS[3:]
INCLINED = "shoulder_lift"  # its origin has roll, pitch and yaw


@pytest.fixture(scope="module")
def text():
    made = arm.camera_on_arm(0, errors={}, collections=3, noise=Noise.none())
    document = new_document(made.dataset, name="arm")
    joint = document["collections"]["000"]["joints"][INCLINED]
    assert all(joint[name] for name in ANGLES)
    document["calibration_config"]["joints"] = {INCLINED: {"params_to_calibrate": ["origin_yaw"]}}
    return dumps(document)


def about_moving_axes(angles_rad):
    """Return the rotation (3, 3) of ATOM: about x, then the new y, then the new z."""
    turns = [se3.rotation_from_rpy(row) for row in np.diag(angles_rad)]
    return turns[0] @ turns[1] @ turns[2]


def calibrated_by_atom(text, yaw_rad):
    """Return a document whose joint ATOM has turned, and ATOM's transforms of it by collection."""
    document, edges = json.loads(text), {}
    for key, collection in document["collections"].items():
        joint = collection["joints"][INCLINED]
        joint["origin_yaw"] += yaw_rad
        axis = np.array([joint[f"axis_{name}"] for name in "xyz"])
        turned = about_moving_axes([joint[name] for name in ANGLES])
        turned = turned @ se3.rotation_from_rotation_vector(axis * joint["position"])
        entry = collection["transforms"][joint["transform_key"]]
        entry["quat"] = [float(v) for v in se3.quaternion_from_rotation(turned)]
        edges[key] = turned
    return document, edges


def written(document, path):
    path.write_text(dumps(document), encoding="utf-8")
    return read_dataset(path)


@pytest.mark.parametrize("yaw_rad", [0.0, 0.05, -2.0])
def test_a_joint_that_atom_calibrated_is_where_its_transforms_are(text, tmp_path, yaw_rad):
    document, edges = calibrated_by_atom(text, yaw_rad)
    dataset = written(document, tmp_path / "dataset.json")
    for key, collection in dataset.collections.items():
        pose = collection.joints[INCLINED].parent_T_child
        np.testing.assert_allclose(pose[:3, :3], edges[key], atol=1e-9)


def test_an_evaluation_of_atoms_joints_measures_what_atom_calibrated(text, tmp_path):
    document, edges = calibrated_by_atom(text, 0.05)
    test = written(json.loads(text), tmp_path / "test.json")
    mixed = mixed_dataset(written(document, tmp_path / "train.json"), test)
    joint = test.joint(INCLINED)
    for key, collection in mixed.collections.items():
        edge = collection.transforms[Edge(joint.edge.parent, joint.edge.child)]
        np.testing.assert_allclose(edge[:3, :3], edges[key], atol=1e-9)


def test_a_joint_as_in_urdf_stays_so_where_its_transform_is_of_another_instant(text, tmp_path):
    document = json.loads(text)
    for collection in document["collections"].values():
        collection["joints"][INCLINED]["position"] += 0.002
    joint = written(document, tmp_path / "dataset.json").joint(INCLINED)
    stored = document["collections"]["000"]["joints"][INCLINED]
    assert [joint.parameters[name] for name in ANGLES] == [stored[name] for name in ANGLES]


def test_atoms_joints_are_written_as_they_were_unless_they_change(text, tmp_path):
    document, _ = calibrated_by_atom(text, 0.05)
    dataset = written(document, tmp_path / "dataset.json")
    assert dumps(document_of(dataset)) == dumps(document)
    changed = dataset.with_joint_parameters({INCLINED: {"origin_x": 0.5}})
    again = written(document_of(changed), tmp_path / "changed.json")
    for key, collection in again.collections.items():
        ours = changed.collections[key].joints[INCLINED].parent_T_child
        np.testing.assert_allclose(collection.joints[INCLINED].parent_T_child, ours, atol=1e-12)
