#!/usr/bin/env python3
"""The panel on a small screen: of no page anything is cut or hidden, and clicks reach their nodes.

The panel itself tells what is cut (ATOM_PANEL_GEOMETRY), by the geometry of its widgets.
"""

import os
import sys
import tempfile
import time
import unittest
from pathlib import Path

import rospkg
import rospy
import rosunit
import yaml

FOLDER = Path(__file__).resolve().parent
sys.path[:0] = [str(FOLDER), f"{rospkg.RosPack().get_path('atom_calibration')}/tests"]

from panel_scene import LARGE, MANY_KEYS, WRONG, PanelScene  # noqa: E402
from screen import Screen, end, middle  # noqa: E402
from workflow_tools import heard_by, wait_until  # noqa: E402

from atom_calibration.configure.window import Side, window_state  # noqa: E402

SIZE = (1280, 800)
PAGES = ("collect", "calibrate", "labels", "first_guess")
WRONG_COLOUR = (190, 50, 20)
IN_A_TABLE = (240, 240)  # on the screen, on every page


class PanelTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("panel_test")
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.geometry = Path(folder.name) / "geometry"
        cls.scene = PanelScene()
        cls.screen = Screen(*SIZE)
        cls.addClassCleanup(cls.screen.close)
        cls.screen.environment["ATOM_PANEL_GEOMETRY"] = str(cls.geometry)
        layout = Path(folder.name) / "panel.rviz"
        layout.write_text(yaml.safe_dump(panel_layout()), encoding="utf-8")
        with (Path(folder.name) / "rviz.log").open("w") as log:
            words = ["-d", str(layout), "__name:=rviz"]
            cls.rviz = cls.screen.run_rviz(words, log)
        cls.addClassCleanup(end, cls.rviz)
        topics = ("/collect_data/state", "/calibrate/state", "/set_initial_estimate/state")
        wait_until(lambda: set(topics) <= heard_by("/rviz"), "RViz listens")

    def test_1_of_no_page_anything_is_cut_or_hidden(self):
        cut = {}
        for number, page in enumerate(PAGES):
            self.turn_to(number + 1)
            cut[page] = self.cut_parts()
            self.save(page)
        self.assertEqual(cut, {page: [] for page in PAGES})

    def test_2_s_on_the_page_of_the_first_guess_saves_it(self):
        self.turn_to(4)
        self.screen.key("s")
        wait_until(lambda: self.scene.calls, "the call", seconds=30.0)
        self.assertEqual(self.scene.calls, [("save guess",)])

    def test_3_a_click_on_a_bar_leaves_out_what_it_stands_for(self):
        self.scene.calls.clear()
        self.turn_to(2)
        place = self.screen.wait_for(WRONG_COLOUR)
        left, top, right, bottom = self.largest(WRONG_COLOUR, place)
        self.screen.click(*middle((left, top, right, bottom)))
        wait_until(lambda: self.scene.calls, "the call", seconds=30.0)
        self.assertEqual(self.scene.calls, [(*WRONG, True)])

    def test_4_twelve_sensors_and_120_collections_fit_into_a_small_screen(self):
        self.scene.show(LARGE, MANY_KEYS)
        for number, page in enumerate(PAGES):
            self.turn_to(number + 1)
            self.assertEqual(self.cut_parts(is_beyond_the_window), [], page)
            self.save(f"large_{page}")

    def test_5_what_lies_beyond_the_screen_is_told(self):
        self.screen.do("search", "--onlyvisible", "--name", "RViz", "windowmove", SIZE[0] // 2, 100)
        wait_until(lambda: "beyond the screen" in self.geometry.read_text("utf-8"), "the geometry")

    def turn_to(self, page):
        self.screen.click(*IN_A_TABLE)
        self.screen.key(f"ctrl+{page}")

    def cut_parts(self, counts=bool):
        """What the panel says once it has settled, as far as it counts."""
        for _ in range(10):
            begin_s = time.time()
            wait_until(
                lambda b=begin_s: (
                    self.geometry.exists() and self.geometry.stat().st_mtime > b + 1.5
                ),
                "the geometry",
            )
            parts = list(filter(counts, self.geometry.read_text(encoding="utf-8").splitlines()))
            if not parts:
                break
        return parts

    def largest(self, colour, place):
        """The bar of a colour that also has a word in the legend above."""
        left, top, right, bottom = place
        picture = self.screen.picture()
        rows = (picture[top : bottom + 1, left : right + 1] == colour).all(axis=2).sum(axis=1)
        low = max(i for i in range(len(rows)) if rows[i] > 0)
        columns = (picture[top + low, left : right + 1] == colour).all(axis=1).nonzero()[0]
        high = low
        while rows[high - 1] > 0:
            high -= 1
        return left + columns[0], top + high, left + columns[-1], top + low

    def save(self, page):
        folder = os.environ.get("ATOM_RVIZ_PICTURES")
        if folder:
            self.screen.save(Path(folder) / f"panel_{page}.png")


def is_beyond_the_window(part):
    """Tell whether a part is lost; bars and maps stand in areas of their own, and are scrolled."""
    return "window" in part and not part.startswith(("bars:", "guidance:"))


def panel_layout():
    """The window as configurations have it, without data."""
    return {
        "Panels": [
            {"Class": "rviz/Displays", "Name": "Displays"},
            {"Class": "atom_rviz_plugins/AtomPanel", "Name": "ATOM", "Page": 0},
        ],
        "Visualization Manager": {
            "Displays": [],
            "Global Options": {"Fixed Frame": "world", "Frame Rate": 5},
            "Tools": [{"Class": "rviz/MoveCamera"}],
        },
        "Window Geometry": {
            "ATOM": {"collapsed": False},
            "Displays": {"collapsed": False},
            "QMainWindow State": window_state(Side(["ATOM", "Displays"], 480), Side([], 0)),
            "X": 0,
            "Y": 0,
            "Width": 1600,
            "Height": 1000,
        },
    }


if __name__ == "__main__":
    rosunit.unitrun("atom_rviz_plugins", "rviz_panel", PanelTest)
