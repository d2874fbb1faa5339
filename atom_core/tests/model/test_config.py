"""A configuration is valid or not made; reading and writing lose nothing."""

import copy
import dataclasses
import json
import pickle
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # config_documents, which the tests share

from config_documents import GONE, changed, full_document, read, refusal  # noqa: E402

from atom_core.model.config import (
    DICTIONARIES,
    ConfigValueError,
    EdgeConfig,
    JointConfig,
    PatternConfig,
    SensorConfig,
)
from atom_core.model.pattern import pattern_from_config


def test_values_and_order_arrive():
    config = read(full_document())
    assert config.warnings == ()
    assert list(config.sensors) == ["cam", "cam_2", "lidar"]
    assert config.sensors["cam"] == SensorConfig(
        "cam_optical_frame", "beam", "cam_link", "/cam/image_raw", "rgb", 10
    )
    assert config.sensors["lidar"].modality is None
    assert config.additional_tfs == {"gantry": EdgeConfig("world", "beam")}
    assert config.joints == {"shoulder": JointConfig(("origin_x", "origin_yaw"))}
    board = config.calibration_patterns["board"]
    assert (board.dimension, board.border_size, board.marker_count) == ((11, 8), (0.04, 0.03), 54)
    assert config.calibration_patterns["small"].border_size == (0.02, 0.02)
    assert config.anchored_sensor == "cam_2"


def test_duration_is_in_milliseconds():
    for value, seconds in ((250, 0.25), (GONE, 1.0), ("250", 0.25), (0.1, 0.1)):
        config = read(changed(["max_duration_between_msgs"], value))
        assert config.max_duration_between_msgs_s == seconds
    assert "is 0.1 and read as seconds; write 100" in config.warnings[0]


def test_writing_gives_the_document_back():
    document = full_document()
    written = read(document).to_document()
    assert written == document
    assert list(written) == list(document)
    assert list(written["sensors"]["cam"]) == list(document["sensors"]["cam"])
    json.dumps(written, allow_nan=False)


@pytest.mark.parametrize("legacy", [True, False])
def test_the_layout_of_a_charuco_is_a_key_that_is_known_and_kept(legacy):
    document = full_document()
    document["calibration_patterns"]["board"]["legacy"] = legacy
    config = read(document)
    assert config.calibration_patterns["board"].legacy is legacy and config.warnings == ()
    assert config.to_document() == document
    assert read(full_document()).calibration_patterns["board"].legacy == "auto"


def test_unknown_keys_are_kept_at_every_level_and_reported():
    document = full_document()
    places = [
        (),
        ("sensors", "cam"),
        ("additional_tfs", "gantry"),
        ("joints", "shoulder"),
        ("calibration_patterns", "board"),
    ]
    for place in places:
        target = document
        for key in place:
            target = target[key]
        target["weather"] = {"notes": ["sunny", 1.5, None]}
    config = read(document)
    assert config.to_document() == document
    expected = {".".join((*place, "weather")) for place in places}
    assert {warning.split(" ")[1] for warning in config.warnings} == expected
    assert all(warning.startswith("dataset.json: ") for warning in config.warnings)
    assert not any("did you mean" in warning for warning in config.warnings)


@pytest.mark.parametrize(
    "path, wrong, right",
    [
        (("sensors", "cam", "modality"), "modalty", "modality"),
        (("sensors", "cam", "throttle"), "throtle", "throttle"),
        (("anchored_sensor",), "anchored_sensors", "anchored_sensor"),
        (("calibration_patterns", "board", "mesh_file"), "mesh_files", "mesh_file"),
    ],
)
def test_likely_slip_of_an_optional_key_is_named(path, wrong, right):
    document = changed(path, GONE)
    target = document
    for key in path[:-1]:
        target = target[key]
    target[wrong] = "x"
    (warning,) = read(document).warnings
    assert f"{'.'.join((*path[:-1], wrong))} is not a known key" in warning
    assert f"did you mean '{right}'?" in warning


