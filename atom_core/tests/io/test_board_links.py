"""A board is where the calibration puts it, wherever else the transforms have its link."""

import json

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.errors import DatasetError
from atom_core.geometry import se3
from atom_core.io.dataset_entries import pose_of_entry, transform_document
from atom_core.io.dataset_json import read_dataset, write_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.model.dataset import board_edge
from atom_core.model.transforms import Edge
from atom_core.synthetic import scenes

OFF = se3.from_rpy(np.array([0.02, 0.01, -0.015]), np.array([0.01, 0.02, 0.0]))


@pytest.fixture(scope="module")
def scene():
    return scenes.two_cameras(3, collections=8)


@pytest.fixture
def path(scene, tmp_path):
    return write_dataset_folder(scene.dataset, tmp_path / "data", name="data")


def hang(path, scene, *frames):
    """Write a way of further transforms to the board, the last of which has its link, off."""
    document = json.loads(path.read_text())
    for (name, key), world_T_board in scene.truth.boards.items():
        transforms = document["collections"][key]["transforms"]
        chain = (*frames, scene.dataset.patterns[name].frame)
        for parent, child in zip(chain, chain[1:]):
            matrix = np.eye(4)
            if parent == "rig_base":
                matrix = se3.inverse(pose_of_entry(transforms["world-rig_base"])) @ world_T_board
            elif parent == "world":
                matrix = world_T_board
            edge = Edge(parent, child)
            transforms[str(edge)] = transform_document(edge, matrix @ OFF)
    path.write_text(json.dumps(document))
    return path


WAYS = [("rig_base",), ("world", "board_base"), ("world", "table", "board_base")]


@pytest.mark.parametrize("frames", WAYS, ids=lambda frames: frames[-1])
def test_a_transform_to_a_boards_link_beside_its_parent_link_is_left_out_and_told(
    path, scene, frames
):
    dataset = read_dataset(hang(path, scene, *frames))
    link = next(iter(dataset.patterns.values())).frame
    edge = Edge(frames[-1], link)
    assert not any(edge in c.transforms for c in dataset.collections.values())
    (told,) = [text for text in dataset.warnings if link in text]
    assert f"'{edge}' is left out" in told and f"set parent_link: {frames[-1]}" in told


@pytest.mark.parametrize("frames", WAYS[:2], ids=lambda frames: frames[-1])
def test_the_board_is_estimated_and_the_answer_can_be_read_again(path, scene, frames):
    plain = calibrate(read_dataset(path), CalibrationOptions()).dataset
    hung = calibrate(read_dataset(hang(path, scene, *frames)), CalibrationOptions()).dataset
    write_dataset(hung, path.with_name("atom_calibration.json"))
    again = read_dataset(path.with_name("atom_calibration.json"))
    (pattern,) = again.patterns.values()
    for edge in (board_edge(pattern), *(sensor.edge for sensor in again.sensors.values())):
        for key, collection in plain.collections.items():
            if edge in collection.transforms:
                found = again.collections[key].transforms[edge]
                np.testing.assert_allclose(found, collection.transforms[edge], atol=1e-9)


def test_a_transform_of_the_boards_own_edge_is_kept(path, scene):
    dataset = read_dataset(hang(path, scene, "world"))
    assert all(Edge("world", "pattern_link") in c.transforms for c in dataset.collections.values())
    assert not [text for text in dataset.warnings if "pattern_link" in text]


def test_a_link_of_the_robot_that_carries_a_sensor_is_refused_as_a_boards(path, scene):
    path.write_text(path.read_text().replace('"pattern_link"', '"rgb_2_post"'))
    with pytest.raises(DatasetError, match="'rgb_2_post' hangs on 'rig_base'.*set parent_link: "):
        read_dataset(path)


def test_a_parent_link_that_hangs_on_the_board_is_refused(path):
    document = json.loads(path.read_text())
    for collection in document["collections"].values():
        edge = Edge("pattern_link", "world")
        collection["transforms"][str(edge)] = transform_document(edge, np.eye(4))
    path.write_text(json.dumps(document))
    with pytest.raises(DatasetError, match="is connected with its parent_link 'world'"):
        read_dataset(path)


def test_a_board_that_hangs_on_another_board_in_the_transforms_is_estimated_by_itself(tmp_path):
    dataset = scenes.two_cameras(3, collections=2).dataset
    path = write_dataset_folder(dataset, tmp_path / "data", name="data")
    document = json.loads(path.read_text())
    patterns = document["calibration_config"]["calibration_patterns"]
    patterns["second"] = {**patterns["pattern_1"], "link": "second_link"}
    for collection in document["collections"].values():
        edge = Edge("pattern_link", "second_link")
        collection["transforms"][str(edge)] = transform_document(edge, np.eye(4))
    path.write_text(json.dumps(document))
    (told,) = [text for text in read_dataset(path).warnings if "second_link" in text]
    assert "'pattern_link-second_link' is left out" in told
