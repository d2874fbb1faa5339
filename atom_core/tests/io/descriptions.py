"""Descriptions of robots that tests read and write."""

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.io.urdf import read_description
from atom_core.model.transforms import Edge

XMLNS = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'

PLAIN = """<?xml version="1.0"?>
<!-- the rig of the laboratory -->
<robot name="rig">
  <link name="base"/>   <link name='camera'/>
\t<link name="arm"/><link name="lidar"/>

  <joint name="base_to_camera" type="fixed">   <!-- measured by hand -->
    <origin rpy = "0 0 0"
            xyz='0.1 0.2 0.3'   />
    <parent link="base"/>
    <child link="camera"/>
  </joint>
  <joint name="base_to_arm" type="revolute">
    <parent link="base"/> <child link="arm"/>
    <origin xyz="1 0 0" rpy="0.1 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
  <joint name="arm_to_lidar" type="fixed">
    <parent link="arm"/>
    <child link="lidar"/>
  </joint>
  <transmission name="t"><joint name="base_to_arm"/></transmission>
</robot>
<!-- the end -->
"""

MACROS = f"""<robot name="rig" {XMLNS}>
  <xacro:property name="height" value="0.3"/>
  <xacro:macro name="camera" params="name parent">
    <link name="${{name}}"/>
    <joint name="${{name}}_joint" type="fixed">
      <parent link="${{parent}}"/> <child link="${{name}}"/>
      <origin xyz="0 0 ${{height}}" rpy="0 0 0"/>
    </joint>
  </xacro:macro>
  <link name="base"/> <link name="lidar"/>
  <xacro:camera name="left" parent="base"/>   <!-- two of them -->
  <xacro:camera name="right" parent="base"/>
  <joint name="lidar_joint" type="fixed">
    <parent link="base"/> <child link="lidar"/>
    <origin xyz="${{height * 2}} 0 0" rpy="0 0 ${{pi / 2}}"/>
  </joint>
</robot>
"""

CAMERA, LIDAR = Edge("base", "camera"), Edge("arm", "lidar")


def link(*names):
    return "".join(f'<link name="{name}"/>' for name in names)


def joint(name, parent, child, content="", kind="fixed"):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f"{content}</joint>"
    )


def rig(content):
    return f'<robot name="rig">{content}</robot>'


def describe(tmp_path, text, name="rig.urdf", **more):
    path = tmp_path / name
    path.write_bytes(text.encode("utf-8"))
    if name.endswith(".xacro"):
        pytest.importorskip("xacro", reason="xacro is not installed; `make setup` installs it")
    return read_description(path, **more)


def origin_of(description, edge):
    return description.robot.joint_between(*edge).parent_T_child_at_zero


def rotation(axis, angle):
    vector = np.zeros(3)
    vector["xyz".index(axis)] = angle
    return se3.rotation_from_rotation_vector(vector)
