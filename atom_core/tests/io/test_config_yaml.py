"""Configurations in files: round trips; every mistake is one line with file, line and key."""

import dataclasses

import numpy as np
import pytest

from atom_core.errors import ConfigError, OutputError
from atom_core.io.config_yaml import read_config, read_config_with_places, write_config

TEXT = """\
# A configuration as a user writes it.
description_file: package://cell/urdf/cell.urdf.xacro
bag_file: $ROS_BAGS/cell.bag
world_link: world
sensors:
  cam:
    link: cam_optical_frame
    parent_link: beam
    child_link: cam_link
    topic_name: /cam/image_raw
    modality: rgb
    throttle:
  cam_2:
    link: cam_2_optical_frame
    parent_link: beam
    child_link: cam_2_link
    topic_name: /cam_2/image_raw
additional_tfs: ""
joints:
  j1: {params_to_calibrate: [origin_x, origin_yaw]}
calibration_patterns:
  pattern_1:
    link: pattern_link
    parent_link: world
    fixed: false
    pattern_type: charuco
    dictionary: DICT_5X5_100
    mesh_file: package://boards/board.dae
    border_size: {x: 0.04, y: 3e-2}
    dimension: {x: 11, y: 8}
    size: 0.06
    inner_size: 45.0e-3
anchored_sensor:
max_duration_between_msgs: 1000
package_name: cell_calibration
version: 3.0
"""
# Each list holds ten times the one before: 300 bytes for a million values.
ALIAS_BOMB = "n0: &n0 [0]\n" + "".join(
    f"n{i}: &n{i} [{', '.join([f'*n{i - 1}'] * 10)}]\n" for i in range(1, 7)
)


def read(tmp_path, text):
    path = tmp_path / "config.yml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8"))
    return read_config(path)


def refusal(tmp_path, text):
    """Return the message after the file's name: ':line: ...'."""
    with pytest.raises(ConfigError) as error:
        read(tmp_path, text)
    message = str(error.value)
    assert message.startswith(str(tmp_path / "config.yml") + ":") and "\n" not in message
    return message[len(str(tmp_path / "config.yml")) :]


def test_values_arrive(tmp_path):
    config = read(tmp_path, TEXT)
    assert config.warnings == ()
    pattern = config.calibration_patterns["pattern_1"]
    assert pattern.border_size == (0.04, 0.03) and pattern.inner_size == 0.045
    assert config.sensors["cam_2"].modality is None and config.anchored_sensor is None
    assert config.joints["j1"].params_to_calibrate == ("origin_x", "origin_yaw")


def test_round_trip(tmp_path):
    config = read(tmp_path, TEXT + "notes:\n  - é\n  - 1.0e-12\n  - null\n")
    write_config(tmp_path / "b.yml", config)
    back = read_config(tmp_path / "b.yml")
    assert back == config and back.to_document() == config.to_document()
    assert list(back.sensors) == ["cam", "cam_2"]
    write_config(tmp_path / "c.yml", back)
    assert (tmp_path / "c.yml").read_bytes() == (tmp_path / "b.yml").read_bytes()


def test_round_trip_of_every_number_and_of_texts_that_look_otherwise(tmp_path):
    rng = np.random.default_rng(6)
    numbers = (rng.normal(size=200) * 10.0 ** rng.integers(-300, 300, 200)).tolist()
    texts = ["1e-3", "5.e3", ".5e1", "1.0", "3", "yes", "null", "~", "", " a", "a: b", "# c", "é\n"]
    letters = list("0123456789eE+-._:# {}[]'\"\\\n\tnaé")
    texts += ["".join(rng.choice(letters, rng.integers(1, 8))) for _ in range(500)]
    config = read(tmp_path, TEXT)
    config = dataclasses.replace(config, extra={"numbers": numbers, "texts": texts})
    write_config(tmp_path / "b.yml", config)
    assert read_config(tmp_path / "b.yml").extra == {"numbers": numbers, "texts": texts}


