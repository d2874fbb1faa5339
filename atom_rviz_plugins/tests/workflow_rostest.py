#!/usr/bin/env python3
"""The workflow in RViz, from a dragged seed to a calibration, by mouse, keys and feedback.

A simulated rig shows a board in four places. Everything is judged by topics and by the files that
are written, and the calibration by the truth.
"""

import json
import os
import signal
import sys
import tempfile
import time
import unittest
from pathlib import Path

import numpy as np
import rospkg
import rospy
import rosunit
import tf2_ros
import yaml
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import MarkerArray

FOLDER = Path(__file__).resolve().parent
sys.path[:0] = [str(FOLDER), f"{rospkg.RosPack().get_path('atom_calibration')}/tests"]

from live_scene import COLLECTIONS, LiveRig, LiveScene, Process  # noqa: E402
from marker_drag import NEAR_M, drag_marker  # noqa: E402
from marker_hand import MarkerHand  # noqa: E402
from orbit_view import OrbitView, cloud, layout  # noqa: E402
from screen import Screen, end, middle, style_sheet  # noqa: E402
from workflow_tools import (  # noqa: E402
    PATIENCE_S,
    Feed,
    Latest,
    Messages,
    heard_by,
    wait_until,
)

from atom_calibration.messages.clouds import point_cloud  # noqa: E402
from atom_calibration.messages.poses import transform_matrix  # noqa: E402
from atom_calibration.msg import (  # noqa: E402
    CalibrationState,
    CollectionStates,
    CollectorState,
    PlaybackState,
    SensorLabels,
)
from atom_core.evaluation.ground_truth import ground_truth_errors  # noqa: E402
from atom_core.geometry import se3  # noqa: E402
from atom_core.io.dataset_json import read_dataset  # noqa: E402
from atom_core.io.seeds import SEEDS_FILE, read_seeds  # noqa: E402
from atom_core.model.dataset import pose  # noqa: E402

KEYS = [f"{number:03d}" for number in range(len(COLLECTIONS))]
CORRECTED = "dataset_corrected.json"
SAVE, SAVE_LABELS = (1, 200, 100), (1, 200, 101)  # the colours of the panel's buttons
LIDAR, DEPTH = "lidar_1", "depth_1"


