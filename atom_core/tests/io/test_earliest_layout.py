"""Datasets from before ATOM's version 2: what they leave unsaid is derived, or named at once."""

from copy import deepcopy

import pytest

from atom_core.cli import main
from atom_core.errors import DatasetError
from atom_core.io.dataset_json import dataset_from_document, dumps, read_dataset
from atom_core.io.dataset_writer import new_document
from atom_core.synthetic import scenes

OF_THE_BOARD = ("link", "parent_link", "fixed")


@pytest.fixture(scope="module")
def scene():
    """Return two cameras before a chessboard; every label holds the whole board."""
    made = scenes.without_ids(3, collections=12)
    columns, rows = made.dataset.config.calibration_patterns["pattern_1"].dimension
    whole = {
        key: collection
        for key, collection in made.dataset.collections.items()
        if collection.labels and all(v.size == columns * rows for v in collection.labels.values())
    }
    assert len(whole) >= 4
    return made, whole


@pytest.fixture
def modern(scene):
    document = new_document(scene[0].dataset, name="modern")
    document["collections"] = {key: document["collections"][key] for key in scene[1]}
    return document


@pytest.fixture
def early(modern):
    """Return the same dataset as ATOM wrote it before its version 2."""
    document = deepcopy(modern)
    for key in ("_metadata", "patterns", "transforms"):
        document.pop(key, None)
    config = document["calibration_config"]
    board = config.pop("calibration_patterns")["pattern_1"]
    config["calibration_pattern"] = {k: v for k, v in board.items() if k not in OF_THE_BOARD}
    config.pop("version")
    for sensor in config["sensors"].values():
        del sensor["modality"]
    for sensor in document["sensors"].values():
        del sensor["modality"]
    for collection in document["collections"].values():
        collection["labels"] = collection["labels"]["pattern_1"]
        for label in collection["labels"].values():
            label["idxs"] = [{"x": corner["x"], "y": corner["y"]} for corner in label["idxs"]]
    return document


def labels_of(dataset):
    return {
        (key, sensor, name): (label.ids.tolist(), label.pixels.tolist())
        for key, collection in dataset.collections.items()
        for (sensor, name), label in collection.labels.items()
    }


def filled_in(dataset):
    lines = [line for line in dataset.warnings if "from before ATOM's version 2" in line]
    assert len(lines) == 1
    return lines[0]


def test_it_reads_like_the_same_dataset_of_version_3(read, modern, early):
    new, old = dataset_from_document(modern, "modern"), read(early)
    assert labels_of(old) == labels_of(new) and labels_of(new)
    assert {n: s.modality for n, s in old.sensors.items()} == {
        n: s.modality for n, s in new.sensors.items()
    }
    board = old.config.calibration_patterns["pattern_1"]
    assert not board.fixed and board.parent_link == old.config.world_link
    assert board.link not in {
        frame for c in old.collections.values() for edge in c.transforms for frame in edge
    }


def test_one_warning_says_what_was_filled_in_and_from_what(read, early):
    line = filled_in(read(early))
    for words in ("messages are Image", "board's link", "world_link", "fixed: false", "ids of"):
        assert words in line


@pytest.mark.parametrize("key", ["link", "parent_link", "child_link", "topic_name"])
def test_the_sensors_own_entries_say_what_the_configuration_does_not(read, early, modern, key):
    del early["calibration_config"]["sensors"]["rgb_2"][key]
    dataset = read(early)
    expected = modern["calibration_config"]["sensors"]["rgb_2"]
    assert getattr(dataset.config.sensors["rgb_2"], key) == expected[key]
    assert f"{key} '" in filled_in(dataset) and "of 'rgb_2'" in filled_in(dataset)


def test_the_root_of_the_transforms_is_the_world(read, early):
    world = early["calibration_config"].pop("world_link")
    dataset = read(early)
    assert dataset.config.world_link == world and f"world_link '{world}'" in filled_in(dataset)


