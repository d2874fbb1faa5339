#!/usr/bin/env python3
"""Asks tf for the frames that display.launch publishes."""

import sys
import unittest

import rospy
import rostest
import tf2_ros

SENSOR_FRAMES = (
    *(f"rgb_{number}_optical_frame" for number in (1, 2, 3)),
    *("depth_1_optical_frame", "depth_1_rgb_optical_frame", "hand_camera_optical_frame"),
    *(f"lidar_{number}" for number in (1, 2, 3)),
)


class Display(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.buffer = tf2_ros.Buffer()
        cls.listener = tf2_ros.TransformListener(cls.buffer)

    def position(self, frame):
        wait = rospy.Duration(20.0)
        found = self.buffer.lookup_transform("world", frame, rospy.Time(0), wait)
        place = found.transform.translation
        return place.x, place.y, place.z

    def test_all_sensors_hang_on_the_world(self):
        for frame in SENSOR_FRAMES:
            x, y, z = self.position(frame)
            self.assertLess(abs(x), 2.0, frame)
            self.assertLess(abs(y), 1.4, frame)
            self.assertTrue(0.8 < z < 2.4, frame)

    def test_the_arm_is_at_home_and_the_tripod_on_the_floor(self):
        self.assertGreater(self.position("tool0")[2], 0.9)
        self.assertAlmostEqual(self.position("tripod_legs_link")[2], 0.0, places=3)


if __name__ == "__main__":
    rospy.init_node("display_test")
    rostest.rosrun("collab_cell_description", "display", Display, sys.argv)
