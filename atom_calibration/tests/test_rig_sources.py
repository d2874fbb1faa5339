"""What a configuration says of a sensor reaches its labeler, whatever the recording is."""

from types import SimpleNamespace

import pytest

from atom_calibration.sources.rig import sensor_from_bag
from atom_core.errors import AtomError
from atom_core.model.config import SensorConfig


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
