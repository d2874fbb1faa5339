"""Topics that a launch file remaps are found under the name that they have."""

import sys

import pytest
import rospy

from atom_calibration.runtime import running
from atom_calibration.sources.live_topics import LiveTopics, published_types
from atom_core.model.config import CalibrationConfig

IMAGE, CLOUD = "sensor_msgs/Image", "sensor_msgs/PointCloud2"


@pytest.fixture
def published(monkeypatch):
    """What is published; /camera/image_raw is remapped to /front/image_raw."""
    topics = {"/front/image_raw": IMAGE, "/lidar/points": CLOUD}
    remapped = {"/camera/image_raw": "/front/image_raw"}
    monkeypatch.setattr(rospy, "get_published_topics", lambda: list(topics.items()))
    monkeypatch.setattr(rospy, "resolve_name", lambda name: remapped.get(name, name))
    return topics


def test_a_remapped_topic_is_published_when_the_other_one_is(published):
    found = published_types(["/camera/image_raw", "/lidar/points"])
    assert found["/camera/image_raw"] == IMAGE and found["/lidar/points"] == CLOUD
    del published["/front/image_raw"]
    published["/camera/image_raw"] = IMAGE  # which this node does not hear
    assert "/camera/image_raw" not in published_types(["/camera/image_raw"])


def test_one_that_is_not_there_is_told_with_both_names(published):
    sensor = {"link": "c", "parent_link": "base", "child_link": "c", "modality": "rgb"}
    board = {"pattern_type": "chessboard", "dimension": {"x": 9, "y": 6}, "size": 0.06}
    board = {**board, "border_size": 0.04, "link": "board", "parent_link": "base", "fixed": False}
    document = {
        "sensors": {"cam": {**sensor, "topic_name": "/camera/image_raw"}},
        "calibration_patterns": {"board": board},
        "world_link": "base",
    }
    config = CalibrationConfig.from_document(document, "config.yml", lambda path: "config.yml:1")
    error = LiveTopics(config).absent("/camera/image_raw", [IMAGE], "sensor 'cam'")
    assert "/camera/image_raw (sensor 'cam'), remapped to /front/image_raw, is" in str(error)


def test_nodes_that_a_node_starts_hear_the_same_topics(monkeypatch):
    words = ["labelers", "--config", "a.yml", "/tf:=/robot/tf", "__name:=labelers", "_rate:=3"]
    monkeypatch.setattr(sys, "argv", words)
    assert running.remappings() == ["/tf:=/robot/tf"]
