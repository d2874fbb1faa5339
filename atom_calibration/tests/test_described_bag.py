"""A bag without /tf: its transforms are those of the description, moved by /joint_states."""

import numpy as np
import pytest
import rospy
from sensor_msgs.msg import JointState
from stand_in_rig import CONFIG, STOPS, messages, refusal

from atom_calibration.nodes.collecting.collect_from_bag import main
from atom_calibration.sources.joint_topics import positions
from atom_core.io.dataset_json import read_dataset
from atom_core.model.transforms import Edge

URDF = """<?xml version="1.0"?>
<robot name="rig">
  <link name="world"/> <link name="cam"/> <link name="cam_optical"/> <link name="arm"/>
  <link name="lidar"/> <link name="jaw"/> <link name="finger"/>
  <joint name="post" type="fixed">
    <parent link="world"/> <child link="cam"/> <origin xyz="0 0.5 0"/>
  </joint>
  <joint name="optics" type="fixed"> <parent link="cam"/> <child link="cam_optical"/> </joint>
  <joint name="slide" type="prismatic">
    <parent link="world"/> <child link="arm"/> <axis xyz="1 0 0"/>
    <limit lower="0" upper="9" effort="1" velocity="1"/>
  </joint>
  <joint name="mount" type="fixed"> <parent link="arm"/> <child link="lidar"/> </joint>
  <joint name="grip" type="prismatic">
    <parent link="arm"/> <child link="jaw"/> <axis xyz="1 0 0"/>
    <limit lower="0" upper="9" effort="1" velocity="1"/>
  </joint>
  <joint name="follower" type="prismatic">
    <parent link="arm"/> <child link="finger"/> <axis xyz="1 0 0"/> <mimic joint="slide"/>
    <limit lower="0" upper="9" effort="1" velocity="1"/>
  </joint>
</robot>
"""
STILL = URDF.replace('name="slide" type="prismatic"', 'name="slide" type="fixed"')


def joints(make, name="slide"):
    """Yield the messages of the rig, its arm told by /joint_states instead of /tf."""
    for topic, message, time_s in messages(make):
        if topic == "/tf":
            arm_m = message.transforms[0].transform.translation.x
            told = JointState(
                header=make.header("", time_s), name=[name, "wheel"], position=[arm_m, 0.0]
            )
            yield "/joint_states", told, time_s
        elif topic != "/tf_static":
            yield topic, message, time_s


def still(make):
    return [m for m in messages(make) if not m[0].startswith("/tf")]


def description(tmp_path, text=URDF, name="rig.urdf"):
    path = tmp_path / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def lidar_places(place):
    """Return the LiDAR's place along x and its stamp less 100 s, by collection."""
    dataset = read_dataset(place.folder / "dataset.json")
    assert len(dataset.collections) == STOPS
    for key, collection in dataset.collections.items():
        stamp = dataset.document["collections"][key]["data"]["lidar"]["header"]["stamp"]
        yield collection, stamp["secs"] + 1e-9 * stamp["nsecs"] - 100.0


def test_joint_states_move_the_description(place, make, tmp_path):
    arguments = [*place(joints(make)), "--description", str(description(tmp_path))]
    assert main(arguments) == 0
    for collection, seconds in lidar_places(place):
        moved = collection.transforms
        assert moved[Edge("world", "arm")][0, 3] == pytest.approx(0.1 * seconds, abs=1e-6)
        assert moved[Edge("arm", "finger")][0, 3] == pytest.approx(0.1 * seconds, abs=0.01)
        np.testing.assert_allclose(moved[Edge("world", "cam")][:3, 3], [0, 0.5, 0], atol=1e-12)
        assert Edge("arm", "jaw") not in moved  # nothing tells where it is, nothing needs it


def test_of_the_descriptions_frames_nothing_in_tf_counts(place, make, tmp_path):
    both = sorted([*messages(make), *joints(make)], key=lambda m: m[2])
    assert main([*place(both), "--description", str(description(tmp_path))]) == 0
    for collection, seconds in lidar_places(place):
        np.testing.assert_allclose(
            collection.transforms[Edge("world", "cam")][:3, 3], [0, 0.5, 0], atol=1e-12
        )
        arm = collection.transforms[Edge("world", "arm")]
        assert arm[0, 3] == pytest.approx(0.1 * seconds, abs=1e-6)


