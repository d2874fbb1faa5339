"""Where a label fails while the board moves, its reason says so."""

import numpy as np
import pytest
from stand_in_rig import GRID

from atom_calibration.labels.motion_watch import MotionWatch
from atom_calibration.modalities.frames import Frame
from atom_core.geometry.camera import Camera
from atom_core.labeling.base import Labeled, nothing
from atom_core.model.labels import RangeLabel, RgbLabel
from atom_core.model.sensor import LIDAR3D, RGB, Sensor
from atom_core.model.transforms import Edge

VIEW = Camera(64, 48, np.array([[50.0, 0, 32], [0, 50.0, 24], [0, 0, 1]]), np.zeros(5))
CAMERA = Sensor("rgb_1", RGB, "rgb_1", Edge("world", "rgb_1"), camera=VIEW)
LIDAR = Sensor("lidar_1", LIDAR3D, "lidar_1", Edge("world", "lidar_1"))
REASON = "no marker of DICT_5X5_100 is seen"


def picture(stamp_s, shift_px):
    """Return a frame of a camera that sees the board; None as shift: it does not."""
    frame = Frame(CAMERA, stamp_s, {}, None)
    if shift_px is None:
        frame.set_label("board", nothing(RGB, REASON))
    else:
        frame.set_label("board", Labeled(RgbLabel(np.arange(20), GRID + shift_px)))
    return frame


def scan(stamp_s, away_m, seed=0):
    points = np.random.default_rng(seed).uniform(-0.3, 0.3, (40, 3)) * [0.03, 1.0, 1.0]
    points += [away_m, 0.0, 0.0]
    frame = Frame(LIDAR, stamp_s, {}, np.rec.fromarrays(points.T, names="x,y,z"))
    frame.set_label("board", Labeled(RangeLabel(np.arange(40), np.arange(4))))
    return frame


def reason_after(frames, last):
    watch = MotionWatch()
    for frame in frames:
        watch.note(frame)
    watch.note(last)
    return last.labels["board"].reason


def test_a_motion_that_the_camera_saw_before_is_named_with_its_speed():
    before = [picture(0.1 * k, 30.0 * k) for k in range(4)]  # 300 px/s in x and in y
    said = reason_after(before, picture(0.4, None))
    assert said == f"{REASON}; the board moved at 424 px/s before sensor 'rgb_1': hold it still"


def test_a_motion_that_another_sensor_sees_is_named():
    before = [scan(0.1 * k, 3.0 - 0.05 * k) for k in range(5)]
    said = reason_after(before, picture(0.45, None))
    assert said.startswith(REASON) and "before sensor 'lidar_1': hold it still" in said
    assert 450.0 < float(said.split("moved at ")[1].split(" mm/s")[0]) < 550.0


@pytest.mark.parametrize(
    "before",
    [
        [picture(0.1 * k, 0.3 * (-1) ** k) for k in range(4)],  # at rest, with its labels' noise
        [scan(0.1 * k, 3.0, seed=k) for k in range(4)],
        [picture(0.1 * k - 2.0, 30.0 * k) for k in range(4)],  # long ago
        [picture(0.0, 0.0)],
        [],
    ],
    ids=["camera at rest", "LiDAR at rest", "long ago", "seen once", "never seen"],
)
def test_without_a_motion_the_reason_is_as_it_was(before):
    assert reason_after(before, picture(0.4, None)) == REASON


def test_a_frame_that_is_noted_twice_names_the_motion_once():
    watch, last = MotionWatch(), picture(0.3, None)
    for frame in [picture(0.1 * k, 30.0 * k) for k in range(3)]:
        watch.note(frame)
    watch.note(last)
    watch.note(last)
    assert last.labels["board"].reason.count("the board moved") == 1
