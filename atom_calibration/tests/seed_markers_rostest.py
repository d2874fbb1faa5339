#!/usr/bin/env python3
"""Seed markers, driven by feedback as RViz sends it: labels follow at once, and are collected."""

import signal
import sys
import tempfile
import unittest

import numpy as np
import rospy
import rosunit
from live_scene import COLLECTIONS, LiveRig, LiveScene, Process, wait_until
from marker_hand import MarkerHand
from visualization_msgs.msg import InteractiveMarkerFeedback

from atom_calibration.msg import CollectorState, SensorLabels
from atom_calibration.srv import SaveCollection, SetSeed
from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset
from atom_core.io.seeds import SEEDS_FILE, read_seeds

RANGE = ("lidar_1", "depth_1")
PATIENCE_S = 60
GREEN, RED = (0.24, 0.86, 0.24), (1.0, 0.16, 0.16)


class SeedMarkersTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scene = LiveScene(cloud_sigma_m=0.0)  # a place is then seen always, or never
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        config, cls.output = cls.scene.write_config(f"{folder.name}/c.yml"), f"{folder.name}/data"
        cls.launch = Process(
            "roslaunch",
            "atom_calibration",
            "collect_data.launch",
            f"config:={config}",
            f"output_folder:={cls.output}",
            "rviz:=false",
        )
        cls.addClassCleanup(cls.launch.end)
        cls.labels, cls.state = {}, None
        for name in cls.scene.sensors:
            rospy.Subscriber(f"/{name}/labels", SensorLabels, cls.keep)
        rospy.Subscriber("/collect_data/state", CollectorState, cls.keep_state)
        cls.markers = {name: MarkerHand(name) for name in RANGE}
        cls.rig = LiveRig(cls.scene)
        cls.rig.show_until(
            COLLECTIONS[0],
            lambda: (
                cls.state is not None
                and all(m.is_ready() for m in cls.markers.values())
                and all(s.patterns and s.patterns[0].detected for s in cls.state.sensors)
            ),
            120,
            lambda: cls.state,
        )

    @classmethod
    def keep(cls, message):
        cls.labels[message.sensor] = message

    @classmethod
    def keep_state(cls, message):
        cls.state = message

    def part(self, name):
        return self.labels[name].patterns[0]

    def centre(self, name, key):
        """Return where the board's middle truly is (3,) in a sensor's frame."""
        middle = np.append(self.scene.pattern.border.centre, 0.0)
        return se3.apply(self.scene.sensor_T_pattern(name, key), middle[None])[0]

    def see(self, key):
        """Show a place until every range sensor has labeled it by itself."""
        for name in RANGE:
            if self.labels[name].manual_seed:
                self.set_seed(name)
        since = self.rig.stamp_s
        self.rig.show_until(
            key,
            lambda: all(
                self.labels[n].header.stamp.to_sec() > since and self.part(n).detected
                for n in RANGE
            ),
            60,
            lambda: {n: self.part(n).reason for n in RANGE},
        )
        self.settle()

    def settle(self):
        """Wait until the last data of all sensors have their labels."""
        last = self.rig.stamp_s - self.rig.period_s
        wait_until(
            lambda: all(abs(m.header.stamp.to_sec() - last) < 0.1 for m in self.labels.values()),
            PATIENCE_S,
            lambda: {n: m.header.stamp.to_sec() for n, m in self.labels.items()},
        )

    def set_seed(self, name, *position):
        answer = rospy.ServiceProxy(f"/{name}/set_seed", SetSeed)(position)
        self.assertTrue(answer.success, answer.message)

    def wait_for(self, name, detected, by_hand):
        """Wait for labels of the data that came last, while no data come."""
        stamp = self.labels[name].header.stamp
        wait_until(
            lambda: (
                (self.part(name).detected, bool(self.labels[name].manual_seed))
                == (detected, by_hand)
            ),
            PATIENCE_S,
            lambda: self.labels[name],
        )
        self.assertEqual(self.labels[name].header.stamp, stamp)

    def test_1_a_marker_follows_the_board(self):
        for key in COLLECTIONS[:3]:
            self.see(key)
            for name, marker in self.markers.items():
                self.assertEqual(marker.shown.header.frame_id, self.scene.sensors[name].frame)
                centre = self.centre(name, key)
                wait_until(
                    lambda m=marker, c=centre: np.linalg.norm(m.position - c) < 0.15,
                    PATIENCE_S,
                    lambda m=marker, c=centre: (m.name, m.position, c),
                )
                wait_until(lambda m=marker: m.colour == GREEN, PATIENCE_S, name)
                self.assertEqual(marker.shown.description, name)

    def test_2_a_drag_labels_the_last_data_at_once(self):
        self.see(COLLECTIONS[1])
        for name, marker in self.markers.items():
            before = set(self.part(name).idxs)
            self.assertFalse(self.labels[name].manual_seed)
            away = self.centre(name, COLLECTIONS[1]) + [0.03, -0.02, 0.02]
            marker.drag(away)
            self.wait_for(name, detected=True, by_hand=True)
            if name == "lidar_1":
                np.testing.assert_allclose(self.labels[name].manual_seed, away, atol=1e-9)
            else:
                pixel = self.scene.sensors[name].camera.project(away[None])[0]
                np.testing.assert_allclose(self.labels[name].manual_seed, pixel, atol=1e-6)
            found = set(self.part(name).idxs)
            self.assertGreaterEqual(len(found & before) / len(found | before), 0.98, name)
            wait_until(lambda m=marker: "by hand" in m.shown.description, PATIENCE_S, name)
            np.testing.assert_allclose(marker.position, away, atol=1e-9)

    def test_3_empty_space_is_shown_and_does_no_harm(self):
        self.see(COLLECTIONS[0])
        board = {name: self.centre(name, COLLECTIONS[0]) for name in RANGE}
        nowhere = {
            "lidar_1": ([0.0, 0.0, 30.0], board["lidar_1"] + [0.0, 0.0, 3.0]),
            "depth_1": ([0.0, 0.0, -1.0], [50.0, 0.0, 1.0]),
        }
        for name, marker in self.markers.items():
            for place in nowhere[name]:
                marker.drag(np.array(place))
                self.wait_for(name, detected=False, by_hand=True)
                wait_until(lambda m=marker: m.colour == RED, PATIENCE_S, name)
                self.assertTrue(self.part(name).reason)
                self.assertIn("not detected", marker.shown.description)
            marker.drag(board[name])
            self.wait_for(name, detected=True, by_hand=True)
            wait_until(lambda m=marker: m.colour == GREEN, PATIENCE_S, name)
            marker.drag(np.array(nowhere[name][0]))
            self.wait_for(name, detected=False, by_hand=True)
            marker.choose("Automatic seed")
            self.wait_for(name, detected=True, by_hand=False)
            wait_until(lambda m=marker: m.shown.description == m.name, PATIENCE_S, name)

    def test_4_a_click_is_no_drag(self):
        self.see(COLLECTIONS[0])
        for name, marker in self.markers.items():
            marker.click()
            marker.tell(InteractiveMarkerFeedback.POSE_UPDATE, np.array([np.nan, 0.0, 0.0]))
            self.set_seed(name, *self.part(name).next_seed)  # answered after what was clicked
            self.wait_for(name, detected=True, by_hand=True)
            np.testing.assert_allclose(self.labels[name].manual_seed, self.part(name).seed)

    def test_5_the_marker_goes_where_a_service_puts_the_seed(self):
        self.see(COLLECTIONS[2])
        point = self.centre("lidar_1", COLLECTIONS[2]) + [0.05, 0.0, 0.0]
        self.set_seed("lidar_1", *point)
        marker = self.markers["lidar_1"]
        wait_until(
            lambda: np.allclose(marker.position, point, atol=1e-9),
            PATIENCE_S,
            lambda: marker.position,
        )
        centre = self.centre("depth_1", COLLECTIONS[2])
        pixel = self.scene.sensors["depth_1"].camera.project(centre[None])[0]
        self.set_seed("depth_1", *pixel)
        marker = self.markers["depth_1"]
        wait_until(
            lambda: (
                "by hand" in marker.shown.description
                and np.linalg.norm(marker.position - centre) < 0.05
            ),
            PATIENCE_S,
            lambda: (marker.position, centre),
        )

    def test_6_what_was_labeled_again_is_what_is_saved(self):
        self.see(COLLECTIONS[2])
        end = self.rig.stamp_s + 1.5
        self.rig.show_until(COLLECTIONS[2], lambda: self.rig.stamp_s > end, 60, lambda: "1.5 s")
        self.settle()
        marker, board = self.markers["lidar_1"], self.centre("lidar_1", COLLECTIONS[2])
        marker.drag(board + [0.0, 0.0, 3.0])
        self.wait_for("lidar_1", detected=False, by_hand=True)
        marker.drag(board + [0.04, 0.02, -0.01])
        self.wait_for("lidar_1", detected=True, by_hand=True)
        seed = np.array(self.labels["lidar_1"].manual_seed)
        wait_until(
            lambda: (
                {s.name: list(s.manual_seed) for s in self.state.sensors}["lidar_1"] == list(seed)
            ),
            PATIENCE_S,
            lambda: self.state,
        )
        save = rospy.ServiceProxy("/collect_data/save_collection", SaveCollection)()
        self.assertTrue(save.success, save.message)
        self.launch.signal(signal.SIGINT)
        self.launch.wait(60)
        dataset = read_dataset(f"{self.output}/dataset.json")
        label = dataset.collections[save.collection_name].labels[
            ("lidar_1", self.scene.pattern.name)
        ]
        self.assertEqual(list(label.indices), list(self.part("lidar_1").idxs))
        stamp = self.labels["lidar_1"].header.stamp.to_sec()
        written = {s.sensor: s for s in read_seeds(f"{self.output}/{SEEDS_FILE}", dataset.sensors)}
        self.assertEqual(set(written), set(RANGE))
        np.testing.assert_array_equal(written["lidar_1"].position, seed)
        self.assertAlmostEqual(written["lidar_1"].stamp_s, stamp)


if __name__ == "__main__":
    rospy.init_node("seed_markers_rostest")
    rosunit.unitrun("atom_calibration", "seed_markers", SeedMarkersTest, sysargs=sys.argv)