def test_all_that_is_missing_stands_in_one_message(refusal, early):
    del early["calibration_config"]["calibration_pattern"]["size"]
    del early["calibration_config"]["calibration_pattern"]["dimension"]
    del early["sensors"]["rgb_1"]["camera_info"]
    del early["sensors"]["rgb_2"]["msg_type"]
    line = refusal(early)
    for key in ("size", "dimension", "sensors.rgb_1.camera_info", "sensors.rgb_2.modality"):
        assert key in line


def test_a_board_that_never_moves_may_be_fixed_or_not(refusal, early):
    first = next(iter(early["collections"].values()))
    for collection in early["collections"].values():
        collection["labels"] = first["labels"]
    assert "calibration_pattern.fixed" in refusal(early)


def test_a_camera_that_moves_does_not_tell_whether_the_board_does(refusal, early):
    for number, collection in enumerate(early["collections"].values()):
        for transform in collection["transforms"].values():
            transform["trans"] = [number + v for v in transform["trans"]]
    assert "calibration_pattern.fixed" in refusal(early)


def test_corners_of_a_part_of_the_board_have_no_numbers(refusal, early):
    key = next(iter(early["collections"]))
    label = early["collections"][key]["labels"]["rgb_1"]
    label["idxs"] = label["idxs"][:-1]
    line = refusal(early)
    assert "idxs[].id" in line and f"{key} 'rgb_1'" in line and "rgb_2'" not in line


@pytest.mark.parametrize("order", ["down the columns", "mirrored"])
def test_corners_in_another_order_are_not_numbered(refusal, early, order):
    size = early["calibration_config"]["calibration_pattern"]["dimension"]
    key = next(iter(early["collections"]))
    label = early["collections"][key]["labels"]["rgb_2"]
    rows = [label["idxs"][i * size["x"] : (i + 1) * size["x"]] for i in range(size["y"])]
    if order == "mirrored":
        label["idxs"] = [corner for row in rows for corner in reversed(row)]
    else:
        label["idxs"] = [corner for column in zip(*rows) for corner in column]
    assert f"{key} 'rgb_2'" in refusal(early)


def test_it_is_converted_too(tmp_path, early):
    (tmp_path / "old.json").write_text(dumps(early))
    arguments = ["--from", "atom_v2", "--to", "atom_v3", "--dataset", str(tmp_path / "old.json")]
    assert main(["convert", *arguments, "--output", str(tmp_path / "new")]) == 0
    converted = read_dataset(tmp_path / "new" / "dataset.json")
    assert not [line for line in converted.warnings if "version 2" in line]
    assert labels_of(converted) == labels_of(read_dataset(tmp_path / "old.json"))


def test_it_is_checked_and_calibrated_as_it_is(tmp_path, early, capsys):
    (tmp_path / "old.json").write_text(dumps(early))
    assert main(["check", "--dataset", str(tmp_path / "old.json")]) == 0
    assert capsys.readouterr().out.count("from before ATOM's version 2") == 1
    places = ["--dataset", str(tmp_path / "old.json"), "--output", str(tmp_path / "out")]
    assert main(["calibrate", *places]) == 0
    solved = read_dataset(tmp_path / "out" / "atom_calibration.json")
    assert not [line for line in solved.warnings if "version 2" in line]


def test_a_real_one_is_read_as_it_is(real_data):
    dataset = read_dataset(real_data("atlascar") / "data_collected.json")
    assert len(dataset.collections) == 26 and len(dataset.sensors) == 4
    assert "52 labels" in filled_in(dataset)


@pytest.mark.parametrize("value", ["a", None, [1.0]])
@pytest.mark.parametrize("numbered", [True, False])
def test_a_corner_without_a_place_is_refused_with_its_collection(early, tmp_path, value, numbered):
    key, collection = next(iter(early["collections"].items()))
    for label in collection["labels"].values():
        ids = [{"id": i} if numbered else {} for i in range(len(label["idxs"]))]
        label["idxs"] = [{**i, **corner} for i, corner in zip(ids, label["idxs"])]
        label["idxs"][1]["x"] = value
    path = tmp_path / "dataset.json"
    path.write_text(dumps(early), encoding="utf-8")
    with pytest.raises(DatasetError, match=f"collection {key}|collections {key}"):
        read_dataset(path)
