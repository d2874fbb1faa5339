"""Ctrl-C ends a node whatever it does at that moment."""

import subprocess
import sys
from contextlib import nullcontext

import pytest

rospy = pytest.importorskip("rospy")
from std_msgs.msg import String  # noqa: E402

from atom_calibration.runtime import running  # noqa: E402

AMID_WAITING = """
import os, signal
from atom_calibration.runtime import running
signal.signal(signal.SIGINT, running._ask_to_end)
with running._stop._cond:  # as the main thread has it for a moment, ten times a second
    for _ in range(3000):
        os.kill(os.getpid(), signal.SIGINT)
raise SystemExit(running.wait())
"""


def test_a_signal_that_comes_amid_the_waiting_ends_it():
    done = subprocess.run([sys.executable, "-c", AMID_WAITING], timeout=120, check=False)
    assert done.returncode == 0


@pytest.mark.parametrize("ending", [True, False])
def test_a_closed_topic_is_silent_only_while_the_node_ends(monkeypatch, ending):
    topic = running.Publisher("/closed", String, queue_size=1)
    topic.impl.closed = True
    monkeypatch.setattr(running, "is_ending", lambda: ending)
    monkeypatch.setattr(rospy.topics, "is_initialized", lambda: True)
    with nullcontext() if ending else pytest.raises(rospy.ROSException, match="closed topic"):
        topic.publish(String("x"))
    with nullcontext() if ending else pytest.raises(rospy.ROSException, match="closed topic"):
        topic.publish(data="x")
