#!/usr/bin/env python3
"""transform_corrector.launch, driven by feedback as RViz sends it: dragged, undone, saved."""

import signal
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np
import rospy
import rosunit
import tf2_ros
from std_srvs.srv import Trigger
from visualization_msgs.msg import InteractiveMarkerFeedback, InteractiveMarkerInit, MarkerArray
from waiting import PATIENCE_S, until

from atom_calibration.messages.poses import pose_message, transform_matrix
from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.model.dataset import board_edge
from atom_core.synthetic import scenes

NODE = "/transform_corrector"
MOVED = se3.from_rpy(np.array([0.4, -0.3, 0.2]), np.array([0.1, -0.5, 2.0]))


class TransformCorrectorTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        scene = scenes.random_scene(seed=1, collections=3)
        self.path = write_dataset_folder(scene.dataset, Path(folder.name) / "data", name="scene")
        self.dataset = read_dataset(self.path)
        (self.pattern,) = self.dataset.patterns.values()
        self.board = board_edge(self.pattern)
        self.mount = list(self.dataset.sensors.values())[1].edge
        self.shown, self.drawn = {}, []
        rospy.Subscriber(f"{NODE}/update_full", InteractiveMarkerInit, self.init)
        rospy.Subscriber(f"{NODE}/data", MarkerArray, lambda m: self.drawn.append(m.markers))
        self.buffer = tf2_ros.Buffer()
        self.listener = tf2_ros.TransformListener(self.buffer)
        self.feedback = rospy.Publisher(
            f"{NODE}/feedback", InteractiveMarkerFeedback, queue_size=10
        )

    def init(self, message):
        self.shown = {marker.name: marker for marker in message.markers}

    def launch(self, **arguments):
        words = [f"{name}:={value}" for name, value in arguments.items()]
        return subprocess.Popen(
            [
                "roslaunch",
                "atom_calibration",
                "transform_corrector.launch",
                f"json:={self.path}",
                f"parents:={self.mount.parent}",
                f"children:={self.mount.child}",
                f"patterns:={self.pattern.name}",
                "rviz:=false",
                *words,
            ],
        )

    def call(self, name):
        rospy.wait_for_service(f"{NODE}/{name}", PATIENCE_S)
        answer = rospy.ServiceProxy(f"{NODE}/{name}", Trigger)()
        self.assertTrue(answer.success, answer.message)
        return answer.message

    def drag(self, edge, matrix):
        for event in (InteractiveMarkerFeedback.POSE_UPDATE, InteractiveMarkerFeedback.MOUSE_UP):
            message = InteractiveMarkerFeedback(
                client_id="rviz",
                marker_name=str(edge),
                event_type=event,
                pose=pose_message(matrix),
            )
            message.header.frame_id = edge.parent
            self.feedback.publish(message)
        self.wait_for(edge, matrix)

    def wait_for(self, edge, expected):
        def there():
            try:
                found = self.buffer.lookup_transform(edge.parent, edge.child, rospy.Time(0))
            except tf2_ros.TransformException:
                return False
            return np.allclose(transform_matrix(found), expected, atol=1e-6)

        until(there, f"transform {edge}")

    def test_dragged_undone_and_saved(self):
        process = self.launch(reference_collection=next(iter(self.dataset.collections)))
        try:
            until(lambda: {str(self.mount), str(self.board), "menu"} <= set(self.shown), "markers")
            until(lambda: self.feedback.get_num_connections(), "the node hears feedback")
            keys = list(self.dataset.collections)
            before = self.dataset.collections[keys[0]].transforms[self.mount]
            self.wait_for(self.mount, before)
            self.drag(self.mount, MOVED)
            self.call("undo")
            self.wait_for(self.mount, before)
            self.assertIn(keys[1], self.call("next"))
            self.drag(self.board, MOVED)
            self.assertIn("dataset_corrected.json", self.call("save"))
            wanted = {"clouds", "labels", "board", "reference"}
            until(lambda: wanted <= {m.ns for m in self.drawn[-1]}, f"{wanted} are drawn")
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(timeout=60)
        corrected = read_dataset(self.path.with_name("dataset_corrected.json"))
        boards = [corrected.collections[key].transforms[self.board] for key in keys]
        np.testing.assert_allclose(boards[1], MOVED, atol=1e-9)
        self.assertFalse(np.allclose(boards[0], MOVED))
        for key in keys:
            mount = corrected.collections[key].transforms[self.mount]
            np.testing.assert_allclose(mount, before, atol=1e-12)
        stands = self.path.with_name("dataset_corrected.json").read_bytes()
        again = self.launch()
        until(lambda: again.poll() is not None, "the launch ends, as the file exists already")
        self.assertEqual(self.path.with_name("dataset_corrected.json").read_bytes(), stands)


if __name__ == "__main__":
    rospy.init_node("drag_transforms")
    rosunit.unitrun("atom_calibration", "drag_transforms", TransformCorrectorTest, sysargs=sys.argv)
