"""Lets a bag that `rosbag play --pause` holds run once the labelers and the collector listen."""

from __future__ import annotations

import argparse
import time

import rospy
from std_srvs.srv import SetBool

from atom_calibration.errors import CollectionError
from atom_calibration.runtime import options, running
from atom_calibration.sources.live_topics import NotYetError, wait_for
from atom_calibration.sources.rig import candidate_topics
from atom_core.commands.common import add_option
from atom_core.commands.option_parser import OptionParser
from atom_core.io.config_yaml import read_config
from atom_core.model.config import CalibrationConfig

_PLAYER_WITHIN_S = 10.0
COLLECTOR = "/collect_data"
_SETTLE_S = 0.5  # who has subscribed is not yet connected


def main() -> int:
    """Run the node; return its exit code."""
    return running.run("start_bag", _parser(), _run)


def _run(args: argparse.Namespace) -> int:
    config = read_config(args.config)
    running.start("start_bag")
    if wait_for(lambda: _everybody_listens(config), running.stopped, rospy.loginfo) is None:
        return 0
    time.sleep(_SETTLE_S)
    pause = f"{args.player}/pause_playback"
    try:
        rospy.wait_for_service(pause, timeout=_PLAYER_WITHIN_S)
        rospy.ServiceProxy(pause, SetBool)(False)
    except (rospy.ROSException, rospy.ServiceException):
        raise CollectionError(
            f"{args.player} does not play: it has no service {pause} that answers; start it with "
            f"`rosbag play --pause`"
        ) from None
    return 0


def _everybody_listens(config: CalibrationConfig) -> bool:
    """Return True once every sensor's topics have their listeners.

    Raises:
        NotYetError: naming a sensor and a node.
    """
    _, _, state = rospy.get_master().getSystemState()
    listeners = {topic: set(nodes) for topic, nodes in state[1]}
    for name, entry in config.sensors.items():
        nodes = set().union(*(listeners.get(topic, set()) for topic in candidate_topics(entry)))
        for node in (f"/{name}_labeler", COLLECTOR):
            if node not in nodes:
                raise NotYetError(f"node {node} does not listen to sensor '{name}' yet")
    return True


def _parser() -> argparse.ArgumentParser:
    parser = OptionParser(
        prog="start_bag",
        description=__doc__,
        epilog="example: rosrun atom_calibration start_bag -cfg config.yml --player /play_bag",
    )
    options.add_config_option(parser)
    add_option(parser, "player", required=True, metavar="NODE", help="name of `rosbag play`")
    return parser
