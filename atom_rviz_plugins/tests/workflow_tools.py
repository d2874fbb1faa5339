"""What the test of the workflow listens with, and what it shows to the sensors."""

from __future__ import annotations

import threading
import time
import xmlrpc.client
from functools import partial

import rosgraph
import rospy
from waiting import until

PATIENCE_S = 120.0
wait_until = partial(until, seconds=PATIENCE_S)


def heard_by(node):
    """Return the topics on which a node is connected with whoever publishes them."""
    try:
        uri = rosgraph.Master("/workflow_test").lookupNode(node)
    except rosgraph.MasterError:
        return set()
    with xmlrpc.client.ServerProxy(uri) as proxy:
        links = proxy.getBusInfo("/workflow_test")[2]
    return {link[4] for link in links if link[2] == "i" and link[5]}


class Latest:
    """The newest message of a topic."""

    def __init__(self, topic, kind):
        self.message = None
        self._subscriber = rospy.Subscriber(topic, kind, self._take)

    def _take(self, message):
        self.message = message

    def comes_within(self, seconds):
        """Wait for a message, but not for long; tell whether there is one."""
        end_s = time.monotonic() + seconds
        while self.message is None and time.monotonic() < end_s:
            time.sleep(0.05)
        return self.message is not None


class Messages:
    """All messages of a topic."""

    def __init__(self, topic, kind):
        self.all = []
        self._subscriber = rospy.Subscriber(topic, kind, self.all.append)


class Feed(threading.Thread):
    """Publishes what the sensors see of the board's place `key`, at the pace of the labelers."""

    def __init__(self, rig, key):
        super().__init__(daemon=True)
        self.rig, self.key, self._ended = rig, key, threading.Event()
        self.start()

    def run(self):
        while not self._ended.is_set():
            key = self.key
            self.rig.show_until(
                key, lambda k=key: self._ended.is_set() or self.key != k, 3600, lambda: "the end"
            )

    def move_board(self, key):
        """Put the board elsewhere; return when it has been there for two seconds of the data."""
        self.key, begin_s = key, self.rig.stamp_s
        wait_until(lambda: self.rig.stamp_s > begin_s + 2.0, "data of the board's new place")

    def stop(self):
        self._ended.set()
        self.join()
        self.rig.close()
