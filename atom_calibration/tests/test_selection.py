"""Frames of one moment: near in time, detections first, and never across a motion."""

import numpy as np
import pytest

from atom_calibration.collect.selection import (
    Moment,
    RecentFrames,
    StopMoments,
    SwitchedMoments,
    TimedMoments,
    check_still,
    choose_frames,
    same_place,
    skew_s,
)
from atom_calibration.errors import CollectionError
from atom_calibration.modalities.frames import Frame
from atom_core.geometry.camera import Camera
from atom_core.labeling.base import Labeled, nothing
from atom_core.labeling.stillness import CornerSighting, PlaneSighting
from atom_core.model.labels import RgbLabel
from atom_core.model.sensor import LIDAR3D, RGB, Sensor
from atom_core.model.transforms import Edge

CAMERA = Camera(64, 48, np.diag([50.0, 50.0, 1.0]))
GRID = np.stack(np.meshgrid(np.arange(5), np.arange(4)), axis=-1).reshape(-1, 2) * 9.0


def frame(name, stamp_s, shift_px=0.0, detected=True):
    sensor = Sensor(name, RGB, name, Edge("world", name), CAMERA, f"/{name}")
    made = Frame(sensor, stamp_s, {}, np.zeros((48, 64, 3), np.uint8))
    made.labels["p"] = nothing(RGB, "no markers")
    if detected:
        made.labels["p"] = Labeled(RgbLabel(np.arange(20), GRID + shift_px))
        made.sightings["p"] = CornerSighting(np.arange(20), GRID + shift_px)
    return made


def test_the_stamps_are_as_near_as_can_be():
    frames = [frame("a", t) for t in (0.0, 0.5, 1.0)] + [frame("b", t) for t in (0.2, 0.45, 0.9)]
    chosen = choose_frames(frames, Moment(0.0, 1.0), 0.3)
    assert (chosen["a"].stamp_s, chosen["b"].stamp_s) == (0.5, 0.45)


def test_a_detection_counts_more_than_nearness():
    frames = [frame("a", 0.5), frame("b", 0.5, detected=False), frame("b", 0.4)]
    assert choose_frames(frames, Moment(0.0, 1.0), 0.3)["b"].stamp_s == 0.4


def test_no_two_stamps_differ_by_more_than_allowed():
    rng = np.random.default_rng(0)
    for _ in range(50):
        frames = [frame(n, t) for n in "abc" for t in rng.uniform(0, 3, 5)]
        chosen = choose_frames(frames, Moment(0.0, 3.0), 0.2)
        assert skew_s(chosen) <= 0.2 + 1e-5


def test_stamps_that_lie_as_far_apart_as_allowed_make_one_collection():
    frames = [frame("a", t) for t in (0.0, 0.2)] + [frame("b", t) for t in (0.04, 0.24)]
    assert set(choose_frames(frames, Moment(0.0, 1.0), 0.05)) == {"a", "b"}
    around = [frame("a", 0.52), frame("b", 0.5), frame("c", 0.545)]  # b before, c after
    assert set(choose_frames(around, Moment(0.0, 1.0), 0.05)) == {"a", "b", "c"}
    assert len(choose_frames(around, Moment(0.0, 1.0), 0.04)) == 2


def test_a_sensor_without_data_of_the_moment_is_left_out():
    frames = [frame("a", 0.5), frame("b", 5.0)]
    assert set(choose_frames(frames, Moment(0.0, 6.0, centre_s=0.5), 0.3)) == {"a"}


def recent(*frames):
    memory = RecentFrames(100.0)
    for one in sorted(frames, key=lambda f: f.stamp_s):
        memory.add(one)
    return memory


def test_a_board_that_stood_still_during_the_skew_is_accepted():
    frames = [frame("a", t) for t in (0.0, 0.4, 0.8)] + [frame("b", 0.6)]
    chosen = {"a": frames[1], "b": frames[3]}
    check_still(chosen, recent(*frames), Moment(0.0, 1.0, 0.5))


