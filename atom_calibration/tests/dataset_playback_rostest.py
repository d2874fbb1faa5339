#!/usr/bin/env python3
"""dataset_playback.launch, driven by what RViz sends: labels corrected, undone, saved, refused."""

import contextlib
import json
import os
import signal
import sys
import tempfile
import threading
import time
import unittest
import xmlrpc.client
from pathlib import Path

import numpy as np
import rosgraph
import rospy
import rosunit
import tf2_ros
from geometry_msgs.msg import Point32, PointStamped, PolygonStamped
from live_scene import Process
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
    write_scene,
)
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import InteractiveMarkerFeedback, InteractiveMarkerInit
from waiting import soon, until

from atom_calibration.messages.clouds import cloud_xyz, point_cloud
from atom_calibration.messages.images import colour_image, depth_image
from atom_calibration.messages.poses import transform_matrix
from atom_calibration.msg import CollectionStates, PlaybackState
from atom_calibration.show.annotation import BORDER_RGB, INSIDE_RGB
from atom_calibration.srv import DeleteLabel, SelectPattern, ShowCollection
from atom_core.io.dataset_json import read_dataset
from atom_core.labeling.depth import DepthLabeler

NODE = "/dataset_playback"
CHOSEN = {
    "inside": "/rviz/selected_points",
    "border": "/rviz/selected_border_points",
    "remove": "/rviz/selected_remove_points",
    "clear": "/rviz/selected_clear_all_points",
}
KINDS = {
    "next": Trigger,
    "previous": Trigger,
    "undo": Trigger,
    "redo": Trigger,
    "reset": Trigger,
    "save": Trigger,
    "polygon_removes_border": SetBool,
    "delete_label": DeleteLabel,
    "show_collection": ShowCollection,
    "select_pattern": SelectPattern,
}
START_S = 60  # until the node has started


class DatasetPlaybackTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.path = write_scene(Path(folder.name) / "data")
        cls.output = cls.path.with_name("dataset_corrected.json")
        cls.dataset = read_dataset(cls.path)
        cls.sensors = cls.dataset.sensors
        cls.states, cls.latest = [], {}
        rospy.Subscriber(f"{NODE}/state", PlaybackState, cls.states.append)
        cls.hear(f"{NODE}/collections", CollectionStates)
        cls.hear(f"{NODE}/update_full", InteractiveMarkerInit)
        for name, sensor in cls.sensors.items():
            kind = PointCloud2 if name == LIDAR else Image
            cls.hear(sensor.topic, kind)
            if name != LIDAR:
                cls.hear(f"{sensor.topic}/labeled2d", Image)
            if name in (LIDAR, DEPTH):
                cls.hear(f"{sensor.topic}/labeled3d", PointCloud2)
        cls.hear("/depth_1/camera_info", CameraInfo)
        cls.buffer = tf2_ros.Buffer()
        cls.listener = tf2_ros.TransformListener(cls.buffer)
        cls.publishers = {
            name: rospy.Publisher(topic, PointCloud2, queue_size=5)
            for name, topic in CHOSEN.items()
        }
        for sensor in (CAMERA, DEPTH):
            for ending, kind in (
                ("mouse_click", PointStamped),
                ("right_click", PointStamped),
                ("polygon", PolygonStamped),
            ):
                topic = f"{cls.sensors[sensor].topic}/labeled2d/{ending}"
                cls.publishers[(sensor, ending)] = rospy.Publisher(topic, kind, queue_size=5)
        cls.feedback = rospy.Publisher(f"{NODE}/feedback", InteractiveMarkerFeedback, queue_size=5)
        cls.launch = cls.start()
        cls.addClassCleanup(lambda: cls.launch.end())
        rospy.wait_for_service(f"{NODE}/save", START_S)
        until(lambda: cls.states, "the state")
        for name, publisher in [*cls.publishers.items(), ("feedback", cls.feedback)]:
            until(publisher.get_num_connections, f"the node hears {name}")

    @classmethod
    def start(cls, *words):
        return Process(
            "roslaunch",
            "atom_calibration",
            "dataset_playback.launch",
            f"dataset:={cls.path}",
            "rviz:=false",
            *words,
        )

    @classmethod
    def hear(cls, topic, kind):
        rospy.Subscriber(topic, kind, lambda m: cls.latest.update({topic: m}), buff_size=2**24)

    def setUp(self):
        self.assertTrue(self.launch.is_running(), "the node has ended")
        self.call("show_collection", collection_name=SECOND)
        if self.state.polygon_removes_border:
            self.call("polygon_removes_border", data=False)

    def tearDown(self):
        while self.state.undo_steps:
            self.call("undo")

    # --- helpers ------------------------------------------------------------------------------

    @property
    def state(self):
        return self.states[-1]

    def after(self, act):
        """Do something that the node tells about; return its state then."""
        count = len(self.states)
        act()
        until(lambda: len(self.states) > count, "a new state")
        return self.state

    def call(self, name, **values):
        answers = []
        self.after(
            lambda: answers.append(rospy.ServiceProxy(f"{NODE}/{name}", KINDS[name])(**values))
        )
        (answer,) = answers
        self.assertTrue(answer.success, answer.message)
        return answer.message

    def refused(self, name, **values):
        answer = rospy.ServiceProxy(f"{NODE}/{name}", KINDS[name])(**values)
        self.assertFalse(answer.success)
        return answer.message

    def header(self, sensor):
        """The header of what is shown of a sensor, once it is shown."""
        return self.shown(sensor, "" if sensor == LIDAR else "/labeled2d").header

    def shown(self, sensor, ending=""):
        """The message on a topic of a sensor, once it is of the collection that is shown."""
        document = self.dataset.document["collections"][self.state.collection]
        stamp = document["data"][sensor]["header"]["stamp"]
        topic = f"{self.sensors[sensor].topic}{ending}"

        def there():
            message = self.latest.get(topic)
            secs = message and (message.header.stamp.secs, message.header.stamp.nsecs)
            return message if secs == (stamp["secs"], stamp["nsecs"]) else None

        return until(there, f"collection {self.state.collection} on {topic}")

    def choose(self, kind, indices, header=None, field="index"):
        """Publish chosen points as the tool does; return the state after it."""
        header = header or self.header(LIDAR)
        points = np.zeros(len(indices), [(a, "<f4") for a in "xyz"] + [(field, "<u4")])
        points[field] = indices
        fields = [PointField(a, 4 * i, 7, 1) for i, a in enumerate("xyz")]
        message = PointCloud2(
            header=header,
            height=1,
            width=len(points),
            point_step=16,
            is_dense=True,
            row_step=16 * len(points),
            fields=[*fields, PointField(field, 12, 6, 1)],
            data=points.tobytes(),
        )
        return self.after(lambda: self.publishers[kind].publish(message))

    def click(self, sensor, pixel, button="mouse_click", header=None):
        message = PointStamped(header=header or self.header(sensor))
        message.point.x, message.point.y = pixel
        return self.after(lambda: self.publishers[(sensor, button)].publish(message))

    def draw(self, sensor, polygon, header=None):
        message = PolygonStamped(header=header or self.header(sensor))
        message.polygon.points = [Point32(x, y, 0.0) for x, y in polygon]
        return self.after(lambda: self.publishers[(sensor, "polygon")].publish(message))

    def label(self, sensor, path=None, key=None):
        """Return a label of a file; of the dataset when no file is named."""
        collection = (read_dataset(path) if path else self.dataset).collections[
            key or self.state.collection
        ]
        return collection.labels.get((sensor, PATTERN))

    def saved(self, sensor, key=None):
        self.call("save")
        return self.label(sensor, self.output, key)

    def told(self, sensor):
        (found,) = [entry for entry in self.state.labels if entry.sensor == sensor]
        return found

    def coloured(self, sensor):
        """Return the labeled points that RViz shows: (inside, border) by `idx`."""
        points = point_cloud(self.shown(sensor, "/labeled3d"))
        border = points["rgb"] == BORDER_RGB
        self.assertTrue(np.all(border | (points["rgb"] == INSIDE_RGB)))
        return set(points["idx"][~border]), set(points["idx"][border])

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
        self.assertIn("exists already; add --overwrite", refused.output)
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
