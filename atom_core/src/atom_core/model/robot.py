"""A robot: links and the joints between them, as a robot description (URDF) states them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Dict, Iterable, List, Mapping, Optional, Tuple

import numpy as np

from atom_core.errors import DescriptionError, quoted
from atom_core.geometry import se3
from atom_core.model.transforms import Edge

FIXED, REVOLUTE, CONTINUOUS, PRISMATIC = "fixed", "revolute", "continuous", "prismatic"
PLANAR, FLOATING = "planar", "floating"
JOINT_TYPES = (FIXED, REVOLUTE, CONTINUOUS, PRISMATIC, PLANAR, FLOATING)
_TYPES_WITH_AXIS = (REVOLUTE, CONTINUOUS, PRISMATIC, PLANAR)
_TYPES_WITH_ONE_POSITION = (FIXED, REVOLUTE, CONTINUOUS, PRISMATIC)
_RIGID = 1e-6  # by so much entries of a rotation may be off


@dataclass(frozen=True)
class JointLimits:
    """Limits of a joint: positions in rad (revolute) or m (prismatic), effort, velocity."""

    lower: float = 0.0
    upper: float = 0.0
    effort: float = 0.0
    velocity: float = 0.0


@dataclass(frozen=True)
class JointMimic:
    """``position = multiplier * (position of joint) + offset``."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint.

    Attributes:
        name: its name in the description.
        type: fixed, revolute, continuous, prismatic, planar or floating.
        parent_link: link that carries the joint.
        child_link: link that the joint moves; its frame is the joint's frame.
        parent_T_child_at_zero: (4, 4) origin, the pose of child in parent at position zero [m].
        axis: (3,) direction of motion in the joint frame, made a unit vector on construction
            (as ROS's kinematics does); without meaning for fixed and floating joints.
        limits: when given.
        mimic: when the joint follows another one.

    Raises:
        DescriptionError: a value is malformed.
    """

    name: str
    type: str
    parent_link: str
    child_link: str
    parent_T_child_at_zero: np.ndarray
    axis: np.ndarray = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    limits: Optional[JointLimits] = None
    mimic: Optional[JointMimic] = None

    def __post_init__(self) -> None:
        if self.type not in JOINT_TYPES:
            raise DescriptionError(
                f"joint '{self.name}': type '{self.type}' is unknown; use {', '.join(JOINT_TYPES)}"
            )
        if self.parent_link == self.child_link:
            raise DescriptionError(
                f"joint '{self.name}': link '{self.child_link}' is its own parent"
            )
        object.__setattr__(self, "parent_T_child_at_zero", self._checked_origin())
        object.__setattr__(self, "axis", self._checked_axis())

    @property
    def edge(self) -> Edge:
        """Return the edge of the transform tree that the joint makes."""
        return Edge(self.parent_link, self.child_link)

    @property
    def has_one_position(self) -> bool:
        """Tell whether one number says where its child link is: not so planar and floating ones."""
        return self.type in _TYPES_WITH_ONE_POSITION

    @property
    def moved_by(self) -> str:
        """Return the name of the joint whose position moves it: its own, or that it mimics."""
        return self.name if self.mimic is None else self.mimic.joint

    def parent_T_child(self, position: float = 0.0) -> np.ndarray:
        """Return the pose (4, 4) of the child link in the parent link: origin, then motion.

        Args:
            position: rad for revolute and continuous, m for prismatic joints; without meaning
                for fixed ones. Limits are not applied.

        Raises:
            DescriptionError: a planar or floating joint, whose position is not one number.
        """
        if not self.has_one_position:
            raise DescriptionError(
                f"joint '{self.name}' is {self.type}: one position does not say where its child "
                f"link '{self.child_link}' is; take that transform from tf"
            )
        return self.parent_T_child_at_zero @ self._motion(position)

    def _motion(self, position: float) -> np.ndarray:
        """Return the pose (4, 4) of the moved child frame in the child frame at zero."""
        if self.type == FIXED:
            return np.eye(4)
        if self.type == PRISMATIC:
            return se3.transform(np.eye(3), self.axis * position)
        return se3.transform(se3.rotation_from_rotation_vector(self.axis * position), np.zeros(3))

    def _checked_origin(self) -> np.ndarray:
        origin = np.array(self.parent_T_child_at_zero, dtype=float)
        if not is_rigid(origin):
            raise DescriptionError(
                f"joint '{self.name}': its origin is no rigid transform; give xyz in metres and "
                f"rpy in radians, all finite"
            )
        origin.flags.writeable = False
        return origin

    def _checked_axis(self) -> np.ndarray:
        axis = np.array(self.axis, dtype=float)
        length = np.linalg.norm(axis) if axis.shape == (3,) else np.nan
        if not np.isfinite(length) or (self.type in _TYPES_WITH_AXIS and length < 1e-12):
            raise DescriptionError(
                f"joint '{self.name}': the axis of a {self.type} joint must be three numbers and "
                f"not zero"
            )
        axis = axis / length if length >= 1e-12 else np.array([1.0, 0.0, 0.0])
        axis.flags.writeable = False
        return axis


@dataclass(frozen=True, eq=False)
class RobotDescription:
    """A tree of links joined by joints.

    Attributes:
        name: name of the robot.
        root_link: the one link that is nobody's child.
        links: names of all links.
        joints: joint of each name.

    Raises:
        DescriptionError: the joints do not make one tree of the links.
    """

    name: str
    root_link: str
    links: Tuple[str, ...]
    joints: Mapping[str, Joint]
    _joint_above: Mapping[str, Joint] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "links", tuple(self.links))
        object.__setattr__(self, "joints", dict(self.joints))
        self._check_names()
        above = _joint_above_each_link(self.joints.values())
        object.__setattr__(self, "_joint_above", above)
        self._check_tree(above)

    def joint_above(self, link: str) -> Optional[Joint]:
        """Return the joint whose child is the link; None for the root and for unknown links."""
        return self._joint_above.get(link)

    def joint_between(self, parent: str, child: str) -> Optional[Joint]:
        """Return the joint from link ``parent`` straight to link ``child``, or None."""
        joint = self.joint_above(child)
        return joint if joint is not None and joint.parent_link == parent else None

    def transforms(self, positions: Optional[Mapping[str, float]] = None) -> Dict[Edge, np.ndarray]:
        """Return ``parent_T_child`` (4, 4) of the edges of all joints.

        Args:
            positions: position of joints by name [rad or m]; those not named stand at zero, those
                that mimic another follow it.

        Returns:
            One transform for each edge. Planar and floating joints are left out: a description
            does not say where they are.
        """
        positions = positions or {}
        return {
            joint.edge: joint.parent_T_child(self._position(joint, positions))
            for joint in self.joints.values()
            if joint.has_one_position
        }

    def _position(self, joint: Joint, positions: Mapping[str, float]) -> float:
        factor, offset, visited = 1.0, 0.0, [joint.name]
        while joint.name not in positions and joint.mimic is not None:
            offset += factor * joint.mimic.offset
            factor *= joint.mimic.multiplier
            if joint.mimic.joint not in self.joints or joint.mimic.joint in visited:
                raise DescriptionError(
                    f"joint '{visited[0]}' mimics '{joint.mimic.joint}', which is unknown or "
                    f"mimics it in turn; mend the mimic or give the position of '{visited[0]}'"
                )
            joint = self.joints[joint.mimic.joint]
            visited.append(joint.name)
        return factor * positions.get(joint.name, 0.0) + offset

    def _check_names(self) -> None:
        links = set(self.links)
        if len(links) != len(self.links):
            raise DescriptionError(f"robot '{self.name}': two links have the same name")
        if self.root_link not in links:
            raise DescriptionError(
                f"robot '{self.name}': the root link '{self.root_link}' is no link"
            )
        for key, joint in self.joints.items():
            if key != joint.name:
                raise DescriptionError(f"joint '{joint.name}' stands under the name '{key}'")
            for link in joint.edge:
                if link not in links:
                    raise DescriptionError(
                        f"joint '{joint.name}': link '{link}' does not exist; add it or mend the "
                        f"name"
                    )

    def _check_tree(self, above: Mapping[str, Joint]) -> None:
        reached = {self.root_link}
        waiting = [self.root_link]
        children: Dict[str, List[str]] = {}
        for joint in above.values():
            children.setdefault(joint.parent_link, []).append(joint.child_link)
        while waiting:
            new = [link for link in children.get(waiting.pop(), ()) if link not in reached]
            reached.update(new)
            waiting.extend(new)
        lost = [link for link in self.links if link not in reached]
        if lost or self.root_link in above:
            names = quoted(lost[:5] or [self.root_link])
            raise DescriptionError(
                f"robot '{self.name}': no chain of joints leads from the root link "
                f"'{self.root_link}' to {names}; the joints must make one tree, without a loop"
            )


def is_rigid(matrix: np.ndarray) -> bool:
    """Tell whether a matrix is (4, 4), finite, with a rotation and the last row 0 0 0 1."""
    matrix = np.asarray(matrix, dtype=float)
    if matrix.shape != (4, 4) or not np.all(np.isfinite(matrix)):
        return False
    rotation = matrix[:3, :3]
    return bool(
        np.allclose(rotation.T @ rotation, np.eye(3), rtol=0.0, atol=_RIGID)
        and np.linalg.det(rotation) > 0.0
        and np.allclose(matrix[3], [0.0, 0.0, 0.0, 1.0], rtol=0.0, atol=_RIGID)
    )


def _joint_above_each_link(joints: Iterable[Joint]) -> Dict[str, Joint]:
    above: Dict[str, Joint] = {}
    for joint in joints:
        other = above.setdefault(joint.child_link, joint)
        if other is not joint:
            raise DescriptionError(
                f"link '{joint.child_link}' is the child of two joints, '{other.name}' and "
                f"'{joint.name}'; a link has one parent"
            )
    return above
