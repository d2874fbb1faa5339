"""Errors of edges, boards and joints against the truth: signs, axes, which are told and how."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.evaluation.edge_errors import edge_errors, joint_errors, pose_error
from atom_core.geometry import se3
from atom_core.model.config import EdgeConfig
from atom_core.model.dataset import board_edge
from atom_core.model.transforms import Edge
from atom_core.model.truth import Truth, truth_of
from atom_core.synthetic import Noise, arm
from atom_core.synthetic.scenes import hand_eye, shared_edge, two_cameras

SMALL = {"collections": 3, "noise": Noise.none()}
BASE = Edge("world", "rig_base")
OFF = {"elbow": {"position_bias": 0.02, "origin_z": 0.003}, "telescope": {"position_bias": -0.004}}


@pytest.fixture(scope="module")
def scene():
    return two_cameras(0, **SMALL)


@pytest.fixture(scope="module")
def on_arm():
    return arm.camera_on_arm(1, errors=OFF, **SMALL).dataset


def shifted(dataset, edge, shift_m, keys=None):
    """Return the dataset with an edge shifted along its parent's axes in some collections."""
    move = se3.transform(np.eye(3), np.array(shift_m))
    keys = dataset.collections if keys is None else keys
    return dataset.with_transforms(
        {key: {edge: move @ dataset.collections[key].transforms[edge]} for key in keys}
    )


def of(errors, name):
    return [error for error in errors if error.name == name]


def test_an_error_is_found_minus_true_along_and_about_the_parent_s_axes():
    true = se3.random_move(1.0, 1.2, np.random.default_rng(0))
    turn_rad, shift_m = np.array([0.02, -0.03, 0.06]), np.array([0.1, 0.2, -0.2])
    turned = se3.rotation_from_rotation_vector(turn_rad) @ true[:3, :3]
    error = pose_error(true, se3.transform(turned, true[:3, 3] + shift_m))
    np.testing.assert_allclose(error.turn_rad, turn_rad, atol=1e-12)
    np.testing.assert_allclose(error.shift_m, shift_m, atol=1e-12)
    assert error.translation_m == pytest.approx(0.3)
    assert error.rotation_rad == pytest.approx(0.07)


def test_truth_and_result_in_each_other_s_place_turn_the_sign():
    rng = np.random.default_rng(1)
    one, other = se3.random_move(1.0, 1.0, rng), se3.random_move(1.0, 1.0, rng)
    there, back = pose_error(one, other), pose_error(other, one)
    np.testing.assert_allclose(there.shift_m, -back.shift_m)
    np.testing.assert_allclose(there.turn_rad, -back.turn_rad, atol=1e-12)


def test_an_edge_with_one_value_has_one_error_before_and_one_after(scene):
    edge = scene.dataset.sensors["rgb_2"].edge
    initial = shifted(scene.dataset, edge, [0.0, 0.3, 0.4])
    solved = shifted(scene.dataset, edge, [0.0, 0.0, -0.02])
    (error,) = of(edge_errors(initial, solved, scene.truth), "rgb_2")
    assert (error.edge, error.collection) == (edge, None)
    assert error.before.translation_m == pytest.approx(0.5)
    np.testing.assert_allclose(error.after.shift_m, [0.0, 0.0, -0.02], atol=1e-12)


def test_an_edge_of_a_single_collection_has_one_value(scene):
    first = next(iter(scene.dataset.collections))
    edge, alone = scene.dataset.sensors["rgb_2"].edge, scene.dataset.selected(collections=[first])
    solved = shifted(alone, edge, [0.0, 0.01, 0.0])
    (error,) = of(edge_errors(alone, solved, scene.truth), "rgb_2")
    assert error.collection is None and error.after.translation_m == pytest.approx(0.01)


def test_an_edge_that_is_off_in_one_collection_has_an_error_in_each(scene):
    edge, keys = scene.dataset.sensors["rgb_2"].edge, list(scene.dataset.collections)
    solved = shifted(scene.dataset, edge, [0.01, 0.0, 0.0], keys[-1:])
    errors = of(edge_errors(scene.dataset, solved, scene.truth), "rgb_2")
    assert [error.collection for error in errors] == keys
    sizes_m = [error.after.translation_m for error in errors]
    assert sizes_m == pytest.approx([0.0, 0.0, 0.01])


def test_a_truth_that_moves_has_an_error_in_each_collection_though_the_result_stands(scene):
    edge, keys = scene.dataset.sensors["rgb_2"].edge, list(scene.dataset.collections)
    true = scene.truth.edges[edge]
    moving = {(edge, keys[0]): se3.transform(np.eye(3), np.array([0.0, 0.2, 0.0])) @ true}
    errors = of(
        edge_errors(scene.dataset, scene.dataset, replace(scene.truth, moving=moving)), "rgb_2"
    )
    assert [error.collection for error in errors] == keys
    np.testing.assert_allclose(errors[0].after.shift_m, [0.0, -0.2, 0.0], atol=1e-12)


def test_a_collection_without_the_edge_is_left_out_and_the_next_one_told(scene):
    edge, keys = scene.dataset.sensors["rgb_2"].edge, list(scene.dataset.collections)
    solved = shifted(scene.dataset, edge, [0.01, 0.0, 0.0], keys[-1:])
    bare = without_edge(solved, keys[1], edge)
    errors = of(edge_errors(scene.dataset, bare, scene.truth), "rgb_2")
    assert [error.collection for error in errors] == [keys[0], keys[2]]


def without_edge(dataset, key, edge):
    collection = dataset.collections[key]
    kept = {e: m for e, m in collection.transforms.items() if e != edge}
    changed = {**dataset.collections, key: replace(collection, transforms=kept)}
    return replace(dataset, collections=changed)


