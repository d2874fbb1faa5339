#!/usr/bin/env python3
"""collect_data.launch with a bag: the dataset of the offline command, without anybody's help."""

import glob
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import xmlrpc.client
from pathlib import Path

import numpy as np
import rospy
import rosunit
from live_scene import COLLECTIONS, LiveScene, Process, turntable
from waiting import until

from atom_core.io.dataset_json import read_dataset
from atom_core.io.seeds import SEEDS_FILE, read_seeds

BAG_RATE, STOPPED_S = 2, 4.0  # without waiting, whole stops of the board would be passed over
FROZEN_S = 2.0  # the player makes up for it, and sends twice as much of the recording at once
TURNTABLE_EDGE = "world-turntable"


def stamp(entry):
    return entry["header"]["stamp"]["secs"] + 1e-9 * entry["header"]["stamp"]["nsecs"]


def pid_of_node(name):
    """Return the process of a node, which it tells itself."""
    _, _, address = rospy.get_master().lookupNode(name)
    _, _, pid = xmlrpc.client.ServerProxy(address).getPid(rospy.get_name())
    return pid


def matrix_difference(a, b):
    return max(np.abs(np.subtract(a[k], b[k])).max() for k in ("trans", "quat"))


class LiveFromBagTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.scene = LiveScene()
        config = cls.scene.write_config(f"{folder.name}/config.yml")
        bag = cls.scene.write_bag(f"{folder.name}/a.bag")
        cls.live, cls.offline = f"{folder.name}/live", f"{folder.name}/offline"
        cls.again = f"{folder.name}/again"
        cls.launch = Process(
            "roslaunch",
            "atom_calibration",
            "collect_data.launch",
            f"config:={config}",
            f"output_folder:={cls.live}",
            f"bag:={bag}",
            "automatic:=true",
            "rviz:=false",
            "pictures:=true",
            "end_when_quiet:=8",
            "patience:=120",
            f"bag_rate:={BAG_RATE}",
        )
        cls.addClassCleanup(cls.launch.end)
        until(lambda: glob.glob(f"{cls.live}/collections/*"), "no collection came", 120)
        labelers = [f"/{name}_labeler" for name in cls.scene.sensors]
        cls.stop(labelers, STOPPED_S)
        cls.stop([*labelers, "/play_bag", "/start_bag", "/collect_data"], FROZEN_S)
        cls.launch.wait(300)
        cls.command = cls.collect(config, bag, cls.offline)
        cls.repeated = cls.collect(config, bag, cls.again, "--seeds", f"{cls.live}/{SEEDS_FILE}")

    @staticmethod
    def stop(nodes, seconds):
        """Let nodes do nothing for a while, as on a busy machine; all of them: on a frozen one."""
        pids = [pid_of_node(node) for node in nodes]
        for number in (signal.SIGSTOP, signal.SIGCONT):
            for pid in pids:
                os.kill(pid, number)
            time.sleep(seconds if number == signal.SIGSTOP else 0.0)

    @staticmethod
    def collect(config, bag, output, *options):
        return subprocess.run(
            [
                "rosrun",
                "atom_calibration",
                "collect_from_bag",
                "--config",
                config,
                "--bag",
                bag,
                "--output",
                output,
                *options,
            ],
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )

    def documents(self, *folders):
        return [
            read_dataset(os.path.join(folder, "dataset.json")).document["collections"]
            for folder in folders or (self.live, self.offline)
        ]

    def test_1_it_ends_by_itself_and_says_how(self):
        self.assertEqual(self.command.returncode, 0, self.command.stderr)
        with open(os.path.join(self.live, "status.json"), encoding="utf-8") as stream:
            status = json.load(stream)
        self.assertEqual(
            status,
            {"step": "collect", "exit_code": 0, "message": f"{len(COLLECTIONS)} collections"},
        )

    def test_2_there_is_one_collection_for_each_stop_and_every_sensor_saw_it(self):
        live, offline = self.documents()
        self.assertEqual(list(live), list(offline))
        self.assertEqual(len(live), len(COLLECTIONS))
        sensors = set(self.scene.sensors)
        for number, entry in enumerate(live.values()):
            self.assertEqual(set(entry["data"]), sensors)
            begin = 100.0 + 2.0 * number
            for data in entry["data"].values():
                self.assertTrue(begin - 1e-6 <= stamp(data) < begin + 2.0)
        seen, seen_offline = (
            [
                (key, name)
                for key, entry in document.items()
                for name, label in entry["labels"][self.scene.pattern.name].items()
                if label["detected"]
            ]
            for document in (live, offline)
        )
        self.assertEqual(seen, seen_offline)
        self.assertGreaterEqual(len(seen), 0.9 * len(COLLECTIONS) * len(sensors))

    def test_3_labels_of_the_same_data_are_those_of_the_offline_command(self):
        compared = 0
        live, offline = self.documents()
        for key, entry in live.items():
            labels = (entry["labels"], offline[key]["labels"])
            for name in self.scene.sensors:
                if stamp(entry["data"][name]) != stamp(offline[key]["data"][name]):
                    continue
                a, b = (of_all[self.scene.pattern.name][name] for of_all in labels)
                compared += a["detected"] and b["detected"]
                if name.startswith("rgb"):
                    self.assertEqual(a, b)
                elif a["detected"] and b["detected"]:  # seeds differ a little
                    for field, least in (("idxs", 0.98), ("idxs_limit_points", 0.8)):
                        mine, theirs = set(a[field]), set(b[field])
                        share = len(mine & theirs) / len(mine | theirs)
                        self.assertGreaterEqual(share, least, (key, name, field))
        self.assertGreaterEqual(compared, 4)

    def test_4_transforms_are_those_of_the_data(self):
        live, offline = self.documents()
        for key, entry in live.items():
            self.assertEqual(set(entry["transforms"]), set(offline[key]["transforms"]))
            for edge, pose in entry["transforms"].items():
                if edge != TURNTABLE_EDGE:
                    difference = matrix_difference(pose, offline[key]["transforms"][edge])
                    self.assertLess(difference, 1e-9, edge)
            mean_s = np.mean([stamp(data) for data in entry["data"].values()])
            found = entry["transforms"][TURNTABLE_EDGE]["quat"]
            angle = 2 * np.arctan2(found[2], found[3])
            truth = turntable(mean_s)
            expected = np.arctan2(truth[1, 0], truth[0, 0])
            self.assertLess(abs(np.angle(np.exp(1j * (angle - expected)))), 1e-6)

    def test_5_data_files_and_pictures_are_there(self):
        live, _ = self.documents()
        for key, entry in live.items():
            for name, data in entry["data"].items():
                self.assertTrue(os.path.isfile(os.path.join(self.live, data["data_file"])))
                self.assertTrue(
                    os.path.isfile(os.path.join(self.live, "pictures", f"{key}_{name}.jpg"))
                )
        self.assertEqual(
            read_dataset(os.path.join(self.live, "dataset.json")).sensors.keys(),
            read_dataset(os.path.join(self.offline, "dataset.json")).sensors.keys(),
        )

    def test_6_the_seeds_that_were_used_repeat_the_labels(self):
        self.assertEqual(self.repeated.returncode, 0, self.repeated.stderr)
        live, again = self.documents(self.live, self.again)
        sensors = read_dataset(os.path.join(self.live, "dataset.json")).sensors
        used = {
            (seed.sensor, round(seed.stamp_s, 3))
            for seed in read_seeds(Path(self.live) / SEEDS_FILE, sensors)
        }
        compared = 0
        for key, entry in live.items():
            for name in ("lidar_1", "depth_1"):
                label = entry["labels"][self.scene.pattern.name][name]
                if not label["detected"]:
                    continue
                self.assertIn((name, round(stamp(entry["data"][name]), 3)), used)
                if stamp(entry["data"][name]) == stamp(again[key]["data"][name]):
                    compared += 1
                    self.assertEqual(label, again[key]["labels"][self.scene.pattern.name][name])
        self.assertGreaterEqual(compared, 3)


if __name__ == "__main__":
    rospy.init_node("live_from_bag_rostest")
    rosunit.unitrun("atom_calibration", "live_from_bag", LiveFromBagTest, sysargs=sys.argv)