def test_a_joint_that_only_tf_tells_is_taken_from_there(place, make, tmp_path):
    moving = [m for m in messages(make) if m[0] != "/tf_static"]
    assert main([*place(moving), "--description", str(description(tmp_path))]) == 0
    for collection, seconds in lidar_places(place):
        arm = collection.transforms[Edge("world", "arm")]
        assert arm[0, 3] == pytest.approx(0.1 * seconds, abs=1e-6)


def test_a_still_rig_needs_images_and_clouds_alone(place, make, tmp_path, capsys):
    path = description(tmp_path, STILL)
    place.config.write_text(f"description_file: {path}\n{CONFIG}")
    assert main(place(still(make))) == 0
    assert f"its transforms are those of {path}" in capsys.readouterr().err
    assert len(list(lidar_places(place))) == STOPS


def test_two_publishers_of_one_joint_are_refused(place, make, tmp_path, capsys):
    content = []
    for topic, message, time_s in joints(make):
        content.append((topic, message, time_s))
        if topic == "/joint_states":  # of a node that knows nothing of the arm, 2 m off
            zero = JointState(header=message.header, name=["slide"], position=[2.0])
            content.append((topic, zero, time_s))
    line = refusal([*place(content), "--description", str(description(tmp_path))], capsys)
    assert "'world-arm' of /joint_states goes to and fro" in line


def test_degrees_are_named(place, make, tmp_path, capsys):
    turning = URDF.replace('name="slide" type="prismatic"', 'name="slide" type="revolute"')
    content = list(joints(make))
    for topic, message, _ in content:
        if topic == "/joint_states":
            message.position = [90.0, 0.0]
    arguments = [*place(content), "--description", str(description(tmp_path, turning))]
    assert "joint 'slide' is at 90 rad, far beyond its limits (0 to 9 rad" in refusal(
        arguments, capsys
    )


def test_limits_that_a_description_does_not_give_are_none(place, make, tmp_path):
    arm = URDF.replace('"slide" type="prismatic"', '"slide" type="revolute"')
    arm = arm.replace('<limit lower="0" upper="9"', "<limit", 1)
    content = list(joints(make))
    for topic, message, _ in content:
        if topic == "/joint_states":
            message.position = [2.0, 0.0]
    assert main([*place(content), "--description", str(description(tmp_path, arm))]) == 0


def test_positions_without_stamps_are_of_when_they_were_received(place, make, tmp_path):
    content = list(joints(make))
    for topic, message, _ in content:
        if topic == "/joint_states":
            message.header.stamp = rospy.Time()
    assert main([*place(content), "--description", str(description(tmp_path))]) == 0
    for collection, seconds in lidar_places(place):
        arm_m = collection.transforms[Edge("world", "arm")][0, 3]
        assert arm_m == pytest.approx(0.1 * seconds, abs=1e-3)


def test_tf_static_alone_counts_where_it_connects_all_and_else_the_description_does(
    place, make, tmp_path, capsys
):
    place.config.write_text(f"description_file: {description(tmp_path)}\n{CONFIG}")
    static = [m for m in messages(make) if m[0] == "/tf_static"]
    assert main(place([*static, *joints(make)])) == 0
    assert "the bag has no /tf: its transforms are those of" in capsys.readouterr().err
    for collection, seconds in lidar_places(place):
        arm = collection.transforms[Edge("world", "arm")]
        assert arm[0, 3] == pytest.approx(0.1 * seconds, abs=1e-6)
    still_arm = ("/tf_static", make.tf("world", "arm", np.eye(4), 100.0), 100.0)
    assert main([*place([*static, still_arm, *joints(make)]), "--overwrite"]) == 0
    assert "its transforms are those of" not in capsys.readouterr().err
    for collection, _ in lidar_places(place):
        assert collection.transforms[Edge("world", "arm")][0, 3] == 0.0


def test_a_still_rig_whose_stamps_are_not_the_times_of_receipt_has_no_tf_to_contradict(
    place, make, tmp_path, capsys
):
    place.config.write_text(f"description_file: {description(tmp_path, STILL)}\n{CONFIG}")
    later = [(topic, message, time + 1e6) for topic, message, time in still(make)]
    arguments = place(later)
    assert main(arguments) == 0
    assert "clock" not in capsys.readouterr().err
    assert len(list(lidar_places(place))) == STOPS
    main([*arguments, "--interval", "1.0", "--overwrite"])
    assert len(read_dataset(place.folder / "dataset.json").collections) > STOPS


