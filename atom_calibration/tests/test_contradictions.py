"""A recording that contradicts itself is refused, or said to; it is never calibrated in silence."""

import cv2
import numpy as np
import pytest

pytest.importorskip("rospy")

import rospy
from sensor_msgs.msg import CompressedImage
from stand_in_rig import messages, refusal
from tf2_msgs.msg import TFMessage

from atom_calibration.errors import MessageError
from atom_calibration.messages.images import colour_image
from atom_calibration.messages.poses import transform_matrix
from atom_calibration.nodes.collecting.collect_from_bag import main
from atom_calibration.sources.contradictions import EdgeWatch
from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset
from atom_core.model.transforms import Edge


def changed(make, topic, from_s, change):
    """Return the messages of a rig, those of a topic changed from a time on."""
    content = list(messages(make))
    for name, message, time_s in content:
        if name == topic and time_s >= from_s:
            change(message)
    return content


def test_intrinsics_that_change_amid_the_bag_are_refused(place, make, capsys):
    def zoom(info):
        info.K = [1.2 * v for v in info.K[:8]] + [1.0]

    line = refusal(place(changed(make, "/cam/camera_info", 103.0, zoom)), capsys)
    assert "sensor 'cam', topic /cam/camera_info: its intrinsics change 3.0 s after" in line
    assert "f = 50.0 px, then 64 x 48 pixels, f = 60.0 px" in line and "rosbag filter" in line
    assert not (place.folder / "dataset.json").exists()


def test_the_last_digits_of_intrinsics_may_differ(place, make):
    def round_off(info):
        info.K = [v * (1 + 1e-7) for v in info.K]

    assert main(place(changed(make, "/cam/camera_info", 103.0, round_off))) == 0


def test_a_recording_in_which_time_jumps_back_is_refused(place, make, capsys):
    once = list(messages(make))
    again = [(topic, message, time_s + 10.0) for topic, message, time_s in messages(make)]
    line = refusal(place([*once, *again]), capsys)
    assert "its stamps jump back by 7.4 s" in line and "played twice" in line


@pytest.mark.parametrize("off_s", [5e5, -4.0])
@pytest.mark.parametrize("topic", ["/lidar/points", "/cam/image_raw"])
@pytest.mark.parametrize("which", [slice(20, 21), slice(30, 33), slice(74, 75)])
def test_a_few_messages_with_a_stamp_far_off_are_left_out(place, make, capsys, topic, off_s, which):
    content = list(messages(make))
    strays = [(message, at_s) for name, message, at_s in content if name == topic][which]
    for message, at_s in strays:
        message.header.stamp = rospy.Time.from_sec(max(at_s + off_s, 1.0))
    assert main(place(content)) == 0
    told = [line for line in capsys.readouterr().err.splitlines() if "its stamp lies" in line]
    assert len(told) == len(strays) and all(f"topic {topic}, received at" in line for line in told)
    assert len(read_dataset(place.folder / "dataset.json").collections) == 3


def test_data_that_were_only_received_late_are_no_strays(place, make, capsys):
    content = [
        (name, message, at_s + 5.0 * (name == "/lidar/points" and at_s > 107.25))
        for name, message, at_s in messages(make)
    ]
    main(place(content))
    assert "its stamp lies" not in capsys.readouterr().err


def test_data_that_change_their_frame_are_refused(place, make, capsys):
    def rename(cloud):
        cloud.header.frame_id = "lidar_base"

    line = refusal(place(changed(make, "/lidar/points", 103.0, rename)), capsys)
    assert "in frame 'lidar' at first, and 3.0 s after the beginning in frame 'lidar_base'" in line
    assert "sensor 'lidar', topic /lidar/points" in line and "rosbag filter" in line


def test_a_slash_before_a_frame_is_no_change(place, make):
    def old_name(cloud):
        cloud.header.frame_id = "/lidar"

    assert main(place(changed(make, "/lidar/points", 103.0, old_name))) == 0


