"""A simulated rig as messages: two cameras (the second one compressed), a depth camera, a LiDAR.

The first estimate on tf is off by 0.1 m and 0.1 rad; labels have their truth. A turntable that no
sensor stands on turns on /tf.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np
import rosbag
import rospy
from messages import Make
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2
from tf2_msgs.msg import TFMessage
from waiting import until

from atom_calibration.msg import SensorLabels
from atom_core.geometry import se3
from atom_core.io.config_yaml import write_config
from atom_core.model.dataset import pose
from atom_core.synthetic import scenes
from atom_core.synthetic.memory import Sampling

COLLECTIONS = ("001", "002", "003", "004")  # that every sensor sees
CLOUD_SIGMA_M, DEPTH_SIGMA_M, GREY_SIGMA = 0.004, 0.001, 1.5  # beyond the scene's own noise
TURNTABLE, TURN_RAD_S = "turntable", 0.3
_LABELERS_START_WITHIN_S, _LABELS_WITHIN_S = 2.0, 30.0  # what is shown too early is shown anew


class LiveScene:
    """The scene, its messages, and the truth of its labels."""

    def __init__(self, cloud_sigma_m=CLOUD_SIGMA_M):
        self._cloud_sigma_m = cloud_sigma_m
        self.scene = scenes.random_scene(
            2,
            rgb=2,
            depth=1,
            lidar3d=1,
            collections=5,
            sampling=Sampling(background_step=1),
            disturbance=(0.1, 0.1),
        )
        self.dataset = self.scene.dataset
        (self.pattern,) = self.dataset.patterns.values()
        self._data = {}
        self._exact = scenes.random_scene(
            2, rgb=2, depth=1, lidar3d=1, collections=5, sampling=Sampling(background_step=1)
        ).dataset

    def write_config(self, path):
        write_config(path, self.dataset.config)
        return path

    @property
    def sensors(self):
        return self.dataset.sensors

    def topic(self, name):
        """Where the data of a sensor are published."""
        return self.sensors[name].topic + ("/compressed" if name == "rgb_2" else "")

    def kind(self, name):
        kinds = {"rgb_2": CompressedImage, "lidar_1": PointCloud2}
        return kinds.get(name, Image)

    def info_topic(self, name):
        return self.sensors[name].topic.rpartition("/")[0] + "/camera_info"

    # --- truth

    def label(self, name, key):
        return self.dataset.collections[key].labels[(name, self.pattern.name)]

    def true_corners(self, name, key, ids):
        """Return the pixels (n, 2) of corners without any noise."""
        corners = self.pattern.corners_of(ids)
        in_camera = se3.apply(self.sensor_T_pattern(name, key), corners)
        return self.sensors[name].camera.project(in_camera)

    def on_board(self, name, key, indices):
        """Return how far pixels lie outside of the true board's border and off its plane [m]."""
        sensor, depth = self.sensors[name], self.data(name, key)
        row, column = np.divmod(np.array(indices), depth.shape[1])
        pixels = np.column_stack([column, row]).astype(float)
        points = sensor.camera.ray_points(pixels, depth[row, column].astype(float))
        x, y, z = se3.apply(se3.inverse(self.sensor_T_pattern(name, key)), points).T
        return self.pattern.border.signed_distance(np.column_stack([x, y]))[0], z

    def sensor_T_pattern(self, name, key):
        """Return the true pose (4, 4) of the board in a sensor's frame."""
        exact = self._exact
        frame = self.sensors[name].frame
        world_T_sensor = pose(exact.collections[key], exact.graph, exact.world, frame)
        world_T_pattern = self.scene.truth.boards[self.pattern.board_key(key)]
        return se3.inverse(world_T_sensor) @ world_T_pattern

    # --- messages

    def message(self, name, key, stamp_s):
        """Return the data of a sensor; key None: the room without a board."""
        rng = np.random.default_rng([int(1000 * stamp_s) % 100000, len(name), ord(name[-1])])
        data, about = self.data(name, key), {"frame": self.sensors[name].frame, "stamp_s": stamp_s}
        if name == "lidar_1":
            points = (data + self._cloud_sigma_m * rng.standard_normal(data.shape)).astype("<f4")
            return Make.xyz_cloud(points, **about)
        if name == "depth_1":
            depth = (data + DEPTH_SIGMA_M * rng.standard_normal(data.shape)).astype("<f4")
            return Make.image(depth, "32FC1", **about)
        noise = np.zeros(data.shape, np.int16)
        cv2.setRNGSeed(int(1000 * stamp_s) % 100000)
        cv2.randn(noise, (0, 0, 0), (GREY_SIGMA, GREY_SIGMA, GREY_SIGMA))
        picture = np.clip(data + noise, 0, 255).astype(np.uint8)
        if name == "rgb_2":
            packed = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 95])[1]
            head = Make.header(about["frame"], stamp_s)
            return CompressedImage(header=head, format="bgr8; jpeg", data=packed.tobytes())
        return Make.image(picture, **about)

    def data(self, name, key):
        """Return the picture, depth image or cloud of a place of the board; None: of no board."""
        if (name, key) not in self._data:
            source, shown = self.dataset.data, key or COLLECTIONS[0]
            data = source.read(shown, name)
            if key is None:
                data = self._without_board(name, data, self.label(name, shown))
            self._data[(name, key)] = data
        return self._data[(name, key)]

    @staticmethod
    def _without_board(name, data, label):
        """Return the data with nothing where the board was, and a little around it."""
        if name.startswith("rgb"):
            return np.full_like(data, 120)
        if name == "lidar_1":
            centre = data[label.indices].mean(axis=0)
            return data[np.linalg.norm(data - centre, axis=1) > 0.9]
        rows, columns = np.divmod(label.indices, data.shape[1])
        emptied = data.copy()
        emptied[max(rows.min() - 20, 0) : rows.max() + 20, columns.min() : columns.max()] = np.nan
        return emptied

    def info(self, name, stamp_s):
        sensor = self.sensors[name]
        return Make.intrinsics(sensor.camera, sensor.frame, stamp_s)

    def static_transforms(self, stamp_s):
        first = next(iter(self.dataset.collections.values()))
        return Make.transforms(first.transforms, stamp_s)

    def moving_transforms(self, stamp_s):
        return Make.tf("world", TURNTABLE, turntable(stamp_s), stamp_s)

    def write_bag(self, path, start_s=100.0, stop_s=2.0, rate_hz=5.0, keys=COLLECTIONS):
        """Write a bag in which the board stands in one place after the other.

        Cameras see it half as often as the other sensors.
        """
        with rosbag.Bag(path, "w") as bag:
            header = {
                "topic": "/tf_static",
                "type": TFMessage._type,
                "md5sum": TFMessage._md5sum,
                "message_definition": TFMessage._full_text,
                "callerid": "/rig",
                "latching": "1",
            }
            begin, static = rospy.Time.from_sec(start_s), self.static_transforms(start_s)
            bag.write("/tf_static", static, begin, connection_header=header)
            for tick in range(int(len(keys) * stop_s * rate_hz)):
                stamp = start_s + tick / rate_hz
                key, now = keys[int(tick / rate_hz / stop_s)], rospy.Time.from_sec(stamp)
                bag.write("/tf", self.moving_transforms(stamp), now)
                for name, sensor in self.sensors.items():
                    if name.startswith("rgb") and tick % 2:
                        continue
                    if sensor.camera is not None:
                        bag.write(self.info_topic(name), self.info(name, stamp), now)
                    bag.write(self.topic(name), self.message(name, key, stamp), now)
        return path


