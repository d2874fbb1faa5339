#!/usr/bin/env python3
"""RViz on a dense screen, where Qt counts one pixel for two by two: what is chosen, and names."""

import sys
import tempfile
import time
import unittest
from pathlib import Path

import numpy as np
import rospkg
import rospy
import rosunit
import yaml
from sensor_msgs.msg import PointCloud2

FOLDER = Path(__file__).resolve().parent
sys.path[:0] = [str(FOLDER), f"{rospkg.RosPack().get_path('atom_calibration')}/tests"]

from scene import LEFT, LEFT_M, NAME, RIGHT, SIDE, SPACING_M, Scene  # noqa: E402
from screen import Screen, end, middle  # noqa: E402
from workflow_tools import wait_until  # noqa: E402

DENSITY = 2
SIZE = (1400, 900)  # of the screen's own pixels
SIZE_OF_NAMES = 40  # of Qt's, in the layout


class DenseTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("dense_test")
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.chosen = []
        rospy.Subscriber("/rviz/selected_points", PointCloud2, cls.chosen.append)
        cls.scene = Scene()
        cls.scene.offer_services()
        cls.screen = Screen(*SIZE)
        cls.addClassCleanup(cls.screen.close)
        cls.screen.environment["QT_SCALE_FACTOR"] = str(DENSITY)
        layout = Path(folder.name) / "view.rviz"
        layout.write_text(yaml.safe_dump(view_alone()), encoding="utf-8")
        with (Path(folder.name) / "rviz.log").open("w") as log:
            cls.rviz = cls.screen.run_rviz(["-d", str(layout)], log)
        cls.addClassCleanup(end, cls.rviz)
        cls.left = cls.screen.wait_for(LEFT)
        cls.right = cls.screen.wait_for(RIGHT)

    def test_1_points_are_chosen_where_they_are_drawn(self):
        self.take_tool("l")
        left, top, right, bottom = self.left
        self.screen.drag((left - 20, top - 20), (right + 20, bottom + 20))
        self.screen.key("p")
        wait_until(lambda: self.chosen, "points")
        (cloud,) = self.chosen
        indices = np.frombuffer(cloud.data, np.uint8).reshape(cloud.width, -1)[:, -4:]
        indices = set(np.ascontiguousarray(indices).view(np.uint32).ravel())
        self.assertEqual(indices, set(range(SIDE, SIDE + SIDE**2)))

    def test_2_a_seed_is_the_point_that_was_clicked(self):
        self.take_tool("d")
        self.screen.click(*middle(self.left))
        wait_until(lambda: self.scene.calls, "the call")
        ((name, position),) = self.scene.calls
        self.assertEqual(name, "seed")
        self.assertLess(np.abs(np.subtract(position, LEFT_M)).max(), 1.01 * SPACING_M)

    def test_3_names_are_as_large_as_other_texts(self):
        like_name = np.all(np.abs(self.screen.picture().astype(int) - NAME) < 90, axis=2)
        rows = np.flatnonzero(like_name.any(axis=1))
        letters_px = rows.max() - rows.min() + 1
        self.assertGreater(letters_px, 0.5 * DENSITY * SIZE_OF_NAMES)

    def take_tool(self, key):
        """Choose a tool by its key, with the mouse in the view."""
        left, top, _, _ = self.right
        self.screen.click(left + 200, top - 100)
        self.screen.key("m")
        time.sleep(0.5)
        self.screen.key(key)
        time.sleep(0.5)


def view_alone():
    """The layout of the plugins without panel and picture, for which there is no room."""
    layout = yaml.safe_load((FOLDER / "plugins.rviz").read_text(encoding="utf-8"))
    layout["Panels"] = []
    manager = layout["Visualization Manager"]
    manager["Displays"] = [d for d in manager["Displays"] if d["Name"] != "Picture"]
    layout["Window Geometry"] = {
        "Hide Left Dock": True,
        "Hide Right Dock": True,
        "X": 0,
        "Y": 0,
        "Width": SIZE[0] // DENSITY - 10,
        "Height": SIZE[1] // DENSITY - 30,
    }
    return layout


if __name__ == "__main__":
    rosunit.unitrun("atom_rviz_plugins", "rviz_dense", DenseTest)
