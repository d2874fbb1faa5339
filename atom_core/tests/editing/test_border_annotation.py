"""A border drawn by ATOM's keys, without a window; evaluations read what is saved."""

import json
from argparse import Namespace
from copy import deepcopy
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from atom_core import cli
from atom_core.commands.annotate_pattern_borders_in_rgb_or_depth import Task, picture
from atom_core.editing.border_annotation import BorderAnnotation
from atom_core.errors import DatasetError
from atom_core.geometry.camera import Camera
from atom_core.io.annotations import read_annotations, read_lines, write_annotations
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import Noise, scenes

CAMERAS = {"rgb_1": SimpleNamespace(camera=Camera(640, 480, np.diag([500.0, 500.0, 1.0])))}


def typed(annotation, words):
    """Click where a pair stands, press where a key stands; return the last outcome."""
    outcome = None
    for word in words:
        if isinstance(word, tuple):
            annotation.click(*word)
        else:
            outcome = annotation.press(word)
    return outcome


def test_sides_follow_one_another_and_share_their_corners():
    drawn = BorderAnnotation(["000", "001"], {})
    typed(drawn, [(0, 0), (10, 0), "n", (10, 8), "n", (0, 8), "n", (0, 0)])
    lines = drawn.lines["000"]
    assert lines["top"] == [(0, 0), (10, 0)] and lines["right"] == [(10, 0), (10, 8)]
    assert lines["bottom"] == [(10, 8), (0, 8)] and lines["left"] == [(0, 8), (0, 0)]
    assert drawn.title == "Collection 000: left side"
    typed(drawn, ["n"])
    assert drawn.title == "Collection 001: top side" and not any(drawn.lines["001"].values())
    typed(drawn, ["p"])
    assert drawn.title == "Collection 000: left side" and drawn.lines["000"] == lines


def test_points_sides_and_collections_are_removed():
    drawn = BorderAnnotation(["000"], {"000": {"top": [(1, 2), (3, 4)]}, "009": {"left": [(5, 6)]}})
    typed(drawn, ["r"])
    assert drawn.lines["000"]["top"] == [(1, 2)]
    typed(drawn, ["n", (7, 7), "x"])
    assert drawn.lines["000"] == {"top": [(1, 2)], "right": [], "bottom": [], "left": []}
    typed(drawn, ["c", "r", "x"])
    assert not any(drawn.lines["000"].values()) and drawn.lines["009"]["left"] == [(5, 6)]


def test_what_keys_ask_of_the_window():
    drawn = BorderAnnotation(["000", "001"], {}, point_size=2)
    outcomes = {key: drawn.press(key) for key in "nprxc+-.,shq?"}
    assert [key for key, o in outcomes.items() if o.save] == [".", ",", "s"]
    assert [key for key, o in outcomes.items() if o.end] == ["s", "q"]
    assert [key for key, o in outcomes.items() if o.help] == ["h"]
    typed(drawn, ["-"] * 5)
    assert drawn.point_size == 1
    typed(drawn, [".", "."])
    assert drawn.collection == "000"


def test_every_change_can_be_taken_back():
    drawn = BorderAnnotation(["000", "001"], {"000": {"top": [(1, 2), (3, 4)]}})
    states = [deepcopy(drawn.lines)]
    for word in ("r", (9, 9), "n", "x", "c"):
        typed(drawn, [word])
        states.append(deepcopy(drawn.lines))
    assert all(one != other for one, other in zip(states, states[1:]))
    typed(drawn, [".", "+", "h"])  # change no point
    for state in reversed(states[:-1]):
        typed(drawn, ["u"])
        assert drawn.lines == state
    typed(drawn, ["u"])
    assert drawn.lines == states[0]


ONE = {"patterns": ["board"], "pattern": "board"}


def test_the_file_is_atoms(tmp_path):
    path = tmp_path / "annotation_rgb_1.json"
    write_annotations(
        path, {"000": {"top": [(0.0, 0.0), (3.0, 4.0), (3.0, 9.0)], "left": [(1, 1)]}}, **ONE
    )
    document = json.loads(path.read_text())
    assert document["_metadata"]["version"] == "2.0"
    top = document["000"]["top"]
    assert top["xs"] == [0.0, 3.0, 3.0] and len(top["ixs"]) == 10
    assert list(zip(top["ixs"], top["iys"]))[0] == (0, 0)
    assert list(zip(top["ixs"], top["iys"]))[-1] == (3, 9)
    assert document["000"]["left"]["ixs"] == [1] and document["000"]["right"]["xs"] == []
    segments = read_annotations(tmp_path, CAMERAS, ["board"])["000", "rgb_1", "board"]
    np.testing.assert_array_equal(segments[0], [[0, 0], [3, 4]])
    assert read_lines(path, ["board"], "board")["000"]["top"] == [(0, 0), (3, 4), (3, 9)]
    write_annotations(path, {"000": {"top": [(0, 0), (10, 0)]}}, points_per_pixel=0.5, **ONE)
    assert len(json.loads(path.read_text())["000"]["top"]["ixs"]) == 5