class LiveRig:
    """Publishes what the sensors see, at the stamps that a test chooses.

    It waits for the labels of what it has published, so that a busy machine only takes longer.
    """

    def __init__(self, scene, start_s=1000.0, period_s=0.2, lidar_lag_s=0.0, pace_s=None):
        """Take a scene.

        Args:
            scene: what is seen.
            start_s: the first stamp.
            period_s: from one stamp to the next.
            lidar_lag_s: by how much the stamps of LiDARs are later.
            pace_s: of the wall's clock from one message to the next, at least; None: as the stamps.
        """
        self.scene, self.stamp_s, self.period_s = scene, start_s, period_s
        self._pace_s = period_s if pace_s is None else pace_s
        self._lag_s = {name: lidar_lag_s for name in scene.sensors if name.startswith("lidar")}
        self._data = {
            name: rospy.Publisher(scene.topic(name), scene.kind(name), queue_size=2)
            for name in scene.sensors
        }
        self._infos = {
            name: rospy.Publisher(scene.info_topic(name), CameraInfo, queue_size=2)
            for name, sensor in scene.sensors.items()
            if sensor.camera is not None
        }
        self._labeled_s = {}
        for name in scene.sensors:
            rospy.Subscriber(f"/{name}/labels", SensorLabels, self._note_labels)
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=10)
        self._tf_static = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
        self._tf_static.publish(scene.static_transforms(start_s))

    def close(self):
        """Take everything back, the transforms above all."""
        for publisher in (*self._data.values(), *self._infos.values(), self._tf, self._tf_static):
            publisher.unregister()

    def _note_labels(self, labels):
        self._labeled_s[labels.sensor] = labels.header.stamp.to_sec()

    def all_labeled(self, names=None):
        """Tell whether the last data of these sensors, or of all, have labels."""
        shown_s, names = self.stamp_s - self.period_s, names or self.scene.sensors
        return all(abs(self._labeled_s.get(n, 0.0) - shown_s) < 0.1 for n in names)

    def show(self, key, names=None):
        """Publish one message of every sensor (or of some), and advance the stamp.

        Several keys: one after the other, with every call.
        """
        if isinstance(key, tuple):
            key = key[int(round(self.stamp_s / self.period_s)) % len(key)]
        self._tf.publish(self.scene.moving_transforms(self.stamp_s))
        for name in names if names is not None else self.scene.sensors:
            if name in self._infos:
                self._infos[name].publish(self.scene.info(name, self.stamp_s))
            stamp = self.stamp_s + self._lag_s.get(name, 0.0)
            self._data[name].publish(self.scene.message(name, key, stamp))
        self.stamp_s += self.period_s

    def listeners(self):
        """Return the number of those that hear every sensor."""
        return min(data.get_num_connections() for data in self._data.values())

    def send(self, name, message):
        """Publish one message as it is."""
        self._data[name].publish(message)

    def show_until(self, key, condition, seconds, what, names=None):
        """Publish, as often as the pace allows, until a condition holds."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            begin = time.monotonic()
            self.show(key, names)
            running = self._labeled_s.keys() >= set(names or self.scene.sensors)
            within_s = _LABELS_WITHIN_S if running else _LABELERS_START_WITHIN_S
            while time.monotonic() < begin + within_s:
                if condition():
                    return
                time.sleep(0.02)
                if time.monotonic() > begin + self._pace_s and self.all_labeled(names):
                    break
        raise AssertionError(f"not within {seconds} s: {what()}")


def turntable(stamp_s):
    """Return world_T_turntable (4, 4)."""
    angle = TURN_RAD_S * stamp_s
    return se3.from_rpy(np.array([2.0, 0.0, 0.5]), np.array([0.0, 0.0, angle]))


def wait_until(condition, seconds, what):
    until(condition, what, seconds)


class Process:
    """A command that runs beside the test; `end` prints what it said."""

    def __init__(self, *words):
        self._file = tempfile.TemporaryFile("w+")  # noqa: SIM115 - open as long as the process
        self._process = subprocess.Popen(
            [str(word) for word in words],
            stdout=self._file,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )

    @property
    def output(self):
        self._file.seek(0)
        return self._file.read()

    def is_running(self):
        return self._process.poll() is None

    def signal(self, number):
        self._process.send_signal(number)

    def wait(self, seconds):
        """Return the exit code."""
        try:
            return self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            self.end()
            raise AssertionError(f"it still ran after {seconds} s") from None

    def end(self):
        """End it if it still runs."""
        if self.is_running():
            self._process.terminate()
            try:
                self._process.wait(20)
            except subprocess.TimeoutExpired:
                os.killpg(self._process.pid, signal.SIGKILL)
                self._process.wait()
        sys.stdout.write(self.output)
