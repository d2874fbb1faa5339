#!/usr/bin/env python3
"""The labelers as nodes: what they publish against the truth, seeds by hand, bad data."""

import signal
import sys
import tempfile
import time
import unittest
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import rospy
import rosunit
from geometry_msgs.msg import PointStamped
from live_scene import COLLECTIONS, LiveRig, LiveScene, Process, wait_until
from sensor_msgs.msg import Image, PointCloud2

from atom_calibration.msg import CollectorState, SensorLabels
from atom_calibration.show.annotation import POINT
from atom_calibration.srv import SaveCollection, SetSeed
from atom_core.io.dataset_json import read_dataset

RANGE = ("depth_1", "lidar_1")
LATEST, COUNT, SHOWN = {}, {}, {}


def keep(message):
    LATEST[message.sensor] = message
    COUNT[message.sensor] = COUNT.get(message.sensor, 0) + 1


def show(message, name):
    SHOWN[name] = message


def part(name):
    return LATEST[name].patterns[0]


def stamp(name):
    return LATEST[name].header.stamp.to_sec() if name in LATEST else -np.inf


def call(name, *position):
    rospy.wait_for_service(f"/{name}/set_seed", timeout=60)
    return rospy.ServiceProxy(f"/{name}/set_seed", SetSeed)(position)


class LabelersTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scene = LiveScene()
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        config = cls.scene.write_config(f"{cls.folder.name}/config.yml")
        cls.labelers = Process("rosrun", "atom_calibration", "labelers", "-cfg", config)
        cls.addClassCleanup(cls.labelers.end)
        cls.rig = LiveRig(cls.scene)
        for name, sensor in cls.scene.sensors.items():
            rospy.Subscriber(f"/{name}/labels", SensorLabels, keep)
            kind = PointCloud2 if name == "lidar_1" else Image
            rospy.Subscriber(f"{sensor.topic}/labeled", kind, show, name)
        cls.rig.show_until(
            COLLECTIONS[0],
            lambda: all(n in LATEST and part(n).detected for n in cls.scene.sensors),
            120,
            lambda: f"everybody sees the board; {cls.why()}",
        )

    @staticmethod
    def why():
        return {name: [p.reason for p in m.patterns] for name, m in LATEST.items()}

    def see(self, key, names=None, detected=True):
        """Show a place of the board until labels of it have come."""
        wanted, since = names or list(self.scene.sensors), self.rig.stamp_s
        self.rig.show_until(
            key,
            lambda: all(
                since < stamp(n) < self.rig.stamp_s and part(n).detected == detected for n in wanted
            ),
            60,
            lambda: f"{wanted} {'see' if detected else 'lose'} the board; {self.why()}",
        )

    def test_1_labels_are_true(self):
        for key in COLLECTIONS:
            self.see(key)
            for name in ("rgb_1", "rgb_2"):
                ids = np.array([c.id for c in part(name).corners])
                found = np.array([[c.x, c.y] for c in part(name).corners])
                error = found - self.scene.true_corners(name, key, ids)
                self.assertGreaterEqual(len(ids), 22)
                self.assertLess(np.sqrt(np.mean(error**2)), 0.25, (name, key))
                self.assertTrue(part(name).pose_known)
            label = self.scene.label("lidar_1", key)
            found, truth = set(part("lidar_1").idxs), set(label.indices)
            self.assertGreater(len(found & truth) / len(found), 0.98, key)
            self.assertGreater(len(found & truth) / len(truth), 0.9, key)
            self.assertLessEqual(set(part("lidar_1").idxs_limit_points), found)
            beside, z = self.scene.on_board("depth_1", key, part("depth_1").idxs)
            self.assertGreater(np.mean((np.abs(z) < 0.04) & (beside < 0.01)), 0.98, key)
            beside, _ = self.scene.on_board("depth_1", key, part("depth_1").idxs_limit_points)
            self.assertLess(np.median(np.abs(beside)), 0.015, key)
            self.assertGreater(len(beside), 30, key)

    def test_2_annotated_data_are_of_the_same_data(self):
        self.see(COLLECTIONS[1])
        wait_until(lambda: SHOWN.keys() >= self.scene.sensors.keys(), 60, lambda: SHOWN.keys())
        for name, sensor in self.scene.sensors.items():
            wait_until(lambda n=name: SHOWN[n].header.stamp == LATEST[n].header.stamp, 60, name)
            self.assertEqual(SHOWN[name].header.frame_id, sensor.frame)
            if name == "lidar_1":
                points = np.frombuffer(SHOWN[name].data, POINT)
                np.testing.assert_array_equal(points["idx"], part(name).idxs)
            else:
                size = (SHOWN[name].width, SHOWN[name].height)
                self.assertEqual(size, (sensor.camera.width, sensor.camera.height))
                self.assertEqual(SHOWN[name].encoding, "bgr8")

    def test_3_a_lost_board_has_a_reason_and_is_found_again(self):
        self.see(None, detected=False)
        for name in self.scene.sensors:
            self.assertTrue(part(name).reason, name)
            self.assertFalse(part(name).idxs or part(name).corners, name)
        self.see(COLLECTIONS[2])

    def test_4_a_seed_by_hand_wins_until_it_is_taken_back(self):
        self.see(COLLECTIONS[0])
        cloud = self.scene.data("lidar_1", COLLECTIONS[0])
        board = cloud[self.scene.label("lidar_1", COLLECTIONS[0]).indices].mean(axis=0)
        away = np.linalg.norm(cloud - board, axis=1)
        wall = cloud[np.argmin(np.abs(away - 2.5))]
        self.assertTrue(call("lidar_1", *wall).success)
        self.see(COLLECTIONS[0], ["lidar_1"], detected=False)  # though a camera sees it elsewhere
        np.testing.assert_allclose(LATEST["lidar_1"].manual_seed, wall, atol=1e-9)
        self.assertTrue(call("lidar_1", *board).success)
        self.see(COLLECTIONS[0], ["lidar_1"])
        self.assertTrue(call("lidar_1").success)
        self.see(COLLECTIONS[1], ["lidar_1"])
        self.assertEqual(len(LATEST["lidar_1"].manual_seed), 0)

    def test_5_a_click_on_the_depth_image_is_a_seed(self):
        topic = f"{self.scene.sensors['depth_1'].topic}/labeled/mouse_click"
        clicks = rospy.Publisher(topic, PointStamped, queue_size=1)
        wait_until(lambda: clicks.get_num_connections(), 60, "the labeler listens")
        click = PointStamped()
        click.point.x, click.point.y = 12.0, 14.0
        clicks.publish(click)
        self.rig.show_until(
            COLLECTIONS[0],
            lambda: list(LATEST["depth_1"].manual_seed) == [12.0, 14.0],
            60,
            lambda: LATEST["depth_1"].manual_seed,
        )
        self.assertTrue(call("depth_1").success)
        self.see(COLLECTIONS[0], ["depth_1"])

    def test_6_seeds_that_cannot_be_are_refused(self):
        for name, position, words in (
            ("lidar_1", (1.0, 2.0), "3 finite numbers (m)"),
            ("lidar_1", (np.nan, 0.0, 0.0), "3 finite numbers (m)"),
            ("lidar_1", (100.0, 0.0, 0.0), "outside the data"),
            ("depth_1", (1.0, 2.0, 3.0), "2 finite numbers (px)"),
            ("depth_1", (-50.0, 10.0), "outside the data"),
        ):
            answer = call(name, *position)
            self.assertFalse(answer.success)
            self.assertIn(words, answer.message)
            self.assertIn(f"'{name}'", answer.message)
        self.see(COLLECTIONS[3], list(RANGE))
        self.assertEqual(len(LATEST["lidar_1"].manual_seed), 0)

    def test_7_bad_data_are_told_and_do_no_harm(self):
        spoiled = self.scene.message("lidar_1", COLLECTIONS[0], self.rig.stamp_s)
        spoiled.data = spoiled.data[:100]
        self.rig.send("lidar_1", spoiled)
        wait_until(lambda: "cut off" in part("lidar_1").reason, 60, self.why)
        spoiled = self.scene.message("rgb_2", COLLECTIONS[0], self.rig.stamp_s)
        spoiled.data = b""
        self.rig.send("rgb_2", spoiled)
        wait_until(lambda: "cannot be decoded" in part("rgb_2").reason, 60, self.why)
        self.see(COLLECTIONS[0])

    def test_8_the_newest_data_win(self):
        messages = []
        for _ in range(30):
            self.rig.stamp_s += 0.2
            messages.append(self.scene.message("rgb_1", COLLECTIONS[0], self.rig.stamp_s))
        begun = COUNT["rgb_1"]
        for message in messages:
            self.rig.send("rgb_1", message)
        wait_until(lambda: stamp("rgb_1") == messages[-1].header.stamp.to_sec(), 60, "the newest")
        rospy.sleep(0.5)
        self.assertEqual(stamp("rgb_1"), messages[-1].header.stamp.to_sec())
        self.assertLess(COUNT["rgb_1"] - begun, 30)

    def test_9_time_may_go_back(self):
        self.rig.stamp_s -= 500.0
        self.see(COLLECTIONS[2])
        self.assertLess(stamp("rgb_1"), 1000.0)

    def test_a_labeler_that_does_not_fit_ends_with_one_line(self):
        config = f"{self.folder.name}/config.yml"
        for program, sensor, words in (
            ("rgb_labeler", "camera_9", "there is no sensor 'camera_9'; use one of rgb_1"),
            ("rgb_labeler", "lidar_1", "start lidar3d_labeler for it"),
        ):
            options = ("-cfg", config, "-sn", sensor, f"__name:=other_{sensor}")
            process = Process("rosrun", "atom_calibration", program, *options)
            if sensor == "lidar_1":
                ended = lambda p=process: not p.is_running()  # noqa: E731
                self.rig.show_until(None, ended, 60, lambda: "it ends")
            self.assertEqual(process.wait(60), 2)
            (line,) = [x for x in process.output.splitlines() if x.startswith("rgb_labeler:")]
            self.assertIn(words, line)

    def test_b_a_collector_that_is_interrupted_leaves_a_whole_dataset(self):
        output = f"{self.folder.name}/dataset"
        collector = Process(
            "rosrun",
            "atom_calibration",
            "collect_data",
            "-c",
            f"{self.folder.name}/config.yml",
            "-o",
            output,
        )
        self.addCleanup(collector.end)

        seen, service = {}, "/collect_data/save_collection"
        rospy.Subscriber("/collect_data/state", CollectorState, lambda m: seen.update(state=m))

        def is_ready():
            services = rospy.get_master().getSystemState()[2][2]
            heard = self.rig.listeners() > 1  # besides the labelers
            return heard and any(service == name for name, _ in services)

        self.rig.show_until(COLLECTIONS[1], is_ready, 60, lambda: "the collector is ready")
        until = self.rig.stamp_s + 1.0

        def all_seen():
            states = seen["state"].sensors if "state" in seen else []
            new = all(s.stamp.to_sec() > until for s in states)
            detected = all(s.patterns and s.patterns[0].detected for s in states)
            return states and new and detected

        self.rig.show_until(COLLECTIONS[1], all_seen, 60, lambda: "everybody sees the board")
        save = rospy.ServiceProxy(service, SaveCollection)
        with ThreadPoolExecutor(1) as pool:
            answer = pool.submit(save)
            self.rig.show_until(COLLECTIONS[1], answer.done, 60, lambda: "an answer")
        self.assertTrue(answer.result().success, answer.result().message)
        wait_until(self.rig.all_labeled, 60, "labels of all that was shown")
        time.sleep(8.0)  # the collector may have heard them later, but not by seconds
        self.assertIn("no labels have come for more than 5 s", save().message)
        collector.signal(signal.SIGINT)
        self.assertEqual(collector.wait(60), 0, collector.output)
        dataset = read_dataset(f"{output}/dataset.json")
        self.assertEqual(list(dataset.collections), ["000"])
        self.assertIn("1 collections", collector.output)


if __name__ == "__main__":
    rospy.init_node("labelers_rostest")
    rosunit.unitrun("atom_calibration", "labeler_nodes", LabelersTest, sysargs=sys.argv)
