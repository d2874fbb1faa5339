"""A clock that is set while a bag is recorded is told, and what it stamped is weak."""

import numpy as np
import pytest

pytest.importorskip("rospy")

import rospy
from stand_in_rig import messages

from atom_calibration.collect.clock_watch import ClockWatch
from atom_calibration.nodes.collecting.collect_from_bag import main
from atom_core.io.dataset_json import read_dataset


def jumping(make, by_s, topic="/lidar/points", from_s=106.0):
    """Return the messages of a rig; stamps of a topic jump."""
    content = list(messages(make, stops=8))
    for name, message, time_s in content:
        if name == topic and time_s > from_s:
            stamp_s = message.header.stamp.to_sec() + by_s
            message.header.stamp = rospy.Time.from_sec(stamp_s)
    return content


@pytest.mark.parametrize(("by_s", "side"), [(0.8, "ahead by 0.80"), (-0.6, "back by 0.60")])
def test_a_sensor_whose_clock_is_set_amid_the_recording_is_weak(place, make, capsys, by_s, side):
    assert main(place(jumping(make, by_s))) in (0, 1)
    told = f"sensor 'lidar': about 6.0 s after the beginning its stamps jump {side} s"
    assert capsys.readouterr().err.count(told) == 1
    (caveat,) = read_dataset(place.folder / "dataset.json").caveats
    assert caveat.sensors == ("lidar",) and "--use_receive_time lidar" in caveat.remedy


def test_the_times_of_receipt_help(place, make):
    assert main([*place(jumping(make, 0.8)), "--use_receive_time", "lidar", "cam"]) == 0
    assert read_dataset(place.folder / "dataset.json").caveats == ()


def caveats_of(**lags_s):
    """Return what is in doubt of sensors of 10 Hz, whose data come so late after their stamps."""
    watch = ClockWatch(lags_s)
    times_s = 100.0 + 0.1 * np.arange(200)
    received = [
        (stamp_s + lag_s, stamp_s, name)
        for name, each_s in lags_s.items()
        for stamp_s, lag_s in zip(times_s, each_s)
    ]
    for received_s, stamp_s, name in sorted(received):
        watch.note(name, stamp_s, received_s)
    return watch.caveats


FAST = np.full(200, 0.02)
LATER = np.arange(200) >= 100


def test_delays_that_begin_or_end_are_no_jumps_of_a_clock():
    busy = np.random.default_rng(0).uniform(0.0, 0.8, 200)
    assert caveats_of(cam=FAST + busy, lidar=FAST) == []
    assert caveats_of(cam=FAST + 1.0 * LATER, lidar=FAST) == []
    assert caveats_of(cam=FAST + 1.0 * ~LATER, lidar=FAST) == []
    assert caveats_of(cam=FAST + 1.0 * ~LATER, lidar=FAST + 1.0) == []


def test_a_jump_ahead_is_one_in_a_copy_of_a_recording_too_unless_all_jump():
    for copied_s in (0.0, 5000.0):
        usual = FAST + copied_s
        (caveat,) = caveats_of(cam=usual - 1.0 * LATER, lidar=usual)
        assert caveat.sensors == ("cam",) and "jump ahead by 1.00 s" in caveat.what
        assert caveats_of(cam=usual - 1.0 * LATER, lidar=usual - 1.0 * LATER) == []


def test_one_sensor_alone_is_judged_by_nothing():
    assert caveats_of(cam=FAST - 1.0 * LATER) == []
