"""What a configuration says of a sensor reaches its labeler, whatever the recording is."""

from types import SimpleNamespace

import numpy as np
import pytest
import rospy

from atom_calibration.messages.poses import transform_message
from atom_calibration.sources.rig import Rig, check_frames, sensor_from_bag
from atom_calibration.sources.transform_tree import TransformTree
from atom_core.errors import AtomError
from atom_core.geometry import se3
from atom_core.model.config import SensorConfig
from atom_core.model.sensor import LIDAR3D, Sensor
from atom_core.model.transforms import Edge


def source(topic, message):
    return SimpleNamespace(types={topic: message}, path="a.bag")


def entry(**more):
    return SensorConfig("lidar", "world", "lidar_base", "/points", **more)


def test_the_width_of_beams_is_that_of_the_configuration():
    bag = source("/points", "sensor_msgs/PointCloud2")
    for width, expected in ((None, 0.0), (0.0134, 0.0134)):
        _, sensor = sensor_from_bag("lidar", entry(beam_width=width), bag)
        assert sensor.beam_width_rad == expected


def test_only_3d_lidars_have_it():
    scans = source("/points", "sensor_msgs/LaserScan")
    with pytest.raises(AtomError, match="'lidar': its data are .*LaserScan, and beam_width is of"):
        sensor_from_bag("lidar", entry(beam_width=0.01), scans)


def tree_with(base_T_data, fixed=True):
    tree, stamp = TransformTree(), rospy.Time.from_sec(1.0)
    tree.add([transform_message(Edge("world", "lidar_base"), np.eye(4), stamp)], fixed=True)
    tree.add([transform_message(Edge("lidar_base", "lidar"), base_T_data, stamp)], fixed)
    return tree


def checked(base_T_data, data_frame, fixed=True):
    edge = Edge("world", "lidar_base")
    lidar = Sensor("left", LIDAR3D, "lidar_base", edge, None, "/points", 0.0)
    rig = Rig({"left": lidar}, {"/points": lidar}, {}, (), {"left": data_frame})
    config = SimpleNamespace(world_link="world", calibration_patterns={})
    check_frames(rig, config, tree_with(base_T_data, fixed))


def test_clouds_of_another_frame_are_refused_with_how_far_it_is():
    above = se3.transform(np.eye(3), np.array([0.0, 0.0, 0.0377]))
    told = "'left': its data are in frame 'lidar' .* 37.7 mm and 0.00 deg .* write `link: lidar`"
    with pytest.raises(AtomError, match=told):
        checked(above, "lidar")
    turned = se3.from_rpy(np.zeros(3), np.array([0.0, 0.0, np.pi]))
    with pytest.raises(AtomError, match="0.0 mm and 180.00 deg"):
        checked(turned, "lidar")


def test_frames_that_are_one_or_that_no_fixed_transform_connects_are_left_to_the_user():
    above = se3.transform(np.eye(3), np.array([0.0, 0.0, 0.0377]))
    checked(np.eye(4), "lidar")
    checked(above, "velodyne")
    checked(above, "lidar", fixed=False)
