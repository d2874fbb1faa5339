"""Messages as sensors send them, of which only their drivers make clouds and images."""

from __future__ import annotations

from typing import Collection, Mapping

from atom_calibration.messages.clouds import POINT_CLOUD
from atom_calibration.messages.images import IMAGE

# Type of message: the type that a program makes of it, and that program.
_MADE_BY = {
    "ouster_ros/PacketMsg": (POINT_CLOUD, "the cloud node of ouster_ros"),
    "velodyne_msgs/VelodyneScan": (POINT_CLOUD, "the cloud node of velodyne_pointcloud"),
    "rslidar_msgs/rslidarScan": (POINT_CLOUD, "the cloud node of ros_rslidar"),
    "hesai_lidar/PandarScan": (POINT_CLOUD, "the cloud node of hesai_lidar"),
    "theora_image_transport/Packet": (IMAGE, "image_transport's `republish theora`"),
}


def undecoded(types: Mapping[str, str], wanted: Collection[str]) -> str:
    """Return a clause about topics of which a driver has still to make data; empty without them.

    Args:
        types: type of messages by topic.
        wanted: types of the data.
    """
    for kind, (made, program) in _MADE_BY.items():
        topics = sorted(topic for topic, carried in types.items() if carried == kind)
        if topics and made in wanted:
            return (
                f"; {kind} on {', '.join(topics)} is what a sensor sends: play the bag while "
                f"{program} runs, and record what that publishes"
            )
    return ""
