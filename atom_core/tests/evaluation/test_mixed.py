"""The test set with the train file's calibration: what is taken from which of the two."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.errors import DatasetError
from atom_core.evaluation.mixed import calibrated_edges, calibrated_joints, mixed_dataset
from atom_core.geometry import se3
from atom_core.model.config import EdgeConfig
from atom_core.model.dataset import MULTIPLE, board_edge
from atom_core.model.transforms import Edge
from atom_core.synthetic import Noise, arm
from atom_core.synthetic.scenes import random_scene

BASE = Edge("world", "rig_base")
OFF = {"elbow": {"position_bias": 0.02}}


@pytest.fixture(scope="module")
def test_set():
    scene = random_scene(0, rgb=2, depth=1, lidar3d=1, collections=3, noise=Noise.none())
    return scene.dataset


@pytest.fixture(scope="module")
def train(test_set):
    """The same rig, calibrated: each sensor's edge elsewhere."""
    rng = np.random.default_rng(0)
    edges = {
        sensor.edge: se3.moved(test_set.first_value(sensor.edge), se3.random_move(0.1, 0.1, rng))
        for sensor in test_set.sensors.values()
    }
    return test_set.with_transforms(dict.fromkeys(test_set.collections, edges))


@pytest.fixture(scope="module")
def on_arm():
    return arm.camera_on_arm(1, errors=OFF, collections=2, noise=Noise.none()).dataset


def without_edge(dataset, key, edge):
    collection = dataset.collections[key]
    kept = {e: m for e, m in collection.transforms.items() if e != edge}
    changed = {**dataset.collections, key: replace(collection, transforms=kept)}
    return replace(dataset, collections=changed)


def with_additional(dataset, edge):
    entry = EdgeConfig(parent_link=edge.parent, child_link=edge.child)
    return replace(dataset, config=replace(dataset.config, additional_tfs={"extra": entry}))


def with_value(dataset, edge, value, keys=None):
    keys = dataset.collections if keys is None else keys
    return dataset.with_transforms({key: {edge: value} for key in keys})


def test_edges_of_sensors_come_from_the_train_file_and_all_others_stay(train, test_set):
    mixed = mixed_dataset(train, test_set)
    estimated = {sensor.edge for sensor in test_set.sensors.values()}
    for key, collection in mixed.collections.items():
        for edge, value in collection.transforms.items():
            source = train if edge in estimated else test_set
            np.testing.assert_array_equal(value, source.collections[key].transforms[edge])
        assert collection.labels == test_set.collections[key].labels


def test_boards_stay_the_test_s_own(train, test_set):
    (pattern,) = test_set.patterns.values()
    edge = board_edge(pattern)
    train = with_value(train, edge, np.diag([-1.0, -1.0, 1.0, 1.0]))
    mixed = mixed_dataset(train, with_value(test_set, edge, np.eye(4)))
    for collection in mixed.collections.values():
        np.testing.assert_array_equal(collection.transforms[edge], np.eye(4))


def test_an_additional_tf_of_the_train_file_is_taken(train, test_set):
    value = se3.random_move(0.5, 0.5, np.random.default_rng(1))
    moved = with_value(train, BASE, value)
    assert BASE not in calibrated_edges(moved, test_set)
    np.testing.assert_array_equal(
        calibrated_edges(with_additional(moved, BASE), test_set)[BASE], value
    )
    assert BASE not in calibrated_edges(moved, with_additional(test_set, BASE))


def test_the_value_is_that_of_the_first_train_collection_which_has_the_edge(train, test_set):
    edge, (first, second, _) = train.sensors["rgb_2"].edge, train.collections
    values = {
        key: se3.random_move(i + 1.0, 0.1, np.random.default_rng(i))
        for i, key in enumerate(train.collections)
    }
    varied = train.with_transforms({key: {edge: value} for key, value in values.items()})
    assert calibrated_edges(varied, test_set)[edge] is values[first]
    bare = without_edge(varied, first, edge)
    assert calibrated_edges(bare, test_set)[edge] is values[second]


def test_an_edge_that_no_train_collection_has_is_refused(train, test_set):
    edge = train.sensors["rgb_2"].edge
    for key in train.collections:
        train = without_edge(train, key, edge)
    with pytest.raises(DatasetError, match=f"transform '{edge}' is in no collection"):
        mixed_dataset(train, test_set)


