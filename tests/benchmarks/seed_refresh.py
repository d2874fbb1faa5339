"""How soon labels follow a seed that is dragged, with all seven sensors of the simulated cell live.

The cell's labelers and its collector run as nodes; a feed sends them one moment of the cell again
and again (clouds of 28,000 points and the depth image of 640 x 480 eight times a second, three
images of 1280 x 800 four times in three seconds, as the simulator does). Then each range sensor's
marker is dragged about the board, 20 steps a second, by the feedback that RViz would send. A step
is answered by the first labels that begin from it, or from a later one.
"""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Callable, Dict, List, NamedTuple, Tuple

import numpy as np
import rosbag
import roslib.message
import rospkg
import rospy
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import InteractiveMarkerFeedback

from atom_calibration.messages.cameras import camera_from_info
from atom_calibration.msg import SensorLabels
from atom_core.io.config_yaml import read_config
from atom_core.model.sensor import DEPTH, LIDAR3D, RGB

_HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(_HERE.parents[1] / "atom_calibration" / "tests"))

from marker_hand import MarkerHand  # noqa: E402
from masters import running_master  # noqa: E402

CONFIG = Path(rospkg.RosPack().get_path("atom_examples")) / "collab_cell/config/config.yml"
RANGE = ("lidar_1", "lidar_2", "lidar_3", "depth_1")
FAST_HZ, SLOW_HZ = 8.0, 4.0 / 3.0  # of range sensors and cameras
STEPS, STEP_S, REACH_M = 100, 0.05, 0.08
PATIENCE_S = 120.0
_ORDER_S = 0.002  # annotated data may be heard a little before the labels


class Refresh(NamedTuple):
    """How a sensor answered.

    Attributes:
        labels_ms: (n,) from each step's stamp to its labels.
        shown_ms: (n,) to the annotated data that RViz draws.
        detected: share of the answers with a label.
    """

    sensor: str
    labels_ms: np.ndarray
    shown_ms: np.ndarray
    detected: float


def seed_refresh(output: Path, steps: int = STEPS) -> List[Refresh]:
    """Measure all range sensors; needs a built workspace on the environment.

    Args:
        output: folder for the recording.
        steps: of each drag.
    """
    bag = output / "seed_refresh.bag"
    words = ["--scenario", "train", "--collections", "1", "--seed", "0", "--reuse", "--overwrite"]
    subprocess.run(
        ["rosrun", "atom_examples", "cell_simulator", "--bag", str(bag), *words], check=True
    )
    with tempfile.TemporaryDirectory() as name, running_master(name) as environment:
        os.environ.update(environment)
        launch = ("roslaunch", "atom_calibration", "collect_data.launch", "rviz:=false")
        settings = (f"config:={CONFIG}", f"output_folder:={name}/dataset")
        processes = [start_program(*launch, *settings)]
        try:
            rospy.init_node("seed_refresh", disable_signals=True)
            processes.append(start_program(sys.executable, __file__, bag))
            drags = [_Drag(sensor) for sensor in RANGE]
            for drag in drags:
                drag.wait_until_ready()
            return [drag.refresh(steps) for drag in drags]
        finally:
            for process in reversed(processes):
                process.send_signal(signal.SIGINT)
                process.wait(60)


