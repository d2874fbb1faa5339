"""A board's border that is corrected in the configuration of a dataset is the one that is used."""

import json

import pytest

from atom_core.io.dataset_json import document_of, read_dataset, write_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes

NAME = "pattern_1"


@pytest.fixture
def path(tmp_path):
    dataset = scenes.two_cameras(0, collections=2).dataset
    return write_dataset_folder(dataset, tmp_path / "data", name="data")


def change(path, function):
    document = json.loads(path.read_text())
    function(document)
    path.write_text(json.dumps(document))


def set_border(document, x_m):
    described = document["calibration_config"]["calibration_patterns"][NAME]
    described["border_size"] = {"x": x_m, "y": x_m}


def width_of(path):
    return 2.0 * read_dataset(path).patterns[NAME].border.half_size[0]


def test_a_border_that_was_corrected_is_used_and_told(path):
    change(path, lambda document: set_border(document, 0.02))
    narrow = width_of(path)
    change(path, lambda document: set_border(document, 0.05))
    assert width_of(path) == pytest.approx(narrow + 0.06)
    (told,) = [text for text in read_dataset(path).warnings if NAME in text]
    assert f"patterns.{NAME}.frame.corners" in told and "border_size" in told


def test_a_dataset_that_is_written_has_the_border_that_was_used(path):
    change(path, lambda document: set_border(document, 0.05))
    again = path.with_name("again.json")
    write_dataset(read_dataset(path), again)
    assert width_of(again) == width_of(path)
    assert not [text for text in read_dataset(again).warnings if NAME in text]
    stored = json.loads(again.read_text())["patterns"][NAME]
    assert stored["corners"] == json.loads(path.read_text())["patterns"][NAME]["corners"]


def test_a_border_that_agrees_is_written_as_it_was_read(path):
    dataset = read_dataset(path)
    assert document_of(dataset)["patterns"] == dataset.document["patterns"]
    assert not [text for text in dataset.warnings if NAME in text]


def test_beside_corners_of_another_board_the_stored_border_is_used_and_its_place_is_named(path):
    width = width_of(path)

    def other_board(document):
        set_border(document, 0.05)
        document["calibration_config"]["calibration_patterns"][NAME]["size"] *= 1.1

    change(path, other_board)
    assert width_of(path) == width
    (told,) = [text for text in read_dataset(path).warnings if NAME in text]
    assert "corners and its border differ" in told and f"patterns.{NAME}.frame.corners" in told
