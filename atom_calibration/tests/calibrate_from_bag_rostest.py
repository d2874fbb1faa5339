#!/usr/bin/env python3
"""calibrate_from_bag.launch: a good bag becomes a calibration, a broken one a status."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import unittest

import numpy as np
import rosbag
import rospy
import rosunit
from live_scene import Process
from messages import Make
from waiting import until

from atom_calibration.msg import CalibrationState
from atom_core.geometry import se3
from atom_core.io.config_yaml import write_config
from atom_core.model.dataset import pose
from atom_core.synthetic import scenes
from atom_core.synthetic.board_image import render

STAMPS_S = (0.0, 0.4, 0.8)  # of the images of one stop


def write_bag(path, scene):
    """Write what two cameras see of a board that stands in one place after the other."""
    dataset = scene.dataset
    (pattern,) = dataset.patterns.values()
    config = dataset.config.calibration_patterns[pattern.name]
    first = next(iter(dataset.collections.values()))
    with rosbag.Bag(path, "w") as bag:
        bag.write("/tf_static", Make.transforms(first.transforms, 100.0), rospy.Time(100))
        for number, collection in enumerate(dataset.collections.values()):
            world_T_pattern = scene.truth.boards[pattern.board_key(collection.key)]
            for sensor in dataset.sensors.values():
                world_T_camera = pose(collection, dataset.graph, dataset.world, sensor.frame)
                camera_T_pattern = se3.inverse(world_T_camera) @ world_T_pattern
                picture = render(sensor.camera, [((pattern, config), camera_T_pattern)])
                for offset in STAMPS_S:
                    stamp = 101.0 + 2.0 * number + offset
                    folder, time = sensor.topic.rpartition("/")[0], rospy.Time.from_sec(stamp)
                    info = Make.intrinsics(sensor.camera, sensor.frame, stamp)
                    bag.write(f"{folder}/camera_info", info, time)
                    image = Make.image(picture, frame=sensor.frame, stamp_s=stamp)
                    bag.write(sensor.topic, image, time)


def launch(**arguments):
    """Run the launch file to its end; return status.json."""
    words = [f"{name}:={value}" for name, value in arguments.items()] + ["report:=false"]
    subprocess.run(
        ["roslaunch", "atom_calibration", "calibrate_from_bag.launch", *words],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    with open(os.path.join(arguments["output"], "status.json"), encoding="utf-8") as stream:
        return json.load(stream)


class CalibrateFromBagTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = lambda *names: os.path.join(folder.name, *names)
        self.scene = scenes.two_cameras()
        write_config(self.path("config.yml"), self.scene.dataset.config)

    def launch(self):
        return launch(
            config=self.path("config.yml"), bag=self.path("a.bag"), output=self.path("out")
        )

    def test_a_good_bag_becomes_a_calibration(self):
        write_bag(self.path("a.bag"), self.scene)
        status = self.launch()
        self.assertEqual((status["step"], status["exit_code"]), ("calibrate", 0), status)
        with open(self.path("out", "calibration", "calibration.json"), encoding="utf-8") as stream:
            result = json.load(stream)
        verdict = {key: result["verdict"][key] for key in ("grade", "sentence")}
        self.assertEqual(status["verdict"], verdict)
        self.assertEqual(result["status"], "converged")
        self.assertGreaterEqual(len(result["collections"]), len(self.scene.dataset.collections) - 1)
        for sensor in result["sensors"].values():
            self.assertLess(sensor["residuals"]["reprojection"]["rms"], 0.3)
        self.assertTrue(os.path.isfile(self.path("out", "dataset", "dataset.json")))
        self.assertTrue(np.isfinite(result["solver"]["cost_final"]))

    def test_the_calibration_of_a_bag_can_be_watched(self):
        write_bag(self.path("a.bag"), self.scene)
        states = []
        subscriber = rospy.Subscriber("/calibrate/state", CalibrationState, states.append)
        self.addCleanup(subscriber.unregister)
        process = Process(
            "rosrun",
            "atom_calibration",
            "calibrate_from_bag",
            "--config",
            self.path("config.yml"),
            "--bag",
            self.path("a.bag"),
            "--output",
            self.path("out"),
            "-rv",
            "--stay",
        )
        self.addCleanup(process.end)
        until(lambda: states and not states[-1].running, "the end of the solver", 120.0)
        self.assertEqual(states[-1].status, "converged")
        until(lambda: os.path.isfile(self.path("out", "status.json")), "status.json")
        self.assertTrue(process.is_running(), "it stays until Ctrl-C")
        process.signal(signal.SIGINT)
        self.assertEqual(process.wait(60), 0)
        with open(self.path("out", "status.json"), encoding="utf-8") as stream:
            self.assertEqual(json.load(stream)["step"], "calibrate")

    def test_a_bag_that_was_cut_off_is_told(self):
        write_bag(self.path("a.bag"), self.scene)
        os.truncate(self.path("a.bag"), os.path.getsize(self.path("a.bag")) // 2)
        status = self.launch()
        self.assertEqual((status["step"], status["exit_code"]), ("collect", 2), status)
        self.assertIn("rosbag reindex", status["message"])
        self.assertFalse(os.path.exists(self.path("out", "calibration")))


if __name__ == "__main__":
    rospy.init_node("bag_to_calibration")
    rosunit.unitrun(
        "atom_calibration", "bag_to_calibration", CalibrateFromBagTest, sysargs=sys.argv
    )
