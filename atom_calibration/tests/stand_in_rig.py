"""A camera and a LiDAR whose labelers read the board's place out of the data.

They are stand-ins for tests that are about collecting alone: pixel 0 of an image holds the board's
shift in pixels (0: not there), and the first forty points of a cloud are the board.
"""

import numpy as np

from atom_calibration.labels import frame_labeler as labeling
from atom_calibration.nodes.collecting.collect_from_bag import main
from atom_core.labeling.base import Labeled, nothing
from atom_core.model.labels import RangeLabel, RgbLabel
from atom_core.model.sensor import RGB

CONFIG = """
world_link: world
sensors:
  cam: {link: cam_optical, parent_link: world, child_link: cam, topic_name: /cam/image_raw,
        modality: rgb}
  lidar: {link: lidar, parent_link: arm, child_link: lidar, topic_name: /lidar/points,
          modality: lidar3d}
calibration_patterns:
  board: {link: board, parent_link: world, fixed: false, pattern_type: charuco,
          dictionary: DICT_5X5_100, dimension: {x: 5, y: 4}, size: 0.1, inner_size: 0.07,
          border_size: {x: 0.02, y: 0.02}}
max_duration_between_msgs: 200
"""
GRID = np.stack(np.meshgrid(np.arange(5), np.arange(4)), axis=-1).reshape(-1, 2) * 8.0 + 5.0
STOPS = 3


class StandIn:
    """A labeler that is told the truth by the data."""

    def __init__(self, sensor, pattern, _config):
        self.modality = sensor.modality

    def label(self, data, seed=None):
        if self.modality == RGB:
            shift = int(data[0, 0, 0])
            if not shift:
                return nothing(RGB, "no markers")
            return Labeled(RgbLabel(np.arange(20), GRID + shift))
        centre = np.array([data[axis][:40].mean() for axis in "xyz"])
        if seed is not None and np.linalg.norm(seed - centre) > 1.0:
            return nothing(self.modality, "the seed is not on the board")
        return Labeled(RangeLabel(np.arange(40), np.arange(4)), next_seed=centre)


def position(time_s):
    """The board's place [px]: it stands for 1.5 s, moves for 1 s, and so on."""
    stop, rest = divmod(time_s, 2.5)
    return int(round(10 * stop + 10 * max(rest - 1.5, 0.0))) + 1


def messages(make, lag_s=0.03, stops=STOPS):
    """Yield (topic, message, time) of a rig whose LiDAR rides on an arm that moves."""
    shift = np.eye(4)
    yield "/tf_static", make.tf("world", "cam", shift, 100.0), 100.0
    yield "/tf_static", make.tf("cam", "cam_optical", shift, 100.0), 100.0
    yield "/tf_static", make.tf("arm", "lidar", shift, 100.0), 100.0
    for tick in range(25 * stops):
        time_s = 0.1 * tick
        stamp = 100.0 + time_s
        arm = np.eye(4)
        arm[0, 3] = 0.01 * tick
        yield "/tf", make.tf("world", "arm", arm, stamp), stamp
        image = np.zeros((48, 64, 3), np.uint8)
        image[0, 0, 0] = position(time_s)
        yield "/cam/camera_info", make.camera_info(frame="cam_optical", stamp_s=stamp), stamp
        yield "/cam/image_raw", make.image(image, frame="cam_optical", stamp_s=stamp), stamp
        seen = stamp + lag_s
        yield "/lidar/points", cloud(make, position(time_s + lag_s), seen), seen


def cloud(make, place_px, stamp_s):
    rng = np.random.default_rng(int(1000 * stamp_s))
    board = rng.uniform(-0.3, 0.3, (40, 3)) * [0, 1, 1] + [3 + 0.05 * place_px, 0, 0]
    wall = np.column_stack([np.full(200, 9.0), rng.uniform(-3, 3, (200, 2))])
    return make.xyz_cloud(np.vstack([board, wall]), stamp_s=stamp_s)


def use_stand_ins(monkeypatch):
    """Let all frames be labeled by them."""
    monkeypatch.setattr(labeling, "labeler_for", StandIn)
    # The stand-ins' camera and LiDAR do not look at one world: no predictions.
    monkeypatch.setattr(labeling.FrameLabeler, "_note_boards", lambda *_: None)


class Place:
    """Where a bag, its configuration and what is collected stand; a call writes the bag."""

    def __init__(self, make, folder):
        self.make, self.root = make, folder
        self.folder, self.config = folder / "out", folder / "config.yml"
        self.config.write_text(CONFIG)

    def __call__(self, content=None, **options):
        """Write a bag of (topic, message, time); return the arguments of the command."""
        content = content or messages(self.make)
        path = self.make.bag(self.root / "a.bag", content, **options)
        words = {"--config": self.config, "--bag": path, "--output": self.folder}
        return [str(word) for pair in words.items() for word in pair]


def refusal(arguments, capsys):
    """Run collect_from_bag, expect a refusal, return its one line."""
    capsys.readouterr()
    assert main(arguments) == 2
    told = [x for x in capsys.readouterr().err.split("\n") if x.startswith("collect_from_bag:")]
    lines = [x for x in told if not x.startswith("collect_from_bag: warning: ")]
    assert len(lines) == 1, lines
    return lines[0]
