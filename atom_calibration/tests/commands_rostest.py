#!/usr/bin/env python3
"""What a node sees: the suite's packages, its Python modules and the commands of rosrun."""

import os
import subprocess
import sys
import tempfile
import unittest

import rosgraph
import rospkg
import rospy
import rosunit

import atom_core
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes

PACKAGES = (
    "atom",
    "atom_core",
    "atom_calibration",
    "atom_evaluation",
    "atom_batch_execution",
    "atom_rviz_plugins",
    "atom_examples",
    "collab_cell_description",
)
COMMANDS = ("calibrate", "check", "collect_from_bag", "evaluate")


def rosrun(command, *arguments):
    return subprocess.run(
        ["rosrun", "atom_calibration", command, *arguments],
        capture_output=True,
        text=True,
        timeout=120,
    )


class CommandsTest(unittest.TestCase):
    def test_the_interpreter_of_a_node_reaches_the_master_and_the_library(self):
        self.assertTrue(rosgraph.is_master_online())
        self.assertTrue(rospy.core.is_initialized())
        self.assertTrue(atom_core.__version__)

    def test_every_package_is_found(self):
        packages = rospkg.RosPack()
        for name in PACKAGES:
            self.assertTrue(os.path.isfile(os.path.join(packages.get_path(name), "package.xml")))

    def test_every_command_explains_itself(self):
        for command in COMMANDS:
            answer = rosrun(command, "--help")
            self.assertEqual(answer.returncode, 0, answer.stderr)
            option = {"evaluate": "--train", "collect_from_bag": "--bag"}.get(command, "--dataset")
            self.assertIn(option, answer.stdout)

    def test_check_tells_a_sound_dataset_from_one_that_falls_apart(self):
        with tempfile.TemporaryDirectory() as folder:
            for scene, code in ((scenes.two_cameras, 0), (scenes.disconnected, 1)):
                path = os.path.join(folder, scene.__name__)
                dataset = write_dataset_folder(scene().dataset, path, name=scene.__name__)
                answer = rosrun("check", "--dataset", str(dataset))
                self.assertEqual(answer.returncode, code, answer.stdout + answer.stderr)
                self.assertIn("rgb_1", answer.stdout)

    def test_a_missing_dataset_is_refused_in_one_line(self):
        with tempfile.TemporaryDirectory() as folder:
            absent = os.path.join(folder, "dataset.json")
            answer = rosrun("check", "--dataset", absent)
        self.assertEqual(answer.returncode, 2, answer.stderr)
        self.assertEqual(len(answer.stderr.strip().splitlines()), 1, answer.stderr)
        self.assertIn(absent, answer.stderr)


if __name__ == "__main__":
    rospy.init_node("commands_rostest")
    rosunit.unitrun("atom_calibration", "commands", CommandsTest, sysargs=sys.argv)
