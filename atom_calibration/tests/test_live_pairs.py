"""Data and labels of one stamp are paired live; data that nobody labels are not kept."""

import message_filters
import pytest
import rospy

from atom_calibration.nodes.collecting.live_collector import forget_before


class Stamped:
    def __init__(self, make, time_s):
        self.header = make.header("cam", time_s)


@pytest.fixture
def pairing(monkeypatch):
    """Two filters, for data and labels; what was paired; the data that wait."""
    monkeypatch.setattr(rospy.Time, "now", staticmethod(lambda: rospy.Time(1)))
    data, labels, paired = message_filters.SimpleFilter(), message_filters.SimpleFilter(), []
    pair = message_filters.TimeSynchronizer([data, labels], 100)
    pair.registerCallback(lambda message, _labels: paired.append(message.header.stamp.to_sec()))
    pair.registerCallback(forget_before, pair.queues[0])
    return data, labels, paired, pair.queues[0]


def test_data_that_are_passed_over_do_not_stay(make, pairing):
    data, labels, paired, waiting = pairing
    for tenth in range(1, 1000):
        data.signalMessage(Stamped(make, tenth / 10))
        if tenth % 5 == 0:
            labels.signalMessage(Stamped(make, tenth / 10))
            assert not waiting
    assert paired == pytest.approx([0.5 * number for number in range(1, 200)])


def test_newer_data_wait_for_their_labels(make, pairing):
    data, labels, paired, waiting = pairing
    for tenth in range(1, 31):
        data.signalMessage(Stamped(make, tenth / 10))
    labels.signalMessage(Stamped(make, 1.0))
    assert len(waiting) == 20 and min(waiting).to_sec() == pytest.approx(1.1)
    labels.signalMessage(Stamped(make, 3.0))
    assert paired == pytest.approx([1.0, 3.0]) and not waiting