def test_around_a_time_what_was_seen_shortly_before_tells_of_slow_sensors():
    frames = [frame("a", t) for t in (0.0, 0.4, 0.8)] + [frame("b", 0.42)]
    check_still({"a": frames[1], "b": frames[3]}, recent(*frames), Moment(0.39, 0.44, 0.41))
    moving = [frame("a", t, 50.0 * t) for t in (0.0, 0.4, 0.8)] + [frame("b", 0.42)]
    with pytest.raises(CollectionError, match="the board moved"):
        check_still({"a": moving[1], "b": moving[3]}, recent(*moving), Moment(0.39, 0.44, 0.41))


def test_a_board_that_moved_during_the_skew_is_refused_with_sensor_and_time():
    frames = [frame("a", t, 5.0 * t) for t in (0.0, 0.4, 0.8)] + [frame("b", 0.6)]
    with pytest.raises(CollectionError, match=r"time 0\.400.*sigmas.*sensor 'a'.*200 ms"):
        check_still({"a": frames[1], "b": frames[3]}, recent(*frames), Moment(0.0, 1.0, 0.5))


def test_how_a_board_comes_to_a_stop_and_leaves_it_does_not_count():
    shifts = [(9.7, -40.0), (10.0, 0.0), (10.5, 0.05), (11.0, 0.0), (11.5, 0.05), (11.8, 40.0)]
    frames = [frame("a", t, shift) for t, shift in shifts]
    chosen, stop = {"a": frames[2], "b": frame("b", 10.35)}, Moment(10.0, 11.5)
    check_still(chosen, recent(*frames, chosen["b"]), stop)
    slid = [frame("a", t, 60.0 * (t - 10.0)) for t, _ in shifts]
    with pytest.raises(CollectionError, match=r"moved by .* sigmas"):
        check_still({**chosen, "a": slid[2]}, recent(*slid, chosen["b"]), stop)


def test_a_board_that_swings_back_to_where_it_was_is_refused():
    frames = [frame("a", t, shift) for t, shift in ((0.0, 0.0), (0.4, 30.0), (0.8, 0.0))]
    other = frame("b", 0.6)
    with pytest.raises(CollectionError, match=r"moved by .* sigmas"):
        check_still({"a": frames[1], "b": other}, recent(*frames, other), Moment(0.0, 1.0, 0.5))


def test_what_no_sensor_saw_twice_is_refused():
    frames = {"a": frame("a", 0.0), "b": frame("b", 0.2)}
    with pytest.raises(CollectionError, match="no sensor saw the board twice"):
        check_still(frames, recent(*frames.values()), Moment(0.0, 0.2))


def test_one_place_is_told_from_another():
    here, again, there = frame("a", 0), frame("a", 1, 0.1), frame("a", 2, 30.0)
    assert same_place({"a": again}, {"a": here})
    assert not same_place({"a": there}, {"a": here})
    assert not same_place({"b": frame("b", 3)}, {"a": here})


def test_memory_is_bounded_by_time():
    memory = RecentFrames(2.0)
    for number in range(1000):
        memory.add(frame("a", 0.01 * number))
    kept = memory.between(-1e9, 1e9)
    newest = memory.between(9.99 - 0.19, 1e9)  # what they go with is not known yet
    assert len(newest) <= 20 and len(kept) - len(newest) <= 11 and kept[0].stamp_s >= 9.99 - 2.0


def test_memory_of_late_and_of_silent_sensors_is_bounded_too():
    memory = RecentFrames(2.0)
    for number in range(1000):
        memory.add(frame("a", 0.01 * number))
        memory.add(frame("late", 0.01 * number - 1.0))
        if number < 200:
            memory.add(frame("silent", 0.01 * number))
    assert len(memory.between(-1e9, 1e9)) <= 20 + 2 * 12


def test_frames_that_belong_together_are_remembered_whatever_was_lost_before():
    for lost in (0, 1, 2, 5):  # of a camera that is triggered together with the other one
        left = [frame("left", t) for t in np.arange(0.0, 1.5, 1 / 30)]
        right = [frame("right", f.stamp_s) for f in left[lost:]]
        kept = recent(*left, *right).between(0.0, 2.0)
        assert len(kept) < 30
        chosen = choose_frames(kept, Moment(0.2, 1.5), 0.01)
        assert set(chosen) == {"left", "right"} and skew_s(chosen) == 0.0


