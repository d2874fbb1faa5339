#!/usr/bin/env python3
"""set_initial_estimate.launch of a configured package, driven by feedback as RViz sends it."""

import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

import numpy as np
import rosgraph
import rospy
import rosunit
import tf2_ros
from messages import Make
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image
from small_rig import CAMERA_IN_BAG, SHOULDER_RAD, write_package
from std_srvs.srv import Trigger
from visualization_msgs.msg import (
    InteractiveMarkerFeedback,
    InteractiveMarkerInit,
    MarkerArray,
)
from waiting import PATIENCE_S, until

from atom_calibration.configure import configure_package
from atom_calibration.messages.poses import pose_matrix, pose_message, transform_matrix
from atom_calibration.srv import GetSensorInteractiveMarker, SetSensorInteractiveMarker
from atom_core.geometry import se3
from atom_core.io.urdf import read_description
from atom_core.model.transforms import Edge

NODE = "/set_initial_estimate"
CAMERA = Edge("mast", "camera_link")
MOVED = se3.from_rpy(np.array([0.4, -0.3, 0.2]), np.array([0.1, -0.5, 2.0]))


class SetInitialEstimateTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.temporary.cleanup)
        cls.package = write_package(Path(cls.temporary.name), Make)
        assert configure_package.main(["-n", str(cls.package)]) == 0
        cls.estimate = cls.package / "urdf" / "initial_estimate.urdf.xacro"
        cls.shown, cls.clocks = {}, []
        rospy.Subscriber(f"{NODE}/update_full", InteractiveMarkerInit, cls.init)
        rospy.Subscriber("/clock", Clock, lambda m: cls.clocks.append(m.clock.to_sec()))
        cls.buffer = tf2_ros.Buffer()
        cls.listener = tf2_ros.TransformListener(cls.buffer)
        cls.publisher = rospy.Publisher(
            f"{NODE}/feedback", InteractiveMarkerFeedback, queue_size=10
        )
        path = f"{os.environ['ROS_PACKAGE_PATH']}:{cls.package.parent}"
        cls.process = subprocess.Popen(
            [
                "roslaunch",
                str(cls.package / "launch" / "set_initial_estimate.launch"),
                "rviz:=false",
                "marker_size:=0.5",
            ],
            env={**os.environ, "ROS_PACKAGE_PATH": path},
        )
        cls.addClassCleanup(cls.stop)
        until(lambda: {"camera", "lidar", "guard", "menu"} <= set(cls.shown), "the markers")
        until(lambda: cls.publisher.get_num_connections(), "the node hears feedback")
        rospy.wait_for_service(f"{NODE}/save", PATIENCE_S)
        rospy.wait_for_service(f"{NODE}/reset_all", PATIENCE_S)

    @classmethod
    def init(cls, message):
        cls.shown = {marker.name: marker for marker in message.markers}

    @classmethod
    def stop(cls):
        if cls.process.poll() is None:
            cls.process.send_signal(signal.SIGINT)
            cls.process.wait(timeout=60)

    def setUp(self):
        answer = rospy.ServiceProxy(f"{NODE}/reset_all", Trigger)()
        self.assertTrue(answer.success, answer.message)

    def feed(self, name, matrix, client="rviz", frame="mast", event=None, entry=0):
        message = InteractiveMarkerFeedback(
            client_id=client,
            marker_name=name,
            pose=pose_message(matrix),
            event_type=InteractiveMarkerFeedback.POSE_UPDATE if event is None else event,
            menu_entry_id=entry,
        )
        message.header.frame_id, message.header.stamp = frame, rospy.Time.now()
        self.publisher.publish(message)

    def choose(self, name, title):
        entry = next(e for e in self.shown[name].menu_entries if e.title == title)
        event = InteractiveMarkerFeedback.MENU_SELECT
        self.feed(name, np.eye(4), event=event, entry=entry.id)

    def transform(self, parent, child):
        try:
            found = self.buffer.lookup_transform(parent, child, rospy.Time(0))
        except tf2_ros.TransformException:
            return None
        return transform_matrix(found)

    def is_at(self, edge, expected):
        found = self.transform(*edge)
        return found is not None and np.allclose(found, expected, atol=1e-6)

    def wait_for_transform(self, edge, expected, what):
        until(lambda: self.is_at(edge, expected), what)

    def described(self):
        return read_description(self.estimate).robot.transforms({"shoulder": SHOULDER_RAD})

    def test_transforms_are_the_descriptions_and_only_odometry_is_the_bags(self):
        described = self.described()
        for edge in (CAMERA, Edge("arm", "lidar_base"), Edge("base", "arm")):
            self.wait_for_transform(edge, described[edge], f"{edge} of the description")
        self.assertFalse(np.allclose(described[CAMERA], CAMERA_IN_BAG))
        until(lambda: self.transform("odom", "base") is not None, "odometry of the bag")

    def test_nobody_else_publishes_the_fixed_transforms(self):
        publishers, _, _ = rosgraph.Master("/test").getSystemState()
        self.assertLessEqual(set(dict(publishers)["/tf_static"]), {NODE, "/filter_bag_tf"})

    def test_the_transform_follows_a_drag_and_the_marker_stays_where_it_is_dropped(self):
        for share in (0.25, 0.5, 1.0):
            step = MOVED.copy()
            step[:3, 3] *= share
            self.feed("camera", step)
            self.wait_for_transform(CAMERA, step, "the dragged transform")
        self.feed("camera", MOVED, event=InteractiveMarkerFeedback.MOUSE_UP)
        until(
            lambda: np.allclose(pose_matrix(self.shown["camera"].pose), MOVED, atol=1e-6),
            "the marker's new place",
        )

    def test_a_pose_that_is_none_moves_nothing(self):
        bad = MOVED.copy()
        bad[0, 3] = np.nan
        self.feed("camera", bad)
        self.feed("camera", MOVED, frame="odom")
        time.sleep(0.5)
        self.wait_for_transform(CAMERA, self.described()[CAMERA], "the transform as it was")

    def test_menus_reset_one_and_all(self):
        described, lidar = self.described(), Edge("arm", "lidar_base")
        for name, edge in (("camera", CAMERA), ("lidar", lidar)):
            self.feed(name, MOVED, frame=edge.parent)
            self.wait_for_transform(edge, MOVED, f"{name} moved")
        self.choose("camera", "Reset camera")
        self.wait_for_transform(CAMERA, described[CAMERA], "camera reset")
        self.wait_for_transform(lidar, MOVED, "lidar still moved")
        self.choose("menu", "Reset all")
        self.wait_for_transform(lidar, described[lidar], "lidar reset")

    def test_saving_writes_the_xacro_with_its_macros(self):
        before = self.estimate.read_text(encoding="utf-8")
        self.addCleanup(self.estimate.write_text, before, encoding="utf-8")
        self.feed("camera", MOVED)
        self.wait_for_transform(CAMERA, MOVED, "camera moved")
        self.choose("menu", "Save")
        until(lambda: self.shown["menu"].description.startswith("saved to"), "the marker says so")
        np.testing.assert_allclose(self.described()[CAMERA], MOVED, atol=1e-9)
        self.assertIn("<xacro:stand name=", self.estimate.read_text(encoding="utf-8"))

    def test_what_cannot_be_saved_is_told(self):
        folder = self.estimate.parent
        folder.rename(folder.with_name("elsewhere"))
        try:
            answer = rospy.ServiceProxy(f"{NODE}/save", Trigger)()
        finally:
            folder.with_name("elsewhere").rename(folder)
        self.assertFalse(answer.success)
        self.assertIn(str(folder), answer.message)

    def test_markers_are_shown_hidden_and_scaled_by_service(self):
        show = rospy.ServiceProxy(
            f"{NODE}/lidar/set_sensor_interactive_marker", SetSensorInteractiveMarker
        )
        tell = rospy.ServiceProxy(
            f"{NODE}/lidar/get_sensor_interactive_marker", GetSensorInteractiveMarker
        )
        self.assertTrue(show(visible=False, scale=0.0).success)
        until(lambda: "lidar" not in self.shown, "the marker is gone")
        self.assertFalse(tell().visible)
        self.assertTrue(show(visible=True, scale=0.8).success)
        until(lambda: "lidar" in self.shown, "the marker is back")
        self.assertAlmostEqual(self.shown["lidar"].scale, 0.8, places=5)
        self.assertFalse(show(visible=True, scale=-1.0).success)

    def test_the_frustum_is_drawn_in_the_cameras_frame(self):
        (marker,) = rospy.wait_for_message("/camera/frustum", MarkerArray, PATIENCE_S).markers
        self.assertEqual(marker.header.frame_id, "camera_optical")
        self.assertTrue(marker.frame_locked)

    def test_compressed_images_are_shown_raw(self):
        image = rospy.wait_for_message("/camera/image_raw", Image, PATIENCE_S)
        self.assertEqual((image.width, image.height, image.encoding), (64, 48, "bgr8"))

    def test_after_the_recording_begins_anew_a_second_rviz_is_heard(self):
        self.feed("camera", MOVED)
        self.wait_for_transform(CAMERA, MOVED, "the first client's drag")
        seen = len(self.clocks)
        until(
            lambda: any(b < a for a, b in zip(self.clocks[seen:], self.clocks[seen + 1 :])), "loop"
        )
        other = se3.inverse(MOVED)

        def drag():
            self.feed("camera", other, client="second")
            return self.is_at(CAMERA, other)

        until(drag, "the second client's drag")
        time.sleep(1.2)  # so long the server listens to the second alone


if __name__ == "__main__":
    rospy.init_node("drag_sensors")
    rosunit.unitrun("atom_calibration", "drag_sensors", SetInitialEstimateTest, sysargs=sys.argv)