def test_likely_slip_of_a_required_key_is_named():
    document = changed(("sensors", "cam", "topic_name"), GONE)
    document["sensors"]["cam"]["topic_nam"] = "/cam"
    message = refusal(document)
    assert message.startswith("sensors.cam.topic_name is absent (is 'topic_nam' meant to be it?)")


OPTIONAL = [
    ("description_file",),
    ("bag_file",),
    ("additional_tfs",),
    ("joints",),
    ("anchored_sensor",),
    ("max_duration_between_msgs",),
    ("package_name",),
    ("sensors", "cam", "modality"),
    ("sensors", "cam", "throttle"),
    ("calibration_patterns", "board", "mesh_file"),
    ("calibration_patterns", "small", "dictionary"),
    ("calibration_patterns", "small", "inner_size"),
]


@pytest.mark.parametrize("path", OPTIONAL, ids=".".join)
def test_optional_keys_may_be_absent_null_or_empty(path):
    configs = [read(changed(path, value)) for value in (GONE, None, "")]
    assert configs[0] == configs[1] == configs[2]
    assert configs[0].warnings == ()


@pytest.mark.parametrize("key", ["additional_tfs", "joints"])
def test_empty_map_is_none(key):
    config = read(changed([key], {}))
    assert getattr(config, key) == {} and config.to_document()[key] is None


REQUIRED = [
    ("world_link",),
    ("sensors",),
    ("calibration_patterns",),
    ("sensors", "cam", "link"),
    ("sensors", "cam", "parent_link"),
    ("sensors", "cam", "child_link"),
    ("sensors", "cam", "topic_name"),
    ("additional_tfs", "gantry", "parent_link"),
    ("additional_tfs", "gantry", "child_link"),
    ("joints", "shoulder", "params_to_calibrate"),
    ("calibration_patterns", "board", "link"),
    ("calibration_patterns", "board", "parent_link"),
    ("calibration_patterns", "board", "fixed"),
    ("calibration_patterns", "board", "pattern_type"),
    ("calibration_patterns", "board", "dictionary"),
    ("calibration_patterns", "board", "dimension"),
    ("calibration_patterns", "board", "dimension", "x"),
    ("calibration_patterns", "board", "border_size", "y"),
    ("calibration_patterns", "board", "size"),
    ("calibration_patterns", "board", "inner_size"),
]


@pytest.mark.parametrize("path", REQUIRED, ids=".".join)
@pytest.mark.parametrize("value", [GONE, None, ""], ids=["absent", "null", "empty"])
def test_required_keys_are_named(path, value):
    message = refusal(changed(path, value))
    assert message.startswith(".".join(path) + " ") and ("absent" in message or "empty" in message)


BOARD = ("calibration_patterns", "board")


