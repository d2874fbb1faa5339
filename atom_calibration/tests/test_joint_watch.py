"""Where /joint_states contradicts /tf, that is told, and what hangs on the joint is in doubt."""

import numpy as np
import pytest

pytest.importorskip("rospy")

import rospy
from sensor_msgs.msg import JointState as JointStateMessage
from stand_in_rig import CONFIG, messages
from test_described_bag import URDF

from atom_calibration.collect.joint_watch import JointWatch, position_at
from atom_calibration.nodes.collecting.collect_from_bag import main
from atom_calibration.sources.joint_readings import LiveJoints
from atom_core.io.dataset_json import read_dataset
from atom_core.model.joints import JointState
from atom_core.model.transforms import Edge


def both(make, off_m, topic="/joint_states", stamped=True):
    """Yield the messages of the rig; the arm's slide is read to be elsewhere than /tf has it."""
    for name, message, time_s in messages(make):
        yield name, message, time_s
        if name == "/tf":
            arm_m = message.transforms[0].transform.translation.x
            header = make.header("", time_s if stamped else 0.0)
            told = JointStateMessage(header=header, name=["slide"], position=[arm_m + off_m])
            yield topic, told, time_s


def collected(place, tmp_path, content, *options):
    """Collect with a description of the arm; return the dataset."""
    (tmp_path / "rig.urdf").write_text(URDF)
    place.config.write_text(f"description_file: {tmp_path}/rig.urdf\n{CONFIG}")
    assert main([*place(list(content)), *options]) == 0
    return read_dataset(place.folder / "dataset.json")


@pytest.mark.parametrize("topic", ["/joint_states", "/arm/joint_states"])
@pytest.mark.parametrize("stamped", [True, False])
def test_a_joint_that_is_elsewhere_to_tf_is_in_doubt_with_what_hangs_on_it(
    place, make, tmp_path, capsys, topic, stamped
):
    # the arm moves by 50 mm in half a second: it is judged by more than that
    dataset = collected(place, tmp_path, both(make, 0.12, topic, stamped))
    (caveat,) = dataset.caveats
    assert caveat.sensors == ("lidar",)
    apart = "118.5 mm apart, and /tf counts"  # the LiDAR's stamps are later by 30 ms
    assert "joint 'slide' is at" in caveat.what and apart in caveat.what
    assert capsys.readouterr().err.count(apart) == 1


def test_what_agrees_and_commands_and_a_description_that_counts_are_no_doubt(place, make, tmp_path):
    for content, options in (
        (both(make, 0.0), ()),
        (both(make, 0.12, topic="/arm/command"), ()),
        (both(make, 0.12), ("--description", str(tmp_path / "rig.urdf"), "--overwrite")),
    ):
        options = [*options, *({"--overwrite"} - {*options})]
        assert collected(place, tmp_path, content, *options).caveats == ()


def watched(kind, positions, told, times=2, around=()):
    """Return what is in doubt of a joint that /tf has at positions, and that is told elsewhere."""
    edge, axis = Edge("a", "b"), np.array([0.0, 0.0, 1.0])
    watch = JointWatch(lambda time_s: {"joint": [(time_s, told), *around]})
    for time_s, position in zip(range(times), positions):
        watch.see(float(time_s), {"joint": JointState(edge, kind, axis, position)})
    return watch.doubtful


def test_a_bias_of_a_joint_at_rest_is_noticed_and_turns_do_not_count():
    (doubt,) = watched("revolute", [0.40, 0.40], 0.41)
    assert "0.4000 rad by /tf" in doubt.what and "0.57 deg apart" in doubt.what
    assert doubt.edge == Edge("a", "b") and not doubt.only_its_pose
    assert watched("continuous", [3.0, 3.0], 3.0 - 4 * np.pi) == []
    assert watched("revolute", [3.1415, 3.1415], -3.1415) == []
    assert len(watched("prismatic", [0.1, 0.1], 0.1 + 2 * np.pi)) == 1


def test_one_collection_alone_and_a_joint_that_moves_are_no_doubt():
    assert watched("revolute", [0.40], 0.45) == []
    assert watched("revolute", [0.40, 0.40], 0.41, around=[(0.1, 0.43)]) == []


def test_readings_are_interpolated():
    told = position_at([(1.2, 0.3), (1.0, 0.1)], 1.1)
    assert told.position == pytest.approx(0.2) and told.spread == pytest.approx(0.2)
    assert position_at([], 1.0) is None


def test_live_readings_are_those_about_a_time(monkeypatch, make):
    heard = {}
    monkeypatch.setattr(
        rospy, "Subscriber", lambda topic, _, note, **__: heard.update({topic: note})
    )
    joints = LiveJoints()
    for time_s in (10.0, 10.1, 12.0):
        header = make.header("", time_s)
        told = JointStateMessage(header=header, name=["a", "b"], position=[time_s, np.nan])
        heard["/joint_states"](told)
    assert joints.around(10.0).keys() == {"a"}
    assert [position for _, position in joints.around(10.0)["a"]] == [10.0, 10.1]
