#!/usr/bin/env python3
"""`calibrate -rv` and its launch file: what is shown while the solver runs, and the results."""

import copy
import json
import os
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
from live_scene import Process
from sensor_msgs.msg import Image, PointCloud2
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray
from waiting import soon, until

from atom_calibration.messages.poses import pose_matrix, transform_matrix, transform_message
from atom_calibration.msg import CalibrationState
from atom_calibration.srv import LeaveOut, ShowCollection
from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.model.dataset import pose
from atom_core.model.transforms import Edge
from atom_core.synthetic import scenes

WITHIN_S = 60.0  # from the start of the process on, on a busy machine
SHELF = se3.from_rpy(np.array([1.0, 2.0, 0.5]), np.array([0.0, 0.0, 1.0]))  # in the world
NOBODY = "http://localhost:9"  # where no master listens


class Listener:
    """Hears everything that the view publishes."""

    def __init__(self, dataset):
        self.states, self.markers, self.clouds, self.images = [], {}, [], {}
        self._subscribers = [
            rospy.Subscriber("/calibrate/state", CalibrationState, self.states.append),
            rospy.Subscriber("/calibrate/points", PointCloud2, self.clouds.append),
        ]
        topics = {s.name: f"{s.topic}/labeled2d" for s in dataset.sensors.values() if s.camera}
        for name, topic in {**topics, "all": "/calibrate/images"}.items():
            self._subscribers.append(
                rospy.Subscriber(topic, Image, lambda m, n=name: self.images.update({n: m}))
            )
        self.cameras = list(topics)
        self._hear_markers("sensors")
        self._hear_markers("ghost")

    def _hear_markers(self, name):
        heard = self.markers[name] = []
        topic = f"/calibrate/{name}"
        self._subscribers.append(
            rospy.Subscriber(topic, MarkerArray, lambda m: heard.append(m.markers))
        )

    def let_it_begin(self):
        """Look at the boards, which is what it waits for, once all else is heard."""
        until(lambda: all(s.get_num_connections() for s in self._subscribers), "topics", WITHIN_S)
        self._hear_markers("patterns")

    def end(self):
        for subscriber in self._subscribers:
            subscriber.unregister()

    def place(self, topic, name, index):
        """Return where a sensor was drawn, in the message with this index."""
        first = next(m for m in self.markers[topic][index] if m.ns == name)
        return pose_matrix(first.pose)[:3, 3]


class CalibrateTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = Path(folder.name)
        scene = scenes.random_scene(2, collections=4, disturbance=(0.1, 0.1))
        cls.path = write_dataset_folder(scene.dataset, cls.folder / "data", name="scene")
        cls.dataset = read_dataset(cls.path)

    def start(self, *words):
        process = Process(*words)
        self.addCleanup(process.end)
        return process

    def command(self, *words, dataset=None):
        """Run `calibrate -rv` to its end; return (code, stdout, stderr)."""
        done = subprocess.run(
            [
                "rosrun",
                "atom_calibration",
                "calibrate",
                "--dataset",
                dataset or self.path,
                "-rv",
                "--no_report",
                *map(str, words),
            ],
            capture_output=True,
            text=True,
            timeout=180,
            check=False,
        )
        return done.returncode, done.stdout, done.stderr

    def ended(self, listener):
        states = listener.states
        until(lambda: states and not states[-1].running, "the end of the solver", WITHIN_S)
        return listener.states[-1]

    # ------------------------------------------------------------------------ a good dataset

    def test_what_is_shown_is_the_calibration(self):
        listener, output = Listener(self.dataset), self.folder / "shown"
        self.addCleanup(listener.end)
        buffer = tf2_ros.Buffer()
        tf2_ros.TransformListener(buffer)
        launch = self.start(
            "roslaunch",
            "atom_calibration",
            "calibrate.launch",
            f"dataset:={self.path}",
            f"output:={output}",
            "rviz:=false",
            "slow:=0.05",
            f"wait:={WITHIN_S}",
        )
        listener.let_it_begin()
        self.ended(listener)
        document = json.loads((output / "calibration.json").read_text(encoding="utf-8"))
        self.check_states(listener.states, document)
        soon(lambda: self.check_markers(listener, output))
        soon(lambda: self.check_images(listener))
        soon(lambda: self.check_transforms(buffer, document))
        self.check_choice_of_collection(listener)
        self.check_leaving_out(listener)
        late = Listener(self.dataset)
        self.addCleanup(late.end)
        self.assertEqual(self.ended(late).status, "converged", "the state stays for who comes late")
        self.assertTrue(launch.is_running())
        launch.signal(signal.SIGINT)
        self.assertEqual(launch.wait(60), 0)

    def check_states(self, states, document):
        self.assertEqual({s.status for s in states[:-1] if s.running}, {"running"})
        running = [s for s in states if s.running and s.residuals]
        self.assertGreater(len(running), 3, "it is told on the way")
        iterations = [s.iteration for s in running]
        self.assertEqual((iterations[0], sorted(iterations)), (0, iterations))
        last = states[-1]
        verdict = document["verdict"]
        self.assertEqual(last.status, document["status"])
        self.assertEqual((last.grade, last.message), (verdict["grade"], verdict["sentence"]))
        self.assertEqual(last.iteration, document["solver"]["iterations"])
        self.assertLessEqual(iterations[-1], last.iteration)
        self.assertEqual(list(last.collections), list(self.dataset.collections))
        for row in last.residuals:
            expected = document["sensors"][row.sensor]["residuals"][row.kind]
            self.assertEqual((row.rms, row.count), (expected["rms"], expected["count"]))
            started = next(
                r for r in running[0].residuals if (r.sensor, r.kind) == (row.sensor, row.kind)
            )
            self.assertEqual(row.rms_initial, started.rms)

    def check_markers(self, listener, output):
        solved = read_dataset(output / "atom_calibration.json")
        collection = next(iter(solved.collections.values()))
        for name, sensor in solved.sensors.items():
            ghost = listener.place("ghost", name, 0)
            np.testing.assert_allclose(listener.place("sensors", name, 0), ghost, atol=1e-12)
            np.testing.assert_allclose(listener.place("ghost", name, -1), ghost, atol=1e-12)
            expected = pose(collection, solved.graph, solved.world, sensor.frame)[:3, 3]
            np.testing.assert_allclose(listener.place("sensors", name, -1), expected, atol=1e-9)
            if name != solved.config.anchored_sensor:
                self.assertGreater(np.linalg.norm(expected - ghost), 0.02)
        boards = {marker.ns for marker in listener.markers["patterns"][-1]}
        self.assertEqual(boards, {f"c{key}" for key in self.dataset.collections})
        self.assertGreater(listener.clouds[-1].width, 100)
        self.assertNotEqual(listener.clouds[0].data, listener.clouds[-1].data)

    def check_images(self, listener):
        self.assertEqual(set(listener.images), {*listener.cameras, "all"})
        for name in listener.cameras:
            camera, image = self.dataset.sensors[name].camera, listener.images[name]
            self.assertEqual((image.width, image.height), (camera.width, camera.height))
            self.assertEqual(image.header.frame_id, self.dataset.sensors[name].frame)

    def check_transforms(self, buffer, document):
        for edge in document["edges"].values():
            found = transform_matrix(
                buffer.lookup_transform(edge["parent"], edge["child"], rospy.Time(0))
            )
            expected = se3.from_quaternion(
                np.array(edge["translation_m"]), np.array(edge["quaternion_xyzw"])
            )
            np.testing.assert_allclose(found, expected, atol=1e-9)

    def check_choice_of_collection(self, listener):
        key, before = next(iter(self.dataset.collections)), copy.copy(listener.images["all"].data)
        answer = rospy.ServiceProxy("/calibrate/next", Trigger)()
        self.assertEqual(answer.message, f"collection {key}")
        state = until(
            lambda: listener.states[-1].collection == key and listener.states[-1], "its state"
        )
        self.assertEqual(state.status, "converged")
        until(lambda: listener.images["all"].data != before, "its images")
        others = {f"c{other}" for other in self.dataset.collections if other != key}

        def only_it_is_drawn():
            last = listener.markers["patterns"][-1]
            self.assertEqual({m.ns for m in last if m.action == m.ADD}, {f"c{key}"})
            self.assertEqual({m.ns for m in last if m.action == m.DELETE}, others)

        soon(only_it_is_drawn)
        rospy.ServiceProxy("/calibrate/previous", Trigger)()
        until(lambda: listener.states[-1].collection == "", "all collections")
        show = rospy.ServiceProxy("/calibrate/show_collection", ShowCollection)
        self.assertTrue(show(key).success)
        until(lambda: listener.states[-1].collection == key, "that collection")
        refusal = show("999")
        self.assertFalse(refusal.success)
        self.assertIn(key, refusal.message)
        self.assertTrue(show("").success)
        until(lambda: listener.states[-1].collection == "", "all collections again")

    def check_leaving_out(self, listener):
        """Solved again at once, judged afterwards; and back to what is written."""
        written, begin = listener.states[-1], len(listener.states)
        place = ("lidar_1", "001")

        def left_out(state):
            return {(bar.sensor, bar.collection) for bar in state.bars if bar.left_out}

        leave_out = rospy.ServiceProxy("/calibrate/leave_out", LeaveOut)
        answer = leave_out(*place, True)
        self.assertTrue(answer.success, answer.message)
        self.assertIn("moves most", answer.message)

        def judged():
            return [s for s in listener.states[begin:] if s.grade and left_out(s) == {place}]

        until(judged, "what it is worth", WITHIN_S)
        first = listener.states[begin]
        self.assertEqual((first.status, first.grade, first.sigmas), ("judging", "", []))
        self.assertEqual(left_out(first), {place})
        self.assertEqual(len(judged()[-1].sigmas), len(self.dataset.sensors))
        self.assertTrue(leave_out(*place, False).success)
        until(lambda: not left_out(listener.states[-1]), "all of it again", WITHIN_S)
        last = listener.states[-1]
        self.assertEqual((last.grade, last.message), (written.grade, written.message))
        self.assertEqual(last.residuals, written.residuals)
        refusal = leave_out("nobody", "001", True)
        self.assertFalse(refusal.success)
        self.assertIn("no label", refusal.message)

    def test_calibrated_transforms_take_the_place_of_the_descriptions(self):
        sensor = self.dataset.sensors["rgb_2"]
        before = self.dataset.first_value(sensor.edge)
        described = {sensor.edge: before, Edge("world", "shelf"): SHELF}
        publisher = rospy.Publisher(
            "/calibrate/description_tf_static", TFMessage, queue_size=1, latch=True
        )
        publisher.publish([transform_message(e, m, rospy.Time(1)) for e, m in described.items()])
        buffer, output = tf2_ros.Buffer(), self.folder / "beside"
        tf2_ros.TransformListener(buffer)

        def tf(parent, child):
            try:
                found = buffer.lookup_transform(parent, child, rospy.Time(0))
            except tf2_ros.TransformException:
                return None
            return transform_matrix(found)

        def is_at(edge, expected):
            found = tf(edge.parent, edge.child)
            return found is not None and np.allclose(found, expected, rtol=0, atol=1e-9)

        words = ["--dataset", self.path, "--output", output, "-rv", "--tf", "calibrated", "--stay"]
        words += ["--no_report"]
        process = self.start("rosrun", "atom_calibration", "calibrate", *words, "--wait", WITHIN_S)
        until(lambda: is_at(sensor.edge, before), "the description's value", WITHIN_S)
        listener = Listener(self.dataset)
        self.addCleanup(listener.end)
        listener.let_it_begin()
        self.ended(listener)
        solved = read_dataset(output / "atom_calibration.json").first_value(sensor.edge)
        self.assertFalse(np.allclose(solved, before, atol=0.01))
        until(lambda: is_at(sensor.edge, solved), "the calibrated value")
        self.assertTrue(is_at(Edge("world", "shelf"), SHELF))
        process.signal(signal.SIGINT)
        self.assertEqual(process.wait(30), 0)
        publisher.unregister()

    def test_files_are_those_of_the_command(self):
        code, said, _ = self.command("--output", self.folder / "watched")
        self.assertEqual(code, 0)
        self.assertIn("converged", said)
        plain = subprocess.run(
            [
                sys.executable,
                "-m",
                "atom_core",
                "calibrate",
                "--dataset",
                self.path,
                "--output",
                self.folder / "plain",
                "--no_report",
            ],
            capture_output=True,
            text=True,
            timeout=180,
            check=True,
        )
        self.assertIn("converged", plain.stdout)
        for name in ("calibration.json", "atom_calibration.json"):
            watched, expected = (
                json.loads((self.folder / run / name).read_text(encoding="utf-8"))
                for run in ("watched", "plain")
            )
            if name == "calibration.json":
                for document in (watched, expected):
                    del document["solver"]["seconds"], document["options"]["output"]
            self.assertEqual(watched, expected, name)
        parameters = "atom_calibration_params.yml"
        self.assertEqual(
            (self.folder / "watched" / parameters).read_text(encoding="utf-8"),
            (self.folder / "plain" / parameters).read_text(encoding="utf-8"),
        )

    def test_interrupted_it_writes_the_best_state(self):
        listener, output = Listener(self.dataset), self.folder / "interrupted"
        self.addCleanup(listener.end)
        process = self.start(
            "rosrun",
            "atom_calibration",
            "calibrate",
            "--dataset",
            self.path,
            "--output",
            output,
            "--no_report",
            "-rv",
            "--slow",
            "3",
            "--stay",
            "--wait",
            WITHIN_S,
        )
        listener.let_it_begin()
        until(lambda: [s for s in listener.states if s.iteration >= 2], "iteration 2", WITHIN_S)
        process.signal(signal.SIGINT)
        self.assertEqual(process.wait(60), 1)
        document = json.loads((output / "calibration.json").read_text(encoding="utf-8"))
        self.assertEqual(document["status"], "not_converged")
        self.assertIn("interrupted", document["message"])
        solver = document["solver"]
        self.assertLess(solver["cost_final"], solver["cost_initial"])
        self.assertTrue((output / "atom_calibration.json").is_file())
        self.assertNotIn("Traceback", process.output)

    # -------------------------------------------------------------------------- bad input

    def refused(self, *words, dataset=None, naming=""):
        output = self.folder / "refused"
        code, _, said = self.command("--output", output, *words, dataset=dataset)
        self.assertEqual((code, len(said.strip().splitlines())), (2, 1), said)
        self.assertIn(naming, said)
        self.assertFalse(output.exists())

    def test_what_cannot_be_used_is_refused_in_one_line(self):
        absent = self.folder / "absent.json"
        self.refused(dataset=absent, naming=str(absent))
        self.refused("--show_collection", "999", naming="999")
        self.refused("-ssf", "nobody", naming="nobody")

    def test_a_dataset_without_detections_is_refused(self):
        document = json.loads(self.path.read_text(encoding="utf-8"))
        for collection in document["collections"].values():
            for pattern in collection["labels"].values():
                for label in pattern.values():
                    label.update(detected=False, idxs=[], idxs_limit_points=[])
        path = self.path.with_name("blind.json")
        path.write_text(json.dumps(document), encoding="utf-8")
        self.refused(dataset=path, naming="detect")

    def test_results_are_not_replaced_unasked(self):
        output = self.folder / "occupied"
        output.mkdir()
        (output / "calibration.json").write_text("{}", encoding="utf-8")
        code, _, said = self.command("--output", output)
        self.assertEqual((code, len(said.strip().splitlines())), (2, 1), said)
        self.assertIn("--overwrite", said)
        self.assertEqual((output / "calibration.json").read_text(encoding="utf-8"), "{}")

    def test_without_a_master_it_says_so(self):
        before = os.environ["ROS_MASTER_URI"]
        os.environ["ROS_MASTER_URI"] = NOBODY
        try:
            self.refused(naming="no ROS master")
        finally:
            os.environ["ROS_MASTER_URI"] = before


if __name__ == "__main__":
    rospy.init_node("watch_calibrate")
    rosunit.unitrun("atom_calibration", "watch_calibrate", CalibrateTest, sysargs=sys.argv)
