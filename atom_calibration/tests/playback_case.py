"""The node dataset_playback as a rostest drives it: what RViz sends it, and what RViz shows."""

import tempfile
import unittest
from pathlib import Path

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import Point32, PointStamped, PolygonStamped
from live_scene import Process
from playback_scene import (
    CAMERA,
    DEPTH,
    LIDAR,
    PATTERN,
    SECOND,
    write_scene,
)
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import InteractiveMarkerFeedback, InteractiveMarkerInit
from waiting import until

from atom_calibration.messages.clouds import point_cloud
from atom_calibration.msg import BorderStroke, CollectionStates, PlaybackState
from atom_calibration.show.annotation import BORDER_RGB, INSIDE_RGB
from atom_calibration.srv import DeleteLabel, SelectPattern, ShowCollection
from atom_core.io.dataset_json import read_dataset

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


class PlaybackCase(unittest.TestCase):
    """A running node; the tests are in the class that inherits from this one."""

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
                ("border", BorderStroke),
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

    def stroke(self, sensor, key="", pixel=(0.0, 0.0), header=None):
        """Click, or type a key, over an image in which a border is drawn."""
        x, y = pixel
        message = BorderStroke(header=header or self.header(sensor), key=key, x=x, y=y)
        return self.after(lambda: self.publishers[(sensor, "border")].publish(message))

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
