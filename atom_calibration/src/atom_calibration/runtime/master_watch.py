"""Notices that the ROS master has gone, or another one has come that knows nothing of this node.

rospy notices neither: a node would wait for ever, unseen.
"""

from __future__ import annotations

import threading
from typing import Callable, Optional

import rosgraph
import rospy

_LOOK_EVERY_S = 1.0
_TIMES = 3  # in a row, before it is believed
GONE = "the ROS master no longer answers; start it, and this node, again"
RESTARTED = "the ROS master was restarted and does not know this node; start the node again"


class MasterWatch:
    """Looks at the master once a second, in a thread of its own.

    Attributes:
        problem: what is wrong, and what helps; empty: nothing.
    """

    def __init__(self, pid: int, stop: threading.Event, on_problem: Callable[[], None]):
        """Start to look.

        Args:
            pid: the master's, before the node registers with it.
            stop: ends the thread when it is set.
            on_problem: called once, in that thread.
        """
        self.problem = ""
        self._stop, self._on_problem = stop, on_problem
        self._master = rosgraph.Master(rospy.get_name())
        self._was_known, self._pid = False, pid
        threading.Thread(target=self._look, name="master watch", daemon=True).start()

    def _look(self) -> None:
        times = 0
        while not self._stop.wait(_LOOK_EVERY_S) and not rospy.is_shutdown():
            problem = self._problem_of()
            times = times + 1 if problem else 0
            if problem and times == _TIMES:
                self.problem = problem
                self._on_problem()
                return

    def _problem_of(self) -> Optional[str]:
        try:
            if self._master.getPid() != self._pid:
                return RESTARTED  # whether it knows the node or not: one that advertises is known
            uri = self._master.lookupNode(rospy.get_name())
        except rosgraph.MasterException:  # it answers, but knows no such node
            return RESTARTED if self._was_known else None
        except Exception:  # noqa: BLE001 - sockets and XML-RPC fail in many ways, all mean this
            return GONE
        self._was_known = self._was_known or uri == rospy.get_node_uri()
        return None
