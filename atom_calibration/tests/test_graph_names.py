"""Names with `-` and `.`: one rule for topics, services and nodes, in Python and in RViz."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from masters import running_master

from atom_calibration.configure.render import collecting_view
from atom_calibration.runtime.graph_names import check_graph_names, graph_name
from atom_core.errors import ConfigError
from atom_core.model.config import CalibrationConfig

CPP = Path(__file__).resolve().parents[2] / "atom_rviz_plugins/tests/test_graph_name.cpp"
EXAMPLE = re.compile(r'EXPECT_EQ\(graph_name\("(.*?)"\), "(.*?)"\);')
OF_ROSCPP = re.compile(r"/?[A-Za-z0-9_/]+")


def test_python_and_cpp_have_the_same_examples():
    examples = EXAMPLE.findall(CPP.read_text(encoding="utf-8"))
    assert len(examples) > 3
    for name, expected in examples:
        assert graph_name(name) == expected


def test_names_that_ros_cannot_tell_apart_are_refused():
    check_graph_names(["lidar-1", "lidar_2", "lidar-1"])
    with pytest.raises(ConfigError, match=r"'lidar-1' and 'lidar\.1' are both 'lidar_1'"):
        check_graph_names(["lidar-1", "lidar_2", "lidar.1"])


def test_every_topic_in_rviz_is_one_that_rviz_accepts():
    topics = list(_topics(yaml.safe_load(collecting_view(_config("lidar-1.front")))))
    assert "/lidar_1_front/data_labeler/update" in topics
    assert [topic for topic in topics if not OF_ROSCPP.fullmatch(topic)] == []


def _topics(value):
    if isinstance(value, dict):
        for key, item in value.items():
            if key.endswith("Topic") and isinstance(item, str) and item:
                yield item
            yield from _topics(item)
    elif isinstance(value, list):
        for item in value:
            yield from _topics(item)


def _config(name):
    sensor = {"link": "l", "parent_link": "base", "child_link": "l", "modality": "lidar3d"}
    board = {"pattern_type": "chessboard", "dimension": {"x": 9, "y": 6}, "size": 0.06}
    board = {**board, "border_size": 0.04, "link": "board", "parent_link": "base", "fixed": False}
    document = {
        "sensors": {name: {**sensor, "topic_name": "/points"}},
        "calibration_patterns": {"board": board},
        "world_link": "base",
    }
    return CalibrationConfig.from_document(document, "config.yml", lambda path: "config.yml:1")


NAMES_OF_A_NODE = """
import rospy
from atom_calibration.runtime import running
running.start("collect_data")
print(rospy.get_name(), rospy.resolve_name("~state"), rospy.Publisher("~state", rospy.AnyMsg).name)
rospy.signal_shutdown("done")
"""


@pytest.mark.slow
def test_a_node_has_its_name_in_whichever_namespace_the_shell_stands(tmp_path):
    pytest.importorskip("rospy")
    with running_master(tmp_path) as variables:
        said = subprocess.run(
            [sys.executable, "-c", NAMES_OF_A_NODE],
            env={**os.environ, **variables, "ROS_NAMESPACE": "robot"},
            capture_output=True,
            text=True,
            timeout=120,
            check=True,
        ).stdout
    assert said.split() == ["/collect_data", "/collect_data/state", "/collect_data/state"]
