"""Collections carry the positions of the joints to be calibrated, as tf tells them."""

from dataclasses import replace

import numpy as np
import pytest

from atom_calibration.collect.joint_positions import described_joints, joint_states
from atom_core.io.dataset_entries import joint_document
from atom_core.model.config import JointConfig
from atom_core.synthetic import arm

URDF = """<robot name="arm">
  <link name="shoulder"/><link name="upper_arm"/><link name="slide"/>
  <joint name="lift" type="revolute"><parent link="shoulder"/><child link="upper_arm"/>
    <origin xyz="0.1 0 0.3" rpy="0.2 0.1 -0.4"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="rail" type="prismatic"><parent link="upper_arm"/><child link="slide"/>
    <axis xyz="0 0.6 0.8"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>
</robot>"""


@pytest.fixture()
def config(tmp_path):
    (tmp_path / "arm.urdf").write_text(URDF)
    config = arm.camera_on_arm(0, errors={}, collections=1).dataset.config
    joints = {name: JointConfig(("position_bias",)) for name in ("lift", "rail", "hip")}
    return replace(config, joints=joints, description_file=str(tmp_path / "arm.urdf"))


def test_positions_come_from_tf_and_geometry_from_the_description(config):
    told = []
    joints = described_joints(config, told.append)
    assert list(joints) == ["lift", "rail"]
    assert told == ["the description has no joint hip: no position is recorded"]
    reported = {"lift": 0.7, "rail": 0.25}
    transforms = {joints[n].edge: joints[n].parent_T_child(q) for n, q in reported.items()}
    states = joint_states(joints, transforms)
    documents = {name: joint_document(state) for name, state in states.items()}
    for name, position in reported.items():
        assert documents[name]["position"] == pytest.approx(position)
    lift = documents["lift"]
    assert (lift["parent_link"], lift["child_link"]) == ("shoulder", "upper_arm")
    np.testing.assert_allclose([lift[f"origin_{a}"] for a in ("x", "z", "yaw")], [0.1, 0.3, -0.4])
    assert [documents["rail"][f"axis_{a}"] for a in "xyz"] == pytest.approx([0.0, 0.6, 0.8])
    assert joint_states(joints, {}) == {}


@pytest.mark.parametrize(
    "description, message", [(None, "names no description"), ("/absent.urdf", "/absent.urdf")]
)
def test_without_a_description_the_user_is_told(config, description, message):
    told = []
    assert described_joints(replace(config, description_file=description), told.append) == {}
    assert len(told) == 1 and "lift, rail, hip" in told[0] and message in told[0]
    told.clear()
    nothing = replace(config, joints={}, description_file=description)
    assert described_joints(nothing, told.append) == {} and told == []


def test_joints_that_are_not_to_be_calibrated_are_recorded_too(config):
    told = []
    assert list(described_joints(replace(config, joints={}), told.append)) == ["lift", "rail"]
    assert told == []
