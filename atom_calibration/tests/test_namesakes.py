"""A node whose name another one has refuses to start, since the master would end that one."""

import os
import subprocess
import sys

import pytest
from masters import running_master

pytest.importorskip("rospy")

from atom_calibration.runtime import running  # noqa: E402 - knows ROS

NODE = """
import sys
from atom_calibration.runtime import running

def work():
    running.start("playback")
    print("runs", flush=True)
    return running.wait()

sys.exit(running.guarded("playback", work))
"""


def started(environment, *words):
    pipe = subprocess.PIPE
    return subprocess.Popen(
        [sys.executable, "-c", NODE, *words], env=environment, stdout=pipe, stderr=pipe, text=True
    )


def test_the_second_node_of_a_name_is_refused_and_the_first_goes_on(tmp_path):
    with running_master(tmp_path) as place:
        environment = {**os.environ, **place}
        first = started(environment)
        try:
            assert first.stdout.readline() == "runs\n"
            second = started(environment)
            told = second.communicate()[1]
            assert second.returncode == running.BAD_INPUT
            assert f"a node /playback runs already (process {first.pid})" in told
            other = started(environment, "__name:=another")
            assert other.stdout.readline() == "runs\n"
            assert first.poll() is None
            first.kill()  # the master does not hear of it
            again = started(environment)
            assert again.stdout.readline() == "runs\n"
            for node in (other, again):
                node.terminate()
                assert node.wait() == 0
        finally:
            first.kill()
            first.communicate()
