"""A session of corrections: undone to the byte, saved whole, fit to be calibrated, nothing lost."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from playback_scene import (
    CAMERA,
    DEPTH,
    FIRST,
    FOURTH,
    LIDAR,
    PATTERN,
    SECOND,
    THIRD,
    around,
    write_scene,
)

from atom_calibration.nodes.correcting.playback_input import KeyPress
from atom_core.cli import main as core_main
from atom_core.editing.label_corrections import LabelCorrections
from atom_core.errors import DatasetError, LabelingError, OutputError, SelectionError
from atom_core.io.dataset_json import document_of, dumps, read_dataset
from atom_core.model.labels import DetectionKey
from atom_core.synthetic import scenes


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return write_scene(tmp_path_factory.mktemp("scene"))


@pytest.fixture
def session(path):
    made = LabelCorrections(read_dataset(path))
    made.show(SECOND)
    return made


def text(session):
    return dumps(document_of(session.dataset, session.changed()))


def label(session, sensor):
    return session.labels(sensor)[PATTERN]


def corner(session, number=0):
    return label(session, CAMERA).pixels[number].copy()


def others(session, count=20):
    """Points of the cloud that are no label."""
    size = len(session.dataset.data.read(session.collection, LIDAR))
    return np.setdiff1d(np.arange(size), label(session, LIDAR).indices)[:count]


def polygon(session, factor=1.15):
    return around(label(session, DEPTH), session.dataset.sensors[DEPTH].camera.width, factor)


def click_twice(session, to):
    session.click(CAMERA, corner(session))
    session.click(CAMERA, to)


CORRECTIONS = {
    "inside": lambda s: s.add_points(LIDAR, others(s), border=False),
    "border": lambda s: s.add_points(LIDAR, others(s), border=True),
    "remove": lambda s: s.remove_points(LIDAR, label(s, LIDAR).indices[::3]),
    "clear": lambda s: s.delete_label(LIDAR),
    "pixels": lambda s: s.add_points(DEPTH, label(s, DEPTH).indices + 1, border=True),
    "fill": lambda s: s.refill(DEPTH, polygon(s, 0.7)),
    "fill from a pixel": lambda s: (
        s.delete_label(DEPTH),
        s.undo(),
        s.remove_border(DEPTH, polygon(s)),
        s.refill_from(DEPTH, polygon(s).mean(axis=0)),
    ),
    "no border": lambda s: s.remove_border(DEPTH, polygon(s)),
    "move": lambda s: click_twice(s, corner(s) + [2.5, -1.25]),
    "corner": lambda s: s.remove_corner(CAMERA, corner(s, 3) + [2.0, 0.0]),
    "corners": lambda s: s.remove_corners(
        CAMERA, corner(s) + 60 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    ),
}


@pytest.mark.parametrize("name", CORRECTIONS)
def test_a_correction_changes_one_label_and_is_undone_to_the_byte(session, path, name):
    original = text(session)
    assert original == path.read_text(encoding="utf-8")
    CORRECTIONS[name](session)
    corrected = text(session)
    (changed,) = session.changed()
    assert changed.collection == SECOND and changed.pattern == PATTERN
    before, after = json.loads(original), json.loads(corrected)
    assert before != after
    for document in (before, after):
        del document["collections"][SECOND]["labels"][PATTERN][changed.sensor]
    assert before == after, "something else was changed too"
    while session.undo_steps:
        session.undo()
    assert text(session) == original and not session.unsaved
    while session.redo_steps:
        session.redo()
    assert text(session) == corrected and session.unsaved


@pytest.mark.parametrize("border", [False, True])
def test_adding_and_removing_points_is_nothing(session, border):
    original, chosen = text(session), others(session)
    session.add_points(LIDAR, chosen, border)
    assert set(chosen) <= set(label(session, LIDAR).indices)
    session.remove_points(LIDAR, chosen)
    assert text(session) == original


def test_corrections_one_after_the_other_are_undone_in_turn(session):
    states = [text(session)]
    for name in ("inside", "remove", "fill", "no border", "move", "corner", "clear"):
        CORRECTIONS[name](session)
        states.append(text(session))
    assert len(set(states)) == len(states) == session.undo_steps + 1
    for expected in reversed(states[:-1]):
        session.undo()
        assert text(session) == expected
    assert session.undo() == "there is nothing to take back"


def test_corrections_that_are_joined_are_undone_at_once(session):
    before = text(session)
    session.remove_points(LIDAR, label(session, LIDAR).indices[::4])
    assert not session.join_last_steps(), "there is one step only"
    session.add_points(LIDAR, others(session), border=True)
    after = text(session)
    assert session.join_last_steps()
    assert session.undo_steps == 1
    words = session.undo()
    assert "removed; " in words and "added to the border" in words
    assert text(session) == before
    session.redo()
    assert text(session) == after
    session.show(THIRD)
    session.remove_points(LIDAR, label(session, LIDAR).indices[::4])
    assert not session.join_last_steps(), "the other one is of another collection"


def test_clouds_of_one_press_belong_together_and_no_others(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    press = KeyPress()
    assert not press.is_still("remove", "a")
    assert press.is_still("remove", "b")
    assert not press.is_still("remove", "b"), "a sensor's second cloud is of another press"
    assert not press.is_still("add", "a"), "another key"
    now[0] = 2 * KeyPress.WITHIN_S
    assert not press.is_still("add", "b"), "too late"


def test_after_undo_a_new_correction_forgets_what_was_undone(session):
    session.add_points(LIDAR, others(session), False)
    session.undo()
    session.remove_corner(CAMERA, corner(session))
    assert session.redo_steps == 0
    assert session.redo() == "there is nothing to make again"
    assert [key.sensor for key in session.changed()] == [CAMERA]


def test_undo_shows_the_collection_that_it_changes(session):
    session.delete_label(LIDAR)
    session.turn(1)
    assert session.collection == THIRD
    session.undo()
    assert session.collection == SECOND and session.labels(LIDAR)
    session.show(FIRST)
    session.redo()
    assert session.collection == SECOND and not session.labels(LIDAR)


def test_reset_is_for_one_collection_and_can_be_undone(session):
    session.delete_label(LIDAR)
    session.show(THIRD)
    session.delete_label(DEPTH)
    corrected = text(session)
    session.reset()
    assert session.changed() == [DetectionKey(SECOND, LIDAR, PATTERN)]
    session.undo()
    assert text(session) == corrected
    session.show(FIRST)
    steps = session.undo_steps
    session.reset()
    assert session.undo_steps == steps, "there is nothing to reset"


def test_collections_are_gone_through_in_a_ring(session):
    session.show(FIRST)
    keys = [session.turn(1) for _ in range(4)]
    assert keys == [SECOND, THIRD, FOURTH, FIRST]
    assert session.turn(-1) == FOURTH
    assert session.show("1") == SECOND, "the number in the key will do"


def test_what_changes_nothing_is_no_step(session):
    inside = label(session, LIDAR).indices[:5]
    assert "nothing changes" in session.add_points(LIDAR, inside, False)
    assert "nothing changes" in session.remove_points(LIDAR, others(session))
    nowhere = np.array([[1.0, 1.0], [6.0, 1.0], [6.0, 6.0]])
    assert "nothing changes" in session.remove_corners(CAMERA, nowhere)
    assert session.undo_steps == 0 and not session.unsaved


def test_of_several_patterns_the_selected_one_gets_points_and_all_lose_them():
    dataset = scenes.two_patterns(collections=3).dataset
    session, name = LabelCorrections(dataset), DEPTH
    key = next(k for k, c in dataset.collections.items() if (name, "right") in c.labels)
    session.show(key)
    first, second = dataset.patterns
    measured = np.flatnonzero(np.isfinite(dataset.data.read(key, name)))
    right = session.labels(name)["right"]
    free = np.setdiff1d(measured, np.append(right.indices, right.limit_indices))[:6]
    session.add_points(name, free, border=False)
    session.select_pattern(second)
    session.add_points(name, free[:3], border=True)
    assert set(free) <= set(session.labels(name)[first].indices)
    assert set(session.labels(name)[second].limit_indices) >= set(free[:3])
    session.remove_points(name, free)
    for pattern in (first, second):
        now = session.labels(name).get(pattern)
        before = dataset.collections[key].labels.get((name, pattern))
        assert (now is None) == (before is None)
        if now is not None:
            np.testing.assert_array_equal(now.indices, before.indices)
            np.testing.assert_array_equal(now.limit_indices, before.limit_indices)


# --- clicks -----------------------------------------------------------------------------------


def test_a_corner_is_chosen_and_moved_though_it_moves_by_little(session):
    before = corner(session)
    number = int(label(session, CAMERA).ids[0])
    assert f"corner {number} is chosen" in session.click(CAMERA, before + [3.0, 3.0])
    session.click(CAMERA, before + [1.5, 0.5])
    assert session.chosen is None
    np.testing.assert_array_equal(corner(session), before + [1.5, 0.5])


def test_another_corner_can_be_chosen_instead(session):
    session.click(CAMERA, corner(session, 0))
    session.click(CAMERA, corner(session, 5) + [1.0, 0.0])
    assert session.chosen.corner == label(session, CAMERA).ids[5]
    assert session.undo_steps == 0


def test_a_corner_that_is_gone_is_not_moved(session):
    place = corner(session)
    for remove in (
        lambda: session.delete_label(CAMERA),
        lambda: session.remove_corners(CAMERA, place + 30 * np.array([[-1, -1], [1, -1], [0, 1]])),
    ):
        session.click(CAMERA, place)
        remove()
        with pytest.raises(LabelingError, match="no corner within"):
            session.click(CAMERA, place)
        session.undo()


def test_a_right_click_beside_the_corners_only_forgets_the_choice(session):
    session.click(CAMERA, corner(session))
    assert session.remove_corner(CAMERA, np.array([2.0, 2.0])) == "no corner is chosen any more"
    assert session.chosen is None and session.undo_steps == 0
    with pytest.raises(LabelingError, match="no corner within"):
        session.remove_corner(CAMERA, np.array([2.0, 2.0]))


# --- files ------------------------------------------------------------------------------------


def test_the_corrected_dataset_is_read_back_and_calibrated(session, path, tmp_path):
    for key in (SECOND, THIRD):
        session.show(key)
        session.remove_points(LIDAR, label(session, LIDAR).indices[::4])
        session.refill(DEPTH, polygon(session))
        session.remove_corner(CAMERA, corner(session))
    session.show(FOURTH)
    session.delete_label(CAMERA)
    output = path.with_name("dataset_corrected.json")
    assert "7 labels of 3 collections" in session.save(output)
    assert not session.unsaved
    back = read_dataset(output)
    assert back.warnings == read_dataset(path).warnings
    for key, collection in back.collections.items():
        ours = session.dataset.collections[key].labels
        assert collection.labels.keys() == ours.keys()
        for place, found in collection.labels.items():
            for name, values in vars(found).items():
                np.testing.assert_array_equal(values, getattr(ours[place], name))
    code = core_main(["calibrate", "--dataset", str(output), "--output", str(tmp_path / "out")])
    assert code in (0, 1)  # few collections determine little; that is told, and no refusal
    assert (tmp_path / "out" / "atom_calibration.json").is_file()
    os.unlink(output)


def test_labels_that_another_program_wrote_keep_what_is_not_corrected(path, tmp_path):
    document = json.loads(path.read_text(encoding="utf-8"))
    labels = document["collections"][SECOND]["labels"][PATTERN]
    for name in (LIDAR, CAMERA):
        labels[name]["idxs_projected"] = [{"x": 1.0, "y": 2.0}]
        labels[name]["samples"] = [0]
    foreign = path.with_name("foreign.json")
    foreign.write_text(json.dumps(document), encoding="utf-8")
    session = LabelCorrections(read_dataset(foreign))
    session.show(SECOND)
    session.remove_points(LIDAR, label(session, LIDAR).indices[:3])
    output = tmp_path / "out.json"
    session.save(output)
    back = json.loads(output.read_text(encoding="utf-8"))["collections"][SECOND]["labels"][PATTERN]
    assert back[CAMERA] == labels[CAMERA]
    assert set(back[LIDAR]) == {"detected", "idxs", "idxs_limit_points"}
    assert back[LIDAR]["idxs"] == labels[LIDAR]["idxs"][3:]


def test_a_label_whose_points_are_all_gone_is_not_detected(session, tmp_path, path):
    session.remove_points(LIDAR, label(session, LIDAR).indices)
    session.save(path.with_name("gone.json"))
    document = json.loads(path.with_name("gone.json").read_text(encoding="utf-8"))
    stored = document["collections"][SECOND]["labels"][PATTERN][LIDAR]
    assert stored == {"detected": False, "idxs": [], "idxs_limit_points": []}


_KILLED = """
import sys
from pathlib import Path
from atom_core.editing.label_corrections import LabelCorrections
from atom_core.io.dataset_json import read_dataset
session = LabelCorrections(read_dataset(Path(sys.argv[1])))
print("ready", flush=True)
while True:
    session.delete_label("lidar_1")
    session.save(Path(sys.argv[2]))
    session.undo()
    session.save(Path(sys.argv[2]))
