"""Hand annotations of borders."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from atom_core.errors import DatasetError
from atom_core.geometry.camera import Camera
from atom_core.io.annotations import UNNAMED, read_annotations, read_lines, write_annotations

SIDES = {
    "top": {"xs": [0, 10], "ys": [1, 1], "ixs": list(range(11)), "iys": [1] * 11},
    "right": {"xs": [10, 11, 12], "ys": [1, 5, 9], "ixs": [], "iys": []},
    "bottom": {"xs": [], "ys": [], "ixs": [0, 1, 2], "iys": [9, 9, 9]},
    "left": {"xs": [], "ys": [], "ixs": [], "iys": []},
}


def camera(width=640, height=480):
    return Camera(width, height, np.diag([500.0, 500.0, 1.0]))


def cameras(*names):
    return {name: SimpleNamespace(camera=camera()) for name in names}


def write(folder, entry, sensor="rgb_1"):
    document = {"_metadata": {"version": "2.0", "user": "someone"}, "004": entry}
    (folder / f"annotation_{sensor}.json").write_text(json.dumps(document))


def test_clicked_points_make_the_line_and_interpolated_ones_serve_where_they_are_alone(tmp_path):
    write(tmp_path, SIDES)
    borders = read_annotations(tmp_path, cameras("rgb_1", "rgb_2"), ["board"])
    assert list(borders) == [("004", "rgb_1", "board")]
    expected = [
        [[0, 1], [10, 1]],
        [[10, 1], [11, 5]],
        [[11, 5], [12, 9]],
        [[0, 9], [1, 9]],
        [[1, 9], [2, 9]],
    ]
    np.testing.assert_array_equal(borders[("004", "rgb_1", "board")], expected)


def test_several_patterns_have_a_level_of_their_own(tmp_path):
    write(tmp_path, {"one": SIDES, "two": SIDES})
    borders = read_annotations(tmp_path, cameras("rgb_1"), ["one", "two"])
    assert sorted(borders) == [("004", "rgb_1", "one"), ("004", "rgb_1", "two")]


def test_sides_without_a_pattern_are_of_no_named_one_where_there_are_several(tmp_path):
    """As ATOM writes them; who draws on must know whose they are."""
    write(tmp_path, SIDES)
    assert list(read_annotations(tmp_path, cameras("rgb_1"), ["one", "two"])) == [
        ("004", "rgb_1", UNNAMED)
    ]
    with pytest.raises(DatasetError, match="several patterns"):
        read_lines(tmp_path / "annotation_rgb_1.json", ["one", "two"], "one")


def test_empty_sides_are_no_annotation(tmp_path):
    write(tmp_path, {side: {"xs": [], "ys": []} for side in SIDES})
    assert read_annotations(tmp_path, cameras("rgb_1"), ["board"]) == {}


def of_version_1(folder, lines):
    document = {"ground_truth_pts": {"004": lines}}
    (folder / "annotation_rgb_1.json").write_text(json.dumps(document))


def test_a_file_of_version_1_means_the_same_with_numbers_for_sides(tmp_path):
    of_version_1(tmp_path, {"0": [[0, 1], [10, 1]], "1": [[10, 1], [11, 5], [12, 9]], "3": []})
    borders = read_annotations(tmp_path, cameras("rgb_1"), ["board"])
    expected = [[[0, 1], [10, 1]], [[10, 1], [11, 5]], [[11, 5], [12, 9]]]
    np.testing.assert_array_equal(borders[("004", "rgb_1", "board")], expected)


def test_a_file_of_version_1_is_drawn_on_and_becomes_one_of_now(tmp_path):
    path = tmp_path / "annotation_rgb_1.json"
    of_version_1(tmp_path, {"0": [[0, 1], [10, 1]], "2": [[3, 4], [5, 6]]})
    lines = read_lines(path, ["board"], "board")
    assert lines["004"]["top"] == [(0, 1), (10, 1)] and lines["004"]["bottom"] == [(3, 4), (5, 6)]
    before = read_annotations(tmp_path, cameras("rgb_1"), ["board"])
    drawn = {"005": {"top": [(1.0, 2.0), (3.0, 4.0)]}}
    write_annotations(path, drawn, patterns=["board"], pattern="board")
    document = json.loads(path.read_text())
    assert set(document) == {"_metadata", "004", "005"}
    assert document["_metadata"]["version"] == "2.0"
    after = read_annotations(tmp_path, cameras("rgb_1"), ["board"])
    key = ("004", "rgb_1", "board")
    np.testing.assert_array_equal(after[key], before[key])


@pytest.mark.parametrize("lines", [{"4": []}, {"top": []}, {"0": [[1, 2, 3]]}, {"0": [1]}, 5, "x"])
def test_a_malformed_file_of_version_1_is_named(tmp_path, lines):
    of_version_1(tmp_path, lines)
    with pytest.raises(DatasetError, match=r"annotation_rgb_1.json: .*version 1\.0"):
        read_annotations(tmp_path, cameras("rgb_1"), ["board"])


@pytest.mark.parametrize("patterns", [["board"], ["one", "two"]])
def test_an_entry_with_neither_sides_nor_known_patterns_is_refused(tmp_path, patterns):
    write(tmp_path, {"0": SIDES["top"], "other": SIDES})
    with pytest.raises(DatasetError, match="collection 004 has neither a side .* but 0, other"):
        read_annotations(tmp_path, cameras("rgb_1"), patterns)
    write(tmp_path, {patterns[0]: SIDES, "other": SIDES})
    assert len(read_annotations(tmp_path, cameras("rgb_1"), patterns)) == 2


@pytest.mark.parametrize(
    "entry",
    [
        {"top": {"xs": [1, 2], "ys": [1]}},
        {"top": {"xs": ["a"], "ys": [1]}},
        {"top": {"xs": [float("nan")], "ys": [1.0]}},
        {"top": [1, 2]},
        {"top": {"xs": [[1, 2]], "ys": [[1, 2]]}},
        [1],
    ],
)
def test_a_malformed_file_is_named(tmp_path, entry):
    write(tmp_path, entry)
    with pytest.raises(DatasetError, match="annotation_rgb_1.json"):
        read_annotations(tmp_path, cameras("rgb_1"), ["board"])


def test_a_truncated_file_is_named(tmp_path):
    (tmp_path / "annotation_rgb_1.json").write_text('{"004": {"top":')
    with pytest.raises(DatasetError, match="annotation_rgb_1.json"):
        read_annotations(tmp_path, cameras("rgb_1"), ["board"])


@pytest.mark.parametrize("x, y", [(0, -3), (641, 5), (5, 481), (1200, 900)])
def test_where_many_points_are_outside_the_images_are_others(tmp_path, x, y):
    write(tmp_path, {"top": {"xs": [5, x], "ys": [5, y]}})
    words = rf"1 of 2 points lie outside the images of 640 x 480 px, the first at \({x}, {y}\)"
    with pytest.raises(DatasetError, match=words):
        read_annotations(tmp_path, cameras("rgb_1"), ["board"])


def test_some_points_outside_are_lines_drawn_on_beyond_the_image(tmp_path):
    write(tmp_path, {"top": {"xs": [-0.6, 639.9], "ys": [5, 479.6]}})
    assert len(read_annotations(tmp_path, cameras("rgb_1"), ["board"])) == 1  # on the rim
    write(tmp_path, {"top": {"xs": [5, 90, 600, 700], "ys": [5, 5, 5, 5]}})
    (segments,) = read_annotations(tmp_path, cameras("rgb_1"), ["board"]).values()
    assert len(segments) == 3


def test_the_size_that_was_drawn_in_is_noted_and_another_one_refused(tmp_path):
    path = tmp_path / "annotation_rgb_1.json"
    lines = {"004": {"top": [(5, 5), (90, 5)]}}
    write_annotations(path, lines, patterns=["board"], pattern="board", camera=camera(320, 240))
    with pytest.raises(DatasetError, match="images of 320 x 240 px, .* have 640 x 480"):
        read_annotations(tmp_path, cameras("rgb_1"), ["board"])
    with pytest.raises(DatasetError, match="images of 320 x 240 px"):
        read_lines(path, ["board"], "board", camera())
    assert read_lines(path, ["board"], "board", camera(320, 240))["004"]["top"] == [(5, 5), (90, 5)]
