#!/usr/bin/env python3
"""playbag.launch of a package with optimized:=true: the recording with the calibrated mounts."""

import os
import signal
import sys
import tempfile
import unittest

import numpy as np
import rospy
import rosunit
import tf2_ros
from live_scene import Process
from messages import Make
from rosgraph_msgs.msg import Clock
from small_rig import CAMERA_IN_BAG, write_package
from waiting import until

from atom_calibration.configure import configure_package
from atom_calibration.messages.poses import transform_matrix
from atom_core.geometry import se3
from atom_core.io.urdf import read_description, write_calibrated_description
from atom_core.model.transforms import Edge

WITHIN_S, PLAYED_S = 60.0, 1.5
CAMERA, LIDAR = Edge("mast", "camera_link"), Edge("arm", "lidar_base")
CALIBRATED = {
    CAMERA: se3.from_rpy(np.array([0.13, 0.02, -0.01]), np.array([0.01, 0.22, -0.03])),
    LIDAR: se3.from_rpy(np.array([-0.02, 0.12, 0.04]), np.array([0.03, 0.0, 0.1])),
}


class OptimizedPlaybagTest(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.package = write_package(temporary.name, Make, seconds=20.0)
        assert configure_package.main(["-n", str(self.package)]) == 0
        self.clock_s = []
        self.buffer = tf2_ros.Buffer()
        tf2_ros.TransformListener(self.buffer)
        clock = rospy.Subscriber("/clock", Clock, lambda m: self.clock_s.append(m.clock.to_sec()))
        self.addCleanup(clock.unregister)

    def launch(self, *words):
        path = f"{os.environ['ROS_PACKAGE_PATH']}:{self.package.parent}"
        process = Process(
            "env",
            f"ROS_PACKAGE_PATH={path}",
            "roslaunch",
            self.package / "launch" / "playbag.launch",
            "rviz:=false",
            *words,
        )
        self.addCleanup(process.end)
        return process

    def tf(self, edge):
        try:
            return transform_matrix(
                self.buffer.lookup_transform(edge.parent, edge.child, rospy.Time(0))
            )
        except tf2_ros.TransformException:
            return None

    def is_calibrated(self):
        found = {edge: self.tf(edge) for edge in CALIBRATED}
        return all(
            found[edge] is not None and np.allclose(found[edge], matrix, rtol=0, atol=1e-9)
            for edge, matrix in CALIBRATED.items()
        )

    def test_mounts_are_the_calibrated_ones_while_it_is_played(self):
        description = read_description(self.package / "calibration" / "rig.urdf.xacro")
        self.assertFalse(np.allclose(CALIBRATED[CAMERA], CAMERA_IN_BAG))
        write_calibrated_description(
            description, CALIBRATED, self.package / "urdf" / "optimized.urdf.xacro"
        )
        process = self.launch("optimized:=true")
        until(self.is_calibrated, "calibrated transforms", WITHIN_S)
        moving = Edge("odom", "base")
        until(lambda: self.tf(moving) is not None, "what moves comes from the bag", WITHIN_S)
        began = self.clock_s[-1]
        until(lambda: abs(self.clock_s[-1] - began) > PLAYED_S, "the bag plays", WITHIN_S)
        self.assertTrue(self.is_calibrated(), "nobody publishes other mounts")
        self.assertTrue(process.is_running())
        process.signal(signal.SIGINT)
        self.assertEqual(process.wait(30), 0)

    def test_without_a_result_it_says_which_file_is_absent(self):
        process = self.launch("optimized:=true")
        self.assertNotEqual(process.wait(60), 0)
        self.assertIn("optimized.urdf.xacro", process.output)


if __name__ == "__main__":
    rospy.init_node("optimized_playbag")
    rosunit.unitrun("atom_calibration", "optimized_playbag", OptimizedPlaybagTest, sysargs=sys.argv)
