"""A camera and a 2D LiDAR of 0.25 deg before boards that lean all ways, as messages."""

import numpy as np

from atom_calibration.messages.scans import scan_message
from atom_core.geometry import se3
from atom_core.model.dataset import pose
from atom_core.model.modality import modality_named
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import LIDAR2D, RGB
from atom_core.model.transforms import Edge
from atom_core.synthetic import Noise, make_dataset
from atom_core.synthetic.board import charuco, held_before
from atom_core.synthetic.rig import assemble, camera_mount, looking_at, pinhole

START_S, PERIOD_S, TIMES = 100.0, 0.2, 4  # messages of each stop
STOPS = 8
NAMES = ("camera", "scanner")


def make_scene():
    """Return the scene: dataset and truth."""
    rng, centre = np.random.default_rng(5), np.array([0.0, 0.0, 1.0])
    structure = {Edge("world", "mast"): looking_at((-0.5, 2.1, 1.3), centre)}
    structure[Edge("world", "post")] = looking_at((0.7, 1.9, 0.95), centre)
    camera = camera_mount("camera", RGB, "mast", np.eye(4), pinhole(640, 480, 500.0))
    scanner = modality_named(LIDAR2D).synthetic.mount("scanner", "post", np.eye(4), None)
    rig = assemble("world", structure, [camera, scanner], anchored="camera")
    border = pattern_from_config("pattern_1", charuco()).border
    boards = [
        held_before(np.array([0.1, 2.2, 1.2]), centre + rng.uniform(-0.15, 0.15, 3), border, rng)
        for _ in range(STOPS)
    ]
    return make_dataset(rig, {"pattern_1": boards}, Noise(), rng)


def stamps(stop):
    return [START_S + PERIOD_S * (TIMES * stop + number) for number in range(TIMES)]


def messages(make, dataset):
    """Yield the recording: the board stands in one place after the other."""
    first = next(iter(dataset.collections.values()))
    yield "/tf_static", make.transforms(first.transforms, START_S), START_S
    camera, scanner = (dataset.sensors[name] for name in NAMES)
    for stop, key in enumerate(dataset.collections):
        picture = dataset.data.read(key, "camera")
        info = camera.topic.replace("image_raw", "camera_info")
        for stamp in stamps(stop):
            about = {"frame": camera.frame, "stamp_s": stamp}
            yield info, make.intrinsics(camera.camera, **about), stamp
            yield camera.topic, make.image(picture, **about), stamp
            yield scanner.topic, scan_at(make, dataset, key, stamp), stamp


def scan_at(make, dataset, key, stamp_s):
    """Return the scan of a place of the board as a message."""
    message = scan_message(dataset.data.read(key, "scanner"))
    message.header = make.header(dataset.sensors["scanner"].frame, stamp_s)
    return message


def seed(scene, key):
    """Return the place of the board's middle in the scanner's frame."""
    dataset = scene.dataset
    world_T_scanner = pose(dataset.collections[key], dataset.graph, "world", "scanner")
    (pattern,) = dataset.patterns.values()
    middle = np.append(pattern.border.centre, 0.0)
    in_world = se3.apply(scene.truth.boards[("pattern_1", key)], middle[None])
    return se3.apply(se3.inverse(world_T_scanner), in_world)[0]
