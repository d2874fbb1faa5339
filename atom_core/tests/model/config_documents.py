"""A configuration with every key of the format, and what is said of one that is refused."""

import pytest

from atom_core.errors import ConfigError
from atom_core.model.config import CalibrationConfig

GONE = object()


def sensor(link, child_link, topic_name, modality, throttle=None):
    keys = ("link", "parent_link", "child_link", "topic_name", "modality", "throttle")
    return dict(zip(keys, (link, "beam", child_link, topic_name, modality, throttle)))


def full_document():
    """Return a document with every key of the format, in ATOM's order."""
    return {
        "description_file": "package://cell_description/urdf/cell.urdf.xacro",
        "bag_file": "$ROS_BAGS/cell/train.bag",
        "world_link": "world",
        "sensors": {
            "cam": sensor("cam_optical_frame", "cam_link", "/cam/image_raw", "rgb", 10),
            "cam_2": sensor("cam_2_optical_frame", "cam_2_link", "/cam_2/image_raw", "depth"),
            "lidar": sensor("lidar", "lidar_base", "/lidar/points", None),
        },
        "additional_tfs": {"gantry": {"parent_link": "world", "child_link": "beam"}},
        "joints": {"shoulder": {"params_to_calibrate": ["origin_x", "origin_yaw"]}},
        "calibration_patterns": {
            "board": {
                "link": "board_link",
                "parent_link": "world",
                "fixed": False,
                "pattern_type": "charuco",
                "dictionary": "DICT_5X5_100",
                "mesh_file": "package://boards/board.dae",
                "border_size": {"x": 0.04, "y": 0.03},
                "dimension": {"x": 11, "y": 8},
                "size": 0.06,
                "inner_size": 0.045,
            },
            "small": {
                "link": "small_link",
                "parent_link": "hand",
                "fixed": True,
                "pattern_type": "chessboard",
                "dictionary": None,
                "mesh_file": None,
                "border_size": 0.02,
                "dimension": {"x": 9, "y": 6},
                "size": 0.02,
                "inner_size": None,
            },
        },
        "anchored_sensor": "cam_2",
        "max_duration_between_msgs": 250,
        "package_name": "cell_calibration",
        "version": 3.0,
    }


def changed(path, value):
    """Return the full document with one value replaced, or removed."""
    document = full_document()
    target = document
    for key in path[:-1]:
        target = target[key]
    if value is GONE:
        del target[path[-1]]
    else:
        target[path[-1]] = value
    return document


def read(document):
    return CalibrationConfig.from_document(document, "dataset.json")


def refusal(document):
    with pytest.raises(ConfigError) as error:
        read(document)
    message = str(error.value)
    assert message.startswith("dataset.json: ") and "\n" not in message
    return message[len("dataset.json: ") :]
