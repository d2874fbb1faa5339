"""configure, with a bag that lacks /joint_states or /tf: does the description tell the rest?"""

from copy import deepcopy
from xml.etree import ElementTree

import numpy as np
import pytest
import rosbag
from livox_messages import livox_message
from small_rig import configure, edit_config, write_package

from atom_calibration.messages.clouds import cloud_xyz, point_cloud


@pytest.fixture
def package(tmp_path, make):
    return write_package(tmp_path, make, seconds=1.0)


def _messages(package):
    with rosbag.Bag(str(package / "calibration" / "rig.bag")) as bag:
        return [(topic, message, time.to_sec()) for topic, message, time in bag.read_messages()]


def calibrate_no_joint(package):
    edit_config(package, "joints:\n  shoulder:\n    params_to_calibrate: [origin_yaw]", "joints:")


def stand_on_the_base(package):
    """Let the world be a frame of the description; that of the rig is known from /tf alone."""
    edit_config(package, 'world_link: "odom"', 'world_link: "base"')
    edit_config(package, 'parent_link: "odom"', 'parent_link: "base"')


def test_a_joint_that_the_bag_does_not_move_is_told(package, capsys, make, tmp_path):
    bag = tmp_path / "no_joints.bag"
    kept = [m for m in _messages(package) if m[0] != "/joint_states"]
    make.bag(bag, kept)
    assert configure(package, "--bag", str(bag)) == 2
    assert "joints.shoulder is not in /joint_states of the bag" in capsys.readouterr().err
    calibrate_no_joint(package)
    assert configure(package, "--bag", str(bag)) == 0
    coming = capsys.readouterr().out.split("next: ")[1]
    assert coming.count(f".launch bag_file:={bag}") + coming.count(f"data bag_file:={bag}") == 2
    assert "--moving_joints" in (package / "launch" / "playbag.launch").read_text("utf-8")


def test_a_bag_without_tf_is_taken_where_the_description_and_joint_states_tell_all(
    package, capsys, make, tmp_path
):
    bag = tmp_path / "no_tf.bag"
    make.bag(bag, [m for m in _messages(package) if not m[0].startswith("/tf")])
    assert configure(package, "--bag", str(bag)) == 2
    assert "world_link is 'odom', which is neither" in capsys.readouterr().err
    stand_on_the_base(package)
    assert configure(package, "--bag", str(bag)) == 0
    told = "bag_file has neither /tf nor /tf_static: its transforms are those of the description, "
    assert told + "moved by /joint_states" in capsys.readouterr().err


def test_a_joint_that_neither_tf_nor_joint_states_tells_is_refused_with_what_hangs_on_it(
    package, capsys, make, tmp_path
):
    bag = tmp_path / "no_tf.bag"
    untold = ("/tf", "/tf_static", "/joint_states")
    make.bag(bag, [m for m in _messages(package) if m[0] not in untold])
    calibrate_no_joint(package)
    stand_on_the_base(package)
    assert configure(package, "--bag", str(bag)) == 2
    error = capsys.readouterr().err
    assert "joint 'shoulder', and where that stands neither /joint_states nor /tf" in error
    assert "sensors.lidar.link is " in error and "sensors.camera.link is " not in error


def test_transforms_that_begin_late_in_the_bag_are_seen(package, capsys, make, tmp_path):
    bag = tmp_path / "late.bag"
    late = ("/tf", "/joint_states")
    make.bag(bag, [(t, m, s + 30.0 * (t in late)) for t, m, s in _messages(package)])
    assert configure(package, "--bag", str(bag)) == 0
    assert "neither /tf nor" not in capsys.readouterr().err


def test_a_joint_that_is_told_long_after_others_is_seen(package, make, tmp_path):
    """Two publishers of /joint_states are usual: an arm's, and that of what it stands on."""
    bag = tmp_path / "two_publishers.bag"
    told = _messages(package)
    (first,) = [m for t, m, _ in told if t == "/joint_states"][:1]
    other = type(first)(header=first.header, name=["wheel"], position=[0.0])
    shifted = [(t, m, s + 25.0 * (t == "/joint_states")) for t, m, s in told]
    make.bag(bag, [*shifted, ("/joint_states", other, told[0][2])])
    assert configure(package, "--bag", str(bag)) == 0


