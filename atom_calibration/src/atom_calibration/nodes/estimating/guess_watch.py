"""What the sensors see while a first guess is made: clouds in the images, points on the board.

It works in a thread of its own, so that dragging never waits for it.
"""

from __future__ import annotations

import threading
import time
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Tuple

import numpy as np
import rospy
import tf2_ros
from sensor_msgs.msg import Image

from atom_calibration.errors import MessageError
from atom_calibration.messages.images import image_message
from atom_calibration.messages.poses import transform_matrix
from atom_calibration.modalities.frames import Frame, decode, points_of
from atom_calibration.modalities.table import ros_modality
from atom_calibration.runtime import running
from atom_calibration.runtime.graph_names import graph_name
from atom_calibration.sources.live_topics import LiveTopics, message_class
from atom_calibration.sources.rig import sensor_from_bag
from atom_core.editing.guess_fit import (
    OffBoard,
    draw_points,
    off_board,
    pixels_of_points,
    smaller,
)
from atom_core.errors import AtomError
from atom_core.labeling.base import Labeler, labeler_for
from atom_core.model.colours import Colour
from atom_core.model.config import CalibrationConfig
from atom_core.model.pattern import Pattern, pattern_from_config
from atom_core.model.sensor import Sensor

_EVERY_S = 0.2  # of the wall's clock
_LOOK_EVERY_S = 1.0  # for sensors that are not there yet, and for the board in an image
_MOST_POINTS = 8000  # of a cloud that are drawn
_MOST_MEASURED = 60000  # of a cloud that are compared with the board
_WIDEST_PX = 640
_BRIGHTNESS = 0.6  # of the image below the points
_BUFFER_BYTES = 2**25


class BoardFit(NamedTuple):
    """How a range sensor's points fit the board that a camera sees."""

    camera: str
    off: OffBoard


