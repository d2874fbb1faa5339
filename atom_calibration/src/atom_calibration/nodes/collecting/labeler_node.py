"""The node of one sensor: data in, labels and annotated data out, seeds heard at once."""

from __future__ import annotations

import threading
from collections import deque
from typing import Any, Collection, Deque, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np
import rospy
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Time

from atom_calibration.collect.live_clocks import is_unstamped, without_stamps
from atom_calibration.errors import CollectionError, MessageError
from atom_calibration.labels.board_figures import add_figures
from atom_calibration.labels.frame_labeler import FrameLabeler
from atom_calibration.labels.label_messages import labels_message
from atom_calibration.messages.headers import frame_name, stamp_s
from atom_calibration.messages.poses import pose_matrix
from atom_calibration.modalities.frames import Frame, decode, undecoded
from atom_calibration.modalities.table import ros_modality
from atom_calibration.msg import SensorLabels
from atom_calibration.nodes.collecting.camera_sights import CameraSights, Sight
from atom_calibration.nodes.collecting.seed_input import SeedListener
from atom_calibration.runtime import running
from atom_calibration.runtime.graph_names import topic_of
from atom_calibration.runtime.pace import labeled_until
from atom_calibration.show.annotation import annotated, labeled_cloud
from atom_calibration.sources.live_topics import LiveTopics, message_class
from atom_calibration.sources.live_transforms import LiveTransforms
from atom_calibration.sources.receipts import ReceiptTimes
from atom_calibration.sources.rig import Rig
from atom_core.errors import LabelingError
from atom_core.io.seeds import Seed
from atom_core.labeling.base import nothing
from atom_core.model.config import CalibrationConfig
from atom_core.model.pattern import pattern_from_config

_BUFFER_BYTES = 2**25  # of a connection: less than a message makes old messages wait
MOST_WAITING = 200  # data of a sensor that wait where none may be passed over
_IDLE_S = 0.1  # of the wall's clock: whoever has got nothing for so long has got all that was sent
_BACK_S = 1.0  # data that are older by more begin anew, as when a bag is repeated
_SOONER = 0.8  # of a period: stamps jitter


class LabelLinks:
    """The labels that go out, and those of cameras that come in: linked before any data flow.

    Attributes:
        out: publisher of the sensor's own labels.
        idle: publisher of the time until which all that has come is labeled.
        frames: of cameras, by their names.
        sights: of cameras, which were not looked at yet.
    """

    def __init__(self, sensor: str, cameras: Mapping[str, str], received: Collection[str]):
        """Advertise and subscribe.

        Args:
            sensor: its name.
            cameras: name to frame, of those whose sight of the board tells seeds.
            received: sensors whose time of receipt is taken, not their stamps.
        """
        self.out = running.Publisher(topic_of(sensor, "labels"), SensorLabels, queue_size=20)
        self.idle = running.Publisher(labeled_until(sensor), Time, queue_size=1)
        self.frames = {name: frame for name, frame in cameras.items() if name != sensor}
        self.sights = CameraSights(self.frames)
        for camera in self.frames:
            see = self._see_now if camera in received else self._see
            topic = topic_of(camera, "labels")
            rospy.Subscriber(topic, SensorLabels, see, camera, queue_size=MOST_WAITING)
            rospy.Subscriber(labeled_until(camera), Time, self._see_idle, camera, queue_size=1)

    def _see(self, labels: SensorLabels, camera: str) -> None:
        self.sights.add(Sight(stamp_s(labels), camera, labels))

    def _see_idle(self, until: Time, camera: str) -> None:
        self.sights.note_idle(camera, until.data.to_sec())

    def _see_now(self, labels: SensorLabels, camera: str) -> None:
        self.sights.add(Sight(rospy.Time.now().to_sec(), camera, labels))


class _Waiting(NamedTuple):
    """What is to be done next: data, the user's newest seed."""

    message: Any = None
    seed: Optional[Tuple[Optional[np.ndarray]]] = None  # (None,): automatic again


