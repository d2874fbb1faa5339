"""The entries of a dataset's JSON, one by one: modalities, transforms, joints."""

from __future__ import annotations

from typing import Any, Dict, List, Mapping, Optional

import numpy as np

from atom_core.geometry import se3
from atom_core.model.config import SensorConfig
from atom_core.model.joints import ORIGIN_PARAMETERS, POSITION_BIAS, JointState
from atom_core.model.modality import Modality, modality_named, modality_of_message
from atom_core.model.transforms import Edge

_ALIKE = {  # keys of a sensor's configuration, and where its own entry says the same
    "link": "parent",
    "parent_link": "calibration_parent",
    "child_link": "calibration_child",
    "modality": "modality",
}
_SAME = 1e-6  # rad; a calibration computes the transform of a joint from its numbers


def modality_of_entry(entry: Mapping[str, Any]) -> Modality:
    """Return the modality of a sensor's entry, where need be by the type of its messages.

    Raises:
        ValueError: it is unknown, or its messages are those of another modality.
    """
    message = str(entry.get("msg_type") or "")
    by_message = modality_of_message(message)
    if not entry.get("modality") and by_message is not None:
        return by_message
    kind = modality_named(entry.get("modality") or "")
    if by_message is not None and not kind.has_messages(message):
        raise ValueError(
            f"its modality is {kind.name}, but its msg_type is {message}, which is of "
            f"{by_message.name}; correct one of them"
        )
    return kind


def other_than_configured(
    name: str, entry: Mapping[str, Any], configured: Optional[SensorConfig]
) -> List[str]:
    """Return a sentence on each key of which a sensor's entry and the configuration differ."""
    return [
        f"sensor '{name}' has {own} '{entry[own]}', and the configuration of this dataset {key} "
        f"'{getattr(configured, key)}'; the sensor's own is used, correct one of the two"
        for key, own in _ALIKE.items()
        if getattr(configured, key, None) and entry.get(own)
        if getattr(configured, key) != entry[own]
    ]


def pose_of_entry(entry: Mapping[str, Any]) -> np.ndarray:
    """Return the ``parent_T_child`` (4, 4) of a transform."""
    translation = np.array(entry["trans"], dtype=float).reshape(3)
    if not np.all(np.isfinite(translation)):
        raise ValueError("the translation is not finite")
    return se3.from_quaternion(translation, np.array(entry["quat"], dtype=float).reshape(4))


def transform_document(edge: Edge, parent_T_child: np.ndarray) -> Dict[str, Any]:
    """Return an edge as it stands in a collection's transforms."""
    return {
        "parent": edge.parent,
        "child": edge.child,
        "trans": [float(v) for v in parent_T_child[:3, 3]],
        "quat": [float(v) for v in se3.quaternion_from_rotation(parent_T_child[:3, :3])],
    }


def lay_over(stored: Dict[str, Any], name: str, edge: Edge, matrix: np.ndarray) -> None:
    """Write an edge unless the file already says the same, whose digits are then kept."""
    if name in stored and np.array_equal(pose_of_entry(stored[name]), matrix):
        return
    stored[name] = {**stored.get(name, {}), **transform_document(edge, matrix)}


def edge_of_joint(value: Mapping[str, Any]) -> Edge:
    """Return the edge of a joint's entry."""
    return Edge(value["parent_link"], value["child_link"])


def joint_of_entry(
    value: Mapping[str, Any], parent_T_child: Optional[np.ndarray] = None
) -> JointState:
    """Return the joint of a collection's entry.

    Args:
        value: the entry.
        parent_T_child: (4, 4) that stands beside it in the collection's transforms. ATOM's
            `calibrate` turns about moving axes, roll first, where URDF has fixed ones; where the
            two differ, and the transform is ATOM's, that is what the angles are taken for.
    """
    joint = _joint_about_fixed_axes(value)
    if parent_T_child is None or _turned_from(joint, parent_T_child) <= _SAME:
        return joint
    roll, pitch, yaw = np.diag([joint.parameters[name] for name in ORIGIN_PARAMETERS[3:]])
    turns = [se3.rotation_from_rpy(angles) for angles in (roll, pitch, yaw)]
    rpy = se3.rpy_from_rotation(turns[0] @ turns[1] @ turns[2])
    of_atom = joint.with_parameters(dict(zip(ORIGIN_PARAMETERS[3:], (float(v) for v in rpy))))
    return of_atom if _turned_from(of_atom, parent_T_child) <= _SAME else joint


def _turned_from(joint: JointState, parent_T_child: np.ndarray) -> float:
    """Return the angle [rad] between where a joint says that its child is and a transform."""
    return se3.pose_difference(joint.parent_T_child, parent_T_child)[1]


def _joint_about_fixed_axes(value: Mapping[str, Any]) -> JointState:
    parameters = {name: float(value[name]) for name in ORIGIN_PARAMETERS}
    parameters[POSITION_BIAS] = float(value.get(POSITION_BIAS, 0.0))
    return JointState(
        edge=edge_of_joint(value),
        type=value["joint_type"],
        axis=np.array([value[f"axis_{axis}"] for axis in "xyz"], dtype=float),
        position=float(value["position"]),
        parameters=parameters,
    )


def joint_document(joint: JointState) -> Dict[str, Any]:
    """Return a joint as it stands in a collection."""
    return {
        "transform_key": str(joint.edge),
        "parent_link": joint.edge.parent,
        "child_link": joint.edge.child,
        "joint_type": joint.type,
        "position": joint.position,
        **joint.parameters,
        **{f"axis_{axis}": float(v) for axis, v in zip("xyz", joint.axis)},
    }


def joints_document(
    stored: Mapping[str, Any], joints: Mapping[str, JointState], names: Mapping[Edge, str]
) -> Dict[str, Any]:
    """Return the joints of a collection as it is stored, those that have changed as they are now.

    Args:
        stored: the collection's document, as it was read.
        joints: by name, as they are now.
        names: of its transforms, by their edge.
    """
    documents = dict(stored.get("joints") or {})
    for name, joint in joints.items():
        old = documents.get(name)
        if old is not None:
            beside = (stored.get("transforms") or {}).get(names.get(edge_of_joint(old)))
            pose = None if beside is None else pose_of_entry(beside)
            if joint_of_entry(old, pose).parameters == joint.parameters:
                continue
        documents[name] = {**(old or {}), **joint_document(joint)}
    return documents