def test_what_had_no_value_before_has_no_error_before(scene):
    edge, first = scene.dataset.sensors["rgb_2"].edge, next(iter(scene.dataset.collections))
    initial = without_edge(scene.dataset, first, edge)
    (error,) = of(edge_errors(initial, scene.dataset, scene.truth), "rgb_2")
    assert error.before is None and error.after.translation_m == pytest.approx(0.0)


def test_edges_that_the_truth_does_not_know_are_left_out(scene):
    edge = scene.dataset.sensors["rgb_2"].edge
    known = Truth({edge: scene.truth.edges[edge]})
    assert [e.name for e in edge_errors(scene.dataset, scene.dataset, known)] == ["rgb_2"]
    assert edge_errors(scene.dataset, scene.dataset, Truth({})) == []


def test_sensors_on_one_edge_and_an_additional_tf_share_its_line():
    shared = shared_edge(0, **SMALL)
    edge = shared.dataset.sensors["rgb_2"].edge
    extra = {
        "base": EdgeConfig(parent_link=BASE.parent, child_link=BASE.child),
        "device": EdgeConfig(parent_link=edge.parent, child_link=edge.child),
    }
    config = replace(shared.dataset.config, additional_tfs=extra)
    dataset = replace(shared.dataset, config=config)
    truth = replace(truth_of(dataset), boards={})
    found = edge_errors(dataset, dataset, truth)
    assert [e.name for e in found] == ["rgb_1", "rgb_2, depth_1, device", "base"]
    assert [e.edge for e in found] == [dataset.sensors["rgb_1"].edge, edge, BASE]


def with_boards(scene):
    (pattern,) = scene.dataset.patterns.values()
    edge = board_edge(pattern)
    return edge, scene.dataset.with_transforms(
        {key: {edge: scene.truth.boards["pattern_1", key]} for key in scene.dataset.collections}
    )


def test_boards_that_are_moved_have_an_error_in_each_collection(scene):
    edge, dataset = with_boards(scene)
    keys = list(dataset.collections)
    solved = shifted(dataset, edge, [0.0, 0.0, 0.05], keys[:1])
    errors = of(edge_errors(scene.dataset, solved, scene.truth), "pattern_1")
    assert [error.collection for error in errors] == keys
    assert [e.after.translation_m for e in errors] == pytest.approx([0.05, 0.0, 0.0])
    assert all(error.before is None and error.edge == edge for error in errors)


def test_a_board_that_stands_has_one_error():
    fixed = hand_eye(0, **SMALL)
    edge, dataset = with_boards(fixed)
    solved = shifted(dataset, edge, [0.0, 0.04, 0.03])
    (error,) = of(edge_errors(dataset, solved, fixed.truth), "pattern_1")
    assert error.collection is None
    assert error.before.translation_m == pytest.approx(0.0)
    assert error.after.translation_m == pytest.approx(0.05)


def test_boards_of_collections_that_were_not_solved_and_of_other_patterns_stay_out(scene):
    _, dataset = with_boards(scene)
    keys = list(dataset.collections)
    fewer = dataset.selected(collections=keys[1:])
    boards = {**scene.truth.boards, ("other", keys[2]): np.eye(4)}
    errors = edge_errors(dataset, fewer, replace(scene.truth, boards=boards))
    assert [e.collection for e in errors if e.name == "pattern_1"] == keys[1:]
    assert not of(errors, "other")


# ------------------------------------------------------------------------------------- joints


def corrected(dataset):
    """Return the parameters of the joints as they truly are, those that are off first."""
    names = [*OFF, *(name for name in arm.JOINT_NAMES if name not in OFF)]
    return {
        name: {
            p: v + OFF.get(name, {}).get(p, 0.0) for p, v in dataset.joint(name).parameters.items()
        }
        for name in names
    }


def test_joints_that_were_off_are_told_parameter_by_parameter_in_their_units(on_arm):
    errors = joint_errors(on_arm, on_arm, Truth({}, joints=corrected(on_arm)))
    found = {(e.joint, e.parameter): (e.unit, e.before, e.after) for e in errors}
    assert set(found) == {(name, p) for name, values in OFF.items() for p in values}
    for (name, parameter), (unit, before, after) in found.items():
        assert before == after == pytest.approx(-OFF[name][parameter])
        assert unit == ("rad" if (name, parameter) == ("elbow", "position_bias") else "m")


def test_a_joint_s_error_is_found_minus_true_before_and_after(on_arm):
    solved = on_arm.with_joint_parameters({"elbow": {"position_bias": 0.025}})
    truth = Truth({}, joints={"elbow": {"position_bias": 0.02}})
    (error,) = joint_errors(on_arm, solved, truth)
    assert (error.before, error.after) == (pytest.approx(-0.02), pytest.approx(0.005))


def test_a_joint_that_only_became_wrong_or_right_is_told(on_arm):
    changed = on_arm.with_joint_parameters({"elbow": {"position_bias": 0.025}})
    truth = Truth({}, joints={"elbow": {"position_bias": 0.0}})
    (worse,) = joint_errors(on_arm, changed, truth)
    (better,) = joint_errors(changed, on_arm, truth)
    assert (worse.before, worse.after) == (0.0, 0.025)
    assert (better.before, better.after) == (0.025, 0.0)


def test_joints_that_were_never_off_or_that_no_collection_knows_stay_out(on_arm):
    truth = Truth({}, joints={"unknown": {"position_bias": 1.0}, **corrected(on_arm)})
    told = {error.joint for error in joint_errors(on_arm, on_arm, truth)}
    assert told == set(OFF)
    assert joint_errors(on_arm, on_arm, truth_of(on_arm)) == []
