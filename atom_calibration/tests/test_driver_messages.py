"""What drivers of LiDARs record besides PointCloud2: Livox's own clouds, and undecoded packets."""

import genpy.dynamic
import numpy as np
import pytest
from livox_messages import livox_message

from atom_calibration.errors import BagError
from atom_calibration.messages.clouds import cloud_xyz, point_cloud
from atom_calibration.modalities.table import modality_of
from atom_calibration.sources import live_topics
from atom_calibration.sources.bag_reader import BagReader
from atom_calibration.sources.driver_messages import undecoded
from atom_calibration.sources.rig import _data_topic
from atom_core.model.config import SensorConfig

PACKET = "uint8[] buf\n"


def entry(topic, modality=None):
    edge = {"parent_link": "base", "child_link": "lidar"}
    return SensorConfig(link="lidar", topic_name=topic, modality=modality, **edge)


@pytest.mark.parametrize("package", ["livox_ros_driver", "livox_ros_driver2"])
def test_a_bag_of_livox_messages_has_clouds(make, tmp_path, package):
    points = np.float32([[1.5, -0.25, 0.5], [0, 0, 0], [np.nan, 1, 2]])
    sent = livox_message(package, points.tolist())
    with BagReader(make.bag(tmp_path / "a.bag", [("/livox/lidar", sent, 12.0)])) as bag:
        assert modality_of(entry("/livox/lidar"), bag.types["/livox/lidar"]) == "lidar3d"
        assert _data_topic("lidar", entry("/livox/lidar", "lidar3d"), bag) == "/livox/lidar"
        cloud = point_cloud(bag.first("/livox/lidar"))
    np.testing.assert_array_equal(cloud_xyz(cloud)[:2], points[:2])
    assert np.all(np.isnan(cloud_xyz(cloud)[2]))
    assert cloud.dtype.names == ("x", "y", "z", "intensity", "tag", "line")
    assert cloud["intensity"].tolist() == [40, 41, 42] and cloud["line"].tolist() == [0, 1, 2]


def test_a_livox_message_without_points_is_an_empty_cloud():
    cloud = point_cloud(livox_message("livox_ros_driver", []))
    assert cloud.shape == (0,) and cloud_xyz(cloud).shape == (0, 3)


def test_live_messages_of_a_package_that_is_not_built_are_told_at_once():
    with pytest.raises(BagError, match="livox_ros_driver2' is not found; build and source") as told:
        live_topics.message_class("livox_ros_driver2/CustomMsg")
    assert not isinstance(told.value, live_topics.NotYetError)  # that would be waited for
    assert live_topics.message_class("livox_ros_driver2/Other") is None


def test_a_bag_of_packets_alone_says_who_makes_clouds_of_them(make, tmp_path):
    kind = "ouster_ros/PacketMsg"
    packet = genpy.dynamic.generate_dynamic(kind, PACKET)[kind](buf=b"1234")
    with BagReader(make.bag(tmp_path / "a.bag", [("/os/lidar_packets", packet, 12.0)])) as bag:
        for topic in ("/os/points", "/os/lidar_packets"):
            with pytest.raises(BagError, match=r"lidar_packets.*cloud node of ouster_ros") as told:
                _data_topic("lidar", entry(topic, "lidar3d"), bag)
            assert "\n" not in str(told.value)
        with pytest.raises(BagError) as told:
            _data_topic("camera", entry("/image_raw", "rgb"), bag)
        assert "ouster" not in str(told.value)


def test_what_is_no_packet_is_not_spoken_of():
    types = {"/points": "sensor_msgs/PointCloud2", "/image/theora": "theora_image_transport/Packet"}
    assert undecoded(types, ["sensor_msgs/PointCloud2"]) == ""
    assert "republish theora" in undecoded(types, ["sensor_msgs/Image"])
