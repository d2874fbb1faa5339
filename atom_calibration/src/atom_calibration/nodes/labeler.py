"""A labeler: one sensor's data in, annotated data and labels out.

Topics, with TOPIC of the configuration: TOPIC/labeled (annotated data), /SENSOR/labels. Range
sensors also have the service /SENSOR/set_seed, and a click on a depth image, on
TOPIC/labeled/mouse_click, sets a seed too.
"""

from __future__ import annotations

import argparse
import sys
import threading
from collections import deque
from typing import Any, Deque, List, Mapping, Optional, Sequence, Tuple

import cv2
import numpy as np
import rospy
from geometry_msgs.msg import PointStamped
from sensor_msgs.msg import Image, PointCloud2

from atom_calibration import conversions
from atom_calibration.annotation import annotated
from atom_calibration.errors import CollectionError, MessageError
from atom_calibration.frames import Frame, decode
from atom_calibration.label_messages import labels_message
from atom_calibration.labelling import FrameLabeler, check_inside
from atom_calibration.live_topics import LiveTopics, message_class, wait_for
from atom_calibration.live_transforms import LiveTransforms
from atom_calibration.msg import SensorLabels
from atom_calibration.nodes import running
from atom_calibration.rig import Rig, rig_from_bag
from atom_calibration.srv import SetSeed, SetSeedResponse
from atom_core.commands.common import add_option
from atom_core.errors import AtomError, ConfigError, LabelingError
from atom_core.io.config_yaml import read_config
from atom_core.io.seeds import Seed, read_seeds, seed_size
from atom_core.labeling.base import nothing
from atom_core.model.config import CalibrationConfig, SensorConfig
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import DEPTH, LIDAR3D, RGB

_BUFFER_BYTES = 2**25  # of a connection: less than a message makes old messages wait
_BACK_S = 1.0  # data that are older by more begin anew, as when a bag is repeated
_SOONER = 0.8  # of a period: stamps jitter


def main(modality: str, argv: Optional[Sequence[str]] = None) -> int:
    """Run the labeler of a modality; return its exit code."""
    name = f"{modality}_labeler"
    args = _parser(name).parse_args(rospy.myargv(sys.argv)[1:] if argv is None else argv)
    return running.guarded(name, lambda: _run(name, modality, args))


def _run(name: str, modality: str, args: argparse.Namespace) -> int:
    config = running.config_of_sensor(args.config, args.sensor)
    everyone = read_config(args.config).sensors
    cameras = {n: entry.link for n, entry in everyone.items() if entry.modality in (RGB, None)}
    running.start(f"{args.sensor}_labeler")
    cv2.setNumThreads(1)
    links = LabelLinks(args.sensor, cameras if modality != RGB else {})
    with LiveTopics(config) as topics:

        def rig_when_there() -> Rig:
            topics.look()
            return rig_from_bag(config, topics)

        rig = wait_for(rig_when_there, running.stopped, rospy.logwarn)
        if rig is None:
            return 0
        node = _node(config, everyone, rig, modality, links, args)
        node.listen(topics)
    node.spin()
    return 0


def _node(
    config: CalibrationConfig,
    everyone: Mapping[str, SensorConfig],
    rig: Rig,
    modality: str,
    links: LabelLinks,
    args: argparse.Namespace,
) -> LabelerNode:
    (sensor,) = rig.sensors.values()
    if sensor.modality != modality:
        raise ConfigError(
            f"{args.config}: sensor '{sensor.name}' is of modality {sensor.modality}; start "
            f"{sensor.modality}_labeler for it"
        )
    for warning in rig.warnings:
        rospy.logwarn(warning)
    seeds = read_seeds(args.seeds, {**everyone, **rig.sensors}) if args.seeds else []
    mine = [seed for seed in seeds if seed.sensor == sensor.name]
    return LabelerNode(config, rig, links, mine, args.automatic_seeds == "on", args.rate)


class LabelLinks:
    """The labels that go out, and those of cameras that come in: linked before any data flow.

    Attributes:
        out: publisher of the sensor's own labels.
        sights: (frame, labels) of cameras that were not looked at yet.
    """

    def __init__(self, sensor: str, cameras: Mapping[str, str]):
        """Advertise and subscribe.

        Args:
            sensor: its name.
            cameras: name to frame, of those whose sight of the board tells seeds.
        """
        self.out = rospy.Publisher(f"/{sensor}/labels", SensorLabels, queue_size=5)
        self.sights: Deque[Tuple[str, SensorLabels]] = deque(maxlen=100)
        for camera, frame in cameras.items():
            if camera != sensor:
                topic = f"/{camera}/labels"
                rospy.Subscriber(topic, SensorLabels, self._see, frame, queue_size=5)

    def _see(self, labels: SensorLabels, camera_frame: str) -> None:
        self.sights.append((camera_frame, labels))


