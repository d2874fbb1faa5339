"""From where RViz looks at a rig when it opens."""

import numpy as np
import pytest

from atom_calibration.configure.viewpoint import Viewpoint, viewpoint
from atom_core.geometry import se3
from atom_core.model.transforms import Edge
from atom_core.synthetic import scenes

OPTICAL = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # looks along x of its mount


def rig(*mounts):
    """Return the configuration of a rig with cameras and one LiDAR, and where they are."""
    cameras = len(mounts) - 1
    scene = scenes.random_scene(1, rgb=cameras, depth=0, lidar3d=1, collections=2)
    config = scene.dataset.config
    names = sorted(config.sensors, key=lambda name: config.sensors[name].modality != "rgb")
    transforms = {
        Edge(config.world_link, config.sensors[name].link): mount
        for name, mount in zip(names, mounts)
    }
    return config, transforms


def camera(place, yaw_rad):
    turn = se3.from_rpy(np.zeros(3), np.array([0.0, 0.0, yaw_rad]))[:3, :3]
    return se3.transform(turn @ OPTICAL, np.array(place))


@pytest.mark.parametrize("yaw_rad", [0.0, 1.0, np.pi, -2.0])
def test_a_rig_whose_cameras_look_one_way_is_seen_from_behind(yaw_rad):
    lidar = se3.transform(np.eye(3), np.array([2.0, 1.0, 1.2]))
    cameras = [camera((2.0, 1.0, 1.0), yaw_rad + off) for off in (-0.2, 0.2)]
    seen = viewpoint(*rig(*cameras, lidar))
    ahead = np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
    to_viewer = np.array([np.cos(seen.yaw_rad), np.sin(seen.yaw_rad)])
    assert to_viewer @ ahead < -0.8
    viewer = np.array(seen.focal_m[:2]) + seen.distance_m * np.cos(seen.pitch_rad) * to_viewer
    assert (viewer - (2.0, 1.0)) @ ahead < -1.0  # behind the cameras
    assert (np.array(seen.focal_m[:2]) - (2.0, 1.0)) @ ahead > 1.0  # which look at what is amid


def test_sensors_around_their_boards_are_seen_from_where_they_always_were():
    lidar = se3.transform(np.eye(3), np.array([0.0, 0.0, 2.0]))
    facing = [camera((-2.0, 0.0, 1.0), 0.0), camera((2.0, 0.0, 1.0), np.pi)]
    assert viewpoint(*rig(*facing, lidar)) == Viewpoint()
    wide = [camera((0.0, -3.0, 1.0), 0.0), camera((0.0, 3.0, 1.0), 0.0)]
    assert viewpoint(*rig(*wide, lidar)) == Viewpoint()


def test_where_nothing_is_known_of_the_rig_the_view_is_of_the_origin():
    config, _ = rig(np.eye(4), np.eye(4))
    assert viewpoint(config, {}) == Viewpoint()
    (lidar,) = (entry for entry in config.sensors.values() if entry.modality == "lidar3d")
    only_lidar = {Edge(config.world_link, lidar.link): np.eye(4)}
    assert viewpoint(config, only_lidar) == Viewpoint()