def test_what_is_told_of_a_frame_that_stands_twice_is_told_where_it_is_refused(place, make, capsys):
    content = list(messages(make))
    content.insert(3, ("/tf_static", make.tf("world", "cam", np.eye(4), 100.0), 100.0))
    content.insert(4, ("/tf_static", make.tf("elsewhere", "cam", np.eye(4), 100.0), 100.0))
    assert main(place(content)) == 2
    told = capsys.readouterr().err
    assert "frame 'cam' stands in 'world' and in 'elsewhere'" in told
    assert "no transform connects frame 'world'" in told


def test_two_values_of_a_fixed_edge_are_told(place, make, capsys):
    shift = se3.transform(np.eye(3), np.array([0.012, 0.0, 0.0]))
    content = list(messages(make))
    content.insert(3, ("/tf_static", make.tf("world", "cam", shift, 100.0), 100.0))
    assert main(place(content)) == 0
    told = capsys.readouterr().err
    assert "'world-cam' has several values in /tf_static, which differ by 12.0 mm" in told


def test_two_programs_that_publish_one_edge_are_refused(place, make, capsys):
    content = []
    for topic, message, time_s in messages(make):
        content.append((topic, message, time_s))
        if topic == "/tf":
            other = se3.transform(np.eye(3), np.array([5.0, 0.0, 0.0]))
            content.append((topic, make.tf("world", "arm", other, time_s + 0.05), time_s + 0.05))
    content.sort(key=lambda entry: entry[2])
    line = refusal(place(content), capsys)
    assert "'world-arm' of /tf goes to and fro between two values" in line


def with_a_second_program(make, edge, shift, stops=3, every=1):
    """Return the messages of a rig in which another program says of an edge what `shift` makes.

    ``shift`` is given the pose of world-arm and when it is [s], and returns a pose.
    """
    content, count = [], 0
    for topic, message, time_s in messages(make, stops=stops):
        if topic == "/tf":
            arm = transform_matrix(message.transforms[0])
            if edge != ("world", "arm"):
                message.transforms.append(make.transform(*edge, arm, time_s))
            count += 1
            if count % every == 0:
                late_s = time_s + 0.05
                content.append((topic, make.tf(*edge, shift(arm, time_s), late_s), late_s))
        content.append((topic, message, time_s))
    return sorted(content, key=lambda entry: entry[2])


def away(arm, _time_s):
    return se3.transform(np.eye(3), np.array([5.0, 0.0, 0.0])) @ arm


def test_two_programs_of_an_edge_that_nothing_hangs_on_are_told_and_the_rest_is_collected(
    place, make, capsys
):
    assert main(place(with_a_second_program(make, ("map", "world"), away))) == 0
    told = capsys.readouterr().err
    assert told.count("'map-world' of /tf goes to and fro between two values, 5") == 1
    dataset = read_dataset(place.folder / "dataset.json")
    assert dataset.caveats == () and len(dataset.collections) == 3


def test_where_two_programs_agree_at_stops_these_are_collected_with_a_doubt(place, make, capsys):
    """One is late while the arm moves, as with `joint_state_publisher` beside a driver."""

    def moves(time_s):
        return 2.8 <= (time_s - 100.0) % 5.0 < 3.8

    def late(arm, time_s):
        return away(arm, time_s) if moves(time_s) else arm

    content = with_a_second_program(make, ("world", "arm"), late, stops=10)
    assert main(place(content)) in (0, 1)
    assert "'world-arm' of /tf goes to and fro" in capsys.readouterr().err
    dataset = read_dataset(place.folder / "dataset.json")
    assert [caveat.sensors for caveat in dataset.caveats] == [("lidar",)]
    assert len(dataset.collections) >= 4
    for collection in dataset.collections.values():
        assert collection.transforms[Edge("world", "arm")][0, 3] < 3.0


def test_what_was_collected_before_the_contradiction_was_known_is_removed(place, make, capsys):
    content = with_a_second_program(make, ("world", "arm"), away, stops=10, every=10)
    assert main(place(content)) == 2
    told = capsys.readouterr().err
    assert "collection 000 is removed: transform 'world-arm' of /tf goes to and fro" in told
    assert "no collection was taken: transform 'world-arm'" in told
    assert not list(place.folder.glob("collections/0*.json"))


