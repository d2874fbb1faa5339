#!/usr/bin/env python3
"""Drives the live cell by its topics and services."""

import sys
import time
import unittest

import numpy as np
import rospy
import rostest
from geometry_msgs.msg import PoseStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import InteractiveMarkerFeedback, InteractiveMarkerInit

LATEST = {}
COUNTS = {}
TOPICS = [
    ("/clock", Clock),
    ("/tf", TFMessage),
    ("/tf_static", TFMessage),
    ("/joint_states", JointState),
    ("/ground_truth/pattern", PoseStamped),
    *(
        (f"/rgb_{n}/{kind}", cls)
        for n in (1, 2, 3)
        for kind, cls in (("image_raw", Image), ("camera_info", CameraInfo))
    ),
    ("/depth_1/image_raw", Image),
    ("/depth_1/camera_info", CameraInfo),
    *((f"/lidar_{n}/points", PointCloud2) for n in (1, 2, 3)),
    ("/cell_simulator/board_marker/update_full", InteractiveMarkerInit),
]


def keep(message, topic):
    LATEST[topic] = message
    COUNTS[topic] = COUNTS.get(topic, 0) + 1


def wait_until(condition, seconds, what):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return
        time.sleep(0.05)
    raise AssertionError(f"not within {seconds} s: {what}")


def clock_rests():
    """Tell whether no time passes for a second."""
    before = LATEST["/clock"].clock
    time.sleep(1.0)
    return LATEST["/clock"].clock == before


def board_position():
    p = LATEST["/ground_truth/pattern"].pose.position
    return np.array([p.x, p.y, p.z])


def call(service, kind, *arguments):
    rospy.wait_for_service(service, timeout=60)
    return rospy.ServiceProxy(service, kind)(*arguments)


class Live(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.subscribers = [rospy.Subscriber(t, kind, keep, t) for t, kind in TOPICS]
        cls.feedback = rospy.Publisher(
            "/cell_simulator/board_marker/feedback", InteractiveMarkerFeedback, queue_size=5
        )
        names = {topic for topic, _ in TOPICS}
        wait_until(lambda: names <= set(COUNTS), 90, "a message on every topic")

    def test_1_sensors_carry_their_frames_and_the_simulated_time(self):
        self.assertEqual(LATEST["/rgb_1/image_raw"].header.frame_id, "rgb_1_optical_frame")
        self.assertEqual(LATEST["/lidar_2/points"].header.frame_id, "lidar_2")
        self.assertEqual(LATEST["/rgb_1/image_raw"].encoding, "rgb8")
        self.assertEqual(LATEST["/depth_1/image_raw"].encoding, "16UC1")
        for topic in ("/rgb_1/image_raw", "/depth_1/image_raw", "/lidar_1/points"):
            wait_until(
                lambda t=topic: abs((LATEST[t].header.stamp - LATEST["/clock"].clock).to_sec()) < 3,
                60,
                f"{topic} of now",
            )
        info = LATEST["/rgb_2/camera_info"]
        self.assertEqual(info.distortion_model, "plumb_bob")
        self.assertTrue(any(info.D))

    def test_2_tf_does_not_know_the_board(self):
        frames = {
            frame
            for topic in ("/tf", "/tf_static")
            for t in LATEST[topic].transforms
            for frame in (t.header.frame_id, t.child_frame_id)
        }
        self.assertIn("lidar_3", frames)
        self.assertFalse([frame for frame in frames if "pattern" in frame or "tripod" in frame])

    def test_3_the_marker_moves_the_board_and_reset_puts_it_back(self):
        begin = board_position()
        time.sleep(1.2)  # the server ignores a second client for one second of ROS time
        marker = LATEST["/cell_simulator/board_marker/update_full"].markers[0]
        moved = InteractiveMarkerFeedback(
            client_id="test",
            marker_name=marker.name,
            control_name="move",
            event_type=InteractiveMarkerFeedback.POSE_UPDATE,
            pose=marker.pose,
        )
        moved.header.frame_id = "world"
        moved.pose.position.x += 0.3

        def there():
            self.feedback.publish(moved)
            return np.linalg.norm(board_position() - begin - [0.3, 0.0, 0.0]) < 1e-6

        wait_until(there, 60, "the board follows the marker")

        def back():  # on a busy machine the last drags may come after a reset
            self.assertTrue(call("/cell_simulator/reset", Trigger).success)
            return np.linalg.norm(board_position() - begin) < 1e-9

        wait_until(back, 60, "reset")

    def test_4_step_advances_the_paused_clock_by_one_tick(self):
        call("/cell_simulator/pause", SetBool, True)
        wait_until(clock_rests, 60, "the clock rests")
        before = LATEST["/clock"].clock
        call("/cell_simulator/step", Trigger)
        wait_until(lambda: LATEST["/clock"].clock > before, 60, "a step")
        wait_until(clock_rests, 60, "the clock rests again")
        self.assertAlmostEqual((LATEST["/clock"].clock - before).to_sec(), 0.1, places=6)
        call("/cell_simulator/pause", SetBool, False)
        wait_until(lambda: (LATEST["/clock"].clock - before).to_sec() > 0.5, 60, "running again")


if __name__ == "__main__":
    rospy.init_node("live_test")
    rostest.rosrun("atom_examples", "live", Live, sys.argv)