class _Drag:
    """Drags the marker of one sensor, and notes when it is answered."""

    def __init__(self, sensor: str):
        self._sensor, self._hand = sensor, MarkerHand(sensor)
        entry = read_config(CONFIG).sensors[sensor]
        self._camera = None
        self._answers: List[Tuple[float, SensorLabels]] = []
        self._shown_s: List[float] = []
        kind = PointCloud2 if entry.modality == LIDAR3D else Image
        rospy.Subscriber(f"/{sensor}/labels", SensorLabels, self._answer, tcp_nodelay=True)
        rospy.Subscriber(f"{entry.topic_name}/labeled", kind, self._show, tcp_nodelay=True)
        if entry.modality == DEPTH:
            info = entry.topic_name.rpartition("/")[0] + "/camera_info"
            rospy.Subscriber(info, CameraInfo, self._learn, queue_size=1)

    def wait_until_ready(self) -> None:
        """Wait until the labeler finds the board by itself and hears the marker."""
        wait_until(
            lambda: (
                self._hand.is_ready()
                and self._answers
                and self._answers[-1][1].patterns[0].detected
            ),
            f"{self._sensor} sees the board",
        )

    def refresh(self, steps: int) -> Refresh:
        """Drag the marker in steps about the place where it is."""
        rng = np.random.default_rng(0)
        board = self._hand.position.copy()
        places = board + rng.uniform(-REACH_M, REACH_M, (steps, 3))
        self._answers.clear()
        sent_s = []
        for place in places:
            sent_s.append(time.time())
            self._hand.tell(InteractiveMarkerFeedback.POSE_UPDATE, place)
            time.sleep(STEP_S)
        self._hand.tell(InteractiveMarkerFeedback.MOUSE_UP, places[-1])
        time.sleep(1.0)
        answers = [(s, labels) for s, labels in self._answers if labels.manual_seed]
        seeds = places if self._camera is None else self._camera.project(places)
        steps_of = [
            int(np.argmin(np.linalg.norm(seeds - labels.manual_seed, axis=1)))
            for _, labels in answers
        ]
        labels_ms, shown_ms = [], []
        for step, begin_s in enumerate(sent_s):
            answered_s = next(s for (s, _), of in zip(answers, steps_of) if of >= step)
            shown_s = next(s for s in self._shown_s if s >= answered_s - _ORDER_S)
            labels_ms.append(1000.0 * (answered_s - begin_s))
            shown_ms.append(1000.0 * (max(shown_s, answered_s) - begin_s))
        detected = np.mean([labels.patterns[0].detected for _, labels in answers])
        return Refresh(self._sensor, np.array(labels_ms), np.array(shown_ms), float(detected))

    def _answer(self, labels: SensorLabels) -> None:
        self._answers.append((time.time(), labels))

    def _show(self, _message: Any) -> None:
        self._shown_s.append(time.time())

    def _learn(self, info: CameraInfo) -> None:
        self._camera = camera_from_info(info)


# --- what it runs on --------------------------------------------------------------------------


def feed(bag: Path) -> None:
    """Send the cell's middle moment again and again, with the stamps of now."""
    rospy.init_node("feed")
    entries = read_config(CONFIG).sensors
    moment, fixed, moving = _moment(bag)
    publishers = {
        topic: rospy.Publisher(topic, type(message), queue_size=2)
        for topic, message in moment.items()
    }
    transforms = rospy.Publisher("/tf", TFMessage, queue_size=10)
    rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True).publish(fixed)
    slow = {entry.topic_name for entry in entries.values() if entry.modality == RGB}
    due_s = dict.fromkeys(moment, 0.0)
    rate = rospy.Rate(FAST_HZ)
    while not rospy.is_shutdown():
        now = rospy.Time.now()
        for part in moving.transforms:
            part.header.stamp = now
        transforms.publish(moving)
        for topic, message in moment.items():
            if now.to_sec() >= due_s[topic]:
                due_s[topic] = now.to_sec() + (1.0 / SLOW_HZ if topic in slow else 0.0)
                message.header.stamp = now
                publishers[topic].publish(message)
        rate.sleep()


def _moment(bag: Path) -> Tuple[Dict[str, Any], TFMessage, TFMessage]:
    """Return a message of each topic of the sensors, and the transforms."""
    wanted = set()
    for entry in read_config(CONFIG).sensors.values():
        wanted |= {entry.topic_name, entry.topic_name.rpartition("/")[0] + "/camera_info"}
    moment: Dict[str, Any] = {}
    edges: Dict[str, Dict[Tuple[str, str], Any]] = {"/tf": {}, "/tf_static": {}}
    with rosbag.Bag(str(bag)) as opened:
        middle_s = 0.5 * (opened.get_start_time() + opened.get_end_time())
        for topic, raw, stamp in opened.read_messages():
            if stamp.to_sec() > middle_s and wanted <= moment.keys():
                break
            if topic in wanted:
                moment[topic] = _own_class(raw)
            elif topic in edges:
                for part in _own_class(raw).transforms:
                    edges[topic][part.header.frame_id, part.child_frame_id] = part
        wanted &= set(opened.get_type_and_topic_info().topics)
    fixed, moving = (TFMessage(list(edges[topic].values())) for topic in ("/tf_static", "/tf"))
    return moment, fixed, moving


def _own_class(raw: Any) -> Any:
    """Return a bag's message as one of the installed class, which publishers want."""
    message = roslib.message.get_message_class(raw._type)()
    buffer = io.BytesIO()
    raw.serialize(buffer)
    return message.deserialize(buffer.getvalue())


def start_program(*words: Any) -> subprocess.Popen:
    quiet = subprocess.DEVNULL
    return subprocess.Popen([str(word) for word in words], stdout=quiet, stderr=quiet)


def wait_until(condition: Callable[[], Any], what: str) -> None:
    end = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > end:
            raise RuntimeError(f"not within {PATIENCE_S:g} s: {what}")
        time.sleep(0.05)


if __name__ == "__main__":
    feed(Path(sys.argv[1]))