def test_the_first_guess_that_a_package_saved_comes_before_its_description(
    place, make, tmp_path, capsys
):
    place.config = tmp_path / "package" / "calibration" / "config.yml"
    place.config.parent.mkdir(parents=True)
    place.config.write_text(f"description_file: {description(tmp_path, STILL)}\n{CONFIG}")
    guess = STILL.replace("0 0.5 0", "0 0.7 0")
    path = description(tmp_path / "package" / "urdf", guess, "initial_estimate.urdf.xacro")
    assert main([*place(still(make)), "--description"]) == 0
    for collection, _ in lidar_places(place):
        assert collection.transforms[Edge("world", "cam")][1, 3] == pytest.approx(0.7)
    assert str(path) not in capsys.readouterr().err  # it was asked for


def test_a_bag_with_neither_tf_nor_joints_is_refused(place, make, tmp_path, capsys):
    arguments = [*place(still(make)), "--description", str(description(tmp_path))]
    line = refusal(arguments, capsys)
    assert "joint 'slide', on which sensor 'lidar' hangs" in line
    assert "the bag has no /joint_states" in line


def test_a_bag_without_tf_whose_configuration_names_no_description_is_refused(place, make, capsys):
    assert "there is no robot description: name one" in refusal(place(still(make)), capsys)
    line = refusal([*place(still(make)), "--description", "--overwrite"], capsys)
    assert "--description: neither" in line and "initial_estimate.urdf.xacro" in line


def test_joints_of_other_names_are_named(place, make, tmp_path, capsys):
    arguments = [*place(joints(make, "rail")), "--description", str(description(tmp_path))]
    line = refusal(arguments, capsys)
    assert "joint 'slide'" in line and "(there are: rail, wheel)" in line


def test_a_description_that_is_not_there_is_refused(place, make, tmp_path, capsys):
    line = refusal([*place(), "--description", str(tmp_path / "no.urdf")], capsys)
    assert "no.urdf" in line


@pytest.mark.parametrize("wheel_topic", ["/joint_states", "/base/joint_states"])
def test_an_arm_may_have_a_topic_of_its_own(place, make, tmp_path, wheel_topic):
    content = []
    for topic, message, time_s in joints(make):
        content.append(
            ("/arm/joint_states" if topic == "/joint_states" else topic, message, time_s)
        )
        if topic == "/joint_states":
            message.name, message.position = ["slide"], message.position[:1]
            wheel = JointState(header=message.header, name=["wheel"], position=[0.0])
            content.append((wheel_topic, wheel, time_s))
    assert main([*place(content), "--description", str(description(tmp_path))]) == 0
    for collection, seconds in lidar_places(place):
        arm = collection.transforms[Edge("world", "arm")]
        assert arm[0, 3] == pytest.approx(0.1 * seconds, abs=1e-6)


def test_commands_do_not_count_for_joints_that_are_told(place, make, tmp_path):
    content = []
    for topic, message, time_s in joints(make):
        content.append((topic, message, time_s))
        if topic == "/joint_states":
            wanted = JointState(header=message.header, name=["slide"], position=[5.0])
            content.append(("/arm/commands", wanted, time_s))
    assert main([*place(content), "--description", str(description(tmp_path))]) == 0
    for collection, seconds in lidar_places(place):
        arm = collection.transforms[Edge("world", "arm")]
        assert arm[0, 3] == pytest.approx(0.1 * seconds, abs=1e-6)


def without_number(make, name):
    """The rig, one of whose joints is told without a number."""
    for topic, message, time_s in joints(make):
        if topic == "/joint_states":
            told = {**dict(zip(message.name, message.position)), name: float("nan")}
            message.name, message.position = list(told), list(told.values())
        yield topic, message, time_s


def test_a_joint_without_a_number_matters_only_where_something_hangs_on_it(
    place, make, tmp_path, capsys
):
    of_rig = str(description(tmp_path))
    assert main([*place(without_number(make, "grip")), "--description", of_rig]) == 0
    arguments = [*place(without_number(make, "slide")), "--description", of_rig, "--overwrite"]
    line = refusal(arguments, capsys)
    assert "joint 'slide', on which sensor 'lidar' hangs" in line
    assert "it is no number (NaN) in /joint_states" in line and "correct its publisher" in line


def test_joints_without_a_position_have_none():
    nan = float("nan")
    assert positions(JointState(name=["slide", "grip"], position=[nan, 1.0])) == {"grip": 1.0}
    assert positions(JointState(name=["slide"])) == {}
