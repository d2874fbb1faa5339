"""What rosdep's keys are called in Debian 12 and Ubuntu 20.04, and the lists of requirements/."""

from __future__ import annotations

import re
from pathlib import Path
from typing import List, Set

REQUIREMENTS = Path(__file__).resolve().parents[1] / "requirements"

# A key -> its packages in Debian 12.
DEBIAN = {
    "eigen": ["libeigen3-dev"],
    "imagemagick": ["imagemagick"],
    "interactive_markers": ["python3-interactive-markers"],
    "joint_state_publisher": ["joint-state-publisher"],
    "libpcl-all-dev": ["libpcl-dev"],
    "libqt5-widgets": ["qtbase5-dev"],
    "message_generation": ["ros-message-generation"],
    "message_runtime": ["ros-message-runtime"],
    "opengl": ["libopengl-dev", "libglu1-mesa-dev"],
    "robot_state_publisher": ["ros-robot-state-publisher"],
    "roscpp": ["libroscpp-dev"],
    "rostest": ["librostest-dev", "python3-rostest"],
    "rviz": ["rviz", "librviz-dev"],
    "pluginlib": ["pluginlib-dev"],
    "topic_tools": ["topic-tools"],
    "xacro": [],  # from PyPI (requirements/pip.txt)
    **{
        name: [f"ros-{dashed}", f"python3-{dashed}", f"lib{dashed}-dev"]
        for name in ("geometry_msgs", "sensor_msgs", "std_msgs")
        for dashed in [name.replace("_", "-")]
    },
    **{
        name: [f"ros-{dashed}", f"python3-{dashed}"]
        for name in ("std_srvs", "visualization_msgs")
        for dashed in [name.replace("_", "-")]
    },
    **{
        name: [f"python3-{name.replace('_', '-')}"]
        for name in ("genpy", "message_filters", "rosbag", "rosgraph", "rosgraph_msgs", "roslaunch")
    },
    **{
        name: [f"python3-{name.replace('_', '-')}"]
        for name in ("roslib", "rospy", "rosunit", "tf2_msgs", "tf2_ros")
    },
}

# A key that names no ROS package -> its packages in Ubuntu 20.04, where the names differ.
_SYSTEM = {
    "eigen": ["libeigen3-dev"],
    "libpcl-all-dev": ["libpcl-dev"],
    "libqt5-widgets": ["libqt5widgets5"],
    "opengl": ["libgl1-mesa-dev", "libglu1-mesa-dev"],
    **{name: [name] for name in ("graphviz", "imagemagick", "openbox", "pkg-config", "xdotool")},
    **{name: [name] for name in ("pybind11-dev", "qtbase5-dev", "xvfb")},
}


def debian_packages(key: str) -> List[str]:
    """Return the packages of Debian 12 that a key stands for."""
    return DEBIAN.get(key, [key.replace("_", "-")])


def noetic_packages(key: str) -> List[str]:
    """Return the packages of Ubuntu 20.04 with ROS Noetic that rosdep installs for a key."""
    if key in _SYSTEM:
        return _SYSTEM[key]
    if key.startswith(("lib", "python3-")):
        return [key]
    return [f"ros-noetic-{key.replace('_', '-')}"]


def listed(file_name: str) -> Set[str]:
    """Return the names in a file of requirements/."""
    text = (REQUIREMENTS / file_name).read_text(encoding="utf-8")
    return set(re.sub(r"#.*", "", text).split())
