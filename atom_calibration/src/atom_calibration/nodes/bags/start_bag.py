"""Lets a bag that `rosbag play --pause` holds run once the labelers and the collector listen.

While labels are behind, it is held again, so that a slow machine passes over no data.
"""

from __future__ import annotations

import argparse
import contextlib
import time
from typing import Any, Callable, List

import rospy
from std_msgs.msg import Time
from std_srvs.srv import SetBool

from atom_calibration.errors import CollectionError
from atom_calibration.messages.headers import stamp_s
from atom_calibration.msg import SensorLabels
from atom_calibration.runtime import options, running
from atom_calibration.runtime.graph_names import labeler_of, topic_of
from atom_calibration.runtime.pace import LOOK_EVERY_S, Pace, labeled_until
from atom_calibration.sources.live_topics import NotYetError, wait_for
from atom_calibration.sources.rig import candidate_topics
from atom_core.commands.common import add_option
from atom_core.commands.option_parser import OptionParser
from atom_core.io.config_yaml import read_config
from atom_core.model.config import CalibrationConfig

_PLAYER_WITHIN_S = 10.0
COLLECTOR = "/collect_data"
_SETTLE_S = 0.5  # who has subscribed is not yet connected
_ASK_EVERY_S = 2.0  # whether a user still holds the recording


def main() -> int:
    """Run the node; return its exit code."""
    return running.run("start_bag", _parser(), _run)


def _run(args: argparse.Namespace) -> int:
    config = read_config(args.config)
    running.start("start_bag")
    pace = Pace(config.sensors)
    for name in config.sensors:
        heard = _note_in(pace, name)
        rospy.Subscriber(topic_of(name, "labels"), SensorLabels, heard, queue_size=20)
        rospy.Subscriber(labeled_until(name), Time, _note_idle_in(pace, name), queue_size=1)
    if wait_for(lambda: _everybody_listens(config), running.stopped, rospy.loginfo) is None:
        return 0
    time.sleep(_SETTLE_S)
    pause = f"{args.player}/pause_playback"
    hold = rospy.ServiceProxy(pause, SetBool)
    try:
        rospy.wait_for_service(pause, timeout=_PLAYER_WITHIN_S)
        hold(False)
    except (rospy.ROSException, rospy.ServiceException):
        raise CollectionError(
            f"{args.player} does not play: it has no service {pause} that answers; start it with "
            f"`rosbag play --pause`"
        ) from None
    # The player goes at the end of the recording, the node's calls when it is asked to end.
    with contextlib.suppress(rospy.ServiceException, rospy.ROSInterruptException):
        _hold_while_late(pace, hold)
    return 0


def _everybody_listens(config: CalibrationConfig) -> bool:
    """Return True once every sensor's topics have their listeners.

    Raises:
        NotYetError: naming a sensor and a node.
    """
    _, _, state = rospy.get_master().getSystemState()
    listeners = {topic: set(nodes) for topic, nodes in state[1]}
    for name, entry in config.sensors.items():
        topics = [rospy.resolve_name(topic) for topic in candidate_topics(entry)]
        nodes = set().union(*(listeners.get(topic, set()) for topic in topics))
        for node in (f"/{labeler_of(name)}", COLLECTOR):
            if node not in nodes:
                raise NotYetError(f"node {node} does not listen to sensor '{name}' yet")
    return True


def _note_in(pace: Pace, sensor: str) -> Callable[[SensorLabels], None]:
    return lambda labels: pace.note(sensor, stamp_s(labels), _now_s())


def _note_idle_in(pace: Pace, sensor: str) -> Callable[[Time], None]:
    return lambda until: pace.note_idle(sensor, until.data.to_sec())


def _hold_while_late(pace: Pace, hold: Callable[[bool], Any]) -> None:
    """Hold the recording whenever labels are late, until the node is asked to end.

    Raises:
        rospy.ServiceException: the player has gone.
        rospy.ROSInterruptException: the node ends amid a call.
    """
    while not running.stopped():
        running.pause(LOOK_EVERY_S)
        late = _late(pace)
        if not late:
            continue
        if not hold(True).success:  # a user has paused it, who lets it go on
            running.pause(_ASK_EVERY_S)
            continue
        rospy.loginfo_once(
            f"the recording waits now and then, until its data are labeled: "
            f"{', '.join(late)} took longer than it plays"
        )
        pace.wait(_now_s, running.pause, running.stopped)
        hold(False)


def _late(pace: Pace) -> List[str]:
    """Return the sensors that are late; nobody is before the clock runs."""
    now_s = _now_s()
    return pace.late(now_s) if now_s > 0.0 else []


def _now_s() -> float:
    return float(rospy.Time.now().to_sec())


def _parser() -> argparse.ArgumentParser:
    parser = OptionParser(
        prog="start_bag",
        description=__doc__,
        epilog="example: rosrun atom_calibration start_bag -cfg config.yml --player /play_bag",
    )
    options.add_config_option(parser)
    add_option(parser, "player", required=True, metavar="NODE", help="name of `rosbag play`")
    return parser