@pytest.mark.parametrize(
    "path, value, problem",
    [
        (("sensors", "cam", "modality"), "rbg", "is 'rbg'; use rgb, depth, lidar3d or lidar2d"),
        (("sensors", "cam", "modality"), ["rgb"], "is a list; use"),
        (("sensors", "cam", "throttle"), 0, "above 0 (Hz)"),
        (("sensors", "cam", "throttle"), "10", "is '10'; write a number without quotes"),
        (("sensors", "cam", "beam_width"), -0.01, "of at least 0 (rad)"),
        (("sensors", "cam", "beam_width"), 0.7, "wider than any beam (0.03); write radians"),
        (("sensors", "cam", "beam_width"), 0.01, "of modality rgb; it is of 3D LiDARs, remove it"),
        (("sensors", "cam", "link"), 3, "is 3; write the name of a frame"),
        (("sensors", "cam", "link"), "a b", "has no spaces"),
        (("sensors", "cam", "child_link"), "beam", "like parent_link"),
        (("sensors", "cam", "topic_name"), True, "is true; write the topic"),
        (("sensors", "cam"), "rgb", "is 'rgb'; write a map"),
        (("sensors",), ["cam"], "is a list; write a map"),
        (("sensors",), {}, "at least one"),
        (("calibration_patterns",), {}, "at least one"),
        (("world_link",), "  ", "is empty"),
        (("bag_file",), 7, "is 7; write a text"),
        (("additional_tfs", "gantry", "child_link"), "world", "like parent_link"),
        (("joints", "shoulder", "params_to_calibrate"), "origin_yaw", "e.g. [origin_yaw]"),
        (("joints", "shoulder", "params_to_calibrate"), [], "is an empty list"),
        (("joints", "shoulder", "params_to_calibrate"), ["yaw"], "holds 'yaw'; use origin_x"),
        (("joints", "shoulder", "params_to_calibrate"), [{}], "holds a map"),
        (("joints", "shoulder", "params_to_calibrate"), ["origin_x"] * 2, "origin_x twice"),
        ((*BOARD, "fixed"), "true", "is 'true'; write true or false without quotes"),
        ((*BOARD, "fixed"), 1, "is 1; write true or false"),
        ((*BOARD, "pattern_type"), "aruco", "is 'aruco'; use chessboard or charuco"),
        ((*BOARD, "dictionary"), "DICT_5X5_99", "is 'DICT_5X5_99'; use DICT_4X4_50"),
        ((*BOARD, "dictionary"), "DICT_5X5_50", "50 markers, but 12 x 9 squares need 54"),
        ((*BOARD, "dimension"), [11, 8], "is a list; write {x: , y: }"),
        ((*BOARD, "dimension", "x"), 1, "at least 2"),
        ((*BOARD, "dimension", "x"), 11.5, "is 11.5; write the number of inner corners"),
        ((*BOARD, "dimension", "y"), "8", "is '8'; write the number of inner corners"),
        ((*BOARD, "dimension", "y"), True, "is true; write the number of inner corners"),
        ((*BOARD, "dimension", "z"), 3, "use x and y"),
        ((*BOARD, "legacy"), "yes", "legacy is 'yes'; write true, false or auto"),
        ((*BOARD, "border_size"), -0.01, "of at least 0"),
        ((*BOARD, "border_size", "x"), -0.01, "of at least 0"),
        ((*BOARD, "border_size"), "wide", "is 'wide'; write a number"),
        ((*BOARD, "size"), 0, "above 0"),
        ((*BOARD, "size"), 1e-300, "is 1e-300, the board"),
        ((*BOARD, "size"), 1e6, "write metres"),
        ((*BOARD, "size"), float("nan"), "is nan"),
        ((*BOARD, "size"), float("inf"), "is inf"),
        ((*BOARD, "size"), True, "is true; write a number"),
        ((*BOARD, "inner_size"), 0.06, "smaller than its square (0.06 m)"),
        ((*BOARD, "inner_size"), -1, "above 0"),
        (("anchored_sensor",), "cam_3", "no sensor; use cam, cam_2 or lidar"),
        (("anchored_sensor",), ["cam"], "is a list"),
        (("max_duration_between_msgs",), 0, "above 0 (ms)"),
        (("max_duration_between_msgs",), "1 s", "write a number"),
        (("version",), "new", "write a number"),
    ],
)
def test_bad_values_are_named_with_the_remedy(path, value, problem):
    message = refusal(changed(path, value))
    assert message.startswith(".".join(path)) and problem in message


def test_frame_with_two_parents():
    message = refusal(changed(("additional_tfs", "gantry", "child_link"), "cam_link"))
    assert message.startswith("additional_tfs.gantry.parent_link is 'world', but 'cam' hangs")
    document = changed(("sensors", "lidar", "child_link"), "cam_link")
    document["sensors"]["lidar"]["parent_link"] = "floor"
    assert "'cam' hangs the same child_link 'cam_link' on 'beam'" in refusal(document)