class LabelerNode:
    """Labels the newest data whenever it is done with those before."""

    def __init__(
        self,
        config: CalibrationConfig,
        rig: Rig,
        links: LabelLinks,
        seeds: Sequence[Seed],
        automatic_seeds: bool,
        rate_hz: float,
    ):
        """Advertise labels and annotated data.

        Args:
            config: the calibration.
            rig: the one sensor to label.
            links: for its labels.
            seeds: given by hand.
            automatic_seeds: predict seeds from cameras, and search.
            rate_hz: labels a second at most, by the stamps of the data.
        """
        ((self._topic, sensor),) = rig.topics.items()
        self._sensor, self._links, self._period_s = sensor, links, _SOONER / rate_hz
        self._patterns = {
            name: pattern_from_config(name, entry)
            for name, entry in config.calibration_patterns.items()
        }
        self._labeler = FrameLabeler(
            config, {sensor.name: sensor}, self._patterns, seeds, automatic_seeds
        )
        self._transforms = LiveTransforms()
        self._newest: Any = None
        self._there = threading.Condition()
        self._last: Optional[Frame] = None
        self._seeding = threading.Lock()
        self._stamp_s = -np.inf
        kind = PointCloud2 if sensor.modality == LIDAR3D else Image
        self._annotated = rospy.Publisher(f"{sensor.topic}/labeled", kind, queue_size=2)

    def listen(self, topics: LiveTopics) -> None:
        """Subscribe to the data and to seeds; take up data that came already."""
        kind = message_class(topics.types[self._topic])
        rospy.Subscriber(self._topic, kind, self._take, queue_size=1, buff_size=_BUFFER_BYTES)
        for message in topics.early(self._topic):
            self._take(message)
        if self._sensor.is_range:
            rospy.Service(f"/{self._sensor.name}/set_seed", SetSeed, self._set_seed)
        if self._sensor.modality == DEPTH:
            clicks = f"{self._sensor.topic}/labeled/mouse_click"
            rospy.Subscriber(clicks, PointStamped, self._click, queue_size=1)

    def spin(self) -> None:
        """Label until the node ends."""
        while not running.stopped():
            with self._there:
                if self._newest is None:
                    self._there.wait(0.2)
                message, self._newest = self._newest, None
            if message is not None and self._is_due(message):
                self._publish(self._labelled(message))

    # --- messages in ------------------------------------------------------------------------

    def _take(self, message: Any) -> None:
        with self._there:
            self._newest = message
            self._there.notify()

    def _is_due(self, message: Any) -> bool:
        stamp = conversions.stamp_s(message)
        if stamp < self._stamp_s - _BACK_S:
            rospy.loginfo("time went back: beginning anew")
            self._labeler.begin_anew()
            self._links.sights.clear()
        elif stamp - self._stamp_s < self._period_s:
            return False
        self._stamp_s = stamp
        return True

    # --- labels out -------------------------------------------------------------------------

    def _labelled(self, message: Any) -> Frame:
        frame = self._nothing_of(message)
        try:
            frame = decode(self._sensor, message)
            with self._seeding:
                while self._links.sights:
                    self._note_board(*self._links.sights.popleft())
                self._labeler.label(frame, self._transforms.at(frame.stamp_s))
        except (MessageError, LabelingError, CollectionError) as error:
            rospy.logwarn_throttle(5.0, str(error))
            for name in self._patterns:
                frame.set_label(name, nothing(self._sensor.modality, str(error)))
        return frame

    def _nothing_of(self, message: Any) -> Frame:
        """Return a frame without data, for what cannot be decoded."""
        header = conversions.header_document(message)
        return Frame(self._sensor, conversions.stamp_s(message), header, np.zeros(0))

    def _note_board(self, camera_frame: str, labels: SensorLabels) -> None:
        stamp = conversions.stamp_s(labels)
        tree = self._transforms.at(stamp)
        for part in labels.patterns:
            if part.pose_known and part.pattern_name in self._patterns:
                pose = conversions.pose_matrix(part.pose)
                self._labeler.see_board(camera_frame, part.pattern_name, stamp, pose, tree)

    def _publish(self, frame: Frame) -> None:
        seed = self._labeler.manual_seed(self._sensor.name)
        self._links.out.publish(labels_message(frame, self._patterns, seed))
        if frame.data.size:
            self._last = frame
        if frame.data.size and self._annotated.get_num_connections() > 0:
            self._annotated.publish(annotated(frame))

    # --- seeds by hand ----------------------------------------------------------------------

    def _set_seed(self, request: Any) -> SetSeedResponse:
        try:
            return SetSeedResponse(True, self._apply_seed(list(request.position)))
        except AtomError as error:
            return SetSeedResponse(False, str(error))

    def _click(self, message: PointStamped) -> None:
        try:
            rospy.loginfo(self._apply_seed([message.point.x, message.point.y]))
        except AtomError as error:
            rospy.logwarn(str(error))

    def _apply_seed(self, position: List[float]) -> str:
        """Set, or with nothing clear, the seed; return what to tell the user."""
        sensor = self._sensor
        if not position:
            with self._seeding:
                self._labeler.set_seed(sensor.name, None)
            return f"sensor '{sensor.name}': seeds are automatic again"
        count, unit = seed_size(sensor)
        if len(position) != count or not np.all(np.isfinite(position)):
            raise CollectionError(
                f"sensor '{sensor.name}': a seed has to be {count} finite numbers ({unit}), not "
                f"{[round(v, 3) for v in position]}"
            )
        seed = Seed(sensor.name, np.array(position))
        if self._last is not None:
            check_inside(seed, self._last, "choose a place on the board")
        with self._seeding:
            self._labeler.set_seed(sensor.name, seed.position)
        return f"sensor '{sensor.name}': the board is looked for at {position} {unit}"


def _parser(name: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=name,
        description=__doc__,
        epilog=f"example: rosrun atom_calibration {name} -cfg config.yml -sn SENSOR",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    running.add_config_option(parser)
    add_option(
        parser, "sensor", "-sn", "--sensor_name", required=True, metavar="NAME", help="which one"
    )
    running.add_labelling_options(parser)
    return parser