def playbag(package):
    """Return the remappings of the player, and the arguments of the filter of transforms."""
    root = ElementTree.parse(str(package / "launch" / "playbag.launch")).getroot()
    nodes = {node.get("name"): node for node in root.findall("node")}
    remaps = {r.get("from"): r.get("to") for r in nodes["playbag"].findall("remap")}
    return remaps, nodes["filter_bag_tf"].get("args")


def test_joints_on_another_topic_move_the_robot_that_is_played(package, make, tmp_path):
    bag = tmp_path / "other_topic.bag"
    there = {"/joint_states": "/rig/joint_states"}
    make.bag(bag, [(there.get(t, t), m, s) for t, m, s in _messages(package)])
    assert configure(package, "--bag", str(bag)) == 0
    remaps, from_bag = playbag(package)
    assert remaps["/rig/joint_states"] == "/joint_states" and from_bag == ""


@pytest.mark.parametrize("arm_too", [False, True])
def test_joints_that_no_topic_tells_are_played_from_tf(package, make, tmp_path, arm_too):
    path = package / "calibration" / "rig.urdf.xacro"
    wheel = """<link name="wheel"/> <joint name="wheel_joint" type="continuous">
    <parent link="base"/> <child link="wheel"/> <axis xyz="0 1 0"/> </joint> </robot>"""
    path.write_text(path.read_text("utf-8").replace("</robot>", wheel), encoding="utf-8")
    calibrate_no_joint(package)
    content = []
    for topic, message, time_s in _messages(package):
        if topic == "/joint_states":
            of_wheel = type(message)(header=message.header, name=["wheel_joint"], position=[0.0])
            content.append((topic, of_wheel, time_s))
            topic = "/arm/joint_states"
        if topic != "/arm/joint_states" or arm_too:
            content.append((topic, message, time_s))
    bag = tmp_path / "wheels.bag"
    make.bag(bag, content)
    assert configure(package, "--bag", str(bag)) == 0
    remaps, from_bag = playbag(package)
    assert from_bag == ("" if arm_too else "--moving_joints shoulder")
    assert ("/arm/joint_states" in remaps) == arm_too


@pytest.mark.parametrize("modality", ["", "rgb"])
def test_depth_images_that_are_not_called_so_are_refused_with_what_to_write(
    package, capsys, make, tmp_path, modality
):
    depth_mm = np.full((48, 64), 900, np.uint16)
    content = [
        (topic.replace("/compressed", ""), make.image(depth_mm, "16UC1", "camera_optical", t), t)
        if topic.endswith("/compressed")
        else (topic, message, t)
        for topic, message, t in _messages(package)
    ]
    bag = make.bag(tmp_path / "depth.bag", content)
    edit_config(package, "    modality:\n", f"    modality: {modality}\n")
    assert configure(package, "--bag", str(bag)) == 2
    key = "topic_name" if modality else "modality"
    (told,) = [line for line in capsys.readouterr().err.splitlines() if "warning" not in line]
    assert f": sensors.camera.{key} does not fit the data in the bag: sensor 'camera'" in told
    assert "set `modality: depth` for this sensor" in told
    if not modality:
        edit_config(package, "    modality: \n", "    modality: depth\n")
        assert configure(package, "--bag", str(bag)) == 0


def test_a_damaged_first_message_is_no_reason_to_refuse(package, make, tmp_path):
    content = list(_messages(package))
    first = next(m for topic, m, _ in content if topic.endswith("/compressed"))
    first.data = first.data[:100]
    bag = make.bag(tmp_path / "damaged.bag", content)
    assert configure(package, "--bag", str(bag)) == 0


