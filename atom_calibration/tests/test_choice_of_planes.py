"""Where a search chose among planes of the board's size, all labels that follow from it say so."""

import numpy as np
import pytest

from atom_calibration.labels import frame_labeler
from atom_calibration.labels.frame_labeler import FrameLabeler
from atom_calibration.modalities.frames import Frame
from atom_core.labeling.base import Labeled
from atom_core.labeling.lidar3d import ALIKE
from atom_core.model.config import CalibrationConfig
from atom_core.model.labels import RangeLabel
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import LIDAR3D, Sensor
from atom_core.model.transforms import Edge
from atom_core.synthetic.board import charuco

POINTS = np.array([[2.0, x, y] for x in (-0.2, 0.0, 0.2) for y in (-0.2, 0.0, 0.2)])


class AmongPlanes:
    """A labeler that finds planes when it searches, and one of them at its seed."""

    def __init__(self, alike):
        self.alike = alike

    def label(self, _data, seed=None):
        quality = {ALIKE: self.alike} if seed is None and self.alike > 1 else {}
        label = RangeLabel(np.arange(9), np.arange(4))
        return Labeled(label, quality=quality, next_seed=POINTS.mean(axis=0))


@pytest.mark.parametrize("alike", [1.0, 3.0])
def test_it_is_kept_while_the_board_is_tracked(monkeypatch, alike):
    monkeypatch.setattr(frame_labeler, "labeler_for", lambda *_: AmongPlanes(alike))
    sensor = Sensor("lidar", LIDAR3D, "lidar_link", Edge("world", "lidar_link"), topic="/points")
    entry = {"link": "lidar_link", "parent_link": "world", "child_link": "lidar_link"}
    config = CalibrationConfig.from_document(
        {
            "world_link": "world",
            "sensors": {"lidar": {**entry, "topic_name": "/points", "modality": "lidar3d"}},
            "calibration_patterns": {"board": charuco().to_document()},
        },
        "config",
    )
    pattern = pattern_from_config("board", charuco())
    labeler = FrameLabeler(config, {"lidar": sensor}, {"board": pattern})
    cloud = np.rec.fromarrays(POINTS.T, names="x,y,z")

    def counts(seconds):
        found = []
        for stamp_s in seconds:
            frame = Frame(sensor, stamp_s, {}, cloud)
            labeler.label(frame, None)
            found.append(frame.labels["board"].quality.get(ALIKE, 1.0))
        return found

    assert counts((1.0, 1.1, 1.2)) == [alike] * 3
    labeler.set_seed("lidar", POINTS[0])
    assert counts((1.3, 1.4)) == [1.0, 1.0]  # the user has chosen