def test_an_edge_that_stands_in_tf_static_and_moves_in_tf_gives_no_collection(place, make, capsys):
    content = list(messages(make))
    content.insert(3, ("/tf_static", make.tf("world", "arm", np.eye(4), 100.0), 100.0))
    assert main(place(content)) == 2
    told = capsys.readouterr().err
    assert "'world-arm' stands still in /tf_static, and moves in /tf; record again without" in told


def test_one_that_nothing_hangs_on_is_told_and_the_rest_is_collected(place, make, capsys):
    content = [("/tf_static", make.tf("world", "lid", np.eye(4), 100.0), 100.0)]
    for topic, message, time_s in messages(make):
        content.append((topic, message, time_s))
        if topic == "/tf":
            (arm,) = message.transforms
            lid = make.transform("world", "lid", transform_matrix(arm), time_s)
            arm_and_lid = TFMessage([arm, lid])
            content[-1] = (topic, arm_and_lid, time_s)
    assert main(place(content)) == 0
    assert "'world-lid' stands still in /tf_static, and moves in /tf" in capsys.readouterr().err
    dataset = read_dataset(place.folder / "dataset.json")
    assert dataset.caveats == () and len(dataset.collections) == 3
    assert all(Edge("world", "lid") not in c.transforms for c in dataset.collections.values())


def test_another_pose_of_a_fixed_edge_in_tf_is_in_doubt(make):
    watch, shift = EdgeWatch(), se3.transform(np.eye(3), np.array([0.012, 0.0, 0.0]))
    watch.see_fixed(make.transform("a", "b", np.eye(4)))
    watch.see_fixed(make.transform("a", "c", np.eye(4)))
    for time_s in range(3):
        watch.see_moving(make.transform("a", "b", shift, time_s))
        watch.see_moving(make.transform("a", "c", np.eye(4), time_s))  # says the same
    (doubt,) = watch.doubtful
    assert "'a-b' has one pose in /tf_static and another one in /tf, 12.0 mm" in doubt.what
    assert doubt.only_its_pose and not watch.contradicted


def test_what_moves_beside_its_fixed_pose_is_no_longer_only_elsewhere(make):
    watch = EdgeWatch()
    watch.see_fixed(make.transform("a", "b", np.eye(4)))
    for x_m in (0.01, 0.01, 0.02, 0.03):
        shift = se3.transform(np.eye(3), np.array([x_m, 0.0, 0.0]))
        watch.see_moving(make.transform("a", "b", shift, 100.0 + x_m))
    (doubt,) = watch.doubtful
    assert "'a-b' stands still in /tf_static, and moves in /tf" in doubt.what
    assert not doubt.only_its_pose
    contradiction = watch.contradicted[Edge("a", "b")]
    assert contradiction.covers(0.0) and contradiction.covers(101.02)
    assert not contradiction.covers(101.04)


def test_frames_that_stand_in_one_another_are_refused(place, make, capsys):
    content = list(messages(make))
    content.insert(3, ("/tf_static", make.tf("cam", "world", np.eye(4), 100.0), 100.0))
    line = refusal(place(content), capsys)
    assert "go in a circle: 'world' in 'cam' in 'world'; two programs" in line


def test_a_frame_that_is_placed_twice_is_told(make):
    watch = EdgeWatch()
    watch.see_fixed(make.transform("base", "cam", np.eye(4)))
    for _ in range(3):
        watch.see_moving(make.transform("arm", "cam", np.eye(4)))
        watch.see_moving(make.transform("base", "arm", np.eye(4)))
    (doubt,) = watch.doubtful
    assert "frame 'cam' stands in 'base' and in 'arm'" in doubt.what and not doubt.only_its_pose


@pytest.mark.parametrize("share", [1, 5])
def test_also_where_one_publishes_less_often(share, make):
    watch, still = EdgeWatch(), np.eye(4)
    moved = se3.transform(se3.rotation_from_rpy(np.array([0.0, 0.0, 0.01])), np.zeros(3))
    for number in range(100):
        for place, pose in enumerate([*[still] * share, moved]):
            watch.see_moving(make.transform("a", "b", pose, number + 0.1 * place))
    assert "0.57 deg apart" in watch.contradicted[Edge("a", "b")].sentence
    assert all(watch.contradicted[Edge("a", "b")].covers(t) for t in (0.0, 50.5, 99.9))