def test_two_additional_tfs_are_two_transforms_though_one_may_be_a_sensor_s():
    document = full_document()
    document["additional_tfs"]["crane"] = dict(document["additional_tfs"]["gantry"])
    message = refusal(document)
    assert message.startswith("additional_tfs.crane is the transform world-beam, as 'gantry' is")
    document["additional_tfs"]["crane"] = {"parent_link": "beam", "child_link": "cam_link"}
    assert list(read(document).additional_tfs) == ["gantry", "crane"]


def test_shared_edge_is_a_warning():
    (warning,) = read(changed(("sensors", "cam_2", "child_link"), "cam_link")).warnings
    assert "sensors.cam_2 shares its edge with sensors.cam" in warning


@pytest.mark.parametrize(
    "name", ["a/b", ".hidden", "a b", "a: b", "%s", "a'b", "a\nb", "-a", "kamera_ö", "x" * 101]
)
@pytest.mark.parametrize("section", ["sensors", "calibration_patterns", "additional_tfs"])
def test_names_that_files_and_nodes_cannot_hold(section, name):
    document = full_document()
    entries = document[section]
    entries[name] = entries.pop(next(iter(entries)))
    assert "is no name to be used" in refusal(document)


@pytest.mark.parametrize("name", ["front-left.cam_2", "2d", "x" * 100])
def test_names_that_are_unusual_and_good(name):
    document = full_document()
    document["sensors"][name] = document["sensors"].pop("cam")
    assert name in read(document).sensors


@pytest.mark.parametrize(
    "key, value, problem",
    [
        ("topic_name", "/cam/$(eval 1)", "a topic has letters"),
        ("topic_name", "/cam image", "a topic has letters"),
        ("link", 'cam" name="x', "the name of a frame has no"),
        ("child_link", "<link>", "the name of a frame has none of"),
        ("parent_link", "${beam}", "the name of a frame has none of"),
    ],
)
def test_what_would_be_markup_in_a_launch_file_is_refused(key, value, problem):
    assert problem in refusal(changed(("sensors", "cam", key), value))


@pytest.mark.parametrize("document", [None, [], "text", 3])
def test_what_is_no_map_is_refused(document):
    assert "write a map" in refusal(document)


def test_keys_that_are_no_text():
    document = full_document()
    document["sensors"][False] = document["sensors"].pop("cam")
    assert "sensors has the key false, which YAML does not read as text" in refusal(document)


def test_single_pattern_of_version_2_is_migrated_with_a_note():
    document = full_document()
    document["calibration_pattern"] = {
        **document.pop("calibration_patterns")["board"],
        "origin": [0, 0, 0],
    }
    document["version"] = 2.0
    config = read(document)
    assert list(config.calibration_patterns) == ["pattern_1"]
    assert config.calibration_patterns["pattern_1"].extra == {"origin": [0, 0, 0]}
    note, origin = config.warnings
    assert "layout of version 2" in note and "calibration_patterns.pattern_1" in note
    assert "calibration_pattern.origin is not a known key" in origin
    written = config.to_document()
    assert "calibration_pattern" not in written and written["version"] == 3.0
    assert read(written) == config


def test_error_in_the_layout_of_version_2_names_the_key_that_stands_there():
    document = full_document()
    document["calibration_pattern"] = document.pop("calibration_patterns")["board"]
    document["calibration_pattern"]["size"] = -1
    assert refusal(document).startswith("calibration_pattern.size is -1")


def test_both_layouts_at_once_keep_the_new_one():
    document = full_document()
    document["calibration_pattern"] = {"size": 1}
    config = read(document)
    assert list(config.calibration_patterns) == ["board", "small"]
    assert config.to_document() == document and len(config.warnings) == 1


def test_a_version_in_quotes_is_a_number():
    config = read(changed(["version"], "3.0"))
    assert config.version == 3.0 and config.warnings == ()
    assert config.to_document()["version"] == 3.0


def test_version_2_with_keys_of_version_3():
    config = read(changed(["version"], 2.0))
    assert config.version == 2.0 and config.warnings == ()


