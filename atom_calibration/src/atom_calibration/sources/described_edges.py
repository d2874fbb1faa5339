"""Transforms of a bag that a description tells: fixed joints, and what /joint_states says.

So ATOM takes all bags: the description moved by /joint_states, and from /tf only what is not in it.
"""

from __future__ import annotations

from itertools import islice
from typing import Any, Dict, FrozenSet, Iterable, List, Mapping, Set, Tuple

from geometry_msgs.msg import TransformStamped
from rospy import Time

from atom_calibration.errors import MessageError, TransformError
from atom_calibration.messages.headers import frame_name
from atom_calibration.messages.poses import transform_message
from atom_calibration.sources.bag_reader import BagReader
from atom_calibration.sources.joint_topics import (
    JOINT_STATE,
    counting,
    is_told,
    moving_names,
    positions,
)
from atom_core.model.joints import REVOLUTE
from atom_core.model.robot import FIXED, Joint, RobotDescription

_BEYOND_RAD = 1.0  # no joint is so far beyond its limits
_FIRST = 500  # messages of a topic that tell which joints there are


class DescribedEdges:
    """The edges of a description whose poses need no /tf.

    Attributes:
        topics: with positions of joints.
        told: names of the joints that they move.
        frames: the children of the edges; of these nothing in /tf counts.
        fixed: the edges that never move.
    """

    def __init__(self, bag: BagReader, robot: RobotDescription):
        """Look which joints the bag has."""
        self._bag, self._robot = bag, robot
        self._broken: Set[str] = set()  # joints that were told without a number
        there = {topic: self._names(topic) for topic in bag.topics_of([JOINT_STATE])}
        self._named = frozenset().union(*there.values())
        self._counting: Dict[str, FrozenSet[str]] = counting(there, moving_names(robot))
        self.topics: Tuple[str, ...] = tuple(self._counting)
        names = frozenset().union(*self._counting.values())
        moving = {n: j for n, j in robot.joints.items() if is_told(j, names)}
        told = list(moving)
        self.told: FrozenSet[str] = frozenset(told)
        # Those that follow another one come last: of two programs that contradict each other, the
        # joint that they publish is named.
        told.sort(key=lambda name: (moving[name].mimic is not None, name))
        self._joints = [moving[name] for name in told]
        still = robot.transforms()
        self.fixed: List[TransformStamped] = [
            transform_message(joint.edge, still[joint.edge], Time())
            for joint in robot.joints.values()
            if joint.type == FIXED
        ]
        self.frames: FrozenSet[str] = frozenset(
            joint.child_link
            for name, joint in robot.joints.items()
            if joint.type == FIXED or name in self.told
        )

    def _names(self, topic: str) -> Set[str]:
        """Return the joints of which a topic tells positions."""
        names: Set[str] = set()
        for found in islice(self._bag.messages([topic]), _FIRST):
            told = positions(found.message)
            names |= told.keys()
            self._broken |= set(found.message.name[: len(found.message.position)]) - told.keys()
        return names

    def transforms(self, message: Any, topic: str) -> List[TransformStamped]:
        """Return the edges that a JointState of a topic moves.

        Raises:
            MessageError: a position is far beyond the joint's limits.
        """
        counts = self._counting[topic]
        known = {n: position for n, position in positions(message).items() if n in counts}
        self._check_limits(known)
        poses = self._robot.transforms(known)
        return [
            transform_message(joint.edge, poses[joint.edge], message.header.stamp)
            for joint in self._joints
            if joint.name in known or joint.moved_by in known
        ]

    def _check_limits(self, known: Mapping[str, float]) -> None:
        for joint in self._joints:
            limits, position = joint.limits, known.get(joint.name)
            if position is None or joint.type != REVOLUTE or limits is None:
                continue
            if limits.lower >= limits.upper:  # URDF has 0 where they are not given
                continue
            if not limits.lower - _BEYOND_RAD <= position <= limits.upper + _BEYOND_RAD:
                raise MessageError(
                    f"joint '{joint.name}' is at {position:.4g} rad, far beyond its limits "
                    f"({limits.lower:.4g} to {limits.upper:.4g} rad in the description); if it is "
                    f"published in degrees, correct its publisher"
                )

    def others(self, transforms: Iterable[Any]) -> List[Any]:
        """Return those TransformStamped that the description does not tell."""
        return [t for t in transforms if frame_name(t.child_frame_id) not in self.frames]

    def check(self, world: str, needed: Mapping[str, str], placed: Iterable[str]) -> None:
        """Refuse a bag that does not tell where a joint stands that something hangs on.

        Args:
            world: the frame from which everything is seen.
            needed: frames that must be known, by what they are of.
            placed: frames that description, /tf and /tf_static place.

        Raises:
            TransformError: naming the joint, and the joints that the bag has.
        """
        known = self.frames | set(placed)
        for whose, frame in needed.items():
            joint = self._robot.joint_above(frame)
            while joint is not None and frame != world:
                if joint.child_link not in known:
                    raise TransformError(self._untold(joint, whose))
                frame = joint.parent_link
                joint = self._robot.joint_above(frame)

    def _untold(self, joint: Joint, whose: str) -> str:
        there = ", ".join(sorted(self._named)[:12]) or "none"
        topics = ", ".join(self._bag.topics_of([JOINT_STATE]))
        remedy = "record it, or correct the joint's name in the description"
        if not topics:
            where = "the bag has no /joint_states, and /tf does not have it"
        elif joint.moved_by in self._broken:
            where = f"it is no number (NaN) in {topics}, and /tf does not have it"
            remedy = "correct its publisher"
        else:
            where = f"it is not in {topics} (there are: {there}), nor in /tf"
        return (
            f"{self._bag.path}: the position of joint '{joint.name}', on which {whose} hangs, is "
            f"not known: {where}; {remedy}"
        )
