"""Corrections of transforms: whose collections they change, undone, reset, saved."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.editing.transform_corrections import TransformCorrections, chosen_edges
from atom_core.errors import SelectionError
from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.model.dataset import board_edge
from atom_core.model.transforms import Edge
from atom_core.synthetic import scenes

ODOMETRY = Edge("world", "odom")
MOVED = se3.from_rpy(np.array([0.4, -0.3, 0.2]), np.array([0.1, -0.5, 2.0]))


def rig():
    """Two cameras, and an odometry that nobody needs and that drifts."""
    dataset = scenes.two_cameras(collections=4).dataset
    drift = {
        key: {ODOMETRY: se3.transform(np.eye(3), np.array([0.1 * number, 0.0, 0.0]))}
        for number, key in enumerate(dataset.collections)
    }
    return dataset.with_transforms(drift)


@pytest.fixture(scope="module")
def dataset():
    return rig()


@pytest.fixture
def mount(dataset):
    return list(dataset.sensors.values())[1].edge


def test_what_moves_is_corrected_in_one_collection_and_what_is_fixed_in_all(dataset, mount):
    corrections = TransformCorrections(dataset, [ODOMETRY, mount])
    keys = list(dataset.collections)
    corrections.turn(1)
    corrections.set(ODOMETRY, MOVED)
    corrections.set(mount, MOVED)
    assert corrections.changed() == {ODOMETRY: [keys[1]], mount: keys}
    for key, collection in corrections.dataset.collections.items():
        np.testing.assert_array_equal(collection.transforms[mount], MOVED)
        before = dataset.collections[key].transforms[ODOMETRY]
        expected = MOVED if key == keys[1] else before
        np.testing.assert_array_equal(collection.transforms[ODOMETRY], expected)


def test_the_type_of_an_edge_counts_more_than_its_values(dataset, mount):
    moving = replace(dataset, edge_types={**dataset.edge_types, mount: "multiple"})
    corrections = TransformCorrections(moving, [mount])
    corrections.set(mount, MOVED)
    assert corrections.changed() == {mount: [corrections.keys[0]]}


def test_a_drag_is_one_step_to_undo_in_whatever_collection(dataset):
    corrections = TransformCorrections(dataset, [ODOMETRY])
    for share in (0.2, 0.6):
        corrections.set(ODOMETRY, se3.transform(np.eye(3), MOVED[:3, 3] * share), dropped=False)
    corrections.set(ODOMETRY, MOVED)
    corrections.turn(2)
    corrections.set(ODOMETRY, MOVED)
    assert corrections.undo()
    assert corrections.changed() == {ODOMETRY: [corrections.keys[0]]}
    assert corrections.undo()
    assert not corrections.changed()
    assert not corrections.undo()


def test_reset_can_be_undone_too(dataset):
    corrections = TransformCorrections(dataset, [ODOMETRY])
    corrections.set(ODOMETRY, MOVED)
    corrections.reset_edge(ODOMETRY)
    assert not corrections.changed()
    corrections.undo()
    np.testing.assert_array_equal(corrections.value(ODOMETRY), MOVED)


def test_collections_go_round(dataset):
    corrections = TransformCorrections(
        dataset, [ODOMETRY], collection=list(dataset.collections)[-1]
    )
    assert corrections.turn(1) == corrections.keys[0]
    assert corrections.turn(-1) == corrections.keys[-1]


def test_a_board_that_the_dataset_does_not_place_starts_where_the_sensors_see_it():
    scene = scenes.two_cameras(collections=3)
    (pattern,) = scene.dataset.patterns.values()
    edge = board_edge(pattern)
    assert all(edge not in c.transforms for c in scene.dataset.collections.values())
    corrections = TransformCorrections(scene.dataset, [], [pattern.name])
    truth = scene.truth.boards[pattern.board_key(corrections.collection)]
    off = np.linalg.inv(truth) @ corrections.value(edge)
    assert np.linalg.norm(off[:3, 3]) < 0.02
    corrections.set(edge, MOVED)
    assert corrections.changed() == {edge: [corrections.keys[0]]}


def test_what_is_saved_reads_back_with_the_corrections_and_nothing_else(dataset, tmp_path):
    path = write_dataset_folder(dataset, tmp_path / "dataset", name="rig")
    before = path.read_bytes()
    corrections = TransformCorrections(read_dataset(path), [ODOMETRY])
    corrections.set(ODOMETRY, MOVED)
    corrected = path.with_name("dataset_corrected.json")
    assert f"{ODOMETRY} in 1 collections" in corrections.save(corrected)
    assert path.read_bytes() == before
    there = read_dataset(corrected)
    for key, collection in read_dataset(path).collections.items():
        for edge, matrix in collection.transforms.items():
            found = there.collections[key].transforms[edge]
            moved = edge == ODOMETRY and key == corrections.keys[0]
            np.testing.assert_allclose(found, MOVED if moved else matrix, atol=1e-12)
        assert there.collections[key].labels.keys() == collection.labels.keys()


def test_what_nobody_saved_is_kept_beside_the_file_and_named(dataset, tmp_path):
    write_dataset_folder(dataset, tmp_path, name="test")
    corrections = TransformCorrections(read_dataset(tmp_path / "dataset.json"), [ODOMETRY])
    output = tmp_path / "dataset_corrected.json"
    assert corrections.keep_unsaved(output) == ""  # nothing was dragged
    corrections.set(ODOMETRY, MOVED)
    corrections.save(output)
    assert corrections.keep_unsaved(output) == ""
    before = output.read_text()
    corrections.turn(1)
    corrections.set(ODOMETRY, MOVED)
    kept = tmp_path / "unsaved_dataset_corrected.json"
    assert f"they are in {kept}: rename it to {output.name}" in corrections.keep_unsaved(output)
    assert output.read_text() == before
    second = read_dataset(kept).collections[corrections.collection]
    np.testing.assert_allclose(second.transforms[ODOMETRY], MOVED, atol=1e-12)


@pytest.mark.parametrize(
    ("edges", "patterns", "collection", "words"),
    [
        ([Edge("world", "nowhere")], [], None, "no edge 'world-nowhere'"),
        ([], ["poster"], None, "no pattern 'poster'"),
        ([ODOMETRY], [], "999", "no collection '999'"),
        ([], [], None, "nothing to correct"),
    ],
)
def test_what_is_not_there_is_refused(dataset, edges, patterns, collection, words):
    with pytest.raises(SelectionError, match=words):
        TransformCorrections(dataset, edges, patterns, collection)


def test_each_parent_has_a_child():
    with pytest.raises(SelectionError, match="2 parents and 1 children"):
        chosen_edges(["a", "b"], ["c"])
