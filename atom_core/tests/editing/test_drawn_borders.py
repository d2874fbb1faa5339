"""Borders drawn while a dataset is gone through: one file for each camera, saved at once."""

import json

import numpy as np
import pytest

from atom_core.editing.drawn_borders import DrawnBorders
from atom_core.errors import DatasetError, LabelingError, OutputError
from atom_core.io.annotations import annotation_path, read_lines
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.model.labels import DetectionKey
from atom_core.synthetic import Noise, scenes

PATTERN = "pattern_1"
RGB, DEPTH = (DetectionKey("000", sensor, PATTERN) for sensor in ("rgb_1", "depth_1"))


@pytest.fixture
def dataset(tmp_path):
    scene = scenes.random_scene(3, rgb=1, depth=1, lidar3d=1, collections=2, noise=Noise.none())
    return read_dataset(write_dataset_folder(scene.dataset, tmp_path / "data", name="two"))


def file_of(dataset, place):
    return annotation_path(dataset.source.parent, place.sensor)


def saved(dataset, place):
    camera = dataset.sensors[place.sensor].camera
    return read_lines(file_of(dataset, place), dataset.patterns, place.pattern, camera)


@pytest.mark.parametrize("place", [RGB, DEPTH])
def test_each_point_is_saved_and_drawn_and_the_next_session_goes_on(dataset, place):
    borders, picture = DrawnBorders(dataset), np.zeros((200, 300, 3), np.uint8)
    borders.draw(place, picture)
    assert not picture.any() and not file_of(dataset, place).exists()
    assert "top side, 1 point;" in borders.click(place, np.array([40.0, 60.0]))
    assert saved(dataset, place)["000"]["top"] == [(40, 60)]
    borders.click(place, np.array([90.0, 60.0]))
    borders.draw(place, picture)
    rows, columns = np.nonzero(picture.any(axis=2))
    assert abs(columns.mean() - 65) < 1 and abs(rows.mean() - 60) < 1
    again = DrawnBorders(dataset)
    assert "top side, 2 points" in again.press(place, "h").words
    again.press(place, "r")
    assert saved(dataset, place)["000"]["top"] == [(40, 60)]


def test_keys_walk_through_sides_and_collections(dataset):
    borders = DrawnBorders(dataset)
    borders.click(RGB, np.array([10.0, 10.0]))
    assert "right side, 1 point" in borders.press(RGB, "n").words  # sides meet in a corner
    before = file_of(dataset, RGB).read_bytes()
    assert borders.press(RGB, "p").collection == "000"
    assert file_of(dataset, RGB).read_bytes() == before, "nothing was drawn"
    press = borders.press(RGB, ".")
    assert press.collection == "001" and "collection 001: top side, 0 points" in press.words
    assert file_of(dataset, RGB).read_bytes() == before
    borders.click(RGB._replace(collection="001"), np.array([7.0, 8.0]))
    assert {key: sides["top"] for key, sides in saved(dataset, RGB).items()} == {
        "000": [(10, 10)],
        "001": [(7, 8)],
    }


def test_the_border_vanishes_from_the_picture_and_stays_in_the_file(dataset):
    borders, picture = DrawnBorders(dataset), np.zeros((99, 99, 3), np.uint8)
    borders.click(RGB, np.array([40.0, 60.0]))
    assert "no longer shown" in borders.press(RGB, "q").words
    borders.draw(RGB, picture)
    assert not picture.any() and saved(dataset, RGB)["000"]["top"] == [(40, 60)]


def test_what_cannot_be_drawn_on_is_refused_and_kept(dataset):
    lidar = RGB._replace(sensor="lidar_1")
    other = RGB._replace(collection="017")
    for place in (lidar, other):
        with pytest.raises(LabelingError, match=f"{place.sensor} has no image in collection"):
            DrawnBorders(dataset).click(place, np.array([1.0, 1.0]))
    camera = dataset.sensors["rgb_1"].camera
    for pixel in ((-1.0, 5.0), (5.0, -1.0), (camera.width, 5.0), (5.0, camera.height)):
        with pytest.raises(LabelingError, match="is outside the image of rgb_1"):
            DrawnBorders(dataset).click(RGB, np.array(pixel))
    path = file_of(dataset, RGB)
    assert not path.exists()
    path.write_text(json.dumps({"_metadata": {"image_size": [9, 7]}}))
    borders = DrawnBorders(dataset)
    with pytest.raises(DatasetError, match="drawn in images of 9 x 7 px"):
        borders.press(RGB, "c")
    assert borders.press(RGB, "q").collection == "000"  # the mode can be left
    assert json.loads(path.read_text()) == {"_metadata": {"image_size": [9, 7]}}


def test_what_others_write_meanwhile_is_kept_and_seen(dataset):
    mine, theirs = DrawnBorders(dataset), DrawnBorders(dataset)
    mine.click(RGB, np.array([10.0, 10.0]))
    theirs.click(RGB._replace(collection="001"), np.array([7.0, 8.0]))
    mine.click(RGB, np.array([20.0, 10.0]))
    lines = saved(dataset, RGB)
    assert lines["000"]["top"] == [(10, 10), (20, 10)] and lines["001"]["top"] == [(7, 8)]
    file_of(dataset, RGB).unlink()  # as our own sentences advise
    assert "top side, 0 points" in mine.press(RGB, "h").words
    mine.press(RGB, "n")
    assert not file_of(dataset, RGB).exists()


def test_what_cannot_be_saved_is_not_drawn(dataset, monkeypatch):
    borders = DrawnBorders(dataset)
    borders.click(RGB, np.array([10.0, 10.0]))

    def full(*_, **__):
        raise OutputError("no space left")

    with monkeypatch.context() as patch:
        patch.setattr("atom_core.editing.border_drawing.write_annotations", full)
        for _ in range(2):
            with pytest.raises(OutputError):
                borders.click(RGB, np.array([20.0, 10.0]))
    assert "top side, 1 point" in borders.press(RGB, "h").words


def test_a_step_back_is_saved_too(dataset):
    borders = DrawnBorders(dataset)
    borders.click(RGB, np.array([10.0, 10.0]))
    borders.press(RGB, "c")
    assert saved(dataset, RGB)["000"]["top"] == []
    borders.press(RGB, "u")
    assert saved(dataset, RGB)["000"]["top"] == [(10, 10)]