def test_livox_messages_that_rviz_cannot_show_are_told(package, capsys, make, tmp_path):
    def of_livox(message):
        if message._type != "sensor_msgs/PointCloud2":
            return message
        sent = livox_message("livox_ros_driver", cloud_xyz(point_cloud(message)).tolist())
        sent.header = message.header
        return sent

    bag = tmp_path / "livox.bag"
    make.bag(bag, [(topic, of_livox(m), time_s) for topic, m, time_s in _messages(package)])
    assert configure(package, "--bag", str(bag)) == 0
    told = [line for line in capsys.readouterr().err.splitlines() if "RViz cannot show" in line]
    assert len(told) == 1 and "sensors.lidar.topic_name carries livox_ros_driver/Cust" in told[0]


def test_what_is_no_transform_and_topics_of_another_robot_are_told_and_passed_over(
    package, capsys, make, tmp_path
):
    bag, kept = tmp_path / "ghost.bag", _messages(package)
    topic, message, time_s = next(m for m in kept if m[0] == "/tf_static")
    ghost, other = deepcopy(message), deepcopy(message)
    ghost.transforms = [deepcopy(message.transforms[0])]
    ghost.transforms[0].child_frame_id = "ghost"
    ghost.transforms[0].transform.translation.x = float("nan")
    other.transforms[0].transform.translation.x += 1.0
    make.bag(bag, [*kept, (topic, ghost, time_s), ("/robot_2/tf_static", other, time_s)])
    assert configure(package, "--bag", str(bag)) == 0
    said = capsys.readouterr().err
    assert "ghost' is no pose" in said and "those on /robot_2/tf_static are not used" in said
    assert "elsewhere" not in said  # the description fits the robot's own


def repeated_on_tf(package, child):
    """Yield the messages of the bag, with a fixed transform on /tf, ten times a second."""
    content, fixed = list(_messages(package)), []
    for topic, message, _ in content:
        if topic == "/tf_static":
            fixed += [t for t in message.transforms if t.child_frame_id == child]
            message.transforms = [t for t in message.transforms if t not in fixed]
        elif topic == "/tf":
            again = deepcopy(fixed[0])
            again.header.stamp = message.transforms[0].header.stamp
            message.transforms.append(again)
    return content


def test_a_mount_that_a_program_repeats_on_tf_is_as_fixed_as_in_tf_static(
    package, capsys, make, tmp_path
):
    bag = make.bag(tmp_path / "repeated.bag", repeated_on_tf(package, "camera_link"))
    assert configure(package, "--bag", str(bag), "--first_guess", "bag") == 0
    told = capsys.readouterr()
    assert "other fixed transforms than the bag: mast-camera_link 100.0 mm" in told.err
    assert "the origin of mast-camera_link is that of the bag" in told.out


def test_one_that_the_description_does_not_have_can_be_estimated(package, capsys, make, tmp_path):
    bag = make.bag(tmp_path / "repeated.bag", repeated_on_tf(package, "camera_link"))
    path = package / "calibration" / "rig.urdf.xacro"
    text = path.read_text()
    mount = text[text.index('<joint name="camera_mount"') : text.index('<joint name="shoulder"')]
    links = '<link name="camera_link"/> <link name="camera_optical"/>'
    path.write_text(text.replace(mount, "").replace(links, ""))
    assert configure(package, "--bag", str(bag)) == 0
    assert "'camera_link', which only the bag's transforms have" in capsys.readouterr().err


def test_an_edge_that_only_the_driver_publishes_is_told_when_it_shall_be_estimated(package, capsys):
    description = package / "calibration" / "rig.urdf.xacro"
    text = description.read_text("utf-8").replace('<link name="camera_optical"/>', "")
    begin = text.index('  <joint name="camera_optics"')
    end = text.index("</joint>", begin) + len("</joint>\n")
    description.write_text(text[:begin] + text[end:], "utf-8")
    assert configure(package) == 0
    assert "only the bag's transforms have" not in capsys.readouterr().err
    edges = ('parent_link: "mast"', 'parent_link: "camera_link"')
    edit_config(package, *edges)
    edit_config(package, 'child_link: "camera_link"', 'child_link: "camera_optical"')
    assert configure(package) == 0
    told = "sensors.camera.child_link is 'camera_optical', which only the bag's transforms have"
    assert told in capsys.readouterr().err
