"""Errors of frames as another frame sees them: their axes, their order, what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.errors import DatasetError
from atom_core.evaluation.frames_against_truth import (
    by_angles,
    by_rotation_vector,
    calibrated_frames,
    frame_errors,
    mean_rows,
    row_of,
)
from atom_core.geometry import se3
from atom_core.model.config import EdgeConfig
from atom_core.model.transforms import Edge
from atom_core.synthetic import Noise
from atom_core.synthetic.scenes import hand_eye, shared_edge

BASE = Edge("world", "rig_base")


@pytest.fixture(scope="module")
def scene():
    return hand_eye(0, collections=3, noise=Noise.none())


def moved(dataset, edge, parent_T_parent=None, child_T_child=None):
    """Return the dataset with an edge moved in its parent's axes, or in its child's."""
    before = np.eye(4) if parent_T_parent is None else parent_T_parent
    after = np.eye(4) if child_T_child is None else child_T_child
    return dataset.with_transforms(
        {k: {edge: before @ c.transforms[edge] @ after} for k, c in dataset.collections.items()}
    )


def test_an_error_is_seen_in_the_axes_of_the_frame_that_is_off(scene):
    true, edge = scene.dataset, scene.dataset.sensors["rgb_1"].edge
    off = se3.random_move(0.03, 0.2, np.random.default_rng(0))
    errors = frame_errors(moved(true, edge, child_T_child=off), true, edge.parent, edge.child)
    assert list(errors) == list(true.collections)
    for error in errors.values():
        np.testing.assert_allclose(error, se3.inverse(off), atol=1e-12)


def test_an_error_of_another_collection_does_not_show(scene):
    true, edge = scene.dataset, scene.dataset.sensors["rgb_1"].edge
    first, second, third = true.collections
    off = se3.random_move(0.03, 0.2, np.random.default_rng(0))
    found = true.with_transforms({second: {edge: true.collections[second].transforms[edge] @ off}})
    errors = frame_errors(found, true, "world", edge.child)
    for key in (first, third):
        np.testing.assert_allclose(errors[key], np.eye(4), atol=1e-12)
    np.testing.assert_allclose(errors[second], se3.inverse(off), atol=1e-12)


def test_what_moves_both_frames_alike_is_no_error_between_them(scene):
    true = scene.dataset
    shift = se3.transform(np.eye(3), np.array([0.1, 0.0, 0.0]))
    found = moved(true, BASE, parent_T_parent=shift)
    for error in frame_errors(found, true, "flange", "rgb_1_link").values():
        np.testing.assert_allclose(error, np.eye(4), atol=1e-12)
    for error in frame_errors(found, true, "world", "rgb_1_link").values():
        assert by_rotation_vector(error).translation_m == pytest.approx(0.1)


@pytest.mark.parametrize("target, frame", [("world", "nowhere"), ("nowhere", "world")])
def test_a_frame_that_is_in_no_transform_is_named(scene, target, frame):
    with pytest.raises(
        DatasetError, match="^hand_eye: frame 'nowhere' is in no transform of the dataset"
    ):
        frame_errors(scene.dataset, scene.dataset, target, frame)


def test_calibrated_frames_are_those_of_sensors_then_of_other_edges_each_once():
    dataset = shared_edge(0, collections=1, noise=Noise.none()).dataset
    extra = {
        "base": EdgeConfig(parent_link=BASE.parent, child_link=BASE.child),
        "again": EdgeConfig(*dataset.sensors["rgb_1"].edge),
    }
    dataset = replace(dataset, config=replace(dataset.config, additional_tfs=extra))
    device = dataset.sensors["depth_1"].edge.child
    assert device == dataset.sensors["rgb_2"].edge.child
    assert calibrated_frames(dataset) == ["rgb_1_link", device, "rig_base"]


def test_a_quarter_turn_about_y_reads_the_same_as_vector_and_as_angles():
    turn = se3.rotation_from_rotation_vector(np.array([0.0, 0.5, 0.0]))
    error = se3.transform(turn, np.array([2.0, 3.0, 6.0]))
    for parts in (by_rotation_vector(error), by_angles(error)):
        np.testing.assert_allclose(parts.turn_rad, [0.0, 0.5, 0.0], atol=1e-12)
        np.testing.assert_array_equal(parts.shift_m, [2.0, 3.0, 6.0])
        assert parts.translation_m == pytest.approx(7.0)


def test_a_turn_is_given_back_by_its_vector_or_by_roll_pitch_yaw():
    vector_rad, rpy_rad = np.array([0.3, -0.2, 0.9]), np.array([0.3, -0.2, 0.9])
    of_vector = se3.transform(se3.rotation_from_rotation_vector(vector_rad), np.ones(3))
    np.testing.assert_allclose(by_rotation_vector(of_vector).turn_rad, vector_rad, atol=1e-12)
    np.testing.assert_allclose(by_angles(se3.from_rpy(np.ones(3), rpy_rad)).turn_rad, rpy_rad)
    assert np.max(np.abs(by_angles(of_vector).turn_rad - vector_rad)) > 0.01


def test_a_row_has_both_sizes_first_then_shift_then_turn():
    error = by_angles(se3.from_rpy(np.array([0.0, -3.0, 4.0]), np.array([0.1, 0.2, 0.3])))
    row = row_of(error, 0.7)
    assert row == pytest.approx([5.0, 0.7, 0.0, -3.0, 4.0, 0.1, 0.2, 0.3])
    assert {type(value) for value in row} == {float}


def test_rows_are_averaged_column_by_column():
    found = mean_rows([[1.0, -1.0, 10.0], [3.0, 1.0, 40.0]])
    assert found == [2.0, 0.0, 25.0]
    assert mean_rows([[4.0, 5.0]]) == [4.0, 5.0]
