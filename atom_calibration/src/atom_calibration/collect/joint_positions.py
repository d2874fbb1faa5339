"""Positions of the joints to be calibrated, for the collections of a dataset."""

from __future__ import annotations

from typing import Callable, Dict, Mapping

import numpy as np

from atom_core.errors import AtomError
from atom_core.io.urdf import read_description
from atom_core.model.config import CalibrationConfig
from atom_core.model.joints import MOVING_TYPES, JointState, joint_from_pose
from atom_core.model.robot import Joint
from atom_core.model.transforms import Edge


def described_joints(config: CalibrationConfig, warn: Callable[[str], None]) -> Dict[str, Joint]:
    """Return the joints to be calibrated as the description has them; none, with a warning, if not.

    Args:
        config: names the joints and the description.
        warn: is told which joints cannot be calibrated then, and why.
    """
    if not config.joints:
        return {}
    named = ", ".join(config.joints)
    if not config.description_file:
        warn(f"positions of joints ({named}) are not recorded: config.yml names no description")
        return {}
    try:
        robot = read_description(config.description_file).robot
    except AtomError as error:
        warn(f"positions of joints ({named}) are not recorded: {error}")
        return {}
    absent = [n for n in config.joints if n not in robot.joints]
    if absent:
        warn(f"the description has no joint {', '.join(absent)}: no position is recorded")
    found = {n: robot.joints[n] for n in config.joints if n in robot.joints}
    return {name: joint for name, joint in found.items() if joint.type in MOVING_TYPES}


def joint_states(
    joints: Mapping[str, Joint], transforms: Mapping[Edge, np.ndarray]
) -> Dict[str, JointState]:
    """Return the joints of a collection; tf, of one instant, tells the positions."""
    return {
        name: joint_from_pose(
            joint.edge,
            joint.type,
            joint.axis,
            joint.parent_T_child_at_zero,
            transforms[joint.edge],
        )
        for name, joint in joints.items()
        if joint.edge in transforms
    }
