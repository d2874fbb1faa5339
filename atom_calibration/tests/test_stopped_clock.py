"""Nodes that are told to take ROS's time while nobody publishes a clock."""

import os
import subprocess
import sys

import pytest
from masters import reserved_port, start_master
from test_master import start, wait_until

from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes

pytestmark = pytest.mark.slow
rosgraph = pytest.importorskip("rosgraph")

QUIT = """
import sys, rospy
from std_srvs.srv import Trigger
print(rospy.ServiceProxy("/dataset_playback/quit", Trigger)().message)
"""


def test_playback_quits_though_the_clock_stands_still_and_tells_that_nothing_is_written(tmp_path):
    scene = scenes.random_scene(2, rgb=1, depth=0, lidar3d=1, collections=3)
    dataset = write_dataset_folder(scene.dataset, tmp_path / "data", name="scene")
    with reserved_port() as port:
        master = start_master(port, tmp_path)
        uri = f"http://localhost:{port}"
        try:
            known = rosgraph.Master("/test_stopped_clock", master_uri=uri)
            known.setParam("/use_sim_time", True)
            playback = start("dataset_playback", ["-json", dataset], port, tmp_path)
            wait_until(
                lambda: "/dataset_playback/quit" in [name for name, _ in known.getSystemState()[2]],
                "it serves",
            )
            asked = subprocess.run(
                [sys.executable, "-c", QUIT],
                env={**os.environ, "ROS_MASTER_URI": uri},
                stdout=subprocess.PIPE,
                text=True,
                timeout=120,
                check=False,
            )
            assert "nothing was left to save" in asked.stdout
            said, _ = playback.communicate(timeout=60)
            assert playback.returncode == 0
            assert f"the next step takes {dataset}" in said
            assert not list(tmp_path.rglob("*_corrected.json"))
        finally:
            master.kill()
            master.wait()
            if playback.poll() is None:
                playback.kill()
                playback.wait()
