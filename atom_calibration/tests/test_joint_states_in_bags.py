"""Joints of bags are listed, and their positions biased in a copy that is else the same."""

import pytest
import rosbag
import rospy
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from atom_calibration.nodes.bags.joint_states import add_noise, list_joints

TOPIC = "/joint_states"


@pytest.fixture
def bag(tmp_path):
    path = tmp_path / "arm.bag"
    with rosbag.Bag(str(path), "w") as bag:
        for i in range(4):
            time = rospy.Time.from_sec(10.0 + i)
            state = JointState(name=["a", "b"], position=[0.1 * i, -0.2], velocity=[1.0, 2.0])
            bag.write(TOPIC, state, time)
            bag.write("/other", String("x"), time)
        gripper = JointState(name=["finger"], position=[0.5])
        bag.write(TOPIC, gripper, rospy.Time.from_sec(11.5))
    return path


def entries(path):
    with rosbag.Bag(str(path)) as bag:
        return [(topic, message, time) for topic, message, time in bag.read_messages()]


def noise(bag, *words):
    return add_noise(["-bfi", str(bag), *(str(word) for word in words)])


def test_joints_are_listed_with_the_next_command(bag, capsys):
    assert list_joints(["-bfi", str(bag)]) == 0
    out = capsys.readouterr().out
    assert out.splitlines()[:3] == ["a", "b", "finger"]
    assert "-jn a b finger -jb 0 0 0" in out
    assert noise(bag, "-l") == 0 and capsys.readouterr().out == out


def test_only_the_positions_of_these_joints_change(bag, tmp_path, capsys):
    copy = tmp_path / "biased.bag"
    assert noise(bag, "-bfo", copy, "-jn", "b", "-jb", "-0.05") == 0
    assert "4 messages" in capsys.readouterr().out
    old, new = entries(bag), entries(copy)
    assert len(old) == len(new) == 9
    for (topic, before, when), (other, after, then) in zip(old, new):
        assert (topic, when) == (other, then)
        if topic == TOPIC and "b" in before.name:
            assert after.position == pytest.approx([before.position[0], before.position[1] - 0.05])
            assert list(after.velocity) == list(before.velocity)
        else:
            assert str(after) == str(before)


def test_joints_of_a_namespace_are_biased_where_collecting_reads_them(tmp_path, capsys):
    """A robot's own namespace counts; what its arm is told to do, and what is merged, does not."""
    path, copy = tmp_path / "mopi.bag", tmp_path / "biased.bag"
    told = {
        "/mopi/joint_states": JointState(name=["a"], position=[0.1]),
        "/mopi/joint_command": JointState(name=["a"], position=[0.3]),
        "/base/joint_states": JointState(name=["w"], position=[1.0]),
        TOPIC: JointState(name=["w"], position=[1.0]),
    }
    with rosbag.Bag(str(path), "w") as bag:
        for topic, message in told.items():
            bag.write(topic, message, rospy.Time.from_sec(10.0))
    assert list_joints(["-bfi", str(path)]) == 0
    assert sorted(capsys.readouterr().out.splitlines()[:2]) == ["a", "w"]
    assert noise(path, "-bfo", copy, "-jn", "a", "w", "-jb", "0.5", "0.25") == 0
    assert "2 messages of " in capsys.readouterr().out
    found = {topic: message.position[0] for topic, message, _ in entries(copy)}
    assert found == {
        "/mopi/joint_states": pytest.approx(0.6),
        "/mopi/joint_command": 0.3,
        "/base/joint_states": 1.0,
        TOPIC: 1.25,
    }


def test_a_bag_without_joints_is_refused(tmp_path, capsys):
    path = tmp_path / "still.bag"
    with rosbag.Bag(str(path), "w") as bag:
        bag.write("/other", String("x"), rospy.Time.from_sec(10.0))
    assert list_joints(["-bfi", str(path)]) == 2
    assert "no topic of sensor_msgs/JointState" in capsys.readouterr().err


def test_that_tf_has_no_bias_is_told_with_the_option_that_uses_it(bag, tmp_path, capsys):
    assert noise(bag, "-bfo", tmp_path / "biased.bag", "-jn", "b", "-jb", "-0.05") == 0
    assert "--description" not in capsys.readouterr().out
    with rosbag.Bag(str(bag), "a") as opened:
        opened.write("/tf", TFMessage([TransformStamped()]), rospy.Time.from_sec(11.0))
    assert noise(bag, "-bfo", tmp_path / "with_tf.bag", "-jn", "b", "-jb", "-0.05") == 0
    told = capsys.readouterr().out
    assert "/tf still has the robot without the bias" in told and "--description" in told


def test_what_cannot_be_biased_is_refused(bag, tmp_path, capsys):
    copy = tmp_path / "biased.bag"
    for words, said in (
        (["-bfo", copy, "-jn", "c", "-jb", "1"], "no joint 'c'; there are: a, b, finger"),
        (["-bfo", copy, "-jn", "a", "b", "-jb", "1"], "names 2 joints and -jb 1"),
        (["-bfo", copy], "with -jn and -jb"),
        (["-bfo", bag, "-ow", "-jn", "a", "-jb", "1"], "is the input"),
        (["-bfo", bag, "-jn", "a", "-jb", "1"], "exists already"),
    ):
        capsys.readouterr()
        assert noise(bag, *words) == 2
        error = capsys.readouterr().err
        assert said in error and error.count("\n") == 1
    assert not copy.exists()
    assert list_joints(["-bfi", str(tmp_path / "no.bag")]) == 2
