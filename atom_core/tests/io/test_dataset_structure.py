"""Whatever value stands wherever in a dataset, it is read or refused in one line."""

import copy
import json
import math

import numpy as np
import pytest

from atom_core.errors import DatasetError
from atom_core.io.dataset_json import dumps, read_dataset
from atom_core.io.dataset_structure import check_dataset_structure

WRONG = [5, -1, math.inf, math.nan, None, True, "x", "", [], {}, ["x"], {"a": 1}, [[]], 10**400]


def places(value, place=()):
    """Yield the way to each value; of collections and lists the first item serves for all."""
    if place:
        yield place
    if isinstance(value, dict):
        first = list(value)[:1] if place[-1:] in (("collections",), ("transforms",)) else value
        for key in first:
            yield from places(value[key], (*place, key))
    elif isinstance(value, list) and value:
        yield from places(value[0], (*place, 0))


def with_value(document, place, value):
    changed = copy.deepcopy(document)
    inside = changed
    for key in place[:-1]:
        inside = inside[key]
    inside[place[-1]] = value
    return changed


@pytest.mark.parametrize("left_out", [(), ("_metadata",)], ids=["version 3", "no version"])
def test_any_value_anywhere_is_read_or_refused_in_one_line(document, tmp_path, left_out):
    path, rng = tmp_path / "dataset.json", np.random.default_rng(0)
    document = json.loads(dumps(document))
    document = {key: value for key, value in document.items() if key not in left_out}
    document["collections"] = dict(list(document["collections"].items())[:1])
    ways = list(places(document))
    refused = 0
    for way, wrong in [(w, WRONG[i]) for w, i in zip(ways, rng.choice(len(WRONG), len(ways)))]:
        path.write_text(json.dumps(with_value(document, way, wrong)))
        try:
            read_dataset(path)
        except DatasetError as error:
            refused += 1
            assert str(error).count("\n") == 0 and len(str(error)) < 500
    assert refused > len(ways) / 4


@pytest.mark.parametrize(
    "place, value, words",
    [
        (("collections", "001", "data", "rgb_1", "data_file"), 5, "001, data.rgb_1.data_file is 5"),
        (("sensors", "rgb_1", "parent"), ["x"], "sensor 'rgb_1', parent is "),
        (("sensors", "rgb_1", "camera_info", "width"), None, "width is null, where a whole number"),
        (("sensors", "rgb_1", "camera_info", "height"), math.inf, "height is Infinity"),
        (("patterns",), 5, "patterns is 5, where names with values"),
        (("transforms",), 5, "transforms is 5"),
        (("collections", "001", "labels", "pattern_1", "rgb_1", "idxs"), "x", "idxs is "),
        (("patterns", "pattern_1", "frame"), 5, "pattern 'pattern_1', frame is 5"),
        (("calibration_config", "sensors"), -1, "calibration_config.sensors is -1"),
        (("calibration_config", "sensors", "rgb_1"), None, "sensors.rgb_1 is null"),
        (("calibration_config", "calibration_patterns"), 5, "calibration_patterns is 5"),
    ],
)
def test_the_place_is_named_as_messages_name_it(document, place, value, words):
    with pytest.raises(DatasetError, match="restore the file or collect again") as refusal:
        check_dataset_structure(with_value(document, place, value), "a.json")
    assert words in str(refusal.value)


@pytest.mark.parametrize("end", ["[" * 990 + "]" * 990, "9" * 5000], ids=["deep", "long"])
def test_deep_brackets_and_long_numbers(document, tmp_path, end):
    path = tmp_path / "dataset.json"
    path.write_text(f'{dumps(document).rstrip()[:-1]}, "x": {end}}}')
    try:
        read_dataset(path)  # what Python's JSON can read is no fault of the file
    except DatasetError as error:
        assert "too deep or a number is too long" in str(error)  # noqa: PT017


def test_no_sensor_at_all_and_a_version_of_the_future(document, refusal, tmp_path):
    assert "there is no sensor" in refusal({**document, "sensors": {}})
    path = tmp_path / "new.json"
    path.write_text(dumps({**document, "_metadata": {"version": "99"}}))
    assert "newer than this program" in read_dataset(path).warnings[0]


@pytest.mark.parametrize("name", ["/etc/passwd", "../../../../../../../../etc/passwd", "/dev/zero"])
def test_no_file_of_others_is_opened_as_data(document, tmp_path, name):
    for sensor in ("rgb_1", "lidar_1"):
        path = tmp_path / "dataset.json"
        key = ("collections", "001", "data", sensor)
        path.write_text(dumps(with_value(document, key, {"data_file": name})))
        assert not read_dataset(path).data.has_data("001", sensor)


def test_a_message_shows_nothing_of_a_file_that_is_no_cloud(document, tmp_path):
    (tmp_path / "secret.pcd").write_text("password hunter2\n")
    path = tmp_path / "dataset.json"
    key = ("collections", "001", "data", "lidar_1")
    path.write_text(dumps(with_value(document, key, {"data_file": "secret.pcd"})))
    with pytest.raises(DatasetError, match="not a PCD file") as refusal:
        read_dataset(path).data.read("001", "lidar_1")
    assert "password" not in str(refusal.value)
