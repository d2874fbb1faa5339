"""Frames come out in the order of their stamps, and nobody waits for a sensor that is gone."""

import numpy as np
import pytest

from atom_calibration.collect.time_order import TimeOrder
from atom_calibration.modalities.frames import Frame
from atom_core.model.sensor import LIDAR3D, Sensor
from atom_core.model.transforms import Edge


def frame(name, stamp_s):
    sensor = Sensor(name, LIDAR3D, name, Edge("world", name))
    return Frame(sensor, stamp_s, {}, np.zeros(0))


def stamps(frames):
    return [f.stamp_s for f in frames]


def test_a_frame_waits_until_every_sensor_is_past_it():
    order = TimeOrder()
    assert stamps(order.add(frame("fast", 1.0))) == [1.0]
    assert order.add(frame("slow", 1.0)) and not order.add(frame("fast", 1.1))
    assert not order.add(frame("fast", 1.2))
    assert stamps(order.add(frame("slow", 1.15))) == [1.1, 1.15]
    assert stamps(order.flush()) == [1.2]


def test_at_the_beginning_every_expected_sensor_is_waited_for():
    order = TimeOrder(("fast", "slow"), hold_s=1.0)
    assert stamps(order.add(frame("fast", 5.0))) == [5.0]
    assert not order.add(frame("fast", 5.2)) and not order.goes_back(frame("slow", 3.0))
    assert stamps(order.add(frame("slow", 5.2))) == [5.2, 5.2]
    order.clear()
    assert stamps(order.add(frame("fast", 1.0))) == [1.0]
    out = [s for i in range(1, 30) for s in stamps(order.add(frame("fast", 1.0 + 0.1 * i)))]
    assert out[-1] == pytest.approx(3.9)  # one that never comes does not hold up the others


@pytest.mark.parametrize("seed", range(5))
def test_any_delays_below_the_limit_come_out_sorted_and_complete(seed):
    rng = np.random.default_rng(seed)
    sent = [(0.1 * i, name) for i in range(100) for name in ("a", "b", "c")]
    delay = {"a": 0.02, "b": 0.3, "c": 0.9}
    arrival = [stamp + delay[name] * rng.uniform(0.5, 1.0) for stamp, name in sent]
    arrival = [max(t, *arrival[i % 3 : i + 1 : 3]) for i, t in enumerate(arrival)]
    order, out = TimeOrder(hold_s=1.5), []
    out += order.add(frame("c", 0.0)) + order.add(frame("a", 0.0)) + order.add(frame("b", 0.0))
    for i in np.argsort(arrival, kind="stable"):
        out += order.add(frame(sent[i][1], sent[i][0]))
    out += order.flush()
    assert stamps(out) == sorted(stamps(out))
    assert len(out) == len(sent) + 3
    assert not order.late


def test_a_sensor_that_ended_is_not_waited_for_longer_than_allowed():
    order = TimeOrder(hold_s=1.0)
    order.add(frame("ends", 0.0))
    out = [s for i in range(30) for s in stamps(order.add(frame("goes_on", 0.1 * i)))]
    assert out[-1] == pytest.approx(2.9)


def test_what_comes_too_late_is_dropped_and_counted():
    order = TimeOrder(hold_s=1.0)
    order.add(frame("slow", 0.0))
    order.add(frame("fast", 5.0))
    assert order.add(frame("slow", 0.4)) == []
    assert order.late == {"slow": 1}


def test_a_repeated_bag_is_noticed_and_nothing_of_the_first_time_stays():
    order = TimeOrder()
    order.add(frame("a", 100.0))
    order.add(frame("b", 100.5))
    assert not order.goes_back(frame("a", 99.5))  # jitter
    assert order.goes_back(frame("a", 10.0))
    assert not order.goes_back(frame("new", 10.0))
    order.clear()
    assert stamps(order.add(frame("a", 10.0))) == [10.0]
    assert not order.late


def test_a_frame_is_late_once_later_ones_were_given_out():
    order = TimeOrder()
    order.add(frame("fast", 1.0))
    order.add(frame("fast", 4.0))
    assert order.is_late(frame("slow", 3.9)) and not order.is_late(frame("slow", 4.0))
    assert order.add(frame("slow", 3.9)) == [] and order.late == {"slow": 1}
