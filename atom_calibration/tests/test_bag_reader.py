"""A bag is read as it was recorded, and a broken one is told from a whole one."""

import numpy as np
import pytest
import rosbag
import rospy

from atom_calibration.errors import BagError
from atom_calibration.sources.bag_reader import BagReader


@pytest.fixture
def messages(make):
    cloud = make.xyz_cloud(np.ones((2000, 3)))
    return [("/points", cloud, 10.0 + 0.1 * i) for i in range(40)]


def test_messages_come_in_the_order_of_recording_and_within_the_limits(make, messages, tmp_path):
    path = make.bag(tmp_path / "a.bag", messages)
    with BagReader(path) as bag:
        assert (bag.types, bag.counts) == ({"/points": "sensor_msgs/PointCloud2"}, {"/points": 40})
        times = [m.recorded_s for m in bag.messages(["/points"])]
        assert times == sorted(times) and len(times) == 40
        part = [m.recorded_s for m in bag.messages(["/points"], 11.0, 12.0)]
        assert len(part) == 11
        assert (bag.start_s, bag.end_s) == pytest.approx((10.0, 13.9))


@pytest.mark.parametrize("compression", [rosbag.Compression.NONE, rosbag.Compression.LZ4])
def test_a_bag_that_was_cut_off_is_refused_with_the_remedy(make, messages, tmp_path, compression):
    path = make.bag(tmp_path / "a.bag", messages, compression=compression, chunk_threshold=100000)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(BagError, match="a.bag.*rosbag reindex|a.bag.*damaged"), BagReader(path):
        pass


def test_an_unindexed_bag_is_refused_with_the_remedy(make, messages, tmp_path):
    path = tmp_path / "a.bag.active"
    bag = rosbag.Bag(str(path), "w", chunk_threshold=100000)
    for topic, message, time_s in messages:
        bag.write(topic, message, rospy.Time.from_sec(time_s))
    bag._file.flush()
    copy = tmp_path / "copy.bag"
    copy.write_bytes(path.read_bytes())
    bag.close()
    with pytest.raises(BagError, match="no index.*rosbag reindex"):
        BagReader(copy)


def test_damage_inside_is_told_with_its_time(make, messages, tmp_path):
    path = make.bag(
        tmp_path / "a.bag", messages, compression=rosbag.Compression.BZ2, chunk_threshold=100000
    )
    data = bytearray(path.read_bytes())
    middle = data.index(b"BZh9", len(data) // 2)  # a chunk of the second half
    data[middle + 20 : middle + 60] = bytes(40)
    path.write_bytes(data)
    with BagReader(path) as bag, pytest.raises(BagError, match="damaged after .* s"):
        list(bag.messages(["/points"]))


def test_what_is_no_bag_is_refused_in_one_line(tmp_path):
    absent, text, empty = tmp_path / "absent.bag", tmp_path / "text.bag", tmp_path / "empty.bag"
    text.write_text("no bag")
    empty.write_bytes(b"")
    for path in (absent, text, empty, tmp_path):
        with pytest.raises(BagError, match=str(path)) as caught:
            BagReader(path)
        assert "\n" not in str(caught.value)


def test_a_bag_without_messages_is_refused(make, tmp_path):
    with pytest.raises(BagError, match="empty"):
        BagReader(make.bag(tmp_path / "a.bag", []))


def test_an_absent_topic_lists_those_of_its_type(make, messages, tmp_path):
    with BagReader(make.bag(tmp_path / "a.bag", messages)) as bag:
        error = bag.absent("/lidar", ["sensor_msgs/PointCloud2"], "sensor 'lidar_1'")
    assert "/lidar (sensor 'lidar_1')" in str(error) and "PointCloud2: /points" in str(error)
