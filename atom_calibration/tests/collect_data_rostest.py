#!/usr/bin/env python3
"""collect_data: services, menu, collections by themselves, a crash, bad input."""

import json
import os
import signal
import sys
import tempfile
import unittest
import xmlrpc.client
from concurrent.futures import ThreadPoolExecutor

import rospy
import rosunit
from live_scene import COLLECTIONS, LiveRig, LiveScene, Process, wait_until
from std_srvs.srv import SetBool
from visualization_msgs.msg import InteractiveMarkerFeedback, InteractiveMarkerInit

from atom_calibration.msg import CollectionStates, CollectorState
from atom_calibration.srv import DeleteCollection, GetDataset, SaveCollection
from atom_core.cli import main as core_main
from atom_core.io.dataset_json import read_dataset

NAME = "/collect_data"
FIRST, SECOND, THIRD, FOURTH = COLLECTIONS
NOW = {}


def keep(message, what):
    NOW[what] = message


def call(service, kind, *arguments):
    rospy.wait_for_service(f"{NAME}/{service}", timeout=60)
    return rospy.ServiceProxy(f"{NAME}/{service}", kind)(*arguments)


def collections():
    return [c.name for c in NOW["collections"].collections]


def detected():
    return {s.name: [p.detected for p in s.patterns] for s in NOW["state"].sensors}


class CollectDataTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scene = LiveScene()
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.path = lambda _, *names: os.path.join(folder.name, *names)
        cls.config = cls.scene.write_config(f"{folder.name}/config.yml")
        cls.output = f"{folder.name}/dataset"
        cls.launch = Process(
            "roslaunch",
            "atom_calibration",
            "collect_data.launch",
            f"config:={cls.config}",
            f"output_folder:={cls.output}",
            "rviz:=false",
        )
        cls.addClassCleanup(cls.launch.end)
        rospy.Subscriber(f"{NAME}/state", CollectorState, keep, "state")
        rospy.Subscriber(f"{NAME}/collections", CollectionStates, keep, "collections")
        rospy.Subscriber("/data_labeler/update_full", InteractiveMarkerInit, keep, "menu")
        cls.rig = LiveRig(cls.scene, lidar_lag_s=0.05)
        cls.rig.show_until(
            FIRST,
            lambda: "state" in NOW and all(v == [True] for v in detected().values()),
            120,
            lambda: NOW.get("state"),
        )

    def show(self, key, seconds=1.6):
        """Let the board stand somewhere for some time of the data's clock."""
        end = self.rig.stamp_s + seconds
        self.rig.show_until(key, lambda: self.rig.stamp_s > end, 60, lambda: "time passes")

    def save(self, key):
        """Ask for a collection while the data go on."""
        with ThreadPoolExecutor(1) as pool:
            answer = pool.submit(call, "save_collection", SaveCollection)
            self.rig.show_until(key, answer.done, 60, lambda: "the service answers")
            return answer.result()

    def save_in_haste(self):
        """Ask for a collection while the board is in a new place each time.

        Once more where it is taken: a starved labeler sees one place only, and no motion.
        """
        for _ in range(20):
            self.show(COLLECTIONS, 2.0)
            answer = self.save(COLLECTIONS)
            if not answer.success:
                break
            call("delete_collection", DeleteCollection, answer.collection_name)
        return answer

    def test_1_the_state_names_every_sensor(self):
        state = NOW["state"]
        self.assertEqual(state.dataset_folder, self.output)
        self.assertEqual((state.automatic, state.collections), (False, 0))
        self.assertEqual([s.name for s in state.sensors], sorted(self.scene.sensors))
        for sensor in state.sensors:
            self.assertEqual(sensor.frame_id, self.scene.sensors[sensor.name].frame)
            self.assertEqual(sensor.modality, self.scene.sensors[sensor.name].modality)
            self.assertGreater(sensor.patterns[0].points, 20)
            self.assertGreater(sensor.stamp.to_sec(), 999.0)
            self.assertRegex(sensor.patterns[0].view, r"\d m")
            is_camera = sensor.modality == "rgb"
            self.assertEqual("blur" in sensor.patterns[0].view, is_camera)

    def test_2_a_collection_is_saved_with_all_that_is_seen(self):
        self.show(FIRST)
        answer = self.save(FIRST)
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(answer.collection_name, "000")
        wait_until(lambda: collections() == ["000"], 60, collections)
        seen = {d.sensor: d.points for d in NOW["collections"].collections[0].detections}
        self.assertEqual(set(seen), set(self.scene.sensors))
        document = json.loads(call("get_dataset", GetDataset).dataset)
        self.assertEqual(list(document["collections"]), ["000"])
        labels = document["collections"]["000"]["labels"][self.scene.pattern.name]
        self.assertEqual({n: len(x["idxs"]) for n, x in labels.items()}, seen)

    def test_3_what_cannot_be_saved_is_refused_and_told(self):
        self.show(None, 2.5)
        answer = self.save(None)
        self.assertFalse(answer.success)
        self.assertIn("no sensor sees the board", answer.message)
        self.assertEqual(answer.collection_name, "")
        wait_until(lambda: "no sensor sees" in NOW["state"].message, 60, lambda: NOW["state"])
        answer = self.save_in_haste()
        self.assertFalse(answer.success)
        self.assertIn("the board moved by", answer.message)
        self.assertIn("hold it still", answer.message)
        wait_until(lambda: collections() == ["000"], 60, collections)

    def test_4_a_collection_is_deleted_by_its_name(self):
        answer = call("delete_collection", DeleteCollection, "017")
        self.assertFalse(answer.success)
        self.assertIn("there is no collection 017; there are: 000", answer.message)
        self.show(SECOND)
        name = self.save(SECOND).collection_name
        wait_until(lambda: collections() == ["000", name], 60, collections)
        files = os.listdir(self.output)
        self.assertTrue(call("delete_collection", DeleteCollection, name).success)
        wait_until(lambda: collections() == ["000"], 60, collections)
        removed = set(files) - set(os.listdir(self.output))
        self.assertEqual(len(removed), len(self.scene.sensors))
        self.assertTrue(all(f"_{name}." in file for file in removed), removed)
        with open(os.path.join(self.output, "seeds.yaml"), encoding="utf-8") as stream:
            self.assertEqual(stream.read().count("lidar_1"), 1)

    def test_5_the_menu_does_the_same(self):
        (marker,) = NOW["menu"].markers
        entries = {entry.title: entry.id for entry in marker.menu_entries}
        feedback = rospy.Publisher(
            "/data_labeler/feedback", InteractiveMarkerFeedback, queue_size=5
        )
        wait_until(lambda: feedback.get_num_connections(), 60, "the menu listens")

        def click(title):
            feedback.publish(
                InteractiveMarkerFeedback(
                    client_id="test",
                    marker_name=marker.name,
                    control_name="menu",
                    event_type=InteractiveMarkerFeedback.MENU_SELECT,
                    menu_entry_id=entries[title],
                )
            )

        self.show(THIRD)
        click("Save collection")
        self.rig.show_until(THIRD, lambda: collections() == ["000", "001"], 60, collections)
        click("Delete last collection")
        wait_until(lambda: collections() == ["000"], 60, collections)
        click("Automatic data collection on/off")
        wait_until(lambda: NOW["state"].automatic, 60, lambda: NOW["state"])
        wait_until(
            lambda: NOW["menu"].markers[0].description.endswith("collections, automatic"),
            60,
            lambda: NOW["menu"].markers[0].description,
        )
        click("Automatic data collection on/off")
        wait_until(lambda: not NOW["state"].automatic, 60, lambda: NOW["state"])

    def test_6_collections_are_taken_where_the_board_stands_still(self):
        self.show(None, 2.5)  # what stood there before is past
        before = len(collections())
        self.assertTrue(call("toggle_automatic_data_collector", SetBool, True).success)
        for number, key in enumerate((SECOND, THIRD)):
            begin = self.rig.stamp_s
            self.show(key, 2.0)
            end, wanted = self.rig.stamp_s, before + number + 1
            self.rig.show_until(None, lambda w=wanted: len(collections()) == w, 60, collections)
            stamp = NOW["collections"].collections[-1].stamp.to_sec()
            self.assertTrue(begin - 1e-6 <= stamp <= end, (begin, stamp, end))
        self.show(None, 2.0)
        self.assertEqual(len(collections()), before + 2)
        self.assertTrue(call("toggle_automatic_data_collector", SetBool, False).success)
        before = collections()
        self.show(FOURTH, 2.0)
        self.show(None, 2.5)
        self.assertEqual(collections(), before)

    def test_7_after_kill_9_nothing_is_lost(self):
        before = collections()
        pid = rospy.get_master().lookupNode(NAME)[2]
        with xmlrpc.client.ServerProxy(pid) as node:
            os.kill(node.getPid("/test")[2], signal.SIGKILL)
        self.launch.wait(60)
        self.assertFalse(os.path.exists(os.path.join(self.output, "dataset.json")))
        with open(os.path.join(self.output, "status.json"), encoding="utf-8") as stream:
            status = json.load(stream)
        self.assertIsNone(status["exit_code"], status)
        self.assertEqual(core_main(["recover", self.output]), 0)
        dataset = read_dataset(os.path.join(self.output, "dataset.json"))
        self.assertEqual(list(dataset.collections), before)

    def test_8_a_folder_that_holds_something_is_refused(self):
        before = sorted(os.listdir(self.output))
        process = Process(
            "rosrun", "atom_calibration", "collect_data", "-c", self.config, "-o", self.output
        )
        self.assertEqual(process.wait(60), 2)
        (line,) = process.output.strip().splitlines()
        self.assertIn("--overwrite", line)
        self.assertEqual(sorted(os.listdir(self.output)), before)

    def test_9_patience_ends_with_what_was_waited_for(self):
        process = Process(
            "rosrun",
            "atom_calibration",
            "collect_data",
            "-c",
            self.config,
            "-o",
            self.path("waiting"),
            "--patience",
            "1",
        )
        self.assertEqual(process.wait(60), 2)
        line = process.output.strip().splitlines()[-1]
        self.assertRegex(line, r"^collect_data: .*(topic|labelers).*")
        with open(self.path("waiting", "status.json"), encoding="utf-8") as stream:
            status = json.load(stream)
        self.assertEqual((status["step"], status["exit_code"]), ("collect", 2))
        self.assertIn(status["message"], line)


if __name__ == "__main__":
    rospy.init_node("collect_data_rostest")
    rosunit.unitrun("atom_calibration", "collect_data_node", CollectDataTest, sysargs=sys.argv)
