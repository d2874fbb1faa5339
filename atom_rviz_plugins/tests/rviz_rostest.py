#!/usr/bin/env python3
"""RViz with all plugins, driven by mouse and keys on a screen of its own; checked by topics."""

import os
import sys
import tempfile
import threading
import time
import unittest
from pathlib import Path

import numpy as np
import rosgraph
import rospy
import rosunit
from geometry_msgs.msg import PointStamped, PolygonStamped
from sensor_msgs.msg import PointCloud2

FOLDER = Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER))

from scene import (  # noqa: E402
    BLOCK,
    BLOCK_PX,
    LEFT,
    NAME,
    RIGHT,
    RIGHT_M,
    SCAN,
    SCAN_BEAMS,
    SCAN_LOST,
    SCAN_MIDDLE_M,
    SCAN_RANGE_M,
    SCAN_STEP_RAD,
    SIDE,
    SPACING_M,
    Scene,
)
from screen import Screen, end, middle, style_sheet  # noqa: E402

from atom_calibration.msg import BorderStroke  # noqa: E402

# Colours that nothing else has, for what the mouse has to find.
SAVE, DELETE, AUTOMATIC, SEED, SENSORS, COLLECTIONS, CLICK, POLYGON, IS_AUTOMATIC, BORDER = (
    (1, 200, 100 + i) for i in range(10)
)
NAMES = {
    "save": SAVE,
    "delete": DELETE,
    "automatic": AUTOMATIC,
    "automatic:checked": IS_AUTOMATIC,
    "clear_seed": SEED,
    "click_mode": CLICK,
    "polygon_mode": POLYGON,
    "border_mode": BORDER,
}
TABLES = {"sensors": SENSORS, "collections": COLLECTIONS}
PATIENCE_S = 60.0  # reached by what is broken only, however busy the machine
TOPICS = {
    "inside": "/rviz/selected_points",
    "border": "/rviz/selected_border_points",
    "remove": "/rviz/selected_remove_points",
    "clear": "/rviz/selected_clear_all_points",
}
LEFT_INDICES = set(range(SIDE, SIDE + SIDE**2))  # after the row of NaN
RIGHT_INDICES = set(range(SIDE + SIDE**2, SIDE + 2 * SIDE**2))


class Inbox:
    """Messages of a topic, to be waited for."""

    def __init__(self, topic, kind):
        self._messages = []
        self._there = threading.Condition()
        self._subscriber = rospy.Subscriber(topic, kind, self._take)

    def _take(self, message):
        with self._there:
            self._messages.append(message)
            self._there.notify()

    def next(self, timeout_s=PATIENCE_S):
        with self._there:
            if not self._there.wait_for(lambda: self._messages, timeout_s):
                raise AssertionError(f"nothing came on {self._subscriber.name}")
            return self._messages.pop(0)

    def is_empty(self):
        with self._there:
            return not self._messages


class RvizTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("rviz_test")
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.labels = {name: Inbox(topic, PointCloud2) for name, topic in TOPICS.items()}
        cls.clicks = Inbox("/camera/labeled/mouse_click", PointStamped)
        cls.right_clicks = Inbox("/camera/labeled/right_click", PointStamped)
        cls.polygons = Inbox("/camera/labeled/polygon", PolygonStamped)
        cls.border = Inbox("/camera/labeled/border", BorderStroke)
        cls.scene = Scene()
        cls.screen = Screen()
        cls.addClassCleanup(cls.screen.close)
        cls.log = Path(cls.folder.name) / "rviz.log"
        words = ["-d", str(FOLDER / "plugins.rviz")]
        words += ["-stylesheet", str(style_sheet(cls.folder.name, NAMES, TABLES))]
        with cls.log.open("w") as log:
            cls.rviz = cls.screen.run_rviz(words, log)
        cls.addClassCleanup(end, cls.rviz)
        cls.left = cls.screen.wait_for(LEFT)
        cls.right = cls.screen.wait_for(RIGHT)

    def setUp(self):
        self.scene.calls.clear()

    def tearDown(self):
        folder = os.environ.get("ATOM_RVIZ_PICTURES")
        if folder:
            self.screen.save(Path(folder) / f"{self.id().split('.')[-1]}.png")

    # ---- what there is

    def test_00_every_plugin_is_loaded_and_speaks_its_topics(self):
        wanted_spoken = {*TOPICS.values(), "/camera/labeled/mouse_click", "/camera/labeled/polygon"}
        wanted_heard = {
            "/camera/labeled",
            "/collect_data/state",
            "/collect_data/collections",
            "/calibrate/state",
        }
        end_s, spoken, heard = time.monotonic() + PATIENCE_S, set(), set()
        while not (wanted_spoken <= spoken and wanted_heard <= heard):
            self.assertLess(time.monotonic(), end_s, (wanted_spoken - spoken, wanted_heard - heard))
            publications, subscriptions, _ = rosgraph.Master("/rviz_test").getSystemState()
            spoken = {topic for topic, nodes in publications if "/rviz_test" not in nodes}
            heard = {topic for topic, nodes in subscriptions if set(nodes) - {"/rviz_test"}}
            time.sleep(0.2)

    # ---- the panel

    def test_10_without_a_collector_nothing_can_be_pressed(self):
        self.screen.wait_for(SAVE, there=False)
        self.assertIsNone(self.screen.find(AUTOMATIC))

    def test_11_save_calls_the_collector_once_it_runs(self):
        self.scene.offer_services()
        self.screen.click(*middle(self.screen.wait_for(SAVE)))
        self.wait_for_calls(("save",))

    def test_12_automatic_is_switched_on_and_off(self):
        place = middle(self.screen.wait_for(AUTOMATIC))
        self.screen.click(*place)
        self.wait_for_calls(("automatic", True))
        self.screen.wait_for(IS_AUTOMATIC)  # the collector has told the panel
        self.screen.click(*place)
        self.wait_for_calls(("automatic", True), ("automatic", False))

    def test_12_s_in_the_view_saves_a_collection(self):
        x, y = middle(self.left)
        self.screen.move(x, y - 100)
        self.screen.key("s")
        self.wait_for_calls(("save",))

    def test_13_delete_asks_once_more_and_deletes_the_selected_collection(self):
        self.assertIsNone(self.screen.find(DELETE), "nothing is selected yet")
        self.select_last_row(COLLECTIONS)
        place = middle(self.screen.wait_for(DELETE))
        self.screen.click(*place)
        self.assertEqual(self.scene.calls, [])
        for _ in range(5):  # a second click that comes too late is a first one
            self.screen.click(*place)
            if self.comes_within(10.0):  # so long it would not wait for a second one
                break
            self.screen.click(*place)
        self.wait_for_calls(("delete", "003"))

    def test_14_seed_of_the_selected_sensor_is_cleared(self):
        left, _, _, bottom = self.screen.wait_for(SENSORS)  # as high as its rows are
        self.screen.click(left + 10, bottom - 5)
        self.screen.click(*middle(self.screen.wait_for(SEED)))
        self.wait_for_calls(("seed", ()))

    # ---- points

    def test_20_dragged_points_are_published_by_the_key(self):
        self.take_tool("l")
        self.drag_around(self.left)
        for key, name in (("p", "inside"), ("b", "border"), ("r", "remove"), ("c", "clear")):
            self.screen.key(key)
            cloud = self.labels[name].next()
            self.assertEqual(self.indices(cloud), LEFT_INDICES, name)
            self.assertEqual(cloud.header.frame_id, "lidar")
        for name, inbox in self.labels.items():
            self.assertTrue(inbox.is_empty(), name)

    def test_21_shift_is_border_and_control_is_remove(self):
        self.take_tool("l")
        self.drag_around(self.right, held="shift")
        self.assertEqual(self.indices(self.labels["border"].next()), RIGHT_INDICES)
        self.drag_around(self.right, held="ctrl")
        self.assertEqual(self.indices(self.labels["remove"].next()), RIGHT_INDICES)
        self.assertTrue(self.labels["inside"].is_empty())

    def test_22_half_a_patch_is_the_half_that_is_seen(self):
        self.take_tool("l")
        left, top, right, bottom = self.left
        half = top + (bottom - top + 1) / 2
        self.screen.drag((left - 10, top - 10), (right + 10, half))
        self.screen.key("p")
        # Up in the view is y of world, which is x of the cloud: the patch's rows.
        upper = {index for index in LEFT_INDICES if (index - SIDE) // SIDE >= SIDE // 2}
        self.assertEqual(self.indices(self.labels["inside"].next()), upper)

    def test_23_a_click_with_the_seed_tool_is_the_point_in_the_cloud(self):
        self.take_tool("d")
        self.screen.click(*middle(self.right))
        self.comes_within(PATIENCE_S)
        self.assertEqual([call[0] for call in self.scene.calls], ["seed"])
        error_m = np.abs(np.subtract(self.scene.calls[0][1], RIGHT_M))
        self.assertLess(error_m.max(), 1.01 * SPACING_M)

    def test_24_a_click_into_empty_space_sets_no_seed(self):
        self.take_tool("d")
        self.screen.click(self.left[0] - 60, self.left[1] - 60)
        time.sleep(1.0)
        self.assertEqual(self.scene.calls, [])

    def test_25_points_of_a_scan_are_the_places_of_their_beams(self):
        self.take_tool("l")
        self.drag_around(self.screen.wait_for(SCAN))
        self.screen.key("b")
        cloud = self.labels["border"].next()
        self.assertEqual(self.indices(cloud), set(range(SCAN_LOST, SCAN_BEAMS)))
        self.assertEqual(cloud.header.frame_id, "scanner")

    def test_26_a_click_on_a_scan_is_a_seed(self):
        self.take_tool("d")
        self.screen.click(*middle(self.screen.wait_for(SCAN)))
        self.comes_within(PATIENCE_S)
        self.assertEqual([call[0] for call in self.scene.calls], ["seed"])
        error_m = np.abs(np.subtract(self.scene.calls[0][1], SCAN_MIDDLE_M))
        self.assertLess(error_m.max(), 1.01 * SCAN_RANGE_M * SCAN_STEP_RAD)

    # ---- names

    def test_27_a_name_is_seen_through_what_would_hide_it(self):
        left, top, right, bottom = self.left
        patch = self.screen.picture()[top : bottom + 1, left : right + 1].astype(int)
        like_name = np.all(np.abs(patch - NAME) < 90, axis=2)
        self.assertGreater(like_name.sum(), 50, "its letters are drawn over the patch")

    # ---- the picture

    def test_30_clicks_are_pixels_of_the_picture_fitted_and_zoomed(self):
        self.screen.click(*middle(self.screen.wait_for(CLICK)))
        for notches in (0, 4, 8):
            for _ in range(notches and 4):
                self.screen.click(*middle(self.screen.find(BLOCK)), button=4)
            place = self.screen.wait_for(BLOCK)
            self.check_click(place, (0, 0))
            self.check_click(place, (1, 1))
        for _ in range(8):
            self.screen.click(*middle(self.screen.find(BLOCK)), button=5)

    def test_31_a_polygon_is_published_when_it_is_closed(self):
        self.screen.click(*middle(self.screen.wait_for(POLYGON)))
        left, top, right, bottom = self.screen.wait_for(BLOCK)
        corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
        for corner in corners:
            self.screen.click(*corner)
        self.assertTrue(self.polygons.is_empty())
        self.screen.key("Return")
        polygon = self.polygons.next()
        self.assertEqual(polygon.header.frame_id, "camera")
        block_left, block_top, width, height = BLOCK_PX
        found = np.array([(point.x, point.y) for point in polygon.polygon.points])
        truth = np.array([(0, 0), (width, 0), (width, height), (0, height)], float)
        truth += np.array([block_left, block_top]) - 0.5
        pixel = width / (right - left + 1)  # of the screen, in px
        self.assertEqual(found.shape, (4, 2))
        self.assertLess(np.abs(found - truth).max(), 1.6 * pixel)
        self.assertTrue(self.clicks.is_empty())

    def test_32_escape_forgets_a_polygon_and_right_closes_one(self):
        self.screen.click(*middle(self.screen.wait_for(POLYGON)))
        left, top, right, bottom = self.screen.wait_for(BLOCK)
        self.screen.click(left, top)
        self.screen.key("Escape")
        for corner in [(right, top), (right, bottom), (left, bottom)]:
            self.screen.click(*corner)
        self.screen.click(left, bottom, button=3)
        self.assertEqual(len(self.polygons.next().polygon.points), 3)

    def test_33_a_right_click_is_told_apart_from_a_left_one(self):
        self.screen.click(*middle(self.screen.wait_for(CLICK)))
        left, top, right, bottom = self.screen.wait_for(BLOCK)
        self.screen.click(left, top, button=3)
        click = self.right_clicks.next()
        self.assertEqual(click.header.frame_id, "camera")
        block_left, block_top, width, _ = BLOCK_PX
        pixel = width / (right - left + 1)  # of the screen, in px
        found = np.subtract((click.point.x, click.point.y), (block_left - 0.5, block_top - 0.5))
        self.assertLess(np.abs(found - 0.5 * pixel).max(), 1.1 * pixel)
        self.assertTrue(self.clicks.is_empty())

    def test_34_a_border_is_drawn_by_clicks_and_the_keys_of_the_annotation_tool(self):
        self.screen.click(*middle(self.screen.wait_for(BORDER)))
        self.assertEqual(self.border.next().key, "h", "the keys are told at the beginning")
        left, top, right, bottom = self.screen.wait_for(BLOCK)
        self.screen.click(left, top)
        first = self.border.next()
        self.assertEqual((first.header.frame_id, first.key), ("camera", ""))
        self.screen.key("n")
        self.assertEqual(self.border.next().key, "n")
        self.screen.click(right, bottom)
        second = self.border.next()
        block_left, block_top, width, height = BLOCK_PX
        pixel = width / (right - left + 1)  # of the screen, in px
        found = np.array([(stroke.x, stroke.y) for stroke in (first, second)])
        truth = np.array([(0, 0), (width, height)]) + [block_left, block_top] - 0.5
        self.assertLess(np.abs(found - truth).max(), 1.6 * pixel)
        for name in ("s", "q", "period", "comma", "plus", "minus", "u"):  # the first two are none
            self.screen.key(name)
        self.assertEqual([self.border.next().key for _ in range(5)], list(".,+-u"))
        self.assertEqual(self.scene.calls, [], "s saves no collection")
        self.screen.click(*middle(self.screen.wait_for(CLICK)))
        self.assertEqual(self.border.next().key, "q")
        self.assertTrue(self.clicks.is_empty())

    # ---- the end

    def test_90_when_the_collector_ends_nothing_can_be_pressed(self):
        self.scene.withdraw_services()
        self.screen.wait_for(SAVE, there=False)

    def test_99_rviz_ends_cleanly_and_has_nothing_to_complain_about(self):
        end(self.rviz)
        self.assertEqual(self.rviz.returncode, 0)
        log = self.log.read_text(encoding="utf-8").splitlines()
        lines = [line for line in log if "[ERROR]" in line or "[ WARN]" in line]
        self.assertEqual(lines, [])

    # ---- helpers

    def take_tool(self, key):
        x, y = middle(self.left)
        self.screen.move(x, y - 100)
        self.screen.key("Escape")  # the default tool, whichever was taken before
        self.screen.key(key)

    def select_last_row(self, colour):
        left, _, _, bottom = self.screen.wait_for(colour)
        self.screen.click(left + 10, bottom - 5)  # no row is there, but keys are for it now
        self.screen.key("ctrl+End")  # the first key only goes to the first cell
        self.screen.key("ctrl+End")

    def drag_around(self, place, held=None):
        left, top, right, bottom = place
        self.screen.drag((left - 15, top - 15), (right + 15, bottom + 15), held)

    def indices(self, cloud):
        fields = {field.name: field.offset for field in cloud.fields}
        records = np.frombuffer(cloud.data, np.uint8).reshape(cloud.width, cloud.point_step)
        index = records[:, fields["index"] : fields["index"] + 4].copy().view(np.uint32)
        self.assertEqual(len(set(index.ravel())), cloud.width)
        return set(index.ravel().tolist())

    def check_click(self, place, corner):
        """Click the block's first or last screen pixel; it is the same corner in the picture."""
        left, top, right, bottom = place
        block_left, block_top, width, height = BLOCK_PX
        scale = (right - left + 1) / width
        self.screen.click(right if corner[0] else left, bottom if corner[1] else top)
        click = self.clicks.next()
        self.assertEqual(click.header.frame_id, "camera")
        self.assertGreater(click.header.stamp.to_sec(), 0.0)
        truth = (block_left - 0.5 + corner[0] * width, block_top - 0.5 + corner[1] * height)
        inwards = 0.5 / scale * np.array([-1 if part else 1 for part in corner])
        error_px = np.subtract((click.point.x, click.point.y), truth + inwards)
        self.assertLess(np.abs(error_px).max(), 1.1 / scale, f"{scale} screen pixels for a pixel")

    def comes_within(self, seconds):
        """Wait for a call of a service; tell whether there was one."""
        deadline = time.monotonic() + seconds
        while not self.scene.calls and time.monotonic() < deadline:
            time.sleep(0.05)
        return bool(self.scene.calls)

    def wait_for_calls(self, *calls):
        deadline = time.monotonic() + PATIENCE_S
        while len(self.scene.calls) < len(calls) and time.monotonic() < deadline:
            time.sleep(0.05)
        self.assertEqual(self.scene.calls, list(calls))


if __name__ == "__main__":
    rosunit.unitrun("atom_rviz_plugins", "rviz", RvizTest)