RATE_HZ = 50.0
TIMES_S = np.arange(0.0, 60.0, 1.0 / RATE_HZ)
MOVES = np.cumsum(np.where(TIMES_S % 6.0 < 3.0, 0.0, 0.01 * np.sin(TIMES_S)))  # stops and moves


def readings(kind):
    """Return what one joint's program publishes [rad], however badly it measures."""
    noise = np.radians(1.0) * np.random.default_rng(0).standard_normal(len(TIMES_S))
    return {
        "scatter": MOVES + 0.05 * noise,
        "much scatter": MOVES + 0.5 * noise,
        "servo's ticks": np.radians(0.088) * np.round((MOVES + 0.02 * noise) / np.radians(0.088)),
        "shakes slowly": MOVES + np.radians(0.1) * np.sin(2 * np.pi * 9.0 * TIMES_S),
        "shakes": MOVES + np.radians(0.5) * np.sin(2 * np.pi * 10.0 * TIMES_S + 0.3),
        "late stamps": np.interp(TIMES_S + 1.7 * noise, TIMES_S, MOVES),
    }[kind]


@pytest.mark.parametrize(
    "kind", ["scatter", "much scatter", "shakes slowly", "shakes", "late stamps"]
)
def test_one_program_that_measures_badly_is_no_contradiction(kind, make):
    watch = EdgeWatch()
    for angle in readings(kind):
        pose = se3.from_rpy(np.zeros(3), np.array([0.0, 0.0, angle]))
        watch.see_moving(make.transform("a", "b", pose))
    assert watch.doubtful == []


def test_readings_that_flicker_between_two_ticks_are_in_doubt_and_not_refused(make):
    watch = EdgeWatch()
    for angle in readings("servo's ticks"):
        pose = se3.from_rpy(np.zeros(3), np.array([0.0, 0.0, angle]))
        watch.see_moving(make.transform("a", "b", pose))
    (doubt,) = watch.doubtful
    assert "0.09 deg apart" in doubt.what and "if its readings flicker" in doubt.remedy


@pytest.mark.parametrize("every", [2, 6])
@pytest.mark.parametrize("apart_m", [0.002, 0.02])
def test_two_that_scatter_contradict_each_other_all_the_same(every, apart_m, make):
    watch, angles = EdgeWatch(), MOVES + np.radians(0.005) * np.sin(1e4 * TIMES_S)

    for number, angle in enumerate(angles):
        shift = np.array([apart_m if number % every == 0 else 0.0, 0.0, 0.0])
        pose = se3.from_rpy(shift, np.array([0.0, 0.0, angle]))
        watch.see_moving(make.transform("a", "b", pose))
    (doubt,) = watch.doubtful
    if apart_m > 0.01:
        assert "two programs publish it" in watch.contradicted[Edge("a", "b")].sentence
    else:
        assert "2.0 mm" in doubt.what and "if its readings flicker" in doubt.remedy


def test_an_arm_that_moves_to_and_fro_and_trembles_is_no_contradiction(make):
    watch, rng = EdgeWatch(), np.random.default_rng(0)
    for time_s in np.arange(0.0, 10.0, 0.02):
        angle = 0.5 * np.sin(5.0 * time_s) + rng.normal(0, 1e-4)
        pose = se3.transform(
            se3.rotation_from_rpy(np.array([0.0, 0.0, angle])), rng.normal(0, 1e-4, 3)
        )
        watch.see_moving(make.transform("a", "b", pose))
        watch.see_fixed(make.transform("c", "d", np.eye(4)))
    assert watch.doubtful == []


@pytest.mark.parametrize("ending", [".jpg", ".png"])
def test_a_picture_that_is_cut_off_is_no_picture(ending):
    pixels = np.random.default_rng(0).integers(0, 255, (60, 80, 3), dtype=np.uint8)
    data = cv2.imencode(ending, pixels)[1].tobytes()
    for whole in (data, data + bytes(100)):  # drivers pad
        assert colour_image(CompressedImage(format="bgr8", data=whole)).shape == (60, 80, 3)
    for share in (0.3, 0.5, 0.99):
        cut = CompressedImage(format="bgr8", data=data[: int(share * len(data))])
        with pytest.raises(MessageError, match="cut off"):
            colour_image(cut)