@pytest.mark.parametrize(
    "old, new, place, problem",
    [
        (
            "modality: rgb",
            "modality: rbg",
            11,
            "sensors.cam.modality is 'rbg'; use rgb, depth, lid",
        ),
        ("    topic_name: /cam/image_raw\n", "", 6, "sensors.cam.topic_name is absent"),
        ("y: 8}", "y: 1}", 30, "calibration_patterns.pattern_1.dimension.y is 1"),
        ("size: 0.06", "size: 6 cm", 31, "pattern_1.size is '6 cm'; write a number"),
        ("inner_size: 45.0e-3", "inner_size: 0.1", 32, "pattern_1.inner_size is 0.1; a marker"),
        ("anchored_sensor:", "anchored_sensor: cam_3", 33, "use cam or cam_2"),
        ("msgs: 1000", "msgs: -1", 34, "max_duration_between_msgs is -1; write a number above 0"),
        ("origin_x,", "origin_q,", 20, "joints.j1.params_to_calibrate holds 'origin_q'"),
        ("world_link: world\n", "", 1, "world_link is absent"),
        ("sensors:\n", "sensors: [a]\nother:\n", 5, "sensors is a list; write a map"),
        ("  cam:\n", "  no:\n", 5, "sensors has the key false, which YAML does not read as text"),
    ],
)
def test_bad_values_are_named_with_their_line(tmp_path, old, new, place, problem):
    assert TEXT.count(old) == 1
    message = refusal(tmp_path, TEXT.replace(old, new))
    line = place if place > 1 else 2  # the first line is a comment; the map begins in the second
    assert message.startswith(f":{line}: ") and problem in message


def test_one_message_in_full(tmp_path):
    message = refusal(tmp_path, TEXT.replace("modality: rgb", "modality: rbg"))
    assert message == ":11: sensors.cam.modality is 'rbg'; use rgb, depth, lidar3d or lidar2d"


def test_warnings_name_the_line(tmp_path):
    config = read(tmp_path, TEXT.replace("    modality: rgb", "    modalty: rgb"))
    assert config.warnings == (
        f"{tmp_path / 'config.yml'}:11: sensors.cam.modalty is not a known key, kept but not "
        f"used; did you mean 'modality'?",
    )


@pytest.mark.parametrize(
    "old, new, line, key, first",
    [
        ("  cam_2:\n", "  cam:\n", 13, "cam", 6),
        ("version: 3.0\n", "version: 3.0\nworld_link: map\n", 37, "world_link", 4),
        ("{x: 11, y: 8}", "{x: 11, y: 5, y: 8}", 30, "y", 30),
    ],
)
def test_duplicate_keys_are_warned_of(tmp_path, old, new, line, key, first):
    (warning,) = read(tmp_path, TEXT.replace(old, new)).warnings
    assert warning == (
        f"{tmp_path / 'config.yml'}:{line}: {key} stands here a second time (first in line "
        f"{first}); this one counts, remove the other"
    )


def test_of_duplicate_keys_the_last_counts(tmp_path):
    text = TEXT.replace("  cam_2:\n", "  cam:\n") + "world_link: map\n"
    config = read(tmp_path, text)
    assert config.world_link == "map" and list(config.sensors) == ["cam"]
    assert config.sensors["cam"].topic_name == "/cam_2/image_raw"
    assert config.sensors["cam"].modality is None
    message = refusal(tmp_path, text.replace("topic_name: /cam_2/image_raw", "topic_name: 5"))
    assert message.startswith(":17: sensors.cam.topic_name")


