"""What cameras saw is told to range sensors in the order of time, however late it comes."""

import pytest

from atom_calibration.nodes.collecting.camera_sights import CameraSights, Sight


def stamps(sights):
    return [sight.stamp_s for sight in sights]


@pytest.fixture
def sights():
    return CameraSights(["left", "right"])


def test_what_was_seen_later_than_the_data_stays(sights):
    for stamp_s in (1.0, 1.2, 1.4):
        sights.add(Sight(stamp_s, "left", None))
    sights.add(Sight(1.1, "right", None))
    assert stamps(sights.take(1.2)) == [1.0, 1.1, 1.2]
    assert stamps(sights.take(1.3)) == []
    assert stamps(sights.take(float("inf"))) == [1.4]


def test_data_wait_for_the_labels_of_images_of_their_time(sights):
    to_come = [Sight(0.2 * n, camera, None) for n in range(1, 31) for camera in ("left", "right")]
    sights.wait_for(0.0, pytest.fail, lambda: False)

    def pause(_seconds):
        sights.add(to_come.pop(0))

    newest = 0.0
    for tenth in range(1, 60):
        sights.wait_for(tenth / 10, pause, lambda: False)
        newest = max([newest, *stamps(sights.take(tenth / 10))])
        assert tenth / 10 - 0.2 - 1e-9 <= newest <= tenth / 10


def test_nobody_waits_for_images_that_were_not_taken(sights):
    sights.wait_for(0.0, pytest.fail, lambda: False)
    sights.add(Sight(1.0, "left", None))
    paused = []

    def pause(seconds):
        paused.append(seconds)
        sights.note_idle("left", 0.9 + len(paused) / 10)
        sights.note_idle("right", 1.0 + len(paused) / 10)

    sights.wait_for(2.4, pause, lambda: False)
    assert len(paused) == 15 and stamps(sights.take(2.4)) == [1.0]
    sights.add(Sight(2.5, "left", None))  # and whoever waited so is awaited as before
    sights.wait_for(3.0, pause, lambda: False)
    assert len(paused) == 21


def test_a_camera_that_has_ended_is_not_waited_for_each_time(sights):
    paused = []
    sights.wait_for(0.0, paused.append, lambda: False)
    for tenth in range(1, 600):
        sights.add(Sight(tenth / 10, "left", None))
        sights.wait_for(tenth / 10, paused.append, lambda: False)
    assert 4 * 40 <= len(paused) <= 10 * 40  # 2 s each time, and each time later


def test_time_that_goes_back_begins_anew(sights):
    sights.wait_for(0.0, pytest.fail, lambda: False)
    for camera in ("left", "right"):
        sights.add(Sight(50.0, camera, None))
    sights.clear()
    sights.wait_for(1.0, pytest.fail, lambda: False)  # at the first data nothing can be late
    assert sights.take(50.0) == []
