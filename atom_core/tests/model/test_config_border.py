"""The border of a board, side by side: read, written, refused in one sentence."""

import pytest

from atom_core.errors import ConfigError
from atom_core.model.config import CalibrationConfig
from atom_core.model.pattern import border_from_document, geometry_document, pattern_from_config


def document():
    """Return a configuration with one camera and one board."""
    camera = {
        "link": "cam_optical_frame",
        "parent_link": "world",
        "child_link": "cam_link",
        "topic_name": "/cam/image_raw",
        "modality": "rgb",
    }
    board = {
        "link": "board_link",
        "parent_link": "world",
        "fixed": False,
        "pattern_type": "charuco",
        "dictionary": "DICT_5X5_100",
        "border_size": {"x": 0.04, "y": 0.03},
        "dimension": {"x": 11, "y": 8},
        "size": 0.06,
        "inner_size": 0.045,
    }
    return {
        "description_file": "package://cell_description/urdf/cell.urdf.xacro",
        "world_link": "world",
        "sensors": {"cam": camera},
        "calibration_patterns": {"board": board},
        "anchored_sensor": "cam",
        "max_duration_between_msgs": 250,
        "version": 3.0,
    }


def read(document):
    return CalibrationConfig.from_document(document, "dataset.json")


def refusal(document):
    with pytest.raises(ConfigError) as error:
        read(document)
    message = str(error.value)
    assert "\n" not in message
    return message[len("dataset.json: ") :]


SIDES = {"left": 0.01, "right": 0.05, "top": 0.02, "bottom": 0.0}


def with_sides(sides):
    changed = document()
    del changed["calibration_patterns"]["board"]["border_size"]
    changed["calibration_patterns"]["board"]["border"] = sides
    return changed


def test_four_sides_of_a_border_arrive_and_are_written_back():
    config = read(with_sides(SIDES))
    board = config.calibration_patterns["board"]
    assert config.warnings == () and board.border_sides == (0.01, 0.05, 0.02, 0.0)
    written = board.to_document()
    assert written["border"] == SIDES and "border_size" not in written
    pattern = pattern_from_config("board", board)
    border = pattern.border
    assert border_from_document(geometry_document(pattern)) == border
    columns, rows = board.dimension
    start = 0.0 if board.pattern_type == "charuco" else -board.size
    assert (border.x_min, border.y_min) == pytest.approx((start - 0.01, start - 0.02))
    end = start + (columns + 1) * board.size, start + (rows + 1) * board.size
    assert (border.x_max, border.y_max) == pytest.approx((end[0] + 0.05, end[1]))


def test_borders_that_contradict_or_lack_a_side_are_refused():
    both = document()
    both["calibration_patterns"]["board"]["border"] = SIDES
    where = "calibration_patterns.board.border"
    assert refusal(both).startswith(f"{where} stands beside border_size; keep one")
    lacking = dict.fromkeys(("left", "right", "top"), 0.01)
    assert refusal(with_sides(lacking)).startswith(f"{where}.bottom is absent; give metres")
    assert refusal(with_sides({**SIDES, "top": -0.01})).startswith(f"{where}.top is -0.01")
    assert refusal(with_sides({**SIDES, "up": 0.01})).startswith(f"{where}.up is no side; use left")
    assert refusal(with_sides(0.04)).startswith(f"{where} is 0.04; write {{left: , right: ")