@pytest.mark.parametrize(
    "text, place, problem",
    [
        (TEXT.replace("    link: cam_opt", "\tlink: cam_opt"), ":7:1: ", "a tab"),
        (TEXT.replace("y: 8}", "y: 8"), ":31:", "not valid YAML"),
        (TEXT.replace("  cam_2:\n", "   cam_2:\n"), ":13:", "not valid YAML"),
        (TEXT.replace("link: pattern_link", "link: 'pattern_link"), ":23:11: ", "not valid YAML"),
        (TEXT.replace("rgb\n", "!!python/object:os.system rgb\n"), ":11:", "not valid YAML"),
        (TEXT.replace("rgb\n", "*unknown\n"), ":11:", "undefined alias"),
        (TEXT.replace("rgb\n", "2024-99-99\n"), ":", "not valid YAML"),
        (TEXT + "notes: [a, b\n", ":37:8: ", "not valid YAML"),
        (TEXT + "---\nworld_link: b\n", ":37:", "not valid YAML"),
        (TEXT + "[a, b]: c\n", ":37:", "not valid YAML"),
        (TEXT.encode() + b"note: \xff\n", ":37: ", "UTF-8"),
        (TEXT + "note: \x00\n", ":37: ", "does not allow"),
        (TEXT + "note: " + "[" * 1200, ": ", "nested too deeply"),
        (TEXT + "note: &a [1, *a]\n", ": ", "'*a' stands within what it stands for"),
        (TEXT + ALIAS_BOMB, ": ", "stands for more than 500000 values"),
        ("", ": ", "is empty"),
        ("# only a comment\n", ": ", "is empty"),
        ("- a\n- b\n", ":1: ", "is a list; write a map"),
        ("just text\n", ":1: ", "write a map"),
    ],
)
def test_broken_files_are_one_line_with_a_position(tmp_path, text, place, problem):
    message = refusal(tmp_path, text)
    assert message.startswith(place) and problem in message


def test_absent_file_and_folder(tmp_path):
    for path in (tmp_path / "absent.yml", tmp_path):
        with pytest.raises(ConfigError, match="cannot be read"):
            read_config(path)


def test_anchors_and_merged_maps(tmp_path):
    text = TEXT.replace("  cam:\n", "  cam: &cam\n").replace(
        "  cam_2:\n", "  cam_2:\n    <<: *cam\n"
    )
    config = read(tmp_path, text)
    assert config.sensors["cam_2"].modality == "rgb"
    assert config.sensors["cam_2"].child_link == "cam_2_link"
    message = refusal(tmp_path, text.replace("modality: rgb", "modality: rbg"))
    assert message.startswith(":11: sensors.cam.modality")


def test_text_with_a_byte_order_mark_and_windows_line_ends(tmp_path):
    data = b"\xef\xbb\xbf" + TEXT.replace("\n", "\r\n").encode()
    assert read(tmp_path, data) == read(tmp_path, TEXT)


def test_version_2_layout_has_lines_too(tmp_path):
    text = TEXT.replace("calibration_patterns:\n  pattern_1:\n", "calibration_pattern:\n")
    (note,) = read(tmp_path, text).warnings
    assert "config.yml:21: calibration_pattern is the layout of version 2" in note
    message = refusal(tmp_path, text.replace("size: 0.06", "size: 0"))
    assert message.startswith(":30: calibration_pattern.size is 0")


@pytest.mark.parametrize("version_2", [False, True])
def test_a_key_of_a_board_is_found_in_both_layouts(tmp_path, version_2):
    new, old = "calibration_patterns:\n  pattern_1:\n", "calibration_pattern:\n"
    text = TEXT.replace(new, old) if version_2 else TEXT
    path = tmp_path / "config.yml"
    path.write_text(text, encoding="utf-8")
    _, locate = read_config_with_places(path)
    line = text[: text.index("mesh_file")].count("\n") + 1
    assert locate(("calibration_patterns", "pattern_1", "mesh_file")) == f"{path}:{line}"


def test_failed_write_keeps_the_old_file(tmp_path):
    config = read(tmp_path, TEXT)
    with pytest.raises(OutputError):
        write_config(tmp_path / "absent" / "config.yml", config)
    assert (tmp_path / "config.yml").read_text() == TEXT
