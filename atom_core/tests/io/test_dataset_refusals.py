"""Damaged datasets are refused in one line that says what and where."""

import math

import numpy as np
import pytest

from atom_core.errors import DatasetError
from atom_core.geometry import se3
from atom_core.io.dataset_entries import pose_of_entry, transform_document
from atom_core.io.dataset_json import (
    dataset_from_document,
    dumps,
    read_dataset,
)
from atom_core.io.dataset_writer import new_document
from atom_core.model.transforms import Edge
from atom_core.synthetic import scenes

# --- refusals -------------------------------------------------------------------------------


def test_a_truncated_file(document, tmp_path):
    path = tmp_path / "dataset.json"
    text = dumps(document)
    path.write_text(text[: len(text) // 2])
    with pytest.raises(DatasetError, match=r"dataset\.json:\d+: not valid JSON .* truncated"):
        read_dataset(path)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(DatasetError, match="no such file"):
        read_dataset(tmp_path / "dataset.json")


def test_a_binary_file(tmp_path):
    path = tmp_path / "dataset.json"
    path.write_bytes(b"\x89PNG\xff\x00")
    with pytest.raises(DatasetError, match="not UTF-8"):
        read_dataset(path)


@pytest.mark.parametrize("content", ["[]", "{}", "3", '{"sensors": {}}'])
def test_json_that_is_no_dataset(tmp_path, content):
    path = tmp_path / "dataset.json"
    path.write_text(content)
    with pytest.raises(DatasetError, match="no ATOM dataset"):
        read_dataset(path)


@pytest.mark.parametrize("version", ["2.0", 2.0, "1.1"])
def test_an_old_version_with_the_way_out(document, refusal, version):
    document["_metadata"]["version"] = version
    assert "convert --from atom_v2" in refusal(document)


@pytest.mark.parametrize("version", ["", "three", None])
def test_a_version_that_is_none(document, refusal, version):
    document["_metadata"]["version"] = version
    assert "_metadata.version" in refusal(document)


def test_an_unknown_modality(document, refusal):
    document["sensors"]["rgb_1"]["modality"] = "radar"
    line = refusal(document)
    assert "'rgb_1'" in line and "'radar'" in line and "lidar3d" in line


@pytest.mark.parametrize(
    "key, value, words",
    [
        ("K", [1.0, 0.0, 1.0], "K has 3 numbers, 9"),
        ("D", [0.1, 0.1, 0.1], "D has 3 numbers"),
        ("D", [0.1] * 7, "D has 7 numbers"),
        ("D", [0.1, 0.1, 0.1, 0.1, math.nan], "finite"),
        ("K", [-900.0, 0, 640, 0, 900, 400, 0, 0, 1], "positive"),
        ("distortion_model", "magic", "'magic' is unknown"),
        ("width", "wide", "wide"),
    ],
)
def test_wrong_intrinsics(document, refusal, key, value, words):
    document["sensors"]["rgb_2"]["camera_info"][key] = value
    line = refusal(document)
    assert "'rgb_2'" in line and words in line


@pytest.mark.parametrize("key", ["camera_info", "parent", "calibration_child"])
def test_a_sensor_that_lacks_a_key(document, refusal, key):
    del document["sensors"]["rgb_1"][key]
    line = refusal(document)
    assert "'rgb_1'" in line and key in line


@pytest.mark.parametrize("key", ["parent", "child", "quat"])
def test_a_transform_that_lacks_a_key(document, refusal, key):
    collection, content = next(iter(document["collections"].items()))
    name, transform = next(iter(content["transforms"].items()))
    del transform[key]
    assert f"collection {collection}, transform '{name}' lacks '{key}'" in refusal(document)


@pytest.mark.parametrize("value", [math.nan, math.inf, True, "12.5"])
def test_a_pixel_that_is_not_a_number(document, refusal, value, first_label):
    label, key = first_label(document, "rgb_1")
    label["idxs"][3]["y"] = value
    line = refusal(document)
    assert f"collection {key}" in line and "'rgb_1'" in line and "not a number" in line


@pytest.mark.parametrize("value", [math.nan, True, "7", [7]])
def test_an_index_that_is_not_a_number(document, refusal, value, first_label):
    label, key = first_label(document, "depth_1")
    label["idxs"][0] = value
    line = refusal(document)
    assert f"collection {key}" in line and "'depth_1'" in line


def test_a_corner_labeled_twice(document, refusal, first_label):
    label, _ = first_label(document, "rgb_1")
    label["idxs"][1]["id"] = label["idxs"][0]["id"]
    assert f"corner {label['idxs'][0]['id']} is labeled more than once" in refusal(document)


@pytest.mark.parametrize("corner", [88, -1])
def test_a_corner_that_the_pattern_does_not_have(document, refusal, corner, first_label):
    label, _ = first_label(document, "rgb_1")
    label["idxs"][0]["id"] = corner
    line = refusal(document)
    assert f"corner id {corner} is not on pattern" in line and "11 x 8" in line


@pytest.mark.parametrize(
    "key, value",
    [
        ("quat", [0.0, 0.0, 0.0, 0.0]),
        ("quat", [0.0, 0.0, 1.0]),
        ("quat", [math.nan, 0.0, 0.0, 1.0]),
        ("trans", [0.0, math.inf, 0.0]),
        ("trans", [0.0, 0.0]),
        ("trans", None),
    ],
)
def test_a_transform_that_is_none(document, refusal, key, value):
    name = next(iter(document["collections"]["001"]["transforms"]))
    document["collections"]["001"]["transforms"][name][key] = value
    line = refusal(document)
    assert "collection 001" in line and name in line


def test_a_configuration_that_is_absent_or_wrong(document, refusal):
    config = document.pop("calibration_config")
    assert "calibration_config" in refusal(document)
    config["calibration_patterns"]["pattern_1"]["size"] = -0.06
    document["calibration_config"] = config
    assert "size" in refusal(document)


@pytest.mark.parametrize(
    "place, value",
    [
        (("sensors",), []),
        (("sensors", "rgb_1"), None),
        (("collections",), []),
        (("collections", "000"), None),
        (("collections", "000", "labels"), []),
        (("collections", "000", "labels", "pattern_1"), []),
        (("collections", "000", "labels", "pattern_1", "rgb_1"), None),
        (("collections", "000", "labels", "pattern_1", "rgb_1"), {"detected": True, "idxs": 3}),
        (("collections", "000", "labels", "pattern_1", "rgb_1"), {"detected": "False", "idxs": []}),
        (("collections", "000", "transforms"), [1]),
        (("collections", "000", "data"), "x"),
        (("sensors", "rgb_1", "camera_info"), []),
        (("_metadata",), []),
        (("patterns", "pattern_1", "corners"), 3),
        (("patterns", "pattern_1", "corners"), []),
        (("patterns",), []),
        (("transforms",), []),
    ],
)
def test_parts_of_the_wrong_type_are_refused_or_ignored_but_never_a_crash(
    document, read, place, value
):
    part = document
    for key in place[:-1]:
        part = part[key]
    part[place[-1]] = value
    try:
        read(document)
    except DatasetError as error:
        assert "dataset.json" in str(error) and "\n" not in str(error)


def test_a_document_without_a_file_names_its_source():
    dataset = scenes.two_cameras(0, collections=1).dataset
    again = dataset_from_document(new_document(dataset, name="x"), dataset.source)
    assert again.source == dataset.source


# --- frames that stand in two places --------------------------------------------------------


def tangle(document, key, name, parent, child, matrix):
    """Add a transform to one collection."""
    entry = transform_document(Edge(parent, child), matrix)
    document["collections"][key]["transforms"][name] = entry


def edge_of(document, sensor, key):
    """Return the edge of a sensor that is calibrated, and its matrix in a collection."""
    entry = document["sensors"][sensor]
    parent, child = entry["calibration_parent"], entry["calibration_child"]
    (found,) = (
        value
        for value in document["collections"][key]["transforms"].values()
        if (value["parent"], value["child"]) == (parent, child)
    )
    return parent, child, pose_of_entry(found)


SLANTED = se3.from_rpy(np.zeros(3), np.full(3, 0.1))


@pytest.mark.parametrize("off_m", [0.0, 0.02])
def test_an_edge_and_its_reverse(document, refusal, off_m):
    parent, child, matrix = edge_of(document, "rgb_2", "001")
    moved = matrix @ se3.from_rpy(np.array([off_m, 0.0, 0.0]), np.zeros(3))
    tangle(document, "001", "back", child, parent, np.linalg.inv(moved))
    message = refusal(document)
    assert "collection 001" in message and f"'{child}-{parent}'" in message
    assert ("20.0 mm" if off_m else "is to be calibrated") in message


def test_a_frame_with_two_parents(document, refusal):
    parent, child, matrix = edge_of(document, "rgb_2", "000")
    tangle(document, "000", "a", parent, "shelf", np.eye(4))
    tangle(document, "000", "b", "shelf", child, matrix @ SLANTED)
    message = refusal(document)
    assert f"'shelf-{child}'" in message and "deg apart" in message


def test_two_values_of_one_edge(document, refusal):
    parent, child, matrix = edge_of(document, "rgb_2", "000")
    tangle(document, "000", "another name", parent, child, matrix @ SLANTED)
    assert f"frame '{child}' in '{parent}'" in refusal(document)


def test_a_loop_of_fixed_transforms_that_agree_is_taken(document, read):
    tangle(document, "000", "a", "world", "shelf", np.eye(4))
    tangle(document, "000", "b", "shelf", "world", np.eye(4))
    assert read(document).collections


def test_intrinsics_of_another_size_than_the_images(document, refusal):
    info = document["sensors"]["rgb_1"]["camera_info"]
    sizes = f"{info['width']} x {info['height']}"
    info["width"], info["height"] = info["width"] // 2, info["height"] // 2
    line = refusal(document)
    assert "collection 000, sensor 'rgb_1'" in line and f"its image is {sizes}" in line
    info["binning_x"] = info["binning_y"] = 2
    assert "it has binning" in refusal(document)
    info["binning_x"] = "two"
    assert "binning_x" in refusal(document)


def test_images_whose_size_is_not_told_are_not_judged(document, read):
    for collection in document["collections"].values():
        del collection["data"]["rgb_1"]["width"]
    document["sensors"]["rgb_1"]["camera_info"]["width"] //= 2
    read(document)
