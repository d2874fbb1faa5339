"""A small robot with a camera and a LiDAR: its xacro, its configuration, its recording."""

from pathlib import Path

import numpy as np
import rospy
from sensor_msgs.msg import CompressedImage, JointState

from atom_calibration.configure import configure_package
from atom_core.geometry import se3
from atom_core.io.urdf import read_description

XACRO = """<?xml version="1.0"?>
<robot name="small_rig" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:property name="height" value="1.2"/>
  <!-- every range sensor stands on one of these -->
  <xacro:macro name="stand" params="name parent">
    <link name="${name}_base"/>
    <joint name="${name}_mount" type="fixed">
      <parent link="${parent}"/> <child link="${name}_base"/>
      <origin xyz="0 0.1 0.05" rpy="0 0 0"/>
    </joint>
  </xacro:macro>

  <link name="base"/> <link name="mast"/> <link name="camera_link"/> <link name="camera_optical"/>
  <link name="arm"/> <link name="lidar"/> <link name="bumper"/> <link name="lamp"/>

  <joint name="mast_joint" type="fixed">
    <parent link="base"/> <child link="mast"/> <origin xyz="0 0 ${height}"/>
  </joint>
  <joint name="camera_mount" type="fixed">  <!-- measured with a ruler -->
    <parent link="mast"/> <child link="camera_link"/>
    <origin xyz="0.1 0 0" rpy="0 0.2 0"/>
  </joint>
  <joint name="camera_optics" type="fixed">
    <parent link="camera_link"/> <child link="camera_optical"/>
    <origin rpy="${-pi/2} 0 ${-pi/2}"/>
  </joint>
  <joint name="shoulder" type="revolute">
    <parent link="base"/> <child link="arm"/> <origin xyz="0.5 0 0.4"/>
    <axis xyz="0 0 1"/> <limit lower="-3" upper="3" effort="1" velocity="1"/>
  </joint>
  <xacro:stand name="lidar" parent="arm"/>
  <joint name="lidar_optics" type="fixed">
    <parent link="lidar_base"/> <child link="lidar"/> <origin xyz="0 0 0.04"/>
  </joint>
  <joint name="bumper_joint" type="fixed"> <parent link="base"/> <child link="bumper"/> </joint>
  <joint name="lamp_joint" type="fixed"> <parent link="base"/> <child link="lamp"/> </joint>
</robot>
"""

CONFIG = """description_file: "rig.urdf.xacro"
bag_file: "rig.bag"
world_link: "odom"
sensors:
  camera:
    link: "camera_optical"
    parent_link: "mast"
    child_link: "camera_link"
    topic_name: "/camera/image_raw"
    modality:
    throttle: 5
  lidar:
    link: "lidar"
    parent_link: "arm"
    child_link: "lidar_base"
    topic_name: "/lidar/points"
    modality: "lidar3d"
    throttle:
additional_tfs:
  guard:
    parent_link: "base"
    child_link: "bumper"
joints:
  shoulder:
    params_to_calibrate: [origin_yaw]
calibration_patterns:
  board:
    link: "board_link"
    parent_link: "odom"
    fixed: false
    pattern_type: "charuco"
    dictionary: "DICT_5X5_100"
    mesh_file:
    border_size: {x: 0.04, y: 0.03}
    dimension: {x: 11, y: 8}
    size: 0.06
    inner_size: 0.045
anchored_sensor:
max_duration_between_msgs: 1000
package_name: "small_rig_calibration"
version: 3.0
"""

MANIFEST = """<?xml version="1.0"?>
<package format="3">
  <name>small_rig_calibration</name> <version>0.1.0</version> <description>test</description>
  <maintainer email="a@example.org">a</maintainer> <license>none</license>
  <buildtool_depend>catkin</buildtool_depend>
  <exec_depend>atom_calibration</exec_depend> <exec_depend>robot_state_publisher</exec_depend>
  <exec_depend>rosbag</exec_depend> <exec_depend>rviz</exec_depend>
  <exec_depend>topic_tools</exec_depend> <exec_depend>xacro</exec_depend>
</package>
"""
SHOULDER_RAD = 0.4
CAMERA_IN_BAG = se3.from_rpy(np.array([0.2, 0.0, 0.0]), np.array([0.0, 0.2, 0.0]))


def write_package(folder, make, bag_name="rig.bag", seconds=4.0):
    """Write the package with its description, configuration and recording; return its folder."""
    folder = Path(folder) / "small_rig_calibration"
    (folder / "calibration").mkdir(parents=True)
    (folder / "package.xml").write_text(MANIFEST, encoding="utf-8")
    (folder / "calibration" / "config.yml").write_text(CONFIG, encoding="utf-8")
    (folder / "calibration" / "rig.urdf.xacro").write_text(XACRO, encoding="utf-8")
    robot = read_description(folder / "calibration" / "rig.urdf.xacro").robot
    make.bag(folder / "calibration" / bag_name, messages(make, robot, seconds))
    return folder


def messages(make, robot, seconds):
    """Return (topic, message, time) of a recording; its mast carries the camera elsewhere."""
    edges = robot.transforms({"shoulder": SHOULDER_RAD})
    static = make.tf("mast", "camera_link", CAMERA_IN_BAG, 10.0)
    for edge, matrix in edges.items():
        if edge.child not in ("camera_link", "arm"):
            static.transforms += make.tf(*edge, matrix, 10.0).transforms
    cloud = np.random.default_rng(0).uniform(-2, 2, (200, 3)).astype(np.float32)
    pixels = np.full((48, 64, 3), 90, np.uint8)
    pixels[10:30, 20:40] = 200
    listed = [("/tf_static", static, 10.0)]
    for step in range(int(10 * seconds)):
        now = 10.0 + 0.1 * step
        odometry = se3.transform(np.eye(3), np.array([0.1 * step, 0.0, 0.0]))
        moving = make.tf("odom", "base", odometry, now)
        moving.transforms += make.tf("base", "arm", edges[("base", "arm")], now).transforms
        joints = JointState(header=make.header("", now), name=["shoulder"], position=[SHOULDER_RAD])
        listed += [
            ("/tf", moving, now),
            ("/joint_states", joints, now),
            ("/camera/camera_info", make.camera_info(frame="camera_optical", stamp_s=now), now),
            ("/camera/image_raw/compressed", _jpeg(make, pixels, now), now),
            ("/lidar/points", make.xyz_cloud(cloud, frame="lidar", stamp_s=now), now),
        ]
    return listed


def _jpeg(make, pixels, now):
    import cv2

    message = CompressedImage(header=make.header("camera_optical", now), format="bgr8; jpeg")
    message.data = cv2.imencode(".jpg", pixels)[1].tobytes()
    assert message.header.stamp == rospy.Time.from_sec(now)
    return message


def configure(folder, *arguments):
    """Run `configure` in the package; return its exit code."""
    return configure_package.main(["-n", str(folder), *arguments])


def edit_config(folder, old, new):
    """Replace the one place of a text in the configuration."""
    path = folder / "calibration" / "config.yml"
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1, f"{old} stands {text.count(old)} times"
    path.write_text(text.replace(old, new), encoding="utf-8")
