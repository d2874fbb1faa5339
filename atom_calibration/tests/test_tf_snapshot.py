"""Transforms of a bag: interpolated, each at its own time, and no guesses in gaps."""

import numpy as np
import pytest
from tf2_msgs.msg import TFMessage

from atom_calibration.errors import TransformError
from atom_calibration.sources.bag_reader import BagReader
from atom_calibration.sources.bag_transforms import BagTransforms
from atom_calibration.sources.transform_tree import TransformTree, edges_at
from atom_core.geometry import se3
from atom_core.model.transforms import Edge


def shifted(x, y=0.0, z=0.0, yaw=0.0):
    return se3.from_rpy(np.array([x, y, z]), np.array([0.0, 0.0, yaw]))


BASE_T_CAM = shifted(0.0, 1.0, yaw=0.5)
BASE_T_LIDAR = shifted(0.0, 0.0, 2.0)


@pytest.fixture
def bag(make, tmp_path):
    """world -> base moves with 1 m/s; no pose of it between 3 s and 6 s."""
    messages = [
        ("/tf_static", make.tf("base", "cam", BASE_T_CAM, 0.5), 0.5),
        ("/tf_static", make.tf("base", "lidar", BASE_T_LIDAR, 0.5), 0.5),
        ("/tf_static", make.tf("elsewhere", "island", np.eye(4), 0.5), 0.5),
    ]
    times = [t for t in np.arange(1.0, 9.01, 0.5) if not 3.0 < t < 6.0]
    messages += [("/tf", make.tf("world", "base", shifted(t), t), t + 0.05) for t in times]
    with BagReader(make.bag(tmp_path / "a.bag", messages)) as reader:
        yield reader


@pytest.mark.parametrize("time_s", [1.0, 2.0, 2.2, 7.75, 9.0])
def test_poses_are_interpolated(bag, time_s):
    tree = BagTransforms(bag).at(time_s)
    world_T_cam = shifted(time_s) @ BASE_T_CAM
    np.testing.assert_allclose(tree.lookup("world", "cam", time_s), world_T_cam, atol=1e-9)


def test_between_two_branches_the_chain_goes_through_their_common_frame(bag):
    tree = BagTransforms(bag).at(2.0)
    expected = se3.inverse(BASE_T_LIDAR) @ BASE_T_CAM
    np.testing.assert_allclose(tree.lookup("lidar", "cam", 2.0), expected, atol=1e-12)
    np.testing.assert_allclose(
        tree.lookup("cam", "world", 2.0) @ tree.lookup("world", "cam", 2.0), np.eye(4), atol=1e-9
    )


def test_a_gap_is_an_error_that_names_edge_and_times(bag):
    with pytest.raises(TransformError, match=r"'world-base' near time 4\.500.*3\.000.*6\.000"):
        BagTransforms(bag).at(4.5).lookup("world", "cam", 4.5)


def test_far_before_the_first_and_after_the_last_pose_there_is_none(bag):
    transforms = BagTransforms(bag)
    for time_s in (0.2, 9.8):
        with pytest.raises(TransformError, match="near time"):
            transforms.at(time_s).lookup("world", "cam", time_s)
    assert transforms.at(9.3).lookup("world", "base", 9.3)[0, 3] == pytest.approx(9.0)


def tree_of(make, stamps_s, poses):
    tree = TransformTree()
    for time_s, pose in zip(stamps_s, poses):
        tree.add(make.tf("a", "b", pose, time_s).transforms, fixed=False)
    return tree


def test_a_fixed_pose_that_is_repeated_each_second_or_so_has_no_gaps(make):
    stamps_s = 1.7e9 + np.cumsum(1.0 + np.abs(np.random.default_rng(0).normal(0.0, 0.01, 20)))
    tree = tree_of(make, stamps_s, [BASE_T_CAM] * 20)
    for time_s in np.arange(stamps_s[0] - 0.9, stamps_s[-1] + 0.9, 0.1):
        np.testing.assert_allclose(tree.lookup("a", "b", time_s), BASE_T_CAM, atol=1e-9)


def test_a_longer_gap_and_one_after_which_the_pose_differs_stay_errors(make):
    far = tree_of(make, [1.0, 3.6], [BASE_T_CAM] * 2)
    moved = tree_of(make, [1.0, 2.1], [BASE_T_CAM, BASE_T_CAM @ shifted(1e-6)])
    quick = tree_of(make, [1.0, 1.1], [BASE_T_CAM] * 2)  # tells nothing of a second later
    for tree, time_s in ((far, 2.0), (moved, 1.5), (moved, 0.3), (quick, 2.0), (quick, 0.4)):
        with pytest.raises(TransformError, match="no pose of 'a-b' near time"):
            tree.lookup("a", "b", time_s)