"""


def test_a_session_that_is_killed_while_saving_leaves_a_whole_file(path, tmp_path):
    output = path.with_name("killed.json")
    LabelCorrections(read_dataset(path)).save(output)
    for seed in range(4):
        process = subprocess.Popen(
            [sys.executable, "-c", _KILLED, str(path), str(output)], stdout=subprocess.PIPE
        )
        process.stdout.readline()
        time.sleep(np.random.default_rng(seed).uniform(0.0, 0.3))
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stdout.close()
        read_dataset(output)
    for left in path.parent.glob(".killed*"):
        left.unlink()


def test_what_cannot_be_saved_is_kept(session, tmp_path):
    session.delete_label(LIDAR)
    with pytest.raises(OutputError, match="create the folder first"):
        session.save(tmp_path / "absent" / "dataset_corrected.json")
    assert session.unsaved and session.undo_steps == 1


# --- bad input --------------------------------------------------------------------------------

OUTSIDE = np.array([[5000.0, 0.0], [5010.0, 0.0], [5010.0, 10.0]])


@pytest.mark.parametrize(
    ("correct", "error", "words"),
    [
        (lambda s: s.refill(DEPTH, OUTSIDE), LabelingError, "outside the image of 640 x 480"),
        (lambda s: s.remove_border(DEPTH, OUTSIDE), LabelingError, "outside the image"),
        (lambda s: s.remove_corners(CAMERA, OUTSIDE), LabelingError, "outside the image"),
        (lambda s: s.refill(DEPTH, OUTSIDE[:2]), LabelingError, "three corners"),
        (lambda s: s.refill(LIDAR, OUTSIDE), SelectionError, "lidar3d, not depth"),
        (lambda s: s.click(LIDAR, np.zeros(2)), SelectionError, "lidar3d, not rgb"),
        (lambda s: s.click(CAMERA, OUTSIDE[0]), LabelingError, "outside its image of 1280 x 800"),
        (lambda s: s.add_points(LIDAR, np.array([10**7]), False), LabelingError, "beyond the data"),
        (lambda s: s.remove_points(LIDAR, np.array([-1])), LabelingError, "beyond the data"),
        (
            lambda s: s.add_points(CAMERA, np.array([1]), False),
            SelectionError,
            "rgb, not depth or lidar",
        ),
        (lambda s: s.add_points("nobody", np.array([1]), False), SelectionError, "no sensor 'nobo"),
        (lambda s: s.delete_label(LIDAR, "cloth"), SelectionError, "no pattern 'cloth'"),
        (lambda s: s.select_pattern("cloth"), SelectionError, "no pattern 'cloth'"),
        (lambda s: s.show("007"), SelectionError, "no collection '007'; use one of 000, 001"),
    ],
)
def test_a_refusal_says_why_and_changes_nothing(session, correct, error, words):
    before = text(session)
    with pytest.raises(error, match=words):
        correct(session)
    assert text(session) == before
    assert (session.undo_steps, session.collection) == (0, SECOND)


def test_points_that_were_not_measured_are_no_label(session, monkeypatch):
    cloud = session.dataset.data.read(SECOND, LIDAR).copy()
    chosen = others(session, 4)
    cloud[chosen[:2]] = np.nan
    monkeypatch.setattr(session.dataset.data, "read", lambda *_: cloud)
    session.add_points(LIDAR, chosen, False)
    assert np.isin(chosen, label(session, LIDAR).indices).tolist() == [False, False, True, True]
    with pytest.raises(LabelingError, match="none of the 2 chosen points was measured"):
        session.add_points(LIDAR, chosen[:2], False)


def test_data_that_are_absent_are_named_and_the_rest_can_be_corrected(path):
    hidden = path.with_name(f"{LIDAR}_{SECOND}.pcd")
    os.rename(hidden, f"{hidden}.away")
    try:
        session = LabelCorrections(read_dataset(path))
        session.show(SECOND)
        with pytest.raises(DatasetError, match=hidden.name):
            session.add_points(LIDAR, np.array([1]), False)
        session.remove_corner(CAMERA, corner(session))
        session.delete_label(LIDAR)  # needs no data
        assert session.undo_steps == 2
    finally:
        os.rename(f"{hidden}.away", hidden)