@pytest.mark.parametrize("names", [("a", "b"), ("left", "right")])
def test_of_two_patterns_each_keeps_its_sides(tmp_path, names):
    path = tmp_path / "annotation_rgb_1.json"
    for pattern, x in zip(names, (1.0, 2.0)):
        lines = {"000": {"top": [(x, 0.0), (x, 5.0)]}}
        write_annotations(path, lines, patterns=names, pattern=pattern)
    for pattern, x in zip(names, (1.0, 2.0)):
        assert read_lines(path, names, pattern)["000"]["top"] == [(x, 0), (x, 5)]
    assert {key[2] for key in read_annotations(tmp_path, CAMERAS, names)} == set(names)


def test_what_the_file_has_of_others_stays(tmp_path):
    path = tmp_path / "annotation_rgb_1.json"
    side = {"xs": [1.0, 2.0], "ys": [3.0, 4.0], "ixs": [1, 2], "iys": [3, 4]}
    entries = {"000": {"board": {"top": side}, "other": {"left": side}}, "001": {"board": {}}}
    path.write_text(json.dumps({"_metadata": {"version": "2.0"}, **entries}))
    write_annotations(path, {"000": {"top": [(7, 7)]}}, **ONE)
    document = json.loads(path.read_text())
    assert document["000"]["other"] == {"left": side} and document["001"] == {"board": {}}
    assert document["000"]["board"]["top"]["xs"] == [7.0]


def test_interpolated_points_serve_where_they_are_alone(tmp_path):
    path = tmp_path / "annotation_rgb_1.json"
    path.write_text(json.dumps({"000": {"top": {"ixs": [1, 2, 3], "iys": [5, 5, 5]}}}))
    assert read_lines(path, ["board"], "board")["000"]["top"] == [(1, 5), (2, 5), (3, 5)]


@pytest.mark.parametrize(
    "text", ["[1]", "{", '{"0": 5}', '{"0": []}', '{"0": {"top": {"xs": [[1]], "ys": [[2]]}}}']
)
def test_no_file_of_others_is_written_over(tmp_path, text):
    path = tmp_path / "annotation_rgb_1.json"
    path.write_text(text)
    with pytest.raises(DatasetError, match="move it away"):
        write_annotations(path, {"000": {"top": [(7, 7)]}}, **ONE)
    assert path.read_text() == text


def test_a_user_without_a_name_draws_too(tmp_path, monkeypatch):
    def nobody():
        raise KeyError("getpwuid(): uid not found: 1234")

    monkeypatch.setattr("getpass.getuser", nobody)
    write_annotations(tmp_path / "annotation_rgb_1.json", {"000": {"top": [(7, 7)]}}, **ONE)


@pytest.fixture
def data(tmp_path):
    scene = scenes.random_scene(3, rgb=1, depth=1, lidar3d=0, collections=2, noise=Noise.none())
    return write_dataset_folder(scene.dataset, tmp_path / "data", name="two")


def task(data, **options):
    usual = {"rgb_sensor": "rgb_1", "pattern": None, "collection_selection_function": None}
    usual.update({"point_size": 10, "points_per_pixel": 1.0, **options})
    return Task(Namespace(dataset=data, **usual))


@pytest.mark.parametrize("sensor", ["rgb_1", "depth_1"])
def test_what_is_drawn_is_shown_saved_and_continued(data, sensor):
    drawn = task(data, rgb_sensor=sensor)
    before, scale = picture(drawn, 600)
    assert before.shape[1] == 600
    typed(drawn.annotation, [(100, 80), (200, 80)])
    after, _ = picture(drawn, 600)
    rows, columns = np.nonzero(np.any(before != after, axis=2))
    assert abs(np.mean(columns) - 150 * scale) < 3 and abs(np.mean(rows) - 80 * scale) < 3
    drawn.save()
    assert drawn.path.name == f"annotation_{sensor}.json"
    assert task(data, rgb_sensor=sensor).annotation.lines["000"]["top"] == [(100, 80), (200, 80)]


def test_what_cannot_be_drawn_on_is_refused(data, monkeypatch, capsys):
    for options, words in (
        ({"rgb_sensor": "x"}, "there are: depth_1, rgb_1"),
        ({"pattern": "x"}, "name the board with --pattern: pattern_1"),
    ):
        with pytest.raises(DatasetError, match=words):
            task(data, **options)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    line = ["annotate_pattern_borders_in_rgb_or_depth", "-d", str(data), "-cs", "rgb_1"]
    assert cli.main(line) == 2 and "no screen" in capsys.readouterr().err

    def without_windows(*_):
        raise cv2.error("not implemented")

    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(cv2, "namedWindow", without_windows)
    assert cli.main(line) == 2 and "without windows" in capsys.readouterr().err