class WorkflowTest(unittest.TestCase):
    done, rviz, logs = 0, None, []

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = Path(folder.name)
        cls.scene = LiveScene()
        cls.config = cls.scene.write_config(str(cls.folder / "config.yml"))
        cls.dataset_folder = cls.folder / "dataset"
        cls.screen = Screen()
        cls.addClassCleanup(cls.screen.close)
        cls.colours = style_sheet(cls.folder, {"save": SAVE, "save_labels": SAVE_LABELS})
        cls.labels = {n: Latest(f"/{n}/labels", SensorLabels) for n in cls.scene.sensors}
        cls.state = Latest("/collect_data/state", CollectorState)
        cls.collections = Latest("/collect_data/collections", CollectionStates)
        cls.markers = {n: MarkerHand(n) for n in (LIDAR, DEPTH)}
        points = f"{cls.scene.sensors[LIDAR].topic}/labeled"
        cls.labeled_points = Latest(points, PointCloud2)

    def setUp(self):
        """Go on only where the step before was done."""
        number = int(self._testMethodName.split("_")[1])
        if number != type(self).done + 1:
            self.skipTest("a step before has failed")

    def tearDown(self):
        folder = os.environ.get("ATOM_RVIZ_PICTURES")
        if folder:
            self.screen.save(Path(folder) / f"{self._testMethodName}.png")

    def finished(self):
        type(self).done += 1

    # ---- collect

    def test_1_a_seed_is_dragged_and_the_label_appears(self):
        self.start(
            "collect_data.launch",
            f"config:={self.config}",
            f"output_folder:={self.dataset_folder}",
            "automatic_seeds:=off",
            "rviz:=false",
        )
        cls = type(self)
        cls.feed = Feed(LiveRig(self.scene, start_s=float(int(time.time()))), COLLECTIONS[0])
        cls.addClassCleanup(cls.feed.stop)
        wait_until(lambda: all(self.is_detected(n) for n in ("rgb_1", "rgb_2")), self.why)
        wait_until(lambda: all(m.is_ready() for m in self.markers.values()), "markers")
        wait_until(lambda: self.labels[LIDAR].message, self.why)
        self.assertFalse(self.is_detected(LIDAR), "nobody has said where the board is")
        marker, target = self.markers[LIDAR], self.middle_of_board(LIDAR, COLLECTIONS[0])
        topic = self.scene.sensors[LIDAR].topic
        view = self.view_of(marker.position, target)
        content = layout(
            view,
            [
                cloud("Cloud", topic, selectable=False),
                cloud("Labels", f"{topic}/labeled", size_px=4, selectable=False),
                {
                    "Class": "rviz/InteractiveMarkers",
                    "Name": "Seed",
                    "Enabled": True,
                    "Update Topic": f"/{LIDAR}/data_labeler/update",
                    "Enable Transparency": False,
                },
            ],
            ["rviz/Interact"],
            [{"Class": "atom_rviz_plugins/AtomPanel", "Name": "ATOM", "Page": 0}],
        )

        def look():
            self.open_rviz(content)
            view.look_for(self.screen)

        look()
        drag_marker(self.screen, view, self.world_T_sensor(LIDAR), marker, target, look)
        wait_until(lambda: self.is_detected(LIDAR), self.why)
        label = self.labels[LIDAR].message
        np.testing.assert_allclose(label.manual_seed, target, atol=NEAR_M)
        self.check_label(COLLECTIONS[0])
        self.finished()

    def test_2_a_seed_is_moved_by_feedback(self):
        self.markers[DEPTH].drag(self.middle_of_board(DEPTH, COLLECTIONS[0]))
        wait_until(lambda: self.is_detected(DEPTH), self.why)
        pixels = self.labels[DEPTH].message.patterns[0].idxs
        beside_m, z_m = self.scene.on_board(DEPTH, COLLECTIONS[0], pixels)
        self.assertGreater(np.mean((np.abs(z_m) < 0.04) & (beside_m < 0.01)), 0.98)
        self.finished()

    def test_3_the_panels_button_saves_a_collection(self):
        self.save_collection(KEYS[:1])
        self.finished()

    def test_4_so_do_further_places_of_the_board(self):
        for number, key in enumerate(COLLECTIONS[1:], 2):
            self.feed.move_board(key)
            for name, marker in self.markers.items():
                marker.drag(self.middle_of_board(name, key))
            self.save_collection(KEYS[:number])
            self.check_label(key)
        self.finished()

    def test_5_the_dataset_is_whole_when_the_collector_ends(self):
        self.feed.stop()
        self.end_launch()
        dataset = read_dataset(self.dataset_folder / "dataset.json")
        self.assertEqual(list(dataset.collections), KEYS)
        for key, entry in dataset.collections.items():
            self.assertEqual({name for name, _ in entry.labels}, set(self.scene.sensors), key)
        seeds = read_seeds(self.dataset_folder / SEEDS_FILE, self.scene.sensors)
        for name in (LIDAR, DEPTH):
            mine = [seed for seed in seeds if seed.sensor == name]
            self.assertEqual(len(mine), len(COLLECTIONS), name)
        self.finished()

    # ---- correct

    def test_6_a_label_is_corrected_with_the_tool_and_saved_by_the_panel(self):
        dataset = read_dataset(self.dataset_folder / "dataset.json")
        state = Latest("/dataset_playback/state", PlaybackState)
        removed = Latest("/rviz/selected_remove_points", PointCloud2)
        self.start("dataset_playback.launch", f"dataset:={dataset.source}", "rviz:=false")
        wait_until(lambda: state.message, "the state of dataset_playback")
        self.assertEqual(state.message.collection, KEYS[0])
        indices, places = self.label_on_screen(dataset, KEYS[0])
        topic = self.scene.sensors[LIDAR].topic
        view = OrbitView(places.mean(axis=0), self.world_T_sensor(LIDAR)[:3, 3])
        self.open_rviz(
            layout(
                view,
                [
                    cloud("Cloud", topic),
                    cloud("Labels", f"{topic}/labeled3d", size_px=5),
                ],
                ["rviz/MoveCamera", "atom_rviz_plugins/PointLabelTool"],
                [{"Class": "atom_rviz_plugins/AtomPanel", "Name": "ATOM", "Page": 2}],
            )
        )
        view.look_for(self.screen)
        wait_until(lambda: {topic, f"{topic}/labeled3d"} <= heard_by("/rviz"), "RViz has the cloud")
        corner, wanted = self.part_of_label(view.pixel(places), indices)
        for _ in range(10):  # the tool looks twice a second for clouds to choose from
            self.choose(corner)
            self.screen.key("r")
            if removed.comes_within(3.0):
                break
        chosen = set(point_cloud(removed.message)["index"].tolist())
        self.assertEqual(chosen & set(indices), wanted)
        wait_until(lambda: state.message.undo_steps == 1, lambda: state.message.message)
        self.press(SAVE_LABELS, lambda: not state.message.unsaved, state)
        self.check_corrected(dataset, wanted)
        self.press_atoms_keys(corner, state)
        self.finished()

    def press_atoms_keys(self, corner, state):
        """The arrows turn, d says what polygons do, q ends; also with another page in the panel."""
        self.screen.move(*corner[:2])
        self.screen.key("Right")
        wait_until(lambda: state.message.collection == KEYS[1], lambda: state.message.message)
        removes = state.message.polygon_removes_border
        self.screen.do("key", "ctrl+2", "Left", "d")  # not waiting for an answer to the first
        wait_until(lambda: state.message.collection == KEYS[0], lambda: state.message.message)
        wait_until(lambda: state.message.polygon_removes_border != removes, "the key d")
        self.screen.key("q")
        self.assertEqual(self.launch.wait(PATIENCE_S), 0)

    def label_on_screen(self, dataset, key):
        """Return the indices (n,) of the LiDAR's label, and where its points are in the world."""
        (label,) = (x for (name, _), x in dataset.collections[key].labels.items() if name == LIDAR)
        points = dataset.data.read(key, LIDAR)[label.indices]
        return label.indices, se3.apply(self.world_T_sensor(LIDAR), points)

    def part_of_label(self, pixels, indices):
        """Return a rectangle on the screen around a part of a label, and its indices."""
        across = np.sort(pixels[:, 0])
        near = slice(len(across) // 6, len(across) // 2)
        gap = near.start + int(np.argmax(np.diff(across)[near]))
        limit = (across[gap] + across[gap + 1]) / 2
        (left, top), bottom = pixels.min(axis=0) - 12, pixels[:, 1].max() + 12
        return (left, top, limit, bottom), set(indices[pixels[:, 0] < limit].tolist())

    def choose(self, rectangle):
        """Drag the tool "Label points" over a rectangle."""
        left, top, right, bottom = rectangle
        self.screen.move(left, top)
        self.screen.key("Escape")
        self.screen.key("l")
        self.screen.drag((left, top), (right, bottom))

    def check_corrected(self, before, removed):
        """The file has lost exactly these points of one label; nothing else is different."""
        after = read_dataset(self.dataset_folder / CORRECTED)
        for key, collection in before.collections.items():
            for name, label in collection.labels.items():
                now = after.collections[key].labels[name]
                if name[0] not in (LIDAR, DEPTH):
                    np.testing.assert_array_equal(now.pixels, label.pixels)
                    continue
                mine = removed if (key, name[0]) == (KEYS[0], LIDAR) else set()
                self.assertEqual(set(now.indices), set(label.indices) - mine, (key, name))

    # ---- calibrate

    def test_7_a_calibration_is_watched_and_its_result_shown(self):
        output = self.folder / "calibration"
        states = Messages("/calibrate/state", CalibrationState)
        self.start(
            "calibrate.launch",
            f"dataset:={self.dataset_folder / CORRECTED}",
            f"output:={output}",
            "rviz:=false",
            f"wait:={PATIENCE_S}",
            "slow:=0.1",
        )
        shipped = Path(rospkg.RosPack().get_path("atom_calibration")) / "rviz" / "calibrate.rviz"
        self.open_rviz(yaml.safe_load(shipped.read_text("utf-8")))
        wait_until(lambda: states.all and not states.all[-1].running, lambda: states.all[-1:])
        last = states.all[-1]
        self.assertEqual(last.status, "converged", last.message)
        self.assertGreater(len({state.iteration for state in states.all if state.running}), 3)
        for residual in last.residuals:
            self.assertLess(residual.rms, residual.rms_initial, residual)
        boards = rospy.wait_for_message("/calibrate/patterns", MarkerArray, PATIENCE_S)
        shown = {marker.ns for marker in boards.markers}
        self.assertEqual(shown, {f"c{key}" for key in KEYS})
        names = ("state", "patterns", "sensors", "ghost", "points", "images")
        wait_until(
            lambda: {f"/calibrate/{name}" for name in names} <= heard_by("/rviz"),
            lambda: f"RViz hears {heard_by('/rviz')}",
        )
        self.check_calibration(output)
        self.end_launch()
        self.finished()

    def check_calibration(self, output):
        """What is written is near the truth, and tf has it."""
        document = json.loads((output / "calibration.json").read_text("utf-8"))
        self.assertEqual(document["status"], "converged")
        dataset = read_dataset(output / "atom_calibration.json")
        errors = ground_truth_errors(dataset, self.scene.scene.truth)
        self.assertLess(errors.mean.translation_m, 0.004)
        self.assertLess(errors.mean.rotation_deg, 0.1)
        buffer = tf2_ros.Buffer()
        listener = tf2_ros.TransformListener(buffer)
        self.addCleanup(listener.unregister)
        first = next(iter(dataset.collections.values()))
        for sensor in self.scene.sensors.values():
            wanted = pose(first, dataset.graph, dataset.world, sensor.frame)

            def there(frame=sensor.frame, wanted=wanted):
                try:
                    found = buffer.lookup_transform(dataset.world, frame, rospy.Time())
                except tf2_ros.TransformException:
                    return False
                return np.allclose(transform_matrix(found), wanted, atol=1e-6)

            wait_until(there, f"the calibrated {sensor.name} on tf")

    def test_8_rviz_has_nothing_to_complain_about(self):
        end(self.rviz)
        self.assertEqual(self.rviz.returncode, 0)
        self.assertEqual(len(self.logs), 3)
        for log in self.logs:
            lines = [x for x in log.read_text("utf-8").splitlines() if "[ERROR]" in x]
            self.assertEqual(lines, [], log)
        self.finished()

    # ---- helpers

    def save_collection(self, names):
        """Click the panel's button when everybody sees the board; these collections are there."""
        wait_until(lambda: all(self.is_detected(n) for n in self.scene.sensors), self.why)
        self.press(
            SAVE,
            lambda: [c.name for c in self.collections.message.collections] == names,
            self.state,
        )
        seen = {d.sensor for d in self.collections.message.collections[-1].detections}
        self.assertEqual(seen, set(self.scene.sensors))

    def press(self, colour, is_done, state):
        """Click a button of the panel until that is done; while it is, it cannot be clicked.

        The panel may move it, or switch it off for a moment, between the look and the click.
        """
        for _ in range(5):
            place = self.screen.wait_for(colour, PATIENCE_S)
            if is_done():
                return
            self.screen.click(*middle(place))
            end_s = time.monotonic() + 20.0
            while time.monotonic() < end_s:
                if is_done():
                    return
                time.sleep(0.05)
        raise AssertionError(f"clicked in vain: {state.message.message}")

    def end_launch(self):
        """End a launch file as Ctrl-C does."""
        self.launch.signal(signal.SIGINT)
        self.assertEqual(self.launch.wait(PATIENCE_S), 0)

    def start(self, name, *arguments):
        """Start a launch file of the workflow."""
        process = Process("roslaunch", "atom_calibration", name, *arguments)
        self.addClassCleanup(process.end)
        type(self).launch = process

    def open_rviz(self, content):
        """Open RViz with a layout, in the place of the one before."""
        if self.rviz is not None:
            end(self.rviz)
        path = self.folder / f"{self._testMethodName}.rviz"
        path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
        log = path.with_suffix(".log")
        with log.open("a") as stream:
            words = ["-d", str(path), "-stylesheet", str(self.colours), "__name:=rviz"]
            type(self).rviz = self.screen.run_rviz(words, stream)
        if log not in self.logs:
            self.logs.append(log)
        self.addClassCleanup(end, self.rviz)

    def view_of(self, start, target):
        """Look at the way of a seed, from beside and from above."""
        world_T_sensor = self.world_T_sensor(LIDAR)
        focus = se3.apply(world_T_sensor, ((start + target) / 2)[None])[0]
        aside = world_T_sensor[:3, :3] @ np.array([-0.35, 0.8, 0.5])
        return OrbitView(focus, focus + 3.0 * aside / np.linalg.norm(aside))

    def world_T_sensor(self, name):
        """Return the pose (4, 4) that tf has."""
        dataset = self.scene.dataset
        first = next(iter(dataset.collections.values()))
        return pose(first, dataset.graph, dataset.world, self.scene.sensors[name].frame)

    def middle_of_board(self, name, key):
        """Return where the board's middle truly is (3,) in a sensor's frame [m]."""
        in_pattern = np.append(self.scene.pattern.border.centre, 0.0)
        return se3.apply(self.scene.sensor_T_pattern(name, key), in_pattern[None])[0]

    def is_detected(self, name):
        message = self.labels[name].message
        return message is not None and message.patterns[0].detected

    def why(self):
        return {
            n: [p.reason for p in latest.message.patterns] if latest.message else None
            for n, latest in self.labels.items()
        }

    def check_label(self, key):
        """The LiDAR's label is the board, and its points are published."""
        points = point_cloud(self.labeled_points.message)
        truth = set(self.scene.label(LIDAR, key).indices)
        for found in (self.labels[LIDAR].message.patterns[0].idxs, points["idx"].tolist()):
            self.assertGreater(len(set(found) & truth), 0.98 * len(found), key)
            self.assertGreater(len(set(found) & truth), 0.9 * len(truth), key)


if __name__ == "__main__":
    rospy.init_node("workflow_test")
    rosunit.unitrun("atom_rviz_plugins", "rviz_workflow", WorkflowTest)
