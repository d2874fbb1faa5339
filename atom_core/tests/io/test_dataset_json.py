"""Datasets come back as they were; what older writers left is tolerated, damage is refused."""

import json
import math
from copy import deepcopy

import numpy as np
import pytest

from atom_core.errors import DatasetError
from atom_core.geometry import se3
from atom_core.io.dataset_json import (
    document_of,
    dumps,
    read_dataset,
    write_dataset,
)
from atom_core.model.caveats import Caveat
from atom_core.model.dataset import MULTIPLE
from atom_core.model.labels import DetectionKey, RgbLabel
from atom_core.model.transforms import Edge

RUNS = ("nig_0.1_run001", "nig_0.2_run002")


# --- the real thing -----------------------------------------------------------------------


@pytest.mark.parametrize("run", RUNS)
def test_a_dataset_of_atom_survives_byte_for_byte(real_data, tmp_path, run):
    path = real_data("atom_softbot") / run / "atom_calibration.json"
    dataset = read_dataset(path)
    write_dataset(dataset, tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()


@pytest.mark.parametrize("run", RUNS)
def test_a_dataset_of_atom_means_what_it_says(real_data, run):
    dataset = read_dataset(real_data("atom_softbot") / run / "atom_calibration.json")
    assert [s.modality for s in dataset.sensors.values()] == ["rgb", "rgb", "lidar3d"]
    pattern = dataset.patterns["pattern_1"]
    assert (pattern.columns, pattern.rows, pattern.fixed) == (11, 8, True)
    np.testing.assert_allclose(pattern.border.corners[2], [0.76, 0.57])
    assert dataset.warnings == ()
    for _, label in dataset.detections():
        if isinstance(label, RgbLabel):
            assert label.ids.max() < 88 and np.all(label.pixels > 0)


@pytest.mark.parametrize("run", RUNS)
def test_only_a_changed_edge_changes_in_the_file(real_data, run):
    path = real_data("atom_softbot") / run / "atom_calibration.json"
    dataset = read_dataset(path)
    edge = dataset.sensors["front_left_camera"].edge
    moved = se3.from_rpy(np.array([0.1, 0.2, 0.3]), np.array([0.1, 0.0, 0.0]))
    changed = document_of(dataset.with_transforms({"000": {edge: moved}}))
    stored = changed["collections"]["000"]["transforms"][str(edge)]
    assert stored["trans"] == [0.1, 0.2, 0.3]
    original = json.loads(path.read_text())
    original["collections"]["000"]["transforms"][str(edge)] = stored
    assert changed == original


# --- round trip and unknown keys ----------------------------------------------------------


def test_reading_and_writing_changes_nothing(document, read):
    assert document_of(read(document)) == json.loads(dumps(document))


def test_unknown_keys_are_kept_everywhere(document, read, first_label):
    label, key = first_label(document, "lidar_1")
    label["samples"] = [1, 2]
    document["x-note"] = {"a": [1, None]}
    document["sensors"]["rgb_1"]["serial"] = "0042"
    document["collections"][key]["transforms_ini"] = {"a-b": {"parent": "a_ini"}}
    document["collections"][key]["data"]["rgb_1"]["exposure"] = 3.5
    edge = next(iter(document["collections"][key]["transforms"].values()))
    edge["comment"] = "measured"
    assert document_of(read(document)) == json.loads(dumps(document))


def test_an_edge_with_a_comment_keeps_it_when_it_moves(document, read):
    dataset = read(document)
    edge = dataset.sensors["rgb_2"].edge
    document["collections"]["000"]["transforms"][str(edge)]["comment"] = "measured"
    moved = read(document).with_transforms({"000": {edge: np.eye(4)}})
    stored = document_of(moved)["collections"]["000"]["transforms"][str(edge)]
    assert stored["comment"] == "measured" and stored["quat"] == [0.0, 0.0, 0.0, 1.0]


def test_a_new_edge_is_added_and_the_original_is_untouched(document, read):
    dataset = read(document)
    board = Edge("world", "pattern_link")
    placed = dataset.with_transforms({"001": {board: np.eye(4)}})
    transforms = document_of(placed)["collections"]["001"]["transforms"]
    assert transforms["world-pattern_link"]["child"] == "pattern_link"
    assert "world-pattern_link" not in dataset.document["collections"]["001"]["transforms"]


def test_frame_names_with_dashes_are_kept_apart(document, read):
    for collection in document["collections"].values():
        collection["transforms"]["a-b-c"] = {
            "parent": "a-b",
            "child": "c",
            "trans": [0.0, 0.0, 0.0],
            "quat": [0.0, 0.0, 0.0, 1.0],
        }
    assert Edge("a-b", "c") in read(document).collections["000"].transforms


# --- tolerance ------------------------------------------------------------------------------


def test_only_the_labels_that_are_named_change_in_the_file(document, read):
    dataset = read(document)
    (pattern,) = dataset.patterns
    key, sensor = next(
        (k, s) for k, c in dataset.collections.items() for s, _ in c.labels if s.startswith("rgb")
    )
    label = dataset.collections[key].labels[(sensor, pattern)]
    fewer = RgbLabel(label.ids[1:], label.pixels[1:])
    changed = dataset.with_labels(key, {(sensor, pattern): fewer})
    assert document_of(changed) == document, "labels are written only when they are named"
    written = document_of(changed, [DetectionKey(key, sensor, pattern)])
    stored = document["collections"][key]["labels"][pattern][sensor]
    now = written["collections"][key]["labels"][pattern].pop(sensor)
    assert now == {"detected": True, "idxs": stored["idxs"][1:]}
    before = deepcopy(document)
    before["collections"][key]["labels"][pattern].pop(sensor)
    assert written == before
    gone = dataset.with_labels(key, {(sensor, pattern): None})
    written = document_of(gone, [DetectionKey(key, sensor, pattern)])
    assert written["collections"][key]["labels"][pattern][sensor] == {
        "detected": False,
        "idxs": [],
    }


def test_a_label_in_the_layout_of_version_2_is_written_by_pattern(document, read):
    (pattern,) = document["collections"]["000"]["labels"]
    for collection in document["collections"].values():
        collection["labels"] = collection["labels"][pattern]
    dataset = read(document)
    sensor, _ = next(iter(dataset.collections["000"].labels))
    written = document_of(dataset, [DetectionKey("000", sensor, pattern)])
    assert (
        read(written).collections["000"].labels.keys() == dataset.collections["000"].labels.keys()
    )
    assert set(written["collections"]["000"]["labels"]) == {pattern}


@pytest.mark.parametrize(
    "topic, D, remark",
    [
        ("/cam/image_raw", [0.1, 0, 0, 0, 0], None),
        ("/cam/image_rect_color", [0, 0, 0, 0, 0], None),
        ("/corrected/direct/image_raw", [0.1, 0, 0, 0, 0], None),
        ("/cam/image_rect_color", [0.1, 0, 0, 0, 0], "'/cam/image_rect_color' looks rectified"),
        ("/cam/rectified/image", [0.1, 0, 0, 0, 0], "one of the two is wrong"),
        ("/cam/image_raw", [], "no distortion coefficients"),
    ],
)
def test_a_lens_in_doubt_is_told_when_the_dataset_is_read(document, read, topic, D, remark):
    sensor = next(name for name, s in document["sensors"].items() if s["modality"] == "rgb")
    document["sensors"][sensor]["topic"] = topic
    document["sensors"][sensor]["camera_info"]["D"] = D
    told = [w for w in read(document).warnings if f"sensor '{sensor}'" in w]
    assert len(told) == (remark is not None) and all(str(remark) in w for w in told)


def test_rectified_images_with_the_matrix_of_raw_ones_are_told(document, read):
    sensor = document["sensors"]["rgb_1"]
    sensor["topic"], info = "/cam/image_rect_color", sensor["camera_info"]
    info["D"] = [0.0] * 5
    told = [w for w in read(document).warnings if "another K than P" in w]
    assert not told
    info["P"][0] *= 0.98
    (told,) = [w for w in read(document).warnings if "another K than P" in w]
    assert "sensor 'rgb_1'" in told and "left three columns" in told


@pytest.mark.parametrize("times", [0.5, 2.0])
def test_the_matrix_of_images_of_another_size_is_told(document, read, times):
    info = document["sensors"]["rgb_1"]["camera_info"]
    assert not read(document).caveats
    for place in (0, 2, 4, 5):
        info["K"][place] *= times
    (caveat,) = read(document).caveats
    assert caveat.sensors == ("rgb_1",)
    assert f"about {times:.2g} times as wide and high as its" in caveat.what


def test_a_principal_point_that_a_region_of_interest_moved_is_not(document, read):
    document["sensors"]["rgb_1"]["camera_info"]["K"][5] *= 1.6
    assert not read(document).caveats


def test_what_collectors_left_in_doubt_is_told_and_survives_a_change(document, read):
    entry = {"sensors": ["rgb_1", "rgb_2"], "what": "a is b", "remedy": "make it c"}
    document["_metadata"]["caveats"] = [entry]
    dataset = read(document)
    assert dataset.caveats == (Caveat(("rgb_1", "rgb_2"), "a is b", "make it c"),)
    assert "sensors 'rgb_1', 'rgb_2': a is b; make it c" in dataset.warnings
    assert document_of(dataset)["_metadata"]["caveats"] == [entry]
    del entry["what"]
    with pytest.raises(DatasetError, match="_metadata.caveats: one lacks 'what'"):
        read(document)


def test_labels_by_sensor_as_in_version_2(document, read):
    expected = {key for key, _ in read(document).detections()}
    for collection in document["collections"].values():
        collection["labels"] = collection["labels"]["pattern_1"]
    assert {key for key, _ in read(document).detections()} == expected
    assert document_of(read(document)) == json.loads(dumps(document))


def test_the_singular_pattern_of_version_2(document, read):
    config = document["calibration_config"]
    config["calibration_pattern"] = config.pop("calibration_patterns")["pattern_1"]
    document["patterns"] = document["patterns"]["pattern_1"]
    for collection in document["collections"].values():
        collection["labels"] = collection["labels"]["pattern_1"]
    dataset = read(document)
    assert list(dataset.patterns) == ["pattern_1"] and list(dataset.detections())
    assert any("version 2" in warning for warning in dataset.warnings)


def test_integers_in_intrinsics(document, read):
    info = document["sensors"]["rgb_1"]["camera_info"]
    info["D"], info["K"] = [0, 0, 0, 0, 0], [900, 0, 640, 0, 900, 400, 0, 0, 1]
    camera = read(document).sensors["rgb_1"].camera
    assert camera.K.dtype == float and camera.K[0, 0] == 900.0
    np.testing.assert_allclose(camera.project(np.array([[0.1, 0.0, 1.0]])), [[730.0, 400.0]])


def test_gaps_in_the_collection_keys(document, read):
    collections = document["collections"]
    collections["1000"], collections["010"] = collections.pop("000"), collections.pop("001")
    assert list(read(document).collections) == ["002", "010", "1000"]


@pytest.mark.parametrize("key", ["patterns", "transforms", "additional_sensor_data"])
def test_absent_parts_of_the_top_level(document, read, key):
    expected = [k for k, _ in read(document).detections()]
    del document[key]
    dataset = read(document)
    assert [k for k, _ in dataset.detections()] == expected
    assert dataset.patterns["pattern_1"].corner_count == 88
    assert document_of(dataset) == json.loads(dumps(document))


def test_absent_joints_and_labels_of_a_sensor(document, read):
    for collection in document["collections"].values():
        del collection["joints"], collection["additional_data"]
        del collection["labels"]["pattern_1"]["rgb_2"]
    assert "rgb_2" not in {key.sensor for key, _ in read(document).detections()}


def test_a_byte_order_mark_that_an_editor_left_is_passed_over(document, tmp_path):
    path = tmp_path / "dataset.json"
    path.write_text(dumps(document), encoding="utf-8-sig")
    assert dumps(document_of(read_dataset(path))) == dumps(document)


def test_empty_text_for_nothing(document, read):
    document["calibration_config"].update(additional_tfs="", joints="", anchored_sensor="")
    dataset = read(document)
    assert dataset.config.additional_tfs == {} and dataset.config.anchored_sensor is None


@pytest.mark.parametrize("sensor", ["rgb_1", "lidar_1", "depth_1"])
def test_detected_with_empty_lists_is_not_detected(document, read, sensor, first_label):
    label, key = first_label(document, sensor)
    label["idxs"], label["idxs_limit_points"] = [], []
    assert (key, sensor) not in {(k.collection, k.sensor) for k, _ in read(document).detections()}


@pytest.mark.parametrize("sensor", ["rgb_1", "lidar_1", "depth_1"])
def test_a_label_that_does_not_say_detected_is_what_its_indices_are(
    document, read, sensor, first_label
):
    before = read(document).collections
    for collection in document["collections"].values():
        del collection["labels"]["pattern_1"][sensor]["detected"]
    for key, collection in read(document).collections.items():
        assert collection.labels.keys() == before[key].labels.keys()


@pytest.mark.parametrize("sensor", ["rgb_1", "lidar_1", "depth_1"])
def test_null_in_a_label_is_an_empty_list(document, read, sensor, first_label):
    label, key = first_label(document, sensor)
    label["idxs_limit_points"] = None
    assert read(document).collections[key].labels[(sensor, "pattern_1")].detected
    label["idxs"] = None
    assert (sensor, "pattern_1") not in read(document).collections[key].labels


def test_repeated_and_foreign_limit_indices(document, read, first_label):
    label, key = first_label(document, "lidar_1")
    label["idxs_limit_points"] = [7] * 16 + [0]
    read_label = read(document).collections[key].labels[("lidar_1", "pattern_1")]
    assert sorted(set(read_label.limit_indices)) == [0, 7]


def test_a_range_label_without_limit_points(document, read, first_label):
    label, key = first_label(document, "lidar_1")
    del label["idxs_limit_points"]
    assert len(read(document).collections[key].labels[("lidar_1", "pattern_1")].limit_indices) == 0


def test_what_the_optimiser_left_in_labels(document, read, first_label):
    label, _ = first_label(document, "rgb_1")
    label["idxs_projected"] = label["idxs_initial"] = [{"x": 1.0, "y": math.nan}]
    assert math.isnan(
        document_of(read(document))["collections"]["000"]["labels"]["pattern_1"]["rgb_1"][
            "idxs_initial"
        ][0]["y"]
    )


def test_corners_that_differ_from_the_configuration_are_used_and_told(document, read):
    document["patterns"]["pattern_1"]["corners"][0]["x"] = 0.0601
    dataset = read(document)
    assert dataset.patterns["pattern_1"].corners_by_id[0, 0] == 0.0601
    assert any("corners differ" in warning for warning in dataset.warnings)


def test_a_modality_that_only_the_message_type_tells(document, read):
    document["sensors"]["lidar_1"]["modality"] = ""
    assert read(document).sensors["lidar_1"].modality == "lidar3d"


@pytest.mark.parametrize(
    "key, value", [("parent_link", "base"), ("link", "rgb_2_link"), ("modality", "depth")]
)
def test_a_sensor_that_is_another_one_in_the_configuration_is_told(document, read, key, value):
    assert not [text for text in read(document).warnings if "rgb_2" in text]
    document["calibration_config"]["sensors"]["rgb_2"][key] = value
    dataset = read(document)
    (told,) = [text for text in dataset.warnings if "rgb_2" in text]
    assert f"{key} '{value}'" in told and "the sensor's own is used" in told
    assert dataset.sensors["rgb_2"].edge.parent == "rgb_2_post"


def test_types_of_edges(document, read):
    name = next(iter(document["transforms"]))
    document["transforms"][name]["type"] = MULTIPLE
    assert list(read(document).edge_types.values()).count(MULTIPLE) == 1


def test_quaternions_are_normalised(document, read):
    edge = next(iter(document["collections"]["000"]["transforms"].values()))
    edge["quat"] = [0.0, 0.0, 2.0, 2.0]
    matrix = read(document).collections["000"].transforms[Edge(edge["parent"], edge["child"])]
    np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-15)


def test_labels_of_a_pattern_that_the_configuration_lacks_are_told(document, read):
    labels = document["collections"]["000"]["labels"]
    labels["pattern_9"] = deepcopy(labels["pattern_1"])
    assert any("pattern_9" in warning for warning in read(document).warnings)
