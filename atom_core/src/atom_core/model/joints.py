"""Joints of a robot at one instant, with the parameters of theirs that can be calibrated.

``parent_T_child = origin(xyz, rpy) @ motion(axis, position + bias)``: the origin as in URDF (roll,
pitch, yaw about fixed axes), then a turn about the axis or a shift along it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Mapping, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.transforms import Edge

ORIGIN_PARAMETERS = (
    *("origin_x", "origin_y", "origin_z"),
    *("origin_roll", "origin_pitch", "origin_yaw"),
)
POSITION_BIAS = "position_bias"  # ATOM knows the six above only
JOINT_PARAMETERS = (*ORIGIN_PARAMETERS, POSITION_BIAS)
REVOLUTE, CONTINUOUS, PRISMATIC = "revolute", "continuous", "prismatic"
MOVING_TYPES = (REVOLUTE, CONTINUOUS, PRISMATIC)


@dataclass(frozen=True)
class JointState:
    """A joint in one collection.

    Attributes:
        edge: parent and child link.
        type: revolute, continuous or prismatic.
        axis: (3,) unit vector of the motion, in the joint's frame.
        position: as the robot reported it [rad or m].
        parameters: values by `JOINT_PARAMETERS` [m, rad]; those absent are zero.

    Raises:
        ValueError: the type is none of these, or a number is not finite.
    """

    edge: Edge
    type: str
    axis: np.ndarray
    position: float
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.type not in MOVING_TYPES:
            raise ValueError(f"joint type '{self.type}' has no position; use {MOVING_TYPES}")
        axis = np.array(self.axis, dtype=float).reshape(-1)
        values = {name: float(self.parameters.get(name, 0.0)) for name in JOINT_PARAMETERS}
        numbers = [self.position, *axis, *values.values()]
        if axis.shape != (3,) or not np.all(np.isfinite(numbers)) or not np.any(axis):
            raise ValueError("position, axis and origin must be finite numbers, the axis not zero")
        length = float(np.linalg.norm(axis))
        # Of a unit vector the digits stay, so that a file that is read and written is the same.
        object.__setattr__(self, "axis", axis if abs(length - 1.0) < 1e-12 else axis / length)
        object.__setattr__(self, "position", float(self.position))
        object.__setattr__(self, "parameters", values)

    @property
    def is_prismatic(self) -> bool:
        """Tell whether the position is a length."""
        return self.type == PRISMATIC

    @property
    def origin(self) -> np.ndarray:
        """(4, 4) pose of the joint's frame at position zero, in the parent."""
        values = np.array([self.parameters[name] for name in ORIGIN_PARAMETERS])
        return se3.from_rpy(values[:3], values[3:])

    @property
    def parent_T_child(self) -> np.ndarray:
        """(4, 4) pose of the child link in the parent link."""
        return self.origin @ self.moved

    @property
    def moved(self) -> np.ndarray:
        """(4, 4) pose of the child link in the joint's frame at position zero."""
        return self.motion(self.parameters[POSITION_BIAS] + self.position)

    @property
    def corrected_origin(self) -> np.ndarray:
        """(4, 4) origin with the bias in it, for a description that knows no bias."""
        return self.origin @ self.motion(self.parameters[POSITION_BIAS])

    def motion(self, position: float) -> np.ndarray:
        """Return the pose (4, 4) of the moved frame in the frame at position zero."""
        return motion(self.axis, self.is_prismatic, position)

    def with_parameters(self, changes: Mapping[str, float]) -> JointState:
        """Return the joint with other values of some parameters [m, rad]."""
        return replace(self, parameters={**self.parameters, **changes})

    def unit(self, parameter: str) -> str:
        """Return m or rad."""
        if parameter == POSITION_BIAS:
            return "m" if self.is_prismatic else "rad"
        return "m" if parameter in ORIGIN_PARAMETERS[:3] else "rad"


def motion(axis: np.ndarray, is_prismatic: bool, position: float) -> np.ndarray:
    """Return (4, 4): a turn about an axis (3,) [rad], or a shift along it [m]."""
    if is_prismatic:
        return se3.transform(np.eye(3), axis * position)
    return se3.transform(se3.rotation_from_rotation_vector(axis * position), np.zeros(3))


def joint_from_pose(
    edge: Edge, joint_type: str, axis: np.ndarray, origin: np.ndarray, parent_T_child: np.ndarray
) -> JointState:
    """Return the joint whose position is told by a transform.

    Args:
        edge: parent and child link.
        joint_type: revolute, continuous or prismatic.
        axis: (3,) unit vector, in the joint's frame.
        origin: (4, 4) of the description.
        parent_T_child: (4, 4) of tf.
    """
    moved = se3.inverse(origin) @ parent_T_child
    turn = se3.rotation_vector_from_rotation(moved[:3, :3])
    position = float(axis @ (moved[:3, 3] if joint_type == PRISMATIC else turn))
    values = (*origin[:3, 3], *se3.rpy_from_rotation(origin[:3, :3]))
    parameters = dict(zip(ORIGIN_PARAMETERS, (float(v) for v in values)))
    return JointState(edge, joint_type, axis, position, parameters)


JointSelection = Mapping[str, Tuple[str, ...]]  # parameters to calibrate, by joint