class GuessWatch:
    """Draws every cloud into every image, and measures the points on the board.

    Attributes:
        fits: of each range sensor, with the camera whose board its points fit best: behind a
            board that a range sensor does not see there are points, too.
    """

    def __init__(
        self,
        config: CalibrationConfig,
        colours: Dict[str, Colour],
        on_change: Callable[[], None],
    ):
        """Begin to look; sensors are taken up as their data come.

        Args:
            config: sensors and patterns.
            colours: by sensor.
            on_change: called when the fits are others, in this object's thread.
        """
        self.fits: Dict[str, BoardFit] = {}
        self._config, self._colours, self._on_change = config, colours, on_change
        self._patterns = {
            n: pattern_from_config(n, p) for n, p in config.calibration_patterns.items()
        }
        self._sensors: Dict[str, Sensor] = {}
        self._labelers: Dict[Tuple[str, str], Labeler] = {}
        self._newest: Dict[str, Any] = {}  # messages
        self._seen: Dict[str, Tuple[float, Dict[str, np.ndarray]]] = {}  # time, board poses
        self._subscribers: List[rospy.Subscriber] = []
        self._buffer = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._buffer)
        self._changed = threading.Event()
        self._topics = LiveTopics(config)
        self._publishers: Dict[str, rospy.Publisher] = {}
        self._due_s = 0.0
        threading.Thread(target=self._work, daemon=True).start()

    def moved(self) -> None:
        """Draw anew: a sensor was dragged."""
        self._changed.set()

    def _work(self) -> None:
        while not running.stopped():
            if not self._changed.wait(_LOOK_EVERY_S):
                self._look_for_sensors()
                continue
            self._changed.clear()
            began = time.monotonic()
            try:
                self._look_for_sensors()
                self._show()
            except rospy.ROSException:  # the topics are closed: the node ends
                return
            time.sleep(max(_EVERY_S - (time.monotonic() - began), 0.05))

    # --- sensors and data -------------------------------------------------------------------

    def _look_for_sensors(self) -> None:
        """Take up sensors whose topics, and intrinsics, have come."""
        if len(self._sensors) == len(self._config.sensors) or time.monotonic() < self._due_s:
            return
        self._due_s = time.monotonic() + _LOOK_EVERY_S
        try:
            self._topics.look()
        except AtomError:
            return
        for name, entry in self._config.sensors.items():
            if name in self._sensors:
                continue
            try:
                topic, sensor = sensor_from_bag(name, entry, self._topics)
            except AtomError:
                continue  # it has not come yet
            if sensor is not None:
                self._take_up(topic, sensor)

    def _take_up(self, topic: str, sensor: Sensor) -> None:
        self._sensors[sensor.name] = sensor
        if sensor.camera is not None:
            name = f"~{graph_name(sensor.name)}/overlay"
            self._publishers[sensor.name] = running.Publisher(name, Image, queue_size=1, latch=True)
        if sensor.camera is not None and not sensor.kind.measures_range:
            for name, pattern in self._patterns.items():
                config = self._config.calibration_patterns[name]
                self._labelers[(sensor.name, name)] = labeler_for(sensor, pattern, config)

        def keep(message: Any) -> None:
            self._newest[sensor.name] = message
            self._changed.set()

        kind = message_class(self._topics.types[topic])
        self._subscribers.append(
            rospy.Subscriber(topic, kind, keep, queue_size=1, buff_size=_BUFFER_BYTES)
        )

    # --- what is shown ----------------------------------------------------------------------

    def _show(self) -> None:
        frames = self._frames()
        clouds = {n: _points(f) for n, f in frames.items() if f.sensor.kind.measures_range}
        fits: Dict[str, BoardFit] = {}
        for name, frame in frames.items():
            if frame.sensor.camera is None:
                continue
            try:
                self._show_in(frame, clouds, fits)
            except AtomError as error:  # the other cameras are shown
                text = f"no clouds are drawn into the images of {name}: {error}"
                rospy.logwarn_throttle_identical(10.0, text)
        if fits != self.fits:
            self.fits = fits
            self._on_change()

    def _show_in(
        self, frame: Frame, clouds: Dict[str, np.ndarray], fits: Dict[str, BoardFit]
    ) -> None:
        """Compare clouds with the boards that a camera sees, and draw them into its image."""
        placed = self._placed(frame.sensor, clouds)
        if not frame.sensor.kind.measures_range:
            self._measure(frame, clouds, placed, fits)
        if self._publishers[frame.sensor.name].get_num_connections():
            self._publish(frame, clouds, placed)

    def _frames(self) -> Dict[str, Frame]:
        frames: Dict[str, Frame] = {}
        for name, message in list(self._newest.items()):
            try:
                frames[name] = decode(self._sensors[name], message)
            except MessageError as error:
                rospy.logwarn_throttle(10.0, f"a message is left out: {error}")
        return frames

    def _placed(self, camera: Sensor, clouds: Dict[str, np.ndarray]) -> Dict[str, np.ndarray]:
        """Return ``camera_T_sensor`` (4, 4) of the sensors that tf ties to a camera."""
        placed = {}
        for name in clouds:
            frame = self._sensors[name].frame
            try:
                found = self._buffer.lookup_transform(camera.frame, frame, rospy.Time())
            except tf2_ros.TransformException:
                continue
            placed[name] = transform_matrix(found)
        return placed

    def _measure(
        self,
        frame: Frame,
        clouds: Dict[str, np.ndarray],
        placed: Dict[str, np.ndarray],
        fits: Dict[str, BoardFit],
    ) -> None:
        """Compare points with the boards that a camera sees."""
        for pattern, camera_T_pattern in self._boards(frame).items():
            for name, camera_T_sensor in placed.items():
                step = -(-len(clouds[name]) // _MOST_MEASURED) or 1
                points = clouds[name][::step]
                found = off_board(
                    points, camera_T_sensor, camera_T_pattern, self._patterns[pattern]
                )
                known = fits.get(name)
                if np.isfinite(found.median_m) and (
                    known is None or found.median_m < known.off.median_m
                ):
                    fits[name] = BoardFit(frame.sensor.name, found)

    def _boards(self, frame: Frame) -> Dict[str, np.ndarray]:
        """Return ``camera_T_pattern`` (4, 4) of the boards in an image, looked for now and then."""
        name = frame.sensor.name
        if time.monotonic() - self._seen.get(name, (-np.inf, {}))[0] >= _LOOK_EVERY_S:
            found: Dict[str, np.ndarray] = {}
            for key, pattern in self._patterns.items():
                pose = self._board(frame, key, pattern)
                if pose is not None:
                    found[key] = pose
            self._seen[name] = (time.monotonic(), found)
        return self._seen[name][1]

    def _board(self, frame: Frame, key: str, pattern: Pattern) -> Optional[np.ndarray]:
        labeled = self._labelers[(frame.sensor.name, key)].label(frame.data, None)
        frame.set_label(key, labeled)
        return frame.board_pose(pattern)

    def _publish(
        self, frame: Frame, clouds: Dict[str, np.ndarray], placed: Dict[str, np.ndarray]
    ) -> None:
        sensor, camera = frame.sensor, frame.sensor.camera
        background = ros_modality(sensor.modality).background
        assert camera is not None and background is not None
        with np.errstate(invalid="ignore"):
            picture = (_BRIGHTNESS * background(frame.data)).astype(np.uint8)
        picture = smaller(picture, _WIDEST_PX)
        scale = picture.shape[1] / camera.width
        for name, camera_T_sensor in placed.items():
            if name == sensor.name:
                continue
            step = -(-len(clouds[name]) // _MOST_POINTS) or 1
            points = transformed(camera_T_sensor, clouds[name][::step])
            pixels = (scale * pixels_of_points(camera, points)).astype(int)
            red, green, blue = (int(255 * part) for part in self._colours[name])
            draw_points(picture, pixels, (blue, green, red))
        message = image_message(picture, "bgr8")
        message.header.stamp, message.header.frame_id = rospy.Time.now(), sensor.frame
        self._publishers[sensor.name].publish(message)


def transformed(a_T_b: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return points (n, 3) of b in a; those that are NaN stay so."""
    return points @ a_T_b[:3, :3].T + a_T_b[:3, 3]


def _points(frame: Frame) -> np.ndarray:
    """Return all points (n, 3) [m] of a range sensor's data."""
    return points_of(frame, np.arange(frame.size)).astype(float)
