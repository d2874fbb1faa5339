"""Ctrl-C ends a node whatever it does at that moment."""

import subprocess
import sys

import pytest

pytest.importorskip("rospy")

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
