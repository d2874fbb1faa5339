"""Labelers of pictures that tests share."""

from atom_core.labeling.rgb import RgbLabeler
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import RGB, Sensor
from atom_core.model.transforms import Edge
from atom_core.synthetic import scenes

CAMERA = scenes.COLOUR_CAMERA  # 1280 x 800, with distortion


def sensor(camera=CAMERA):
    return Sensor("rgb_1", RGB, "rgb_1_optical_frame", Edge("world", "rgb_1_link"), camera)


def labeler(config, camera=CAMERA):
    return RgbLabeler(sensor(camera), pattern_from_config("pattern_1", config), config)


def without_intrinsics(labeler):
    object.__setattr__(labeler.sensor, "camera", None)
    return labeler
