"""Live data of a sensor whose clock is wrong are taken at the time they came, with their labels."""

import numpy as np
import pytest
import rospy
from std_msgs.msg import Header

from atom_calibration.collect.collector import Setup
from atom_calibration.collect.stamps import check_received
from atom_calibration.errors import CollectionError
from atom_calibration.labels.label_messages import labels_message
from atom_calibration.messages.headers import stamp_s
from atom_calibration.modalities.frames import decode
from atom_calibration.nodes.collecting.live_collector import LiveCollector
from atom_calibration.sources.receipts import ReceiptTimes
from atom_core.io.collections import CollectionStore
from atom_core.labeling.base import Labeled
from atom_core.model.labels import RgbLabel
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import RGB, Sensor
from atom_core.model.transforms import Edge
from atom_core.synthetic import scenes

BOOT_S, CAME_S = 12.5, 1000.25  # the sensor's clock counts from when it was switched on


class Clock:
    """The time that nodes see."""

    now_s = CAME_S

    def now(self):
        return rospy.Time.from_sec(self.now_s)


class Quiet:
    """A board on which nobody looks."""

    def __getattr__(self, _name):
        return lambda *_words: None


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(rospy.Time, "now", staticmethod(clock.now))
    return clock


def data_at(make, time_s):
    return make.image(np.zeros((24, 32, 3), np.uint8), frame="cam", stamp_s=time_s)


def test_data_and_labels_of_one_stamp_have_the_time_at_which_the_data_came(make, clock):
    receipts, data = ReceiptTimes(["cam"]), data_at(make, BOOT_S)
    receipts.note(data, "cam")
    clock.now_s += 0.7  # until the labels are there
    labels = type("Labels", (), {"header": Header(stamp=data.header.stamp)})()
    assert receipts.time_s(data, "cam") == receipts.time_s(labels, "cam") == CAME_S
    assert stamp_s(receipts.stamped(data, "cam")) == CAME_S
    assert stamp_s(data) == BOOT_S  # others hold the same message


def test_other_sensors_keep_their_stamps(make, clock):
    receipts, data = ReceiptTimes(["cam"]), data_at(make, BOOT_S)
    receipts.note(data, "other")
    assert receipts.stamped(data, "other") is data and receipts.time_s(data, "other") == BOOT_S
    assert "cam" in receipts and "other" not in receipts


def test_only_the_last_times_are_remembered(make, clock):
    receipts = ReceiptTimes(["cam"])
    for number in range(2000):
        receipts.note(data_at(make, BOOT_S + number), "cam")
    assert receipts.time_s(data_at(make, BOOT_S), "cam") == BOOT_S
    assert receipts.time_s(data_at(make, BOOT_S + 1999), "cam") == CAME_S


def test_a_name_that_is_no_sensor_is_refused():
    check_received(["cam"], ["cam", "lidar"])
    with pytest.raises(CollectionError, match="no sensor 'radar'; there are cam, lidar"):
        check_received(["radar"], ["cam", "lidar"])


def collector(folder, receipts):
    """A collector of one camera; its sensor, its patterns."""
    dataset = scenes.two_cameras(0, collections=2).dataset
    config = dataset.config
    patterns = {n: pattern_from_config(n, p) for n, p in config.calibration_patterns.items()}
    sensor = dataset.sensors["rgb_1"]
    sensor = Sensor("rgb_1", RGB, sensor.frame, Edge(*sensor.edge), camera=sensor.camera)
    setup = Setup(config, {"rgb_1": sensor}, patterns, None, CollectionStore.create(folder))
    return LiveCollector(setup, None, Quiet(), False, receipts), sensor, patterns


def test_the_collector_pairs_by_the_stamps_and_takes_the_time_of_receipt(make, clock, tmp_path):
    receipts = ReceiptTimes(["rgb_1"])
    live, sensor, patterns = collector(tmp_path / "d", receipts)
    data = data_at(make, BOOT_S)
    receipts.note(data, "rgb_1")
    clock.now_s += 0.4
    frame = decode(sensor, data)
    pixels = np.array([[3.0, 4.0], [9.0, 4.0], [3.0, 9.0], [9.0, 9.0]])
    frame.set_label("pattern_1", Labeled(RgbLabel(np.array([0, 1, 11, 12]), pixels)))
    labels = labels_message(frame, patterns)
    assert stamp_s(labels) == BOOT_S
    live._receive(data, labels, sensor)
    live.work(0.0)
    taken = live._newest["rgb_1"]
    assert taken.stamp_s == CAME_S and taken.detections == 1
    assert taken.header["stamp"]["secs"] == int(CAME_S)  # so it is written


def test_the_collector_ends_where_a_driver_sets_no_stamps(make, clock, tmp_path):
    live, _, _ = collector(tmp_path / "d", ReceiptTimes(["rgb_1"]))
    for _ in range(3):
        live.work(0.0)
        live._clocks.note(data_at(make, 0.0), "rgb_1")
    with pytest.raises(CollectionError, match="'rgb_1': its stamps are all zero"):
        live.work(0.0)