class LabelerNode:
    """Labels the newest data whenever it is done with those before; of recordings, all.

    A seed is heard between two messages: the last data are then labeled again at once.
    """

    def __init__(
        self,
        config: CalibrationConfig,
        rig: Rig,
        links: LabelLinks,
        seeds: Sequence[Seed],
        automatic_seeds: bool,
        rate_hz: float,
        receipts: ReceiptTimes,
        all_messages: bool = False,
    ):
        """Advertise labels and annotated data.

        Args:
            config: the calibration.
            rig: the one sensor to label.
            links: for its labels.
            seeds: given by hand.
            automatic_seeds: predict seeds from cameras, and search.
            rate_hz: labels a second at most, by the stamps of the data.
            receipts: of sensors whose stamps are not used; their labels carry them all the same.
            all_messages: let data wait, instead of passing over all but the newest: until cameras
                have labeled what they saw by then, too.
        """
        ((self._topic, sensor),) = rig.topics.items()
        self._config, self._receipts = config, receipts
        self._sensor, self._links, self._period_s = sensor, links, _SOONER / rate_hz
        self._patterns = {
            name: pattern_from_config(name, entry)
            for name, entry in config.calibration_patterns.items()
        }
        self._labeler = FrameLabeler(
            config, {sensor.name: sensor}, self._patterns, seeds, automatic_seeds
        )
        self._transforms = LiveTransforms()
        self._in_order = all_messages
        self._messages: Deque[Any] = deque(maxlen=MOST_WAITING if all_messages else 1)
        self._seed: Optional[Tuple[Optional[np.ndarray]]] = None
        self._there = threading.Condition()
        self._last: Optional[Frame] = None
        self._stamp_s = -np.inf
        self._data_frame: Optional[str] = None
        self._seeds: Optional[SeedListener] = None
        kind = Image if sensor.kind.has_camera_info else PointCloud2
        self._annotated = running.Publisher(f"{sensor.topic}/labeled", kind, queue_size=2)
        self._in_space: Optional[rospy.Publisher] = None
        if sensor.kind.has_camera_info and sensor.kind.measures_range:
            topic = f"{sensor.topic}/labeled3d"
            self._in_space = running.Publisher(topic, PointCloud2, queue_size=2)

    def listen(self, topics: LiveTopics) -> None:
        """Subscribe to the data and to seeds; take up data that came already."""
        kind = message_class(topics.types[self._topic])
        most = self._messages.maxlen
        rospy.Subscriber(self._topic, kind, self._take, queue_size=most, buff_size=_BUFFER_BYTES)
        for message in topics.early(self._topic):
            self._take(message)
        seeds = ros_modality(self._sensor.modality).seeds
        if seeds is not None:
            self._seeds = SeedListener(self._sensor, seeds, self._take_seed, lambda: self._last)

    def spin(self) -> None:
        """Label until the node ends."""
        while not running.stopped():
            now = rospy.Time.now()
            waiting = self._next()
            if waiting == _Waiting() and self._in_order:
                self._links.idle.publish(now)  # what had come by then has been labeled since
            if waiting.seed is not None:
                self._begin_from(*waiting.seed)
            if waiting.message is not None and self._is_due(waiting.message):
                self._publish(self._labeled(waiting.message))

    # --- messages in ------------------------------------------------------------------------

    def _next(self) -> _Waiting:
        with self._there:
            if not self._messages and self._seed is None:
                self._there.wait(_IDLE_S)
            message = self._messages.popleft() if self._messages else None
            waiting, self._seed = _Waiting(message, self._seed), None
        return waiting

    def _take(self, message: Any) -> None:
        self._receipts.note(message, self._sensor.name)
        with self._there:
            self._messages.append(message)
            self._there.notify()

    def _take_seed(self, position: Optional[np.ndarray]) -> None:
        with self._there:
            self._seed = (position,)
            self._there.notify()

    def _is_due(self, message: Any) -> bool:
        stamp = self._time_s(message)
        if stamp < self._stamp_s - _BACK_S:
            rospy.loginfo("time went back: beginning anew")
            self._labeler.begin_anew()
            self._links.sights.clear()
        elif stamp - self._stamp_s < self._period_s:
            return False
        self._stamp_s = stamp
        return True

    def _time_s(self, message: Any) -> float:
        """Return the time [s] that is taken for a message's; now, if its driver tells none."""
        if is_unstamped(message):
            return float(rospy.Time.now().to_sec())
        return self._receipts.time_s(message, self._sensor.name)

    # --- labels out -------------------------------------------------------------------------

    def _begin_from(self, position: Optional[np.ndarray]) -> None:
        """Look for the board at a seed, or with None anywhere; the last data are labeled anew."""
        self._labeler.set_seed(self._sensor.name, position)
        if self._last is not None:
            frame = self._last.unlabeled()
            self._label(frame)
            self._publish(frame)

    def _labeled(self, message: Any) -> Frame:
        frame = undecoded(self._sensor, message)
        try:
            self._check_header(message)
            frame = decode(self._sensor, message)
        except MessageError as error:
            self._give_up(frame, error)
            return frame
        frame.stamp_s = self._receipts.time_s(message, self._sensor.name)
        if self._in_order:
            self._links.sights.wait_for(frame.stamp_s, running.pause, running.stopped)
        self._label(frame)
        return frame

    def _check_header(self, message: Any) -> None:
        """Refuse data without a stamp, and of another frame than those before.

        Raises:
            MessageError: naming the sensor, and both frames.
        """
        if is_unstamped(message):
            raise MessageError(without_stamps(self._sensor.name), self._sensor.name)
        frame = frame_name(message.header.frame_id)
        self._data_frame = frame if self._data_frame is None else self._data_frame
        if frame != self._data_frame:
            raise MessageError(
                f"sensor '{self._sensor.name}', topic {self._sensor.topic}: its data are in frame "
                f"'{frame}', and were in frame '{self._data_frame}' before; publish those of one "
                f"driver, in one frame, on it"
            )

    def _label(self, frame: Frame) -> None:
        try:
            for sight in self._links.sights.take(frame.stamp_s if self._in_order else np.inf):
                self._note_board(sight)
            self._labeler.label(frame, self._transforms.at(frame.stamp_s))
            for name, pattern in self._patterns.items():
                add_figures(frame, pattern, self._config.calibration_patterns[name])
            for text in self._labeler.relocated.values():
                rospy.logwarn_once(text)
        except (LabelingError, CollectionError) as error:
            self._give_up(frame, error)

    def _give_up(self, frame: Frame, error: Exception) -> None:
        rospy.logwarn_throttle(5.0, str(error))
        for name in self._patterns:
            frame.set_label(name, nothing(self._sensor.modality, str(error)))

    def _note_board(self, sight: Sight) -> None:
        tree, frame = self._transforms.at(sight.stamp_s), self._links.frames[sight.camera]
        for part in sight.labels.patterns:
            if part.pose_known and part.pattern_name in self._patterns:
                pose = pose_matrix(part.pose)
                self._labeler.see_board(frame, part.pattern_name, sight.stamp_s, pose, tree)

    def _publish(self, frame: Frame) -> None:
        seed = self._labeler.manual_seed(self._sensor.name)
        self._links.out.publish(labels_message(frame, self._patterns, seed))
        if not frame.size:
            return
        self._last = frame
        if self._annotated.get_num_connections() > 0:
            self._annotated.publish(annotated(frame))
        if self._in_space is not None and self._in_space.get_num_connections() > 0:
            self._in_space.publish(labeled_cloud(frame))
        if self._seeds is not None:
            self._seeds.show(frame, seed)
