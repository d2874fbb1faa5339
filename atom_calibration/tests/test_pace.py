"""A recording waits for labels that are late, and for nobody for ever."""

from types import SimpleNamespace

import pytest

from atom_calibration.nodes.bags import start_bag
from atom_calibration.runtime.pace import LATE_S, Pace


def test_nobody_is_late_until_a_second_of_the_recording_has_passed():
    pace = Pace(["cam", "lidar"])
    assert pace.late(100.0) == [] and pace.late(100.0 + LATE_S) == []
    pace.note("cam", 101.0, 101.05)
    assert pace.late(100.1 + LATE_S) == ["lidar"]
    pace.note("lidar", 101.0, 101.3)
    assert pace.late(101.9) == [] and pace.late(102.1) == ["cam", "lidar"]


def test_whoever_was_waited_for_in_vain_may_be_twice_as_late():
    pace, waits = Pace(["slow"]), []
    for tenth in range(1, 1000):
        now_s = 100.0 + 0.1 * tenth
        if pace.late(now_s):
            waits.append(now_s)
            pace.wait_no_more(now_s)
    assert 3 <= len(waits) <= 8  # a sensor that never sends holds a recording of 100 s up so often


def test_waiting_allows_nothing_to_those_who_are_in_time():
    pace = Pace(["cam", "lidar"])
    pace.late(100.0)
    pace.note("cam", 101.5, 101.5)
    pace.wait_no_more(102.0)
    pace.note("lidar", 102.0, 102.0)
    assert pace.late(102.9) == ["cam"]


def test_it_is_waited_for_as_long_as_any_labels_come():
    pace, paused = Pace(["cam", "lidar"]), []

    def pause(seconds):
        paused.append(seconds)
        if len(paused) % 30 == 0 and len(paused) <= 300:  # slow: a label in 1.5 s
            pace.note("cam", 100.0 + len(paused) / 100, 105.5)

    pace.late(100.0)
    pace.wait(lambda: 105.5, pause, lambda: False)
    assert len(paused) == 300 + 40  # and 2 s longer, in vain
    assert pace.late(110.0) == ["cam"]  # the other one may be later until its labels come
    pace.note("cam", 109.9, 110.0)
    pace.wait(lambda: 110.0, pause, lambda: False)
    assert len(paused) == 340


def test_labels_that_come_again_are_awaited_as_before():
    pace = Pace(["cam", "lidar"])
    pace.late(100.0)
    pace.note("lidar", 105.0, 105.0)
    pace.wait_no_more(105.0)
    assert pace.late(106.0) == []
    pace.note("cam", 106.0, 106.2)
    pace.note("lidar", 107.2, 107.3)
    assert pace.late(107.3) == ["cam"]


def test_whoever_has_labeled_all_that_came_is_not_late():
    pace = Pace(["cam"])
    pace.late(100.0)
    pace.note("cam", 101.0, 101.0)
    pace.note_idle("cam", 104.0)
    assert pace.late(104.9) == [] and pace.late(105.1) == ["cam"]
    pace.note_idle("cam", 103.0)  # overtaken by its own newer word
    assert pace.late(104.9) == []


def test_what_is_idle_keeps_nobody_waiting_for_one_that_has_ended():
    pace, paused = Pace(["cam", "lidar"]), []

    def pause(seconds):
        paused.append(seconds)
        pace.note_idle("cam", 105.0 + len(paused))

    pace.late(100.0)
    pace.wait(lambda: 105.0, pause, lambda: False)
    assert len(paused) == 40


def test_nobody_waits_once_it_has_ended():
    pace, paused = Pace(["cam"]), []
    pace.late(100.0)
    pace.wait(lambda: 109.0, paused.append, lambda: len(paused) == 3)
    assert len(paused) == 3 and pace.late(109.0) == ["cam"]


def test_stamps_of_another_clock_count_as_when_they_came():
    pace = Pace(["cam"])
    pace.late(100.0)
    pace.note("cam", 1.7e9, 104.0)
    assert pace.late(104.9) == [] and pace.late(105.1) == ["cam"]


def test_a_recording_that_begins_again_begins_anew():
    pace = Pace(["cam"])
    pace.late(100.0)
    pace.note("cam", 139.0, 139.0)
    assert pace.late(139.1) == []
    assert pace.late(100.0) == [] and pace.late(101.1) == ["cam"]


class Played:
    """A recording, by the clock of which labels come, or do not; `hold` is the player's service."""

    def __init__(self, monkeypatch, labels_after, ends_s, paused_by_user=False):
        self.now_s, self.held, self.asked = 100.0, paused_by_user, []
        self.pace, self._labels_after, self._ends_s = Pace(["cam"]), labels_after, ends_s
        self._wall_s = 0.0
        monkeypatch.setattr(start_bag.running, "pause", self._pass_time)
        monkeypatch.setattr(start_bag.running, "stopped", lambda: self._wall_s > self._ends_s)
        now = SimpleNamespace(now=lambda: SimpleNamespace(to_sec=lambda: self.now_s))
        monkeypatch.setattr(start_bag.rospy, "Time", now)

    def _pass_time(self, seconds):
        self._wall_s += seconds
        self.now_s += 0.0 if self.held else seconds
        if self._labels_after(self._wall_s):
            self.pace.note("cam", self.now_s, self.now_s)

    def hold(self, held):
        changed, self.held = held != self.held, held
        self.asked.append((round(self._wall_s, 2), held))
        return SimpleNamespace(success=changed)


def test_it_is_held_until_the_labels_have_come(monkeypatch):
    played = Played(monkeypatch, lambda wall_s: not 1.0 < wall_s < 3.0, ends_s=5.0)
    start_bag._hold_while_late(played.pace, played.hold)
    (begin_s, held), (end_s, free) = played.asked
    assert held and not free
    assert begin_s == pytest.approx(1.0 + LATE_S, abs=0.2) and end_s == pytest.approx(3.0, abs=0.2)
    assert played.now_s == pytest.approx(100.0 + 5.0 - (end_s - begin_s), abs=0.2)


def test_it_runs_on_where_labels_never_come(monkeypatch):
    played = Played(monkeypatch, lambda wall_s: wall_s < 1.0, ends_s=60.0)
    start_bag._hold_while_late(played.pace, played.hold)
    assert not played.held and 4 <= len(played.asked) <= 12 and played.now_s > 145.0


def test_what_a_user_has_paused_stays_paused(monkeypatch):
    played = Played(monkeypatch, lambda wall_s: False, ends_s=5.0, paused_by_user=True)
    played.now_s, played.pace = 105.0, Pace(["cam"])
    played.pace.late(100.0)
    start_bag._hold_while_late(played.pace, played.hold)
    assert played.held and all(held for _, held in played.asked)
    assert len(played.asked) <= 3  # nor is the player asked all the time
