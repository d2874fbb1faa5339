"""What dataset_playback publishes of a collection: transforms, data and labels, all latched."""

from __future__ import annotations

from functools import partial
from typing import Any, Dict, List, NamedTuple

import numpy as np
import rospy
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from tf2_msgs.msg import TFMessage

from atom_calibration.messages.poses import transforms_message
from atom_calibration.modalities.table import is_labeled, ros_modality
from atom_calibration.runtime import running
from atom_calibration.show import playback_view as view
from atom_calibration.show.annotation import labeled_cloud
from atom_core.editing.drawn_borders import DrawnBorders
from atom_core.editing.label_corrections import LabelCorrections
from atom_core.model.labels import DetectionKey
from atom_core.model.sensor import Sensor


class _Publishers(NamedTuple):
    """Where a sensor's data and labels go; infos of cameras only."""

    data: rospy.Publisher
    infos: List[rospy.Publisher]
    pictures: List[rospy.Publisher]
    points: List[rospy.Publisher]


class CollectionTopics:
    """The topics of every sensor, and /tf_static.

    Attributes:
        sensors: those that are shown, by name.
        shown: what is shown of each.
    """

    def __init__(self, corrections: LabelCorrections, borders: DrawnBorders):
        """Advertise; nothing is published yet."""
        self._corrections, self._borders = corrections, borders
        sensors = corrections.dataset.sensors
        self.sensors = {n: s for n, s in sensors.items() if is_labeled(s.modality)}
        self.shown: Dict[str, view.Shown] = {}
        self._tf = running.Publisher("/tf_static", TFMessage, queue_size=10, latch=True)
        self._publishers = {name: _publishers(s) for name, s in self.sensors.items()}

    def show_collection(self) -> None:
        """Publish transforms, data and labels of the collection that is chosen."""
        dataset, key = self._corrections.dataset, self._corrections.collection
        transforms = dataset.collections[key].transforms
        self._tf.publish(transforms_message(transforms, rospy.Time.now()))  # data are placed by it
        for name, publishers in self._publishers.items():
            self.shown[name] = view.shown(self._corrections, name)
            frame = self.shown[name].frame
            for publisher in publishers.infos:
                publisher.publish(view.camera_info(frame))
            publishers.data.publish(view.data_message(frame))
            self._publish_labels(name)

    def show_all_labels(self) -> None:
        """Publish the labels anew, as after a correction that may be of any sensor."""
        for name in self.sensors:
            self.show_labels(name)

    def show_labels(self, name: str) -> None:
        """Publish the labels of a sensor anew."""
        self.shown[name] = view.shown(self._corrections, name)
        self._publish_labels(name)

    def _publish_labels(self, name: str) -> None:
        frame, publishers = self.shown[name].frame, self._publishers[name]
        for publisher in publishers.pictures:
            chosen = self._corrections.chosen
            publisher.publish(view.labeled_image(frame, chosen, partial(self._draw_border, name)))
        for publisher in publishers.points:
            publisher.publish(labeled_cloud(frame))

    def _draw_border(self, name: str, picture: np.ndarray) -> None:
        corrections = self._corrections
        place = DetectionKey(corrections.collection, name, corrections.pattern)
        self._borders.draw(place, picture)


def _publishers(sensor: Sensor) -> _Publishers:
    topic = view.data_topic(sensor)
    image = sensor.kind.has_camera_info

    def latched(name: str, kind: Any) -> rospy.Publisher:
        return running.Publisher(name, kind, queue_size=2, latch=True)

    info = f"{topic.rpartition('/')[0]}/camera_info"
    return _Publishers(
        latched(topic, ros_modality(sensor.modality).message),
        [latched(info, CameraInfo)] if image else [],
        [latched(f"{topic}/{view.IMAGES}", Image)] if image else [],
        [latched(f"{topic}/{view.POINTS}", PointCloud2)] if sensor.kind.measures_range else [],
    )
