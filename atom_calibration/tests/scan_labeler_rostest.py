#!/usr/bin/env python3
"""The labeler of a 2D LiDAR as a node: labels, seeds by service and by marker, bad scans."""

import sys
import tempfile
import time
import unittest

import numpy as np
import rospy
import rosunit
from live_scene import Process, wait_until
from marker_hand import MarkerHand
from messages import Make
from scan_scene import make_scene, scan_at, seed
from sensor_msgs.msg import LaserScan, PointCloud2

from atom_calibration.messages.scans import laser_scan
from atom_calibration.msg import SensorLabels
from atom_calibration.show.annotation import POINT
from atom_calibration.srv import SetSeed
from atom_core.io.config_yaml import write_config
from atom_core.labeling.base import labeler_for

NAME, KEYS = "scanner", ("000", "001", "002")
PERIOD_S, PATIENCE_S = 0.2, 60
GREEN, RED = (0.24, 0.86, 0.24), (1.0, 0.16, 0.16)


class ScanLabelerTest(unittest.TestCase):
    labels, shown, stamp_s = None, None, 1000.0

    @classmethod
    def setUpClass(cls):
        cls.scene = make_scene()
        cls.sensor = cls.scene.dataset.sensors[NAME]
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        config = f"{folder.name}/config.yml"
        write_config(config, cls.scene.dataset.config)
        words = ("-cfg", config, "-sn", NAME, "--automatic_seeds", "off")
        cls.labeler = Process("rosrun", "atom_calibration", "lidar2d_labeler", *words)
        cls.addClassCleanup(cls.labeler.end)
        cls.scans = rospy.Publisher(cls.sensor.topic, LaserScan, queue_size=2)
        rospy.Subscriber(f"/{NAME}/labels", SensorLabels, cls.keep)
        rospy.Subscriber(f"{cls.sensor.topic}/labeled", PointCloud2, cls.show)
        cls.marker = MarkerHand(NAME)
        cls.send_until(KEYS[0], lambda: cls.labels and cls.marker.is_ready())

    @classmethod
    def keep(cls, message):
        cls.labels = message

    @classmethod
    def show(cls, message):
        cls.shown = message

    @classmethod
    def scan(cls, key):
        """Return the next scan of a place of the board."""
        cls.stamp_s += PERIOD_S
        return scan_at(Make, cls.scene.dataset, key, cls.stamp_s)

    @classmethod
    def send_until(cls, key, condition):
        """Publish scans of a place of the board until a condition holds."""
        end_s = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < end_s, cls.labels
            cls.scans.publish(cls.scan(key))
            rospy.sleep(PERIOD_S)

    def see(self, message):
        """Publish one scan, and return what its label says."""
        self.scans.publish(message)
        wait_until(lambda: self.labels.header.stamp == message.header.stamp, PATIENCE_S, "labels")
        return self.labels.patterns[0]

    def set_seed(self, *position):
        return rospy.ServiceProxy(f"/{NAME}/set_seed", SetSeed)(position)

    def expected(self, key, position):
        """Return the label of a place of the board about a seed."""
        (pattern,) = self.scene.dataset.patterns.values()
        labeler = labeler_for(self.sensor, pattern, None)
        scan = laser_scan(scan_at(Make, self.scene.dataset, key, 0.0))
        return labeler.label(scan, np.asarray(position)).label

    def check(self, part, key, position):
        """The label is that of the labeler, as indices into the ranges."""
        expected = self.expected(key, position)
        np.testing.assert_array_equal(part.idxs, expected.indices)
        np.testing.assert_array_equal(part.idxs_limit_points, expected.limit_indices)
        truth = self.scene.dataset.collections[key].labels[(NAME, part.pattern_name)]
        self.assertGreater(np.mean(np.isin(part.idxs, truth.indices)), 0.95)
        self.assertLess(max(part.idxs), len(self.scan(key).ranges))

    def test_1_without_a_seed_nothing_is_labeled_and_it_says_why(self):
        part = self.see(self.scan(KEYS[0]))
        self.assertFalse(part.detected or part.idxs)
        self.assertTrue(part.reason)
        self.assertEqual(self.marker.shown.header.frame_id, self.sensor.frame)
        wait_until(lambda: self.marker.colour == RED, PATIENCE_S, "a red marker")

    def test_2_a_seed_by_service_labels_the_last_scan_at_once(self):
        position = seed(self.scene, KEYS[0])
        self.see(self.scan(KEYS[0]))
        answer = self.set_seed(*position)
        self.assertTrue(answer.success, answer.message)
        wait_until(lambda: self.labels.patterns[0].detected, PATIENCE_S, lambda: self.labels)
        self.check(self.labels.patterns[0], KEYS[0], position)
        np.testing.assert_allclose(self.labels.manual_seed, position)
        wait_until(lambda: self.marker.colour == GREEN, PATIENCE_S, "a green marker")
        np.testing.assert_allclose(self.marker.position, position, atol=1e-9)

    def test_3_the_labeled_points_are_shown(self):
        part = self.see(self.scan(KEYS[0]))
        wait_until(
            lambda: self.shown and self.shown.header.stamp == self.labels.header.stamp,
            PATIENCE_S,
            "the labeled points",
        )
        self.assertEqual(self.shown.header.frame_id, self.sensor.frame)
        points = np.frombuffer(self.shown.data, POINT)
        np.testing.assert_array_equal(points["idx"], part.idxs)

    def test_4_the_marker_is_a_seed_whatever_its_height(self):
        for height_m in (0.0, 1.5):
            position = seed(self.scene, KEYS[1]) * [1.0, 1.0, 0.0] + [0.0, 0.0, height_m]
            self.see(self.scan(KEYS[1]))
            self.marker.drag(position)
            wait_until(
                lambda p=position: (
                    self.labels.patterns[0].detected and np.allclose(self.labels.manual_seed, p)
                ),
                PATIENCE_S,
                lambda: self.labels,
            )
            self.check(self.labels.patterns[0], KEYS[1], position)
            self.assertTrue(self.set_seed(*position).success)

    def test_5_a_seed_far_from_the_scan_is_refused(self):
        for position, words in (
            ((1.0, 2.0), "3 finite numbers (m)"),
            ((100.0, 0.0, 0.0), "outside the data"),
        ):
            answer = self.set_seed(*position)
            self.assertFalse(answer.success)
            self.assertIn(words, answer.message)

    def test_6_a_bad_scan_is_one_warning_and_the_next_is_labeled(self):
        position = seed(self.scene, KEYS[2])
        for words, spoil in (
            ("no valid range", lambda scan: setattr(scan, "ranges", [np.inf] * len(scan.ranges))),
            ("ranges, but its angles make", lambda scan: setattr(scan, "ranges", scan.ranges[:99])),
        ):
            self.assertTrue(self.set_seed(*position).success)
            self.assertTrue(self.see(self.scan(KEYS[2])).detected)
            before = len(self.labeler.output)
            spoiled = self.scan(KEYS[2])
            spoil(spoiled)
            part = self.see(spoiled)
            self.assertFalse(part.detected)
            self.assertIn(words, part.reason)
            told = [x for x in self.labeler.output[before:].splitlines() if x.strip()]
            self.assertEqual(len(told), 1, told)
            self.assertIn(words, told[0])
            self.assertIn(f"'{NAME}'", told[0])
            self.check(self.see(self.scan(KEYS[2])), KEYS[2], position)
            time.sleep(6.0)  # what is wrong is told every 5 s at most

    def test_7_it_runs_to_the_end(self):
        self.assertTrue(self.labeler.is_running())
        self.assertNotIn("Traceback", self.labeler.output)


if __name__ == "__main__":
    rospy.init_node("scan_labeler_rostest")
    rosunit.unitrun("atom_calibration", "scan_labeler", ScanLabelerTest, sysargs=sys.argv)
