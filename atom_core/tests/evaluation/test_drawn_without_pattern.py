"""Borders that do not say which of several patterns was drawn, as in ATOM's files."""

import json

import numpy as np
import pytest

from atom_core import cli
from atom_core.evaluation.annotation_check import with_patterns
from atom_core.evaluation.observed import Observed
from atom_core.io.annotations import UNNAMED
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.model.labels import DetectionKey
from atom_core.synthetic import scenes


@pytest.fixture(scope="module")
def dataset():
    """Return rgb_2 before two patterns, of which depth_1 sees the right one."""
    return scenes.two_patterns(1, collections=3).dataset


@pytest.fixture(scope="module")
def written(dataset, tmp_path_factory):
    return write_dataset_folder(dataset, tmp_path_factory.mktemp("two") / "data", name="two")


def border(dataset, pattern, key="000"):
    return Observed(dataset).border(DetectionKey(key, "rgb_2", pattern))


def test_a_border_is_of_the_pattern_that_the_labels_have_there(dataset):
    drawn = {("000", "rgb_2", UNNAMED): border(dataset, "right") + 2.0}
    drawn["001", "rgb_2", UNNAMED] = border(dataset, "left", "001")
    found, (told,) = with_patterns(dataset, drawn)
    assert list(found) == [("000", "rgb_2", "right"), ("001", "rgb_2", "left")]
    np.testing.assert_array_equal(found["000", "rgb_2", "right"], border(dataset, "right") + 2.0)
    assert told == (
        "annotation_rgb_2.json does not say which pattern is drawn: 2 of 2 borders are used for "
        "the pattern on whose labels they lie; put the pattern's name above the sides of each "
        "collection"
    )


def test_a_border_that_lies_on_no_selected_pattern_is_left_out(dataset):
    drawn = {("000", "rgb_2", UNNAMED): border(dataset, "right")}
    drawn["001", "rgb_2", UNNAMED] = border(dataset, "left", "001")
    found, (told,) = with_patterns(dataset.selected(patterns=["left"]), drawn)
    assert list(found) == [("001", "rgb_2", "left")]
    assert "1 of 2 borders are used" in told and "1 lie on none (left) and are left out" in told


def test_borders_that_name_their_pattern_stay_and_those_that_nothing_sees_are_not_told(dataset):
    drawn = {("000", "rgb_2", "left"): border(dataset, "right")}
    unseen = {("017", "rgb_2", UNNAMED): border(dataset, "left")}
    blind = dataset.with_labels("001", {("rgb_2", name): None for name in ("left", "right")})
    unseen["001", "rgb_2", UNNAMED] = border(dataset, "left", "001")
    assert with_patterns(blind, {**drawn, **unseen}) == (drawn, [])


def annotate(path, sensor, segments):
    """Write a border as ATOM does, as one side; all collections have the same."""
    xs, ys = np.concatenate([segments[:, 0], segments[-1:, 1]]).T.tolist()
    entry = {"top": {"xs": xs, "ys": ys, "ixs": [], "iys": []}}
    file = path.parent / f"annotation_{sensor}.json"
    file.write_text(json.dumps({"_metadata": {"version": "2.0"}, "000": entry}))
    return file


def test_atom_s_annotations_serve_beside_a_dataset_of_several_patterns(
    dataset, written, tmp_path, capsys
):
    file = annotate(written, "rgb_2", border(dataset, "right"))
    try:
        line = ["evaluate", "--train", written, "--test", written, "--output", tmp_path / "all"]
        assert cli.main([str(word) for word in line]) == 0
        (doubt,) = json.loads((tmp_path / "all" / "evaluation.json").read_text())[
            "annotations_in_doubt"
        ]
        assert "1 of 1 borders are used" in doubt
        capsys.readouterr()
        pair = ["depth_to_rgb_evaluation", "-train_json", written, "-test_json", written, "-uic"]
        pair += ["-ds", "depth_1", "-cs", "rgb_2", "-pn", "right"]
        assert cli.main([str(word) for word in pair]) == 0
        assert "warning: annotation_rgb_2.json does not say" in capsys.readouterr().out
    finally:
        file.unlink()


def test_between_cameras_no_annotation_is_read(written, tmp_path):
    file = written.parent / "annotation_rgb_2.json"
    file.write_text("no annotation")
    try:
        line = ["evaluate", "--train", written, "--test", written, "--output", tmp_path / "a"]
        assert cli.main([*map(str, line), "-ssf", "rgb_1", "rgb_2"]) == 0
        assert cli.main([*map(str, line[:-1]), str(tmp_path / "b")]) == 2
    finally:
        file.unlink()
