"""Positions of the joints of a description, for the collections of a dataset."""

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
    """Return the joints that the description has; none, with a warning, if some are configured.

    Also those that are not to be calibrated: with their positions a calibration can tell that one
    of them is off, which else looks like sensors that stand elsewhere.

    Args:
        config: names the description, and the joints to be calibrated.
        warn: is told which of these cannot be calibrated then, and why.
    """
    named = ", ".join(config.joints)
    why = "config.yml names no description"
    robot = None
    try:
        if config.description_file:
            robot = read_description(config.description_file).robot
    except AtomError as error:
        why = str(error)
    if robot is None:
        if named:
            warn(f"positions of joints ({named}) are not recorded: {why}")
        return {}
    absent = [n for n in config.joints if n not in robot.joints]
    if absent:
        warn(f"the description has no joint {', '.join(absent)}: no position is recorded")
    return {
        name: joint
        for name, joint in robot.joints.items()
        if joint.type in MOVING_TYPES and (joint.mimic is None or name in config.joints)
    }


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