def test_an_unknown_frame_and_one_that_hangs_elsewhere_are_told_apart(bag):
    tree = BagTransforms(bag).at(2.0)
    with pytest.raises(TransformError, match="frame 'nowhere' is in no message"):
        tree.lookup("world", "nowhere", 2.0)
    with pytest.raises(TransformError, match="no transform connects"):
        tree.lookup("world", "island", 2.0)


@pytest.mark.parametrize("time_s", [1.0, 39.0])
def test_transforms_that_begin_late_or_end_early_are_told_with_their_times(make, tmp_path, time_s):
    messages = [
        ("/tf_static", make.tf("base", "cam", BASE_T_CAM, 0.5), 0.5),
        ("/tf_static", make.tf("world", "lidar", BASE_T_LIDAR, 0.5), 0.5),
    ]
    messages += [("/tf", make.tf("world", "base", shifted(t), t), t) for t in (15.0, 15.5, 16.0)]
    wanted = "/tf has no pose of 'world-base' near this time.* from time 15.000 to 16.000"
    with BagReader(make.bag(tmp_path / "a.bag", messages)) as reader:
        tree = BagTransforms(reader).at(time_s)
        for frame in ("cam", "base"):
            with pytest.raises(TransformError, match=wanted):
                tree.lookup("lidar", frame, time_s)
        with pytest.raises(TransformError, match="frame 'nowhere' is in no message"):
            tree.lookup("world", "nowhere", time_s)


def test_the_edges_of_a_collection_are_those_connected_each_at_its_sensors_time(make, bag):
    tree = BagTransforms(bag).at(2.0)
    edges = edges_at(tree, "world", {"cam": 2.0, "lidar": 2.4})
    assert set(edges) == {Edge("world", "base"), Edge("base", "cam"), Edge("base", "lidar")}
    assert edges[Edge("world", "base")][0, 3] == pytest.approx(2.2)  # the mean: both hang on it


def test_two_sensors_on_arms_of_their_own_have_transforms_at_their_own_stamps(make):
    tree = TransformTree()
    for time_s in (1.0, 2.0):
        for child in ("cam", "lidar"):
            tree.add(make.tf("world", child, shifted(time_s), time_s).transforms, fixed=False)
    edges = edges_at(tree, "world", {"cam": 1.25, "lidar": 1.75})
    assert edges[Edge("world", "cam")][0, 3] == pytest.approx(1.25)
    assert edges[Edge("world", "lidar")][0, 3] == pytest.approx(1.75)


def test_a_bag_without_tf_is_refused(make, tmp_path):
    path = make.bag(tmp_path / "b.bag", [("/points", make.xyz_cloud(np.ones((3, 3))), 1.0)])
    with BagReader(path) as reader, pytest.raises(TransformError, match="neither /tf nor"):
        BagTransforms(reader)


@pytest.mark.parametrize("empty", [1, 30])
def test_messages_without_transforms_tell_no_clock(make, tmp_path, empty):
    nothing = [("/tf", TFMessage([]), 1.0 + 0.01 * n) for n in range(empty)]
    late = [("/tf", make.tf("world", "base", shifted(t), t), t + 90.0) for t in (2.0, 2.5)]
    with BagReader(make.bag(tmp_path / "a.bag", [*nothing, *late])) as reader:
        transforms = BagTransforms(reader)
        assert transforms.moving and transforms.lag_s == pytest.approx(90.0)
        assert transforms.at(2.2).lookup("world", "base", 2.2)[0, 3] == pytest.approx(2.2)
    with BagReader(make.bag(tmp_path / "b.bag", nothing)) as reader:
        assert not BagTransforms(reader).moving


def test_poses_older_than_the_span_are_forgotten(make):
    tree = TransformTree(span_s=5.0)
    for stamp_s in np.arange(0.0, 100.0, 0.1):
        tree.add(make.tf("world", "arm", shifted(stamp_s), stamp_s).transforms, fixed=False)
    edge = Edge("world", "arm")
    np.testing.assert_allclose(tree.edge(edge, 97.33), shifted(97.33), atol=1e-6)
    with pytest.raises(TransformError, match="no pose of 'world-arm' near time 50.000"):
        tree.edge(edge, 50.0)
    assert len(tree._stamps[edge]) <= 101


def test_poses_may_come_in_any_order(make):
    tree = TransformTree()
    for stamp_s in (3.0, 1.0, 2.0, 2.5, 1.5):
        tree.add(make.tf("world", "arm", shifted(stamp_s), stamp_s).transforms, fixed=False)
    for time_s in (1.2, 1.7, 2.2, 2.9):
        np.testing.assert_allclose(tree.edge(Edge("world", "arm"), time_s), shifted(time_s))
