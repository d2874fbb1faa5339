"""A bag is read as it was recorded, and a broken one is told from a whole one."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import rosbag
import rospy

from atom_calibration.errors import BagError
from atom_calibration.sources import bag_index
from atom_calibration.sources.bag_parts import bag_files, name_of, named_together, other_parts
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


def test_a_window_costs_its_own_messages_and_not_those_before_it(make, tmp_path, monkeypatch):
    moves = [("/tf", make.tf("a", "b", np.eye(4)), 10.0 + 0.01 * i) for i in range(2000)]
    looked_at = []
    time_ns = bag_index._time_ns
    monkeypatch.setattr(bag_index, "_time_ns", lambda e: looked_at.append(e) or time_ns(e))
    with BagReader(make.bag(tmp_path / "a.bag", moves)) as bag:
        list(bag.messages(["/tf"]))
        looked_at.clear()
        assert len(list(bag.messages(["/tf"], 28.0, 28.1))) == 11
        assert len(looked_at) < 100


def test_messages_come_in_the_order_of_their_times_whatever_chunk_holds_them(make, tmp_path):
    cloud = make.xyz_cloud(np.ones((2000, 3)))
    shuffled = [("/points", cloud, 10.0 + 0.1 * (7 * i % 40)) for i in range(40)]
    with BagReader(make.bag(tmp_path / "a.bag", shuffled, chunk_threshold=100000)) as bag:
        times = [m.recorded_s for m in bag.messages(["/points"])]
        assert times == pytest.approx([10.0 + 0.1 * i for i in range(40)])
        within = [m.recorded_s for m in bag.messages(["/points"], 11.0, 12.0)]
        assert within == pytest.approx([11.0 + 0.1 * i for i in range(11)])


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


# ---- recordings in parts


@pytest.fixture
def parts(make, messages, tmp_path):
    """Return the files of a recording in three parts."""
    contents = messages[:15], messages[15:28], messages[28:]
    return [make.bag(tmp_path / f"rig_{n}.bag", some) for n, some in enumerate(contents)]


def contents(bag, *limits):
    return [(m.topic, m.recorded_s) for m in bag.messages(["/points"], *limits)]


def test_parts_are_read_as_the_whole_recording(make, messages, tmp_path, parts):
    with BagReader(make.bag(tmp_path / "whole.bag", messages)) as whole, BagReader(parts) as bag:
        assert contents(bag) == contents(whole) and len(contents(bag)) == 40
        assert contents(bag, 11.0, 12.5) == contents(whole, 11.0, 12.5)
        assert (bag.types, bag.counts) == (whole.types, whole.counts)
        assert (bag.start_s, bag.end_s) == (whole.start_s, whole.end_s)
        assert bag.first("/points").header.stamp == whole.first("/points").header.stamp
        assert bag.size_bytes == sum(part.stat().st_size for part in parts)
        assert str(bag.path) == str(tmp_path / "rig_0.bag ... rig_2.bag")


def test_parts_are_merged_by_time_whatever_their_order(messages, make, tmp_path, parts):
    with BagReader(parts[::-1]) as bag, BagReader(tmp_path / "rig_*.bag") as by_pattern:
        assert contents(bag) == contents(by_pattern)
        assert bag.files == parts[::-1] and by_pattern.files == parts


def test_a_part_that_is_absent_damaged_or_of_another_recording_is_named(make, parts, tmp_path):
    with pytest.raises(BagError, match=r"rig_7\.bag: the bag cannot be read"):
        BagReader([*parts, tmp_path / "rig_7.bag"])
    with pytest.raises(BagError, match=r"other\.bag: /points carries .*Image, in .*rig_0\.bag"):
        image = make.image(np.zeros((4, 4), dtype=np.uint8), "mono8")
        BagReader([*parts, make.bag(tmp_path / "other.bag", [("/points", image, 11.0)])])
    parts[1].write_bytes(parts[1].read_bytes()[:-400])
    with pytest.raises(BagError, match=r"rig_1\.bag.*(reindex|damaged)"), BagReader(parts) as bag:
        contents(bag)


def test_a_pattern_names_files_in_the_order_of_their_numbers_once_each(tmp_path):
    for name in ("a_10.bag", "a_9.bag", "a_0.bag", "b.bag", "c[1].bag"):
        (tmp_path / name).touch()
    names = lambda *given: [f.name for f in bag_files([tmp_path / name for name in given])]  # noqa: E731
    assert names("a_*.bag") == ["a_0.bag", "a_9.bag", "a_10.bag"]
    assert names("a_9.bag", "a_*.bag") == ["a_9.bag", "a_0.bag", "a_10.bag"]
    assert names("a_?.bag") == ["a_0.bag", "a_9.bag"]
    assert names("c[1].bag") == ["c[1].bag"]  # a file of that name is itself
    assert names("none_*.bag") == ["none_*.bag"]


def test_a_pattern_without_files_is_refused_by_its_name(tmp_path):
    with pytest.raises(BagError, match=r"none_\*\.bag: the bag cannot be read"):
        BagReader(tmp_path / "none_*.bag")


def test_a_recording_has_the_name_that_its_parts_share():
    assert name_of([Path("/a/train.bag")]) == "train"
    assert name_of([Path("/a/train_0.bag"), Path("/a/train_1.bag")]) == "train"
    assert name_of([Path("/a/x.bag"), Path("/a/y.bag")]) == "x"
    assert named_together([Path("/a/x.bag")]) == Path("/a/x.bag")


def test_other_parts_of_a_recording_are_noticed(tmp_path, parts):
    assert other_parts([parts[1]]) == [parts[0], parts[2]]
    assert other_parts(parts) == []
    shutil.copy(parts[0], tmp_path / "whole.bag")
    assert other_parts([tmp_path / "whole.bag"]) == []
    parts[1].unlink()  # a recording in parts leaves no number out
    assert other_parts([parts[0]]) == []
