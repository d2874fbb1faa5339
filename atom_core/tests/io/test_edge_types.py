"""Files without types of edges: what moves is told by its values, and said of additional tfs."""

import numpy as np
import pytest

from atom_core.evaluation.mixed import mixed_dataset
from atom_core.io.dataset_json import document_of, dumps, read_dataset
from atom_core.io.dataset_writer import new_document
from atom_core.model.dataset import MULTIPLE, board_edge
from atom_core.synthetic import scenes


@pytest.fixture
def untyped(document):
    """Return a document as ATOM wrote it before types, whose rig was driven about."""
    del document["transforms"]
    return document


def driven(document, step_m, add_tf=True):
    """Move the rig on by a step in each collection; return the edge that moves."""
    base = next(
        e
        for e in document["collections"]["000"]["transforms"].values()
        if e["parent"] == "world" and "pattern" not in e["child"]
    )
    edge = (base["parent"], base["child"])
    for i, collection in enumerate(document["collections"].values()):
        for entry in collection["transforms"].values():
            if (entry["parent"], entry["child"]) == edge:
                entry["trans"] = [step_m * i, 0.0, 0.0]
    if add_tf:
        document["calibration_config"]["additional_tfs"] = {
            "odom": {"parent_link": edge[0], "child_link": edge[1]}
        }
    return edge


def test_an_edge_that_differs_between_collections_is_multiple_and_an_additional_tf_is_told(
    untyped, read
):
    edge = driven(untyped, 0.5)
    dataset = read(untyped)
    assert dataset.edge_types == {edge: MULTIPLE}
    (told,) = [w for w in dataset.warnings if "additional tf" in w]
    assert "'odom' moves" in told and "-".join(edge) in told and "'fixed'" in told


def test_what_interpolation_leaves_does_not_move(untyped, read):
    driven(untyped, 1e-8)
    dataset = read(untyped)
    assert dataset.edge_types == {} and not dataset.warnings


def test_a_quaternion_and_its_negative_are_one_pose(untyped, read):
    driven(untyped, 0.0)
    last = list(untyped["collections"].values())[-1]
    for entry in last["transforms"].values():
        entry["quat"] = [-q for q in entry["quat"]]
    assert read(untyped).edge_types == {}


def test_nothing_is_told_where_no_additional_tf_moves(untyped, read):
    edge = driven(untyped, 0.5, add_tf=False)
    dataset = read(untyped)
    assert dataset.edge_types == {edge: MULTIPLE} and not dataset.warnings


def test_a_stored_type_is_believed_and_an_additional_tf_that_contradicts_it_is_told(document, read):
    edge = driven(document, 0.5)
    for entry in document["transforms"].values():
        entry["type"] = "fixed"
    dataset = read(document)
    assert dataset.edge_types[edge] == "fixed"
    (told,) = dataset.warnings
    assert "'odom' has the type 'fixed'" in told and "'multiple'" in told
    driven(document, 1e-4, add_tf=False)
    assert not read(document).warnings


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_what_hangs_on_a_joint_that_no_number_places_has_a_pose_in_each_collection(
    document, read, kind
):
    """A dataset has the types of the description's joints; such ones carry odometry."""
    edge = driven(document, 0.5)
    document["transforms"]["-".join(edge)]["type"] = kind
    assert read(document).edge_types[edge] == MULTIPLE
    driven(document, 0.0)
    assert read(document).edge_types[edge] == kind


@pytest.mark.parametrize("kind", [None, "absent"])
def test_an_edge_without_a_type_among_others_is_told_by_its_values(document, read, kind):
    edge = driven(document, 0.5)
    name = "-".join(edge)
    if kind is None:
        document["transforms"][name]["type"] = None
    else:
        del document["transforms"][name]
    assert read(document).edge_types[edge] == MULTIPLE


def test_sensors_stand_still_and_boards_are_spoken_of_by_the_configuration(untyped, read):
    dataset = read(untyped)
    (sensor, *_), (pattern,) = dataset.sensors.values(), dataset.patterns.values()
    for i, key in enumerate(dataset.collections):
        moved = np.eye(4)
        moved[0, 3] = i
        dataset = dataset.with_transforms({key: {sensor.edge: moved, board_edge(pattern): moved}})
    assert read(document_of(dataset)).edge_types == {}


def test_which_collections_are_read_does_not_change_what_moves(untyped, tmp_path):
    edge = driven(untyped, 0.5)
    path = tmp_path / "dataset.json"
    path.write_text(dumps(untyped))
    dataset = read_dataset(path, lambda keys: keys[:1])
    assert len(dataset.collections) == 1 and dataset.edge_types == {edge: MULTIPLE}


def test_a_moving_additional_tf_of_an_untyped_train_file_leaves_the_test_its_own_poses(read):
    scene = scenes.hand_eye(0, collections=3)
    (arm,) = [edge for edge, kind in scene.dataset.edge_types.items() if kind == MULTIPLE]
    document = new_document(scene.dataset, name="arm")
    del document["transforms"]
    document["calibration_config"]["additional_tfs"] = {
        "arm": {"parent_link": arm.parent, "child_link": arm.child}
    }
    dataset = read(document)
    assert dict(dataset.config.additional_tfs)
    mixed = mixed_dataset(dataset, dataset)
    for key, collection in mixed.collections.items():
        expected = dataset.collections[key].transforms[arm]
        np.testing.assert_array_equal(collection.transforms[arm], expected)