def test_what_is_remembered_fits_together_about_as_well_as_all_there_was():
    rng = np.random.default_rng(0)
    worse = []
    for _ in range(60):
        periods_s = rng.choice([0.033, 0.05, 0.1, 0.2], 3)
        frames = [
            frame(name, t)
            for name, period_s in zip("abc", periods_s)
            for t in np.arange(rng.uniform(0, period_s), 3.0, period_s)
        ]
        kept, stop = recent(*frames).between(0.0, 3.0), Moment(0.7, 2.2)
        of_all = [f for f in frames if 0.7 <= f.stamp_s <= 2.2]
        of_kept = [f for f in kept if 0.7 <= f.stamp_s <= 2.2]
        best, left = (skew_s(choose_frames(of, stop, 0.4)) for of in (of_all, of_kept))
        worse.append(left - best)
    assert np.mean(worse) < 0.002 and np.max(worse) < 0.02


def test_times_are_due_when_all_their_data_have_come():
    moments = TimedMoments([1.0, 2.0], 0.4)
    due = [m.centre_s for t in np.arange(0.0, 2.0, 0.1) for m in moments.add(frame("a", t))]
    assert due == [1.0]
    assert [m.centre_s for m in moments.finish()] == [2.0]


def test_all_times_near_the_end_are_taken_though_stamps_may_lie_far_apart():
    """Of 13 pictures a second apart, stamps of a collection up to 1 s, the last was lost."""
    moments, wanted = TimedMoments([0.0, 1.0, 2.0, 3.0], 1.0), [0.0, 1.0, 2.0, 3.0]
    due = [m.centre_s for t in wanted for m in moments.add(frame("a", t))]
    assert [*due, *(m.centre_s for m in moments.finish())] == wanted


def range_frame(stamp_s):
    """A LiDAR that notices no motion, as of a board that slides in its plane."""
    sensor = Sensor("lidar", LIDAR3D, "lidar", Edge("world", "lidar"), None, "/lidar")
    made = Frame(sensor, stamp_s, {}, np.zeros(0))
    made.sightings["p"] = PlaneSighting(np.zeros(3), np.array([1.0, 0, 0]), 0.3, 0.01, 99, 15.0)
    return made


def stops_of(frames):
    moments = StopMoments(["p"])
    found = [m for f in sorted(frames, key=lambda f: f.stamp_s) for m in moments.add(f)]
    return found + list(moments.finish())


def test_where_a_camera_sees_motion_a_range_sensor_does_not_make_a_stop():
    lidar = [range_frame(t) for t in np.arange(0.0, 2.0, 0.1)]
    assert len(stops_of(lidar)) == 1
    assert stops_of([*lidar, *(frame("a", t, 30.0 * t) for t in (0.0, 1.0, 1.9))]) == []
    assert stops_of([*lidar[8:16], frame("a", 0.1), frame("a", 1.1, 30.0)]) == []


def test_where_no_camera_sees_the_board_range_sensors_make_the_stop():
    lidar = [range_frame(t) for t in np.arange(2.0, 4.0, 0.1)]
    assert len(stops_of([*lidar, frame("a", 1.0), frame("a", 1.5, 30.0)])) == 1


def test_a_stop_after_which_nobody_sees_the_board_is_due_before_its_data_are_forgotten():
    moments = StopMoments(["p"])
    seen = [frame("a", t) for t in np.arange(0.0, 1.05, 0.1)]
    gone = [frame("a", t, detected=False) for t in np.arange(1.1, 10.0, 0.1)]
    due = [(f.stamp_s, m) for f in [*seen, *gone] for m in moments.add(f)]
    assert [moment for _, moment in due] == [Moment(0.0, pytest.approx(1.0))]
    assert due[0][0] - due[0][1].start_s < moments.memory_s
    assert list(moments.finish()) == []


def test_moments_count_only_while_they_are_switched_on():
    def taken(switch_on_s, switch_off_s):
        moments = SwitchedMoments(StopMoments(["p"]), on=False)
        found = []
        for t in np.arange(0.0, 12.0, 0.1):
            moments.on = switch_on_s <= t < switch_off_s
            found += moments.add(frame("a", t, shift_px=30.0 * (t // 2.0)))
        return [int(moment.start_s // 2.0) for moment in found]

    assert taken(-1.0, 99.0) == [0, 1, 2, 3, 4]
    assert taken(3.0, 99.0) == [1, 2, 3, 4]  # of the stop that goes on when it is switched on, too
    assert taken(-1.0, 7.0) == [0, 1, 2]