def with_type_multiple(dataset, edge):
    return replace(dataset, edge_types={**dataset.edge_types, edge: MULTIPLE})


@pytest.mark.parametrize("in_train", [True, False])
def test_an_additional_tf_of_type_multiple_in_either_file_stays_and_the_others_are_taken(
    train, test_set, in_train
):
    train = with_additional(train, BASE)
    if in_train:
        train = with_type_multiple(train, BASE)
    else:
        test_set = with_type_multiple(test_set, BASE)
    of_sensors = {sensor.edge for sensor in test_set.sensors.values()}
    assert set(calibrated_edges(train, test_set)) == of_sensors


@pytest.mark.parametrize("files", [("train",), ("test",), ("train", "test")])
def test_a_sensors_edge_is_estimated_as_one_whatever_type_it_has(train, test_set, files):
    edge = test_set.sensors["rgb_1"].edge
    if "train" in files:
        train = with_type_multiple(train, edge)
    if "test" in files:
        test_set = with_type_multiple(test_set, edge)
    found = calibrated_edges(train, test_set)[edge]
    np.testing.assert_array_equal(found, train.first_value(edge))


def test_a_sensors_edge_that_the_train_file_held_where_it_moved_stays_the_tests_own(
    train, test_set
):
    edge, (first, *_) = test_set.sensors["rgb_1"].edge, train.collections
    moved = with_value(with_type_multiple(train, edge), edge, np.eye(4), [first])
    assert edge not in calibrated_edges(moved, test_set)
    assert edge not in calibrated_edges(moved, with_type_multiple(test_set, edge))


def test_sensors_that_only_the_train_file_has_give_no_edge(train, test_set):
    fewer = test_set.selected(sensors=["rgb_1", "depth_1"])
    edges = {test_set.sensors[name].edge for name in fewer.sensors}
    assert set(calibrated_edges(train, fewer)) == edges


# ------------------------------------------------------------------------------ which sensors


def with_camera(dataset, sensor, factor):
    old = dataset.sensors[sensor]
    camera = replace(old.camera, K=old.camera.K * [[factor], [1.0], [1.0]])
    return replace(dataset, sensors={**dataset.sensors, sensor: replace(old, camera=camera)})


def test_intrinsics_come_from_the_train_file_and_the_rest_of_a_sensor_from_the_test(
    train, test_set
):
    better = with_camera(train, "rgb_2", 1.01)
    old = test_set.sensors["rgb_2"]
    other = replace(test_set, sensors={**test_set.sensors, "rgb_2": replace(old, topic="/other")})
    mixed = mixed_dataset(better, other)
    assert mixed.sensors["rgb_2"].camera is better.sensors["rgb_2"].camera
    assert mixed.sensors["rgb_2"].topic == "/other"
    assert list(mixed.sensors) == list(test_set.sensors)


def test_only_sensors_that_are_asked_for_remain_in_the_test_s_order(train, test_set):
    mixed = mixed_dataset(train, test_set, ["lidar_1", "rgb_1"])
    assert list(mixed.sensors) == ["rgb_1", "lidar_1"]
    assert list(mixed_dataset(train, test_set, []).sensors) == []


@pytest.mark.parametrize("lacking", ["train", "test"])
def test_a_sensor_that_one_file_lacks_is_refused_only_if_it_is_asked_for(train, test_set, lacking):
    names = [name for name in test_set.sensors if name != "rgb_2"]
    files = {"train": train, "test": test_set}
    files[lacking] = files[lacking].selected(sensors=names)
    for asked in (None, ["rgb_1", "rgb_2"]):
        with pytest.raises(DatasetError, match="sensor 'rgb_2' of .* is absent.*'!rgb_2'"):
            mixed_dataset(files["train"], files["test"], asked)
    assert list(mixed_dataset(files["train"], files["test"], names).sensors) == names


def test_the_last_sensor_is_looked_at_as_well_as_the_first(train, test_set):
    fewer = train.selected(sensors=[name for name in train.sensors if name != "lidar_1"])
    with pytest.raises(DatasetError, match="sensor 'lidar_1'"):
        mixed_dataset(fewer, test_set)


