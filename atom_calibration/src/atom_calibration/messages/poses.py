"""Poses and transforms: messages to matrices and back."""

from __future__ import annotations

from typing import Any, Iterable, Mapping

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, TransformStamped, Vector3
from tf2_msgs.msg import TFMessage

from atom_calibration.errors import MessageError
from atom_calibration.messages.headers import frame_name
from atom_core.geometry import se3
from atom_core.model.transforms import Edge

TF_MESSAGE = "tf2_msgs/TFMessage"
SHORTEST_QUATERNION = 1e-6  # a shorter one tells no rotation


def edge_of(message: Any) -> Edge:
    """Return the edge of a TransformStamped."""
    return Edge(frame_name(message.header.frame_id), frame_name(message.child_frame_id))


def transform_matrix(message: Any) -> np.ndarray:
    """Return ``parent_T_child`` (4, 4) of a TransformStamped.

    Raises:
        MessageError: a number is not finite, or the quaternion has no length.
    """
    t, q = message.transform.translation, message.transform.rotation
    translation, quaternion = np.array([t.x, t.y, t.z]), np.array([q.x, q.y, q.z, q.w])
    if not (np.all(np.isfinite(translation)) and np.linalg.norm(quaternion) > SHORTEST_QUATERNION):
        raise MessageError(
            f"transform '{edge_of(message)}' is no pose (translation {translation.tolist()}, "
            f"quaternion {quaternion.tolist()}); correct its publisher"
        )
    return se3.from_quaternion(translation, quaternion)


def transform_message(edge: Edge, parent_T_child: np.ndarray, stamp: Any) -> TransformStamped:
    """Return a transform as tf has it.

    Args:
        edge: from the parent to the child.
        parent_T_child: (4, 4) pose of the child [m].
        stamp: a ``rospy.Time``.
    """
    pose = pose_message(parent_T_child)
    message = TransformStamped(child_frame_id=edge.child)
    message.header.frame_id, message.header.stamp = edge.parent, stamp
    message.transform.translation = Vector3(pose.position.x, pose.position.y, pose.position.z)
    message.transform.rotation = pose.orientation
    return message


def transforms_message(transforms: Mapping[Edge, np.ndarray], stamp: Any) -> TFMessage:
    """Return transforms ``parent_T_child`` (4, 4) [m] by edge, all of one stamp, as tf has them."""
    return TFMessage([transform_message(edge, m, stamp) for edge, m in transforms.items()])


def point_message(position: Iterable[float]) -> Point:
    """Return a position (3,) [m] as a message."""
    return Point(*(float(value) for value in position))


def pose_message(frame_T_object: np.ndarray) -> Pose:
    """Return a pose (4, 4) [m] as a message."""
    quaternion = se3.quaternion_from_rotation(frame_T_object[:3, :3])
    return Pose(
        point_message(frame_T_object[:3, 3]),
        Quaternion(*(float(value) for value in quaternion)),
    )


def pose_matrix(message: Any) -> np.ndarray:
    """Return ``frame_T_object`` (4, 4) [m] of a Pose.

    Raises:
        MessageError: a number is not finite, or the quaternion has no length.
    """
    p, q = message.position, message.orientation
    position, quaternion = np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w])
    if not (np.all(np.isfinite(position)) and np.linalg.norm(quaternion) > SHORTEST_QUATERNION):
        raise MessageError(
            f"this is no pose (position {position.tolist()}, quaternion {quaternion.tolist()}); "
            f"correct its publisher"
        )
    return se3.from_quaternion(position, quaternion)
