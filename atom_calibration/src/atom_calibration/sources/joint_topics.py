"""Which topics of a recording tell where joints stand, and for which joints each counts."""

from __future__ import annotations

from itertools import islice
from typing import AbstractSet, Any, Dict, FrozenSet, Mapping, Set

import numpy as np

from atom_calibration.sources.bag_reader import BagReader
from atom_core.model.joints import MOVING_TYPES
from atom_core.model.robot import FIXED, Joint, RobotDescription

JOINT_STATE = "sensor_msgs/JointState"
JOINT_STATES = "/joint_states"
_FIRST = 500  # messages of a topic that tell which joints there are


def joint_names(bag: BagReader) -> Dict[str, Set[str]]:
    """Return the joints that are named on each topic with positions."""
    return {
        topic: {n for found in islice(bag.messages([topic]), _FIRST) for n in found.message.name}
        for topic in bag.topics_of([JOINT_STATE])
    }


def counting(
    named: Mapping[str, AbstractSet[str]], wanted: AbstractSet[str]
) -> Dict[str, FrozenSet[str]]:
    """Return for which joints each topic counts; those that count for none are left out.

    /joint_states counts for all that it has, topics of that name in a namespace for what it lacks,
    and others, which may be commands, for what all these lack.

    Args:
        named: joints by topic.
        wanted: joints that a description has.
    """
    found: Dict[str, FrozenSet[str]] = {}
    known: FrozenSet[str] = frozenset()
    for kind in range(3):
        new = {
            t: frozenset(names & wanted) - known for t, names in named.items() if _kind(t) == kind
        }
        found.update({topic: names for topic, names in new.items() if names})
        known = known.union(*new.values())
    return found


def _kind(topic: str) -> int:
    if topic == JOINT_STATES:
        return 0
    return 1 if topic.endswith(JOINT_STATES) else 2


def played(
    named: Mapping[str, AbstractSet[str]], robot: RobotDescription
) -> Dict[str, FrozenSet[str]]:
    """Return the topics, with their joints, that can be played together as /joint_states.

    These are the ones that count for all joints of the description that they have: no joint is
    then told twice.
    """
    wanted = moving_names(robot)
    return {t: names for t, names in counting(named, wanted).items() if named[t] & wanted == names}


def is_told(joint: Joint, names: AbstractSet[str]) -> bool:
    """Tell whether positions of these names say where the child of a moving joint is."""
    return joint.type in MOVING_TYPES and bool({joint.name, joint.moved_by} & names)


def moving_names(robot: RobotDescription) -> Set[str]:
    """Return the names under which positions of a robot's joints may be told."""
    moving = [joint for joint in robot.joints.values() if joint.type != FIXED]
    return {name for joint in moving for name in (joint.name, joint.moved_by)}


def positions(message: Any) -> Dict[str, float]:
    """Return the positions [rad or m] of a JointState by joint; those that are numbers."""
    found = dict(zip(message.name, message.position))
    return {name: position for name, position in found.items() if np.isfinite(position)}
