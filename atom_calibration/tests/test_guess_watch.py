"""What is drawn while a first guess is made, without a master."""

import threading

import numpy as np
import pytest

rospy = pytest.importorskip("rospy")

import tf2_ros  # noqa: E402

from atom_calibration.messages.images import image_message  # noqa: E402
from atom_calibration.nodes.estimating.guess_watch import GuessWatch  # noqa: E402
from atom_core.labeling.base import labeler_for  # noqa: E402
from atom_core.model.colours import sensor_colours  # noqa: E402
from atom_core.synthetic import scenes  # noqa: E402


class Pictures:
    """A topic that somebody looks at; keeps what is published."""

    def __init__(self):
        self.sent = []

    def get_num_connections(self):
        return 1

    def publish(self, message):
        self.sent.append(message)


class NoTransforms:
    def lookup_transform(self, *_):
        raise tf2_ros.LookupException("nothing is connected")


@pytest.fixture
def watch(monkeypatch):
    """A watch of two cameras, whose thread does not run."""
    monkeypatch.setattr(rospy.rostime, "_rostime_initialized", True)
    dataset = scenes.two_cameras().dataset
    made = GuessWatch.__new__(GuessWatch)
    made.fits, made._seen, made._newest = {}, {}, {}
    made._config, made._colours = dataset.config, sensor_colours(dataset.config.sensors)
    made._patterns, made._sensors = dict(dataset.patterns), dict(dataset.sensors)
    made._labelers = {
        (sensor.name, name): labeler_for(sensor, pattern, dataset.config.calibration_patterns[name])
        for sensor in dataset.sensors.values()
        for name, pattern in dataset.patterns.items()
    }
    made._publishers = {name: Pictures() for name in dataset.sensors}
    made._buffer, made._changed = NoTransforms(), threading.Event()
    made._on_change = lambda: None
    return made


def image_of(sensor, scale=1.0):
    size = (int(scale * sensor.camera.height), int(scale * sensor.camera.width), 3)
    message = image_message(np.full(size, 90, np.uint8), "bgr8")
    message.header.frame_id = sensor.frame
    return message


def test_a_camera_whose_images_are_not_of_its_size_keeps_no_other_from_being_shown(watch):
    wrong, right = watch._sensors.values()
    watch._newest = {wrong.name: image_of(wrong, 0.5), right.name: image_of(right)}
    watch._show()
    assert len(watch._publishers[right.name].sent) == 1
    assert len(watch._publishers[wrong.name].sent) == 0
