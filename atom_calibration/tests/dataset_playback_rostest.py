#!/usr/bin/env python3
"""dataset_playback.launch, driven by what RViz sends: labels corrected, undone, saved, refused."""

import contextlib
import json
import os
import signal
import sys
import threading
import time
import xmlrpc.client

import numpy as np
import rosgraph
import rospy
import rosunit
from playback_case import KINDS, NODE, START_S, PlaybackCase
from playback_scene import (
    CAMERA,
    DEPTH,
    FIRST,
    FOURTH,
    LIDAR,
    PATTERN,
    SECOND,
    THIRD,
    around,
)
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import InteractiveMarkerFeedback
from waiting import soon, until

from atom_calibration.messages.clouds import cloud_xyz, point_cloud
from atom_calibration.messages.images import colour_image, depth_image
from atom_calibration.messages.poses import transform_matrix
from atom_calibration.srv import DeleteLabel
from atom_core.io.annotations import annotation_path, read_lines
from atom_core.io.dataset_json import read_dataset
from atom_core.labeling.depth import DepthLabeler


class DatasetPlaybackTest(PlaybackCase):
    # --- what is shown ------------------------------------------------------------------------

    def test_00_data_labels_and_transforms_of_a_collection_are_shown(self):
        cloud = cloud_xyz(point_cloud(self.shown(LIDAR)))
        np.testing.assert_array_equal(cloud, self.dataset.data.read(SECOND, LIDAR))
        depth = depth_image(self.shown(DEPTH))
        np.testing.assert_array_equal(depth, self.dataset.data.read(SECOND, DEPTH))
        for name in (LIDAR, DEPTH):
            label = self.label(name)
            border = set(label.limit_indices)
            until(
                lambda n=name, i=set(label.indices) - border, b=border: self.coloured(n) == (i, b),
                f"labels of {name}",
            )

        def transforms_are_those_of_the_collection():
            for edge, matrix in self.dataset.collections[SECOND].transforms.items():
                found = self.buffer.lookup_transform(edge.parent, edge.child, rospy.Time(0))
                np.testing.assert_allclose(transform_matrix(found), matrix, atol=1e-9)

        soon(transforms_are_those_of_the_collection)
        for name in (CAMERA, DEPTH):
            blue, green, red = np.moveaxis(
                colour_image(self.shown(name, "/labeled2d")).astype(int), 2, 0
            )
            drawn = (green - red > 60) & (green - blue > 60)  # corners, and pixels on the board
            self.assertGreater(np.sum(drawn), 500, name)
        until(lambda: "/depth_1/camera_info" in self.latest, "intrinsics")

    def test_01_figures_of_each_label_are_told(self):
        self.assertEqual(self.state.collection, SECOND)
        self.assertEqual((self.state.number, self.state.collections), (2, 4))
        corners, points = self.told(CAMERA), self.told(LIDAR)
        self.assertEqual(corners.points, len(self.label(CAMERA).ids))
        self.assertEqual(corners.unit, "px")
        self.assertLess(corners.rms, 0.6)  # 0.3 px of noise along each axis
        self.assertGreaterEqual(corners.worst, corners.rms)
        self.assertEqual(points.points, len(self.label(LIDAR).indices))
        self.assertEqual(points.border_points, len(self.label(LIDAR).limit_indices))
        self.assertLess(points.rms, 0.02)
        matrix = until(lambda: self.latest.get(f"{NODE}/collections"), "collections").collections
        self.assertEqual([entry.name for entry in matrix], [FIRST, SECOND, THIRD, FOURTH])
        self.assertEqual({d.sensor for d in matrix[0].detections}, {LIDAR, DEPTH})

    def test_02_a_wrong_corner_stands_out(self):
        number = int(self.label(CAMERA).ids[7])
        place = self.label(CAMERA).pixels[7]
        self.click(CAMERA, place)
        self.click(CAMERA, place + [9.0, 0.0])
        found = self.told(CAMERA)
        self.assertTrue(found.corrected)
        self.assertEqual(found.worst_item, number)
        self.assertGreater(found.worst, 6.0)

    # --- points -------------------------------------------------------------------------------

    def test_10_chosen_points_become_labels(self):
        before = self.label(LIDAR)
        size = len(self.dataset.data.read(SECOND, LIDAR))
        free = np.setdiff1d(np.arange(size), before.indices)
        state = self.choose("inside", free[:5])
        self.assertFalse(state.failed, state.message)
        state = self.choose("border", free[5:8])
        self.assertEqual(state.undo_steps, 2)
        self.choose("remove", before.indices[:2])
        inside = (set(before.indices[2:]) | set(free[:8])) - set(before.limit_indices)
        border = (set(before.limit_indices) | set(free[5:8])) - set(before.indices[:2])
        until(lambda: self.coloured(LIDAR) == (inside - border, border), "labels in RViz")
        label = self.saved(LIDAR)
        self.assertEqual(set(label.indices), inside | border)
        self.assertEqual(set(label.limit_indices), border)
        self.choose("clear", [0])
        self.assertIsNone(self.saved(LIDAR))
        self.assertFalse(self.told(LIDAR).detected)
        for _ in range(4):
            self.call("undo")
        self.call("save")
        self.assertEqual(self.output.read_bytes(), self.path.read_bytes())
        for _ in range(3):
            self.call("redo")
        self.assertEqual(set(self.saved(LIDAR).limit_indices), border)

    def test_11_labeled_points_may_be_chosen_themselves(self):
        before = self.label(DEPTH)
        self.choose("remove", before.limit_indices[:40], self.header(DEPTH), field="idx")
        kept = before.limit_indices[40:]
        np.testing.assert_array_equal(self.saved(DEPTH).limit_indices, kept)

    # --- pictures -----------------------------------------------------------------------------

    def test_20_a_polygon_is_filled_anew(self):
        labeler = DepthLabeler(self.sensors[DEPTH], self.dataset.patterns[PATTERN])
        automatic = labeler.label(self.dataset.data.read(SECOND, DEPTH)).label
        polygon = around(self.label(DEPTH), self.sensors[DEPTH].camera.width)
        self.call("delete_label", sensor=DEPTH, pattern_name=PATTERN)
        self.assertIsNone(self.saved(DEPTH))
        state = self.draw(DEPTH, polygon)
        self.assertFalse(state.failed, state.message)
        self.assert_alike(self.saved(DEPTH), automatic)
        self.call("undo")
        self.click(DEPTH, polygon.mean(axis=0))  # or from a click
        self.assert_alike(self.saved(DEPTH), automatic)

    def assert_alike(self, one, other):
        for name in ("indices", "limit_indices"):
            first, second = getattr(one, name), getattr(other, name)
            common = len(np.intersect1d(first, second))
            self.assertGreater(common, 0.95 * len(np.union1d(first, second)), name)

    def test_21_or_takes_its_border_pixels_away(self):
        before, width = self.label(DEPTH), self.sensors[DEPTH].camera.width
        self.call("polygon_removes_border", data=True)
        self.assertTrue(self.state.polygon_removes_border)
        corners = around(before, width)
        middle = corners.mean(axis=0)
        left = np.minimum(corners, [middle[0], np.inf])
        self.draw(DEPTH, left)
        label, column = self.saved(DEPTH), before.limit_indices % width
        kept = np.isin(before.limit_indices, label.limit_indices)
        self.assertTrue(np.all(kept[column > middle[0] + 1]))
        self.assertFalse(np.any(kept[column < middle[0] - 1]))
        np.testing.assert_array_equal(label.indices, before.indices)

    def test_22_corners_are_moved_and_removed(self):
        before = self.label(CAMERA)
        self.click(CAMERA, before.pixels[0] + [2.0, 1.0])
        self.assertIn(f"corner {before.ids[0]} is chosen", self.state.message)
        self.assertEqual(self.state.undo_steps, 0)
        self.click(CAMERA, before.pixels[0] + [1.25, -0.5])
        self.click(CAMERA, before.pixels[5] + [1.0, 0.0], "right_click")
        label = self.saved(CAMERA)
        np.testing.assert_array_equal(label.ids, np.delete(before.ids, 5))
        moved = np.delete(before.pixels, 5, axis=0)
        np.testing.assert_allclose(label.pixels[0], moved[0] + [1.25, -0.5], atol=1e-9)
        np.testing.assert_array_equal(label.pixels[1:], moved[1:])
        low, high = before.pixels.min(axis=0) - 5, before.pixels.max(axis=0) + 5
        self.draw(CAMERA, [low, [high[0], low[1]], high, [low[0], high[1]]])
        self.assertIsNone(self.saved(CAMERA))
        self.call("reset")
        self.assertFalse(self.told(CAMERA).corrected)
        self.assertEqual(self.saved(CAMERA).ids.tolist(), before.ids.tolist())

    def test_23_a_border_is_drawn_and_saved_for_evaluations(self):
        file = annotation_path(self.path.parent, CAMERA)
        keys, topic = list(self.dataset.collections), f"{self.sensors[CAMERA].topic}/labeled2d"
        self.assertFalse(file.exists())
        before = colour_image(self.shown(CAMERA, "/labeled2d"))
        self.assertIn("n / p: next / previous side", self.stroke(CAMERA, "h").message)
        for pixel in ((20.5, 30.0), (200.0, 35.0)):
            self.stroke(CAMERA, pixel=pixel)
        self.assertIn("top side, 2 points; saved to annotation_", self.state.message)

        def both_are_drawn():  # in the latest picture, which may be of the first point still
            drawn = colour_image(self.latest[topic])
            places = np.nonzero(np.any(drawn != before, axis=2))
            return np.allclose(np.mean(places, axis=1), [32, 110], rtol=0.0, atol=8)

        until(both_are_drawn, "both points in the picture")
        self.stroke(CAMERA, "n")
        self.stroke(CAMERA, pixel=(210.0, 150.0))
        lines = read_lines(file, [PATTERN], PATTERN, self.sensors[CAMERA].camera)
        expected = {"top": [(20.5, 30), (200, 35)], "right": [(200, 35), (210, 150)]}
        self.assertEqual(lines[SECOND], {**expected, "bottom": [], "left": []})
        here = self.header(CAMERA)
        state = self.stroke(CAMERA, ".")
        self.assertEqual(state.collection, keys[(keys.index(SECOND) + 1) % len(keys)])
        state = self.stroke(CAMERA, "c", header=here)  # typed before the picture had changed
        self.assertTrue(state.failed and "another collection" in state.message, state.message)
        self.assertEqual(self.stroke(CAMERA, ",").collection, SECOND)
        self.stroke(CAMERA, "q")
        until(lambda: np.array_equal(colour_image(self.latest[topic]), before), "the picture alone")
        self.assertEqual(self.state.undo_steps, 0)  # no label is touched

    def test_24_a_border_of_images_of_another_size_is_refused_and_kept(self):
        file = annotation_path(self.path.parent, DEPTH)
        text = '{"_metadata": {"version": "2.0", "image_size": [9, 7]}}'
        file.write_text(text)
        state = self.stroke(DEPTH, pixel=(5.0, 5.0))
        self.assertTrue(state.failed)
        self.assertIn("drawn in images of 9 x 7 px", state.message)
        self.assertFalse(self.stroke(DEPTH, "q").failed)  # the mode can be left all the same
        self.assertEqual(file.read_text(), text)

    # --- collections --------------------------------------------------------------------------

    def test_30_going_on_saves(self):
        self.call("delete_label", sensor=LIDAR)
        self.assertTrue(self.state.unsaved)
        self.assertIn("dataset_corrected.json", self.call("next"))
        self.assertEqual(self.state.collection, THIRD)
        self.assertFalse(self.state.unsaved)
        self.assertIsNone(self.label(LIDAR, self.output, SECOND))
        self.assertIsNotNone(self.label(LIDAR, self.output, THIRD))
        self.header(LIDAR)
        self.call("previous")
        self.assertEqual(self.state.collection, SECOND)
        self.call("select_pattern", pattern_name=PATTERN)

    def test_31_the_menu_does_what_the_services_do(self):
        marker = until(
            lambda: (
                f"{NODE}/update_full" in self.latest and self.latest[f"{NODE}/update_full"].markers
            ),
            "the menu",
        )[0]
        entries = {entry.title: entry.id for entry in marker.menu_entries}
        for title, key in (("Next collection", THIRD), ("Previous collection", SECOND)):
            message = InteractiveMarkerFeedback(
                client_id="rviz",
                marker_name=marker.name,
                menu_entry_id=entries[title],
                event_type=InteractiveMarkerFeedback.MENU_SELECT,
            )
            message.header.frame_id = marker.header.frame_id
            self.after(lambda m=message: self.feedback.publish(m))
            self.assertEqual(self.state.collection, key)

    # --- what cannot be done ------------------------------------------------------------------

    def test_40_refusals_are_told_in_one_line_and_lose_nothing(self):
        self.choose("remove", self.label(LIDAR).indices[:2])
        before = self.state
        stale = self.header(LIDAR)
        other = PointCloud2().header
        other.frame_id = "nowhere"
        earlier = PointCloud2().header
        earlier.frame_id, earlier.stamp = stale.frame_id, rospy.Time(12345)
        old_picture = PointCloud2().header
        old_picture.stamp = rospy.Time(12345)
        far = [(900.0, 0.0), (950.0, 0.0), (950.0, 50.0)]
        size = len(self.dataset.data.read(SECOND, LIDAR))
        cases = [
            (lambda: self.choose("inside", [size]), "beyond the data"),
            (lambda: self.choose("inside", [1], other), "frame 'nowhere' are of no range sensor"),
            (lambda: self.choose("inside", [1], self.header(CAMERA)), "are of no range sensor"),
            (lambda: self.choose("clear", [1], earlier), "another collection"),
            (lambda: self.choose("inside", [1], field="number"), "no field 'index'"),
            (lambda: self.draw(DEPTH, far), "outside the image of 640 x 480"),
            (lambda: self.draw(DEPTH, far[:2]), "three corners"),
            (lambda: self.draw(DEPTH, [(5, 5), (9, 5), (9, 9)]), DEPTH),
            (lambda: self.draw(CAMERA, far, old_picture), "another collection"),
            (lambda: self.click(CAMERA, (np.nan, 1.0)), "not a number"),
            (lambda: self.click(CAMERA, (3000.0, 1.0)), "outside its image"),
            (lambda: self.click(CAMERA, (1.0, 1.0), "right_click"), "no corner within 10 px"),
        ]
        for act, words in cases:
            state = act()
            self.assertTrue(state.failed, words)
            self.assertIn(words, state.message)
            self.assertNotIn("\n", state.message)
            self.assertEqual(state.undo_steps, before.undo_steps)
            self.assertEqual(state.labels, before.labels)
        for name, values, words in (
            ("show_collection", {"collection_name": "abc"}, "there is no collection 'abc'"),
            ("delete_label", {"sensor": "abc"}, "there is no sensor 'abc'"),
            ("select_pattern", {"pattern_name": "abc"}, "there is no pattern 'abc'"),
        ):
            self.assertIn(words, self.refused(name, **values))
        label = self.saved(LIDAR)
        np.testing.assert_array_equal(label.indices, self.label(LIDAR).indices[2:])

    def test_41_a_data_file_that_is_absent_is_told_and_the_others_are_shown(self):
        hidden = self.path.with_name(f"{LIDAR}_{FOURTH}.pcd")
        os.rename(hidden, f"{hidden}.away")
        try:
            self.call("show_collection", collection_name=FOURTH)
        finally:
            os.rename(f"{hidden}.away", hidden)
        self.assertIn(hidden.name, self.told(LIDAR).problem)
        self.assertEqual(self.told(LIDAR).points, len(self.label(LIDAR).indices))
        self.assertEqual(self.told(DEPTH).problem, "")
        self.header(DEPTH)
        until(lambda: self.shown(LIDAR).width == 0, "an empty cloud")

    # --- the end ------------------------------------------------------------------------------

    def test_90_a_node_that_ends_saves_and_a_killed_one_leaves_a_whole_file(self):
        self.call("delete_label", sensor=LIDAR)
        self.call("save")
        stands = self.output.read_bytes()
        self.call("delete_label", sensor=DEPTH)
        self.launch.signal(signal.SIGINT)
        self.launch.wait(60)
        self.assertIsNone(self.label(DEPTH, self.output, SECOND))
        self.assertNotEqual(self.output.read_bytes(), stands)
        self.assertEqual(list(self.path.parent.glob(".*.tmp")), [], "temporary files are left over")
        self.assertNotIn("Traceback", self.launch.output)
        stands = self.output.read_bytes()
        refused = self.start()
        type(self).launch = refused  # ended with the class, come what may
        refused.wait(START_S)
        self.assertIn("exists already; add overwrite:=true", refused.output)
        self.assertEqual(self.output.read_bytes(), stands)
        # What was corrected is gone on with.
        again = self.start("overwrite:=true", f"dataset:={self.output}", f"collection:={SECOND}")
        type(self).launch = again
        self.wait_for_start()
        self.assertFalse(self.told(LIDAR).detected)
        again.signal(signal.SIGINT)
        again.wait(60)
        self.assertEqual(self.output.read_bytes(), stands, "nothing was changed, nothing written")
        damaged = self.path.with_name("damaged.json")
        damaged.write_text(json.dumps(self.dataset.document)[:5000], encoding="utf-8")
        type(self).launch = self.start(f"dataset:={damaged}", "output:=/nowhere.json")
        self.launch.wait(START_S)
        self.assertIn("the file is damaged or truncated", self.launch.output)
        self.assertNotIn("Traceback", self.launch.output)
        for seed in range(2):
            self.kill_while_it_saves(seed)

    def wait_for_start(self):
        del self.states[:]
        rospy.wait_for_service(f"{NODE}/save", START_S)
        until(lambda: self.states and self.state.collection == SECOND, "the state")

    def kill_while_it_saves(self, seed):
        type(self).launch = self.start("overwrite:=true", f"collection:={SECOND}")
        self.wait_for_start()
        uri = rosgraph.Master("/correct_labels").lookupNode(NODE)
        pid = xmlrpc.client.ServerProxy(uri).getPid("/correct_labels")[2]

        def save_again_and_again():
            call = {n: rospy.ServiceProxy(f"{NODE}/{n}", KINDS[n]) for n in ("undo", "save")}
            delete = rospy.ServiceProxy(f"{NODE}/delete_label", DeleteLabel)
            with contextlib.suppress(rospy.ServiceException, OSError):  # until it is dead
                while True:
                    delete(sensor=DEPTH)
                    call["save"]()
                    call["undo"]()
                    call["save"]()

        before = self.output.stat().st_mtime_ns
        saving = threading.Thread(target=save_again_and_again)
        saving.start()
        until(lambda: self.output.stat().st_mtime_ns != before, "a file is saved")
        time.sleep(np.random.default_rng(seed).uniform(0.0, 0.2))
        os.kill(pid, signal.SIGKILL)
        saving.join(60)
        self.launch.wait(40)
        self.assertEqual(set(read_dataset(self.output).collections), set(self.dataset.collections))

    def run(self, result=None):
        """The last test ends the node: nothing is undone after it."""
        if self._testMethodName.startswith("test_90"):
            self.tearDown = lambda: None
        return super().run(result)


if __name__ == "__main__":
    rospy.init_node("correct_labels")
    rosunit.unitrun("atom_calibration", "correct_labels", DatasetPlaybackTest, sysargs=sys.argv)