@pytest.mark.parametrize(
    "path, value, text",
    [
        (("version",), 4.5, "this program knows version 3.0"),
        ((*BOARD, "size"), 60, "meant in millimetres"),
        ((*BOARD, "border_size"), {"x": 40, "y": 30}, "side of 40 metres; is it meant in milli"),
        ((*BOARD, "border_size"), GONE, "border_size is absent and taken as 0"),
        (("calibration_patterns", "small", "dimension", "x"), 8, "upside down"),
    ],
)
def test_doubtful_values_are_warned_about(path, value, text):
    (warning,) = read(changed(path, value)).warnings
    assert text in warning


def test_two_boards_with_the_same_markers_are_warned_about():
    document = full_document()
    document["calibration_patterns"]["twin"] = {
        **document["calibration_patterns"]["board"],
        "dictionary": "DICT_5X5_250",
        "link": "twin",
    }
    (warning,) = read(document).warnings
    assert "calibration_patterns.twin.dictionary has the same markers as 'board'" in warning


def test_two_chessboards_of_one_dimension_are_warned_about():
    document = full_document()
    patterns = document["calibration_patterns"]
    patterns["twin"] = {
        **patterns["small"],
        "dimension": dict(patterns["small"]["dimension"]),
        "link": "twin",
    }
    (warning,) = read(document).warnings
    assert "calibration_patterns.twin.dimension is that of 'small'" in warning


def test_a_board_has_a_frame_of_its_own():
    sensor = full_document()["sensors"]["cam"]
    for link in (sensor["link"], sensor["child_link"]):
        message = refusal(changed((*BOARD, "link"), link))
        assert "give the board a frame of its own" in message and f"'{link}'" in message
    document = full_document()
    document["calibration_patterns"]["twin"] = dict(document["calibration_patterns"]["board"])
    message = refusal(document)
    assert message.startswith("calibration_patterns.twin.link is ") and "link of 'board'" in message


def test_all_dictionaries_of_the_format():
    assert len(DICTIONARIES) == 16 and len(set(DICTIONARIES)) == 16
    for name in DICTIONARIES[1:4]:
        read(changed((*BOARD, "dictionary"), name))


def test_config_does_not_change_with_the_document_it_came_from():
    document = full_document()
    document["notes"] = ["a"]
    config = read(document)
    before = copy.deepcopy(config)
    document["notes"].append("b")
    document["sensors"].clear()
    config.to_document()["notes"].append("c")
    assert config == before == pickle.loads(pickle.dumps(config))


def test_direct_construction_is_checked_too():
    config = read(full_document())
    with pytest.raises(ConfigValueError, match="^anchored_sensor is 'x'"):
        dataclasses.replace(config, anchored_sensor="x")
    with pytest.raises(ConfigValueError, match="^modality is 'radar'"):
        SensorConfig("a", "b", "c", "/t", "radar")
    with pytest.raises(ConfigValueError, match="^dimension.x is 1"):
        dataclasses.replace(config.calibration_patterns["board"], dimension=(1, 8))
    with pytest.raises(ConfigValueError, match="^dimension is 9"):
        PatternConfig("a", "b", True, "chessboard", 9, 0.1)
    assert PatternConfig("a", "b", True, "chessboard", (9, 6), 0.1, 0.05).border_size == (0.05,) * 2


def test_pattern_geometry_follows_from_the_config():
    pattern = pattern_from_config("board", read(full_document()).calibration_patterns["board"])
    assert pattern.corner_count == 88
    assert tuple(pattern.first_corner) == pytest.approx((0.06, 0.06))


@pytest.mark.parametrize("run", ["nig_0.1_run001", "nig_0.2_run002"])
def test_config_inside_a_dataset_written_by_atom(real_data, run):
    path = real_data("atom_softbot") / run / "atom_calibration.json"
    document = json.loads(path.read_text())["calibration_config"]
    config = read(document)
    assert config.to_document() == document and config.warnings == ()
    assert config.calibration_patterns["pattern_1"].dimension == (11, 8)
