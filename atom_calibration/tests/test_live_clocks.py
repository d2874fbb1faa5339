"""Live, a clock that is off is said with its remedy, and data without stamps are refused."""

from types import SimpleNamespace

import numpy as np
import pytest
import rospy

from atom_calibration.collect.live_clocks import LiveClocks
from atom_calibration.errors import CollectionError, MessageError
from atom_calibration.nodes.collecting.labeler_node import LabelerNode
from atom_calibration.nodes.collecting.live_collector import LiveCollector
from atom_calibration.sources.receipts import ReceiptTimes

NOW_S = 1.7e9


@pytest.fixture
def clock(monkeypatch):
    """The time that nodes see [s], which tests move."""
    clock = SimpleNamespace(now_s=NOW_S)
    now = staticmethod(lambda: rospy.Time.from_sec(clock.now_s))
    monkeypatch.setattr(rospy.Time, "now", now)
    return clock


@pytest.fixture
def cloud(make):
    """Data with a stamp [s]."""
    return lambda stamp_s: make.xyz_cloud(np.ones((3, 3)), stamp_s=stamp_s)


def watched(clock, cloud, stamps_s, received=()):
    """Two sensors send for two seconds; `stamps_s` is what each one's clock says at a time."""
    clocks = LiveClocks(stamps_s, received)
    told = []
    for _ in range(20):
        clock.now_s += 0.1
        for name, said_s in stamps_s.items():
            clocks.note(cloud(said_s(clock.now_s)), name)
        told += clocks.check()
    return clocks, told


@pytest.mark.parametrize(
    "lidar_s, said",
    [
        (lambda now_s: now_s + 3.0, "stamps lie 3.00 s after those of the other sensors"),
        (lambda now_s: now_s - 3.0, "received 3.00 s later after their stamps"),
        (lambda now_s: now_s - NOW_S + 312.0, "stamps are 1699999688.0 s before those"),
    ],
)
def test_a_clock_that_is_off_is_told_once_with_its_remedy(clock, cloud, lidar_s, said):
    clocks, told = watched(clock, cloud, {"cam": lambda now_s: now_s, "lidar": lidar_s})
    assert len(told) == 1 and said in told[0] and "sensor 'lidar'" in told[0]
    assert "use_receive_time:='lidar'" in told[0]
    assert clocks.why_behind(3.0) == told[0]


def test_data_that_are_late_for_want_of_speed_blame_no_clock(clock, cloud):
    stamps_s = {"cam": lambda now_s: now_s - 0.02, "lidar": lambda now_s: now_s - 0.12}
    clocks, told = watched(clock, cloud, stamps_s)
    assert not told and "too slow" in clocks.why_behind(3.0)


@pytest.mark.parametrize("speed", [0.3, 2.0])
def test_a_recording_that_is_played_at_another_speed_without_a_clock_blames_no_sensor(
    clock, cloud, speed
):
    clocks, told = LiveClocks(["cam", "lidar"], ()), []
    for tick in range(40):  # the camera has half as many images
        clock.now_s += 0.1 / speed
        clocks.note(cloud(100.0 + 0.1 * tick), "lidar")
        if tick % 2 == 0:
            clocks.note(cloud(100.0 + 0.1 * tick), "cam")
        told += clocks.check()
    (line,) = told
    assert f"go at {speed:.2f} of the speed" in line and "--clock" in line
    assert "use_receive_time" not in line


def test_a_clock_whose_stamps_are_not_used_is_not_blamed(clock, cloud):
    stamps_s = {"cam": lambda now_s: now_s, "lidar": lambda now_s: now_s + 3.0}
    assert not watched(clock, cloud, stamps_s, ["lidar"])[1]


@pytest.mark.parametrize("received", [(), ("lidar",)])
def test_live_data_without_stamps_are_refused_with_what_helps(clock, cloud, received):
    stamps_s = {"cam": lambda now_s: now_s, "lidar": lambda _: 0.0}
    with pytest.raises(CollectionError, match="'lidar': its stamps are all zero.*collect_from_bag"):
        watched(clock, cloud, stamps_s, received)


def test_zero_is_a_stamp_when_a_simulation_begins(clock, cloud):
    clock.now_s = 0.0
    clocks = LiveClocks(["lidar"], ())
    for _ in range(5):
        clocks.note(cloud(0.0), "lidar")
    assert not clocks.check()


def test_a_clock_that_was_left_behind_is_told_once_and_judges_nobody(clock, cloud):
    clocks, told, stamp_s = LiveClocks(["cam", "lidar"], ()), [], NOW_S
    clock.now_s = 0.0  # /use_sim_time of an earlier launch file
    for _ in range(30):
        stamp_s += 0.1
        for name in ("cam", "lidar"):
            clocks.note(cloud(stamp_s), name)
        told += clocks.check()
    (line,) = told
    assert "nobody publishes /clock" in line and "rosparam set use_sim_time false" in line


@pytest.mark.parametrize(
    "begin_s, now_s, stale",
    [
        (0.0, 0.0, True),  # no clock ever went
        (100.0, 100.0, False),  # a recording is paused
        (100.0, 120.0, True),
        (100.0, 80.0, True),  # it is played again, without these data
    ],
)
def test_data_that_have_ceased_to_come_are_not_saved(clock, monkeypatch, begin_s, now_s, stale):
    live = LiveCollector.__new__(LiveCollector)
    clock.now_s = begin_s
    live._data_came()
    clock.now_s = now_s
    seconds = live.last_data_s + 60.0
    monkeypatch.setattr("time.monotonic", lambda: seconds)
    assert live._is_stale() is stale


def labeler(received=()):
    sensor = SimpleNamespace(name="lidar", topic="/points")
    links = SimpleNamespace(sights=SimpleNamespace(clear=lambda: None))
    node = LabelerNode.__new__(LabelerNode)
    node._sensor, node._receipts, node._links = sensor, ReceiptTimes(received), links
    node._labeler = SimpleNamespace(begin_anew=lambda: pytest.fail("began anew"))
    node._stamp_s, node._period_s, node._data_frame = -np.inf, 0.16, None
    return node


def test_a_labeler_says_at_each_message_that_stamps_are_missing(clock, cloud):
    node = labeler(["lidar"])
    for _ in range(5):
        clock.now_s += 1.0
        assert node._is_due(cloud(0.0))
        with pytest.raises(MessageError, match="its stamps are all zero"):
            node._check_header(cloud(0.0))


def test_a_labeler_goes_by_the_time_of_receipt_where_stamps_are_not_used(clock, cloud):
    node = labeler(["lidar"])
    due = []
    for stamp_s in (50.0, 49.9, 20.0, 20.0001):  # a clock that is set back, and almost stands
        clock.now_s += 1.0
        node._receipts.note(cloud(stamp_s), "lidar")
        due.append(node._is_due(cloud(stamp_s)))
    assert due == [True] * 4