def test_a_sensor_of_another_modality_is_refused_with_both(train, test_set):
    other = replace(train.sensors["rgb_2"], modality="depth")
    train = replace(train, sensors={**train.sensors, "rgb_2": other})
    why = "sensor 'rgb_2' is depth in the train file and rgb in the test file"
    with pytest.raises(DatasetError, match=why):
        mixed_dataset(train, test_set)


def test_a_sensor_on_another_edge_is_refused_with_both(train, test_set):
    edge = test_set.sensors["rgb_2"].edge
    other = replace(test_set.sensors["rgb_2"], edge=edge._replace(child="elsewhere"))
    test_set = replace(test_set, sensors={**test_set.sensors, "rgb_2": other})
    why = f"train file estimates edge '{edge}', the test file '{edge.parent}-elsewhere'"
    with pytest.raises(DatasetError, match=why):
        mixed_dataset(train, test_set)


# ------------------------------------------------------------------------------------- joints


def without_joint(dataset, key, name):
    collection = dataset.collections[key]
    kept = {n: joint for n, joint in collection.joints.items() if n != name}
    changed = {**dataset.collections, key: replace(collection, joints=kept)}
    return replace(dataset, collections=changed)


def test_joints_with_the_same_description_are_left_alone(on_arm):
    assert calibrated_joints(on_arm, on_arm) == {}


def test_a_joint_that_the_train_file_describes_otherwise_is_taken_with_its_transforms(on_arm):
    train = on_arm.with_joint_parameters({"elbow": {"position_bias": 0.02}})
    assert calibrated_joints(train, on_arm) == {"elbow": train.joint("elbow").parameters}
    mixed = mixed_dataset(train, on_arm)
    for key, collection in mixed.collections.items():
        joint = collection.joints["elbow"]
        assert joint.parameters["position_bias"] == 0.02
        assert joint.position == on_arm.collections[key].joints["elbow"].position
        expected = train.collections[key].transforms[joint.edge]
        np.testing.assert_allclose(collection.transforms[joint.edge], expected)
        others = [n for n in arm.JOINT_NAMES if n != "elbow"]
        for name in others:
            edge = collection.joints[name].edge
            same = on_arm.collections[key].transforms[edge]
            np.testing.assert_array_equal(collection.transforms[edge], same)


@pytest.mark.parametrize("place", [0, 1])
def test_a_test_collection_without_the_position_of_a_calibrated_joint_is_named(on_arm, place):
    key = list(on_arm.collections)[place]
    why = f"collection {key} has no position of joint 'elbow'"
    with pytest.raises(DatasetError, match=why):
        calibrated_joints(on_arm, without_joint(on_arm, key, "elbow"))


def test_of_several_such_test_collections_the_first_one_is_named(on_arm):
    bare = on_arm
    for key in on_arm.collections:
        bare = without_joint(bare, key, "elbow")
    first = next(iter(on_arm.collections))
    with pytest.raises(DatasetError, match=f"collection {first} has no position"):
        calibrated_joints(on_arm, bare)


def test_without_the_position_of_a_joint_that_was_not_calibrated_its_description_stays(on_arm):
    first = next(iter(on_arm.collections))
    train = on_arm.with_joint_parameters({"wrist_1": {"position_bias": 0.1}})
    assert set(calibrated_joints(train, on_arm)) == {"wrist_1"}
    assert calibrated_joints(train, without_joint(on_arm, first, "wrist_1")) == {}


def test_a_joint_that_differs_in_one_test_collection_alone_is_taken(on_arm):
    last = list(on_arm.collections)[-1]
    changed = on_arm.with_joint_parameters({"elbow": {"position_bias": 0.3}})
    mixed = replace(on_arm, collections={**on_arm.collections, last: changed.collections[last]})
    assert set(calibrated_joints(on_arm, mixed)) == {"elbow"}


def test_a_joint_that_only_a_later_train_collection_knows_is_taken_too(on_arm):
    first = next(iter(on_arm.collections))
    train = on_arm.with_joint_parameters({"elbow": {"position_bias": 0.02}})
    assert set(calibrated_joints(without_joint(train, first, "elbow"), on_arm)) == {"elbow"}
