#!/usr/bin/env python3
"""Every launch file of a calibration package starts and stops cleanly, headless and with RViz."""

import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

import rosgraph
import rospy
import rosunit
from conftest import Make
from small_rig import write_package

from atom_calibration.configure import configure_package

PATIENCE_S = 30.0
DISPLAY = ":83"
PLAYING = {"/playbag", "/robot_state_publisher", "/filter_bag_tf", "/throttle_camera"}
NODES = {
    "playbag": {*PLAYING, "/decompress_images"},
    "set_initial_estimate": {*PLAYING, "/decompress_images", "/set_initial_estimate"},
    "collect_data": {*PLAYING, "/labelers", "/collect_data", "/camera_labeler", "/lidar_labeler"},
}


def running():
    """Return the names of all nodes that the master knows."""
    publishers, subscribers, _ = rosgraph.Master("/package_launches").getSystemState()
    return {node for group in (publishers, subscribers) for _, nodes in group for node in nodes}


class PackageLaunchesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(temporary.cleanup)
        cls.folder = Path(temporary.name)
        cls.package = write_package(cls.folder, Make, seconds=20.0)
        assert configure_package.main(["-n", str(cls.package)]) == 0

    def start_and_stop(self, name, rviz):
        words = [f"rviz:={str(rviz).lower()}"]
        if name == "collect_data":
            words.append(f"output_folder:={self.folder / f'dataset_{rviz}'}")
        path = f"{os.environ['ROS_PACKAGE_PATH']}:{self.package.parent}"
        log = self.folder / f"{name}_{rviz}.txt"
        screen = {"DISPLAY": DISPLAY, "LIBGL_ALWAYS_SOFTWARE": "1", "QT_X11_NO_MITSHM": "1"}
        with open(log, "w", encoding="utf-8") as stream:
            launch = subprocess.Popen(
                ["roslaunch", str(self.package / "launch" / f"{name}.launch"), *words],
                env={**os.environ, "ROS_PACKAGE_PATH": path, **(screen if rviz else {})},
                stdout=stream, stderr=subprocess.STDOUT,
            )  # fmt: skip
        expected = NODES[name] | ({"/rviz"} if rviz else set())
        try:
            end = time.monotonic() + PATIENCE_S
            while not expected <= running() and launch.poll() is None and time.monotonic() < end:
                time.sleep(0.1)
            missing = expected - running()
            time.sleep(1.0)
            alive = launch.poll() is None
        finally:
            launch.send_signal(signal.SIGINT)
            code = launch.wait(timeout=25)
        told = log.read_text(encoding="utf-8")
        self.assertFalse(missing, f"not started: {missing}\n{told}")
        self.assertTrue(alive, f"ended by itself\n{told}")
        self.assertEqual(code, 0, told)
        for word in ("has died", "Traceback", "escalating"):
            self.assertNotIn(word, told)

    def test_headless(self):
        for name in ("playbag", "collect_data"):  # set_initial_estimate.test does the other
            with self.subTest(name):
                self.start_and_stop(name, rviz=False)

    def test_with_rviz(self):
        screen = subprocess.Popen(
            ["Xvfb", DISPLAY, "-screen", "0", "1280x900x24", "+extension", "GLX", "-noreset"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            time.sleep(1.0)
            for name in NODES:
                with self.subTest(name):
                    self.start_and_stop(name, rviz=True)
        finally:
            screen.terminate()
            screen.wait(timeout=10)


if __name__ == "__main__":
    rospy.init_node("package_launches")
    rosunit.unitrun("atom_calibration", "package_launches", PackageLaunchesTest, sysargs=sys.argv)
