"""Clocks of sensors, transforms and receipt: what is off is said, with the option that helps."""

import numpy as np
import pytest
import rospy
from stand_in_rig import STOPS, messages, refusal

from atom_calibration.nodes.collecting.collect_from_bag import main
from atom_core.io.dataset_json import read_dataset


def with_clock(make, ahead_s, stops=STOPS):
    """The LiDAR's stamps are ahead of the time at which its data are measured and received."""
    content = list(messages(make, stops=stops))
    for topic, message, _ in content:
        if topic == "/lidar/points":
            message.header.stamp = type(message.header.stamp).from_sec(
                message.header.stamp.to_sec() + ahead_s
            )
    return content


@pytest.mark.parametrize("ahead_s", [0.25, -0.4])
def test_a_clock_that_is_off_is_said_and_receipt_serves(place, make, capsys, ahead_s):
    arguments = [*place(with_clock(make, ahead_s)), "--overwrite"]
    main(arguments)
    said = capsys.readouterr().err
    assert "warning: sensor 'lidar': " in said and "--use_receive_time lidar" in said
    assert ("its clock is ahead" if ahead_s > 0 else "its clock is behind") in said
    assert main([*arguments, "--use_receive_time", "lidar"]) == 0
    assert "clock" not in capsys.readouterr().err
    dataset = read_dataset(place.folder / "dataset.json")
    assert len(dataset.collections) == STOPS
    data = dataset.document["collections"]["001"]["data"]
    stamps = [data[n]["header"]["stamp"] for n in ("cam", "lidar")]
    seconds = [stamp["secs"] + 1e-9 * stamp["nsecs"] for stamp in stamps]
    assert abs(seconds[0] - seconds[1]) < 0.2


def test_a_clock_that_counts_from_elsewhere_is_refused(place, make, capsys):
    arguments = place(with_clock(make, -90.0))
    line = refusal(arguments, capsys)
    assert "'lidar': its stamps are 90.0 s before those of the other sensors" in line
    assert "--use_receive_time lidar" in line
    assert main([*arguments, "--use_receive_time", "lidar", "--overwrite"]) == 0


def test_a_clock_from_elsewhere_in_a_copied_bag_names_all_whose_receipt_is_to_be_taken(
    place, make, capsys
):
    copied = [(topic, message, time + 1e6) for topic, message, time in with_clock(make, -90.0)]
    still = ("/tf_static", make.tf("world", "arm", np.eye(4), 100.0), copied[0][2])
    arguments = place([still, *(m for m in copied if m[0] != "/tf")])
    line = refusal(arguments, capsys)
    assert "'lidar': its stamps are 90.0 s before" in line
    assert "--use_receive_time cam lidar takes" in line
    line = refusal([*arguments, "--use_receive_time", "lidar", "--overwrite"], capsys)
    assert "--use_receive_time cam lidar takes" in line


def test_a_copy_of_an_older_bag_has_no_wrong_clocks(place, make, capsys):
    later = [(topic, message, time + 1e6) for topic, message, time in messages(make)]
    assert main(place(later)) == 0
    assert "clock" not in capsys.readouterr().err
    assert list(read_dataset(place.folder / "dataset.json").collections) == ["000", "001", "002"]
    assert main([*place(later), "--interval", "1.0", "--overwrite"]) in (0, 1)


def test_transforms_of_another_clock_are_refused(place, make, capsys):
    late = [(topic, m, time + 90.0) for topic, m, time in messages(make)]
    for _, message, time in late:
        if hasattr(message, "header"):
            message.header.stamp = type(message.header.stamp).from_sec(time)
    assert "/tf: its stamps are 90.0 s before" in refusal(place(late), capsys)


def test_sensors_whose_clocks_all_count_from_boot_are_refused_with_the_option(place, make, capsys):
    content = list(messages(make))
    for topic, message, time in content:
        if topic in ("/cam/image_raw", "/lidar/points"):
            message.header.stamp = type(message.header.stamp).from_sec(time - 90.0)
    arguments = place(content)
    line = refusal(arguments, capsys)
    assert "/tf: its stamps are 90.0 s after" in line and "--use_receive_time cam lidar" in line
    assert main([*arguments, "--use_receive_time", "cam", "lidar", "--overwrite"]) == 0
    assert len(read_dataset(place.folder / "dataset.json").collections) == STOPS


def test_stamps_that_no_driver_set_are_refused_with_the_option(place, make, capsys):
    content = list(messages(make))
    for topic, message, _ in content:
        if topic in ("/cam/image_raw", "/lidar/points"):
            message.header.stamp = type(message.header.stamp)()
    arguments = place(content)
    line = refusal(arguments, capsys)
    assert "the stamps of cam, lidar are all zero" in line
    line = refusal([*arguments, "--use_receive_time", "lidar", "--overwrite"], capsys)
    assert "the stamps of cam are all zero" in line and "--use_receive_time lidar cam" in line
    assert main([*arguments, "--use_receive_time", "cam", "lidar", "--overwrite"]) == 0
    assert len(read_dataset(place.folder / "dataset.json").collections) == STOPS


@pytest.mark.parametrize("unset", [[0], [30, 31, 32]])
def test_single_messages_without_a_stamp_are_left_out(place, make, capsys, unset):
    content = list(messages(make))
    images = [message for topic, message, _ in content if topic == "/cam/image_raw"]
    for number in unset:
        images[number].header.stamp = rospy.Time()
    assert main(place(content)) == 0
    told = "sensor 'cam', topic /cam/image_raw, received at 10"
    assert capsys.readouterr().err.count(f"a message is left out: {told}") == len(unset)
    assert len(read_dataset(place.folder / "dataset.json").collections) == 3


@pytest.mark.parametrize("topic", ["/cam/image_raw", "/lidar/points"])
@pytest.mark.parametrize("strays, ahead_s", [(1, 1e6), (1, 3.0), (3, 90.0)])
def test_the_first_messages_of_a_sensor_are_left_out_where_their_stamps_stray(
    place, make, capsys, topic, strays, ahead_s
):
    """All after them seemed to be played twice, and the whole bag was refused."""
    content = list(messages(make))
    of_topic = [message for on, message, _ in content if on == topic]
    for message in of_topic[:strays]:
        message.header.stamp += rospy.Duration.from_sec(ahead_s)
    assert main(place(content)) == 0
    said = capsys.readouterr().err
    assert said.count("a message is left out: ") == strays
    assert f"topic {topic}, received at 100" in said
    assert f"its stamp lies +{ahead_s:.1f} s off those around it" in said
    assert len(read_dataset(place.folder / "dataset.json").collections) == STOPS


def test_a_clock_that_is_set_after_the_first_messages_is_no_stray(place, make, capsys):
    content = list(messages(make))
    for message in [m for on, m, _ in content if on == "/cam/image_raw"][:6]:
        message.header.stamp += rospy.Duration.from_sec(90.0)
    assert "its stamps jump back by 89.9 s" in refusal(place(content), capsys)


def test_receipt_of_an_unknown_sensor_is_refused(place, capsys):
    line = refusal([*place(), "--use_receive_time", "radar"], capsys)
    assert "there is no sensor 'radar'; there are cam, lidar" in line
