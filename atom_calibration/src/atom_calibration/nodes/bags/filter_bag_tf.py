"""Pass on the transforms of a bag that its description does not have.

The bag is played with /tf and /tf_static renamed to /bag/..., so that the transforms that it was
recorded with do not fight those of the description. Odometry, and whatever else only the bag
knows, comes through here.
"""

from __future__ import annotations

import argparse
from typing import Any, Collection, Dict, FrozenSet, List, Optional

import rospy
from tf2_msgs.msg import TFMessage

from atom_calibration.messages.headers import frame_name
from atom_calibration.runtime import running
from atom_core.commands.option_parser import OptionParser
from atom_core.errors import DescriptionError
from atom_core.io.urdf import parse_urdf
from atom_core.model.robot import FIXED, RobotDescription


def frames_of_description(
    robot: RobotDescription, moving_joints: Optional[Collection[str]]
) -> FrozenSet[str]:
    """Return the frames whose transforms come from the description.

    Args:
        robot: the description.
        moving_joints: those whose links come from the bag, since no positions of them are played;
            empty: all that move; None: none.
    """
    joints = robot.joints.values()
    if moving_joints is None:
        return frozenset(joint.child_link for joint in joints)
    names = moving_joints or robot.joints.keys()
    return frozenset(j.child_link for j in joints if j.type == FIXED or j.name not in names)


class TransformFilter:
    """Passes on the transforms to frames that the description does not place."""

    def __init__(self, described: FrozenSet[str], moving: Any, fixed: Any):
        """Publish to `moving` and `fixed` what is given to `pass_on`."""
        self._described, self._moving, self._fixed = described, moving, fixed
        self._all_fixed: Dict[str, Any] = {}  # a latched topic holds one message: it has them all

    def pass_on(self, message: Any) -> None:
        """Take a message of the bag's /tf."""
        wanted = self._wanted(message)
        if wanted:
            self._moving.publish(TFMessage(wanted))

    def pass_on_fixed(self, message: Any) -> None:
        """Take a message of the bag's /tf_static."""
        wanted = {frame_name(t.child_frame_id): t for t in self._wanted(message)}
        if wanted:
            self._all_fixed.update(wanted)
            self._fixed.publish(TFMessage(list(self._all_fixed.values())))

    def _wanted(self, message: Any) -> List[Any]:
        return [
            t for t in message.transforms if frame_name(t.child_frame_id) not in self._described
        ]


def main() -> int:
    """Run the node; return its exit code."""
    return running.run("filter_bag_tf", _parser(), lambda args: _run(args.moving_joints))


def _run(moving_joints: Optional[Collection[str]]) -> int:
    running.start("filter_bag_tf")
    urdf = rospy.get_param("robot_description", None)
    if urdf is None:
        raise DescriptionError("parameter robot_description is absent; set it in the launch file")
    robot, _ = parse_urdf(urdf)
    passing = TransformFilter(
        frames_of_description(robot, moving_joints),
        running.Publisher("/tf", TFMessage, queue_size=100),
        running.Publisher("/tf_static", TFMessage, queue_size=100, latch=True),
    )
    rospy.Subscriber("/bag/tf", TFMessage, passing.pass_on, queue_size=100)
    rospy.Subscriber("/bag/tf_static", TFMessage, passing.pass_on_fixed, queue_size=100)
    return running.wait()


def _parser() -> argparse.ArgumentParser:
    made = OptionParser(prog="filter_bag_tf", description=__doc__.split("\n")[0])
    made.add_argument(
        "--moving_joints",
        "--moving-joints",
        nargs="*",
        metavar="JOINT",
        help="the links of these moving joints (or of all of them) come from the bag, since "
        "nothing in it tells their positions",
    )
    return made
