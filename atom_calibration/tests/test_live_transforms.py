"""What /tf and /tf_static of a running robot contradict each other in is noticed as in a bag."""

import numpy as np
import pytest

pytest.importorskip("rospy")

import rospy

from atom_calibration.errors import TransformError
from atom_calibration.sources.live_transforms import LiveTransforms
from atom_core.geometry import se3


class Said:
    """The topics of a robot, by name; what is said on them is heard at once."""

    def __init__(self):
        self.heard = {}

    def subscriber(self, topic, _kind, callback, **_):
        self.heard[topic] = callback

    def tf(self, message):
        self.heard["/tf"](message)

    def tf_static(self, message):
        self.heard["/tf_static"](message)


@pytest.fixture
def said(monkeypatch):
    topics = Said()
    monkeypatch.setattr(rospy, "Subscriber", topics.subscriber)
    return topics


def shifted(x_m):
    return se3.transform(np.eye(3), np.array([x_m, 0.0, 0.0]))


def say_two(said, make, begin_s, count=100):
    """Let two programs say at 10 Hz each, by turns, that one frame is in places 5 m apart."""
    for time_s in begin_s + 0.1 * np.arange(count):
        said.tf(make.tf("world", "arm", np.eye(4), time_s))
        said.tf(make.tf("world", "arm", shifted(5.0), time_s + 0.05))


def test_two_publishers_of_one_edge_are_in_doubt_and_it_has_no_pose(said, make):
    transforms = LiveTransforms()
    say_two(said, make, 100.0)
    tree = transforms.at(105.0)
    (doubt,) = transforms.doubtful
    assert "'world-arm' of /tf goes to and fro between two values, 5000.0 mm" in doubt.what
    with pytest.raises(TransformError, match="two programs publish it and contradict each other"):
        tree.lookup("world", "arm", 105.0)


def test_after_time_went_back_there_are_the_transforms_of_before_for_what_was_seen_then(said, make):
    transforms = LiveTransforms()
    for time_s in 100.0 + 0.1 * np.arange(120):
        said.tf(make.tf("world", "arm", shifted(time_s), time_s))
    for time_s in 100.0 + 0.1 * np.arange(3):  # a recording is played again, another one
        said.tf(make.tf("world", "arm", shifted(0.0), time_s))
    last, first = (transforms.at(t).lookup("world", "arm", t) for t in (111.0, 100.1))
    assert last[0, 3] == pytest.approx(111.0) and first[0, 3] == 0.0


def test_once_one_of_them_has_ended_there_are_poses_again(said, make):
    transforms = LiveTransforms()
    say_two(said, make, 100.0)
    for time_s in np.arange(110.0, 115.0, 0.1):
        said.tf(make.tf("world", "arm", np.eye(4), time_s))
    tree = transforms.at(114.0)
    np.testing.assert_allclose(tree.lookup("world", "arm", 114.0), np.eye(4), atol=1e-9)
    assert len(transforms.doubtful) == 1


def test_an_edge_that_stands_in_tf_static_and_moves_in_tf_has_no_pose(said, make):
    transforms = LiveTransforms()
    said.tf_static(make.tf("world", "arm", np.eye(4), 100.0))
    said.tf_static(make.tf("world", "mast", np.eye(4), 100.0))
    for time_s in np.arange(100.0, 110.0, 0.1):
        said.tf(make.tf("world", "arm", shifted(0.1 * (time_s - 100.0)), time_s))
        said.tf(make.tf("world", "mast", np.eye(4), time_s))  # the same: no contradiction
    tree = transforms.at(105.0)
    (doubt,) = transforms.doubtful
    assert "'world-arm' stands still in /tf_static, and moves in /tf" in doubt.what
    with pytest.raises(TransformError, match="stands still in /tf_static"):
        tree.lookup("world", "arm", 105.0)
    np.testing.assert_allclose(tree.lookup("world", "mast", 105.0), np.eye(4))


def test_a_recording_that_is_repeated_contradicts_nothing(said, make):
    transforms = LiveTransforms()
    for _ in range(30):
        for time_s in np.arange(100.0, 110.0, 0.5):
            said.tf(make.tf("world", "arm", shifted(0.1 * (time_s - 100.0)), time_s))
    tree = transforms.at(105.0)
    assert transforms.doubtful == []
    np.testing.assert_allclose(tree.lookup("world", "arm", 105.0), shifted(0.5), atol=1e-6)


def test_what_was_contradicted_counts_no_more_when_time_goes_back(said, make):
    transforms = LiveTransforms()
    say_two(said, make, 200.0)
    transforms.at(205.0)
    for time_s in np.arange(100.0, 105.0, 0.1):
        said.tf(make.tf("world", "arm", shifted(1.0), time_s))
    tree = transforms.at(102.0)
    np.testing.assert_allclose(tree.lookup("world", "arm", 102.0), shifted(1.0), atol=1e-9)
    assert len(transforms.doubtful) == 1  # it is kept with what was collected meanwhile


def test_what_is_no_transform_is_left_out_and_told_once(said, make, monkeypatch):
    told = []
    monkeypatch.setattr(rospy, "logwarn", told.append)
    transforms = LiveTransforms()
    for time_s in np.arange(100.0, 101.0, 0.1):
        said.tf(make.tf("world", "arm", np.eye(4), time_s))
        said.tf(make.tf("world", "ghost", shifted(np.nan), time_s))
        said.tf(make.tf("arm", "arm", np.eye(4), time_s))
    said.tf_static(make.tf("", "mast", np.eye(4), 100.0))
    tree = transforms.at(100.5)
    assert tree.frames == {"world", "arm"}
    assert len(told) == 3 and sum("frame 'arm' stands in itself" in line for line in told) == 1
