"""A collector that is killed at any moment leaves a dataset that can be recovered."""

import multiprocessing
import time

import numpy as np
import pytest

pytest.importorskip("rospy")

from live_scene import COLLECTIONS, LiveScene

from atom_calibration.collect.collector import Setup, write_collection
from atom_calibration.labels.frame_labeler import FrameLabeler
from atom_calibration.modalities.frames import decode
from atom_calibration.sources.transform_tree import TransformTree
from atom_core.cli import main as core_main
from atom_core.io.collections import CollectionStore
from atom_core.io.dataset_json import read_dataset
from atom_core.model.sensor import DEPTH, LIDAR3D

KILLS, SHOWN = 8, COLLECTIONS[0]
_WITHIN_S = 60.0


@pytest.fixture(scope="module")
def taken():
    """Return a scene, its labeled frames of one moment, and its transforms."""
    scene = LiveScene(cloud_sigma_m=0.0)
    tree = TransformTree(30.0)
    tree.add(scene.static_transforms(100.0).transforms, fixed=True)
    labeler = FrameLabeler(scene.dataset.config, scene.sensors, scene.dataset.patterns)
    frames = {}
    for name, sensor in scene.sensors.items():
        frames[name] = decode(sensor, scene.message(name, SHOWN, 100.0))
        labeler.label(frames[name], tree)
    assert all(frame.detections for frame in frames.values())
    return scene, frames, tree


def collect_for_ever(setup, frames, count):
    while True:
        write_collection(setup, frames)
        count.value += 1  # the only one who writes; a lock might be held when it is killed


def test_whenever_it_is_killed_all_that_was_announced_is_there(taken, tmp_path):
    scene, frames, tree = taken
    rng, forking = np.random.default_rng(0), multiprocessing.get_context("fork")
    for number in range(KILLS):
        folder = tmp_path / str(number)
        setup = Setup(
            scene.dataset.config,
            scene.sensors,
            scene.dataset.patterns,
            lambda _: tree,
            CollectionStore.create(folder),
        )
        count = forking.Value("i", 0, lock=False)
        collector = forking.Process(target=collect_for_ever, args=(setup, frames, count))
        collector.start()
        end_s = time.monotonic() + _WITHIN_S
        wanted = int(rng.integers(1, 4))
        while count.value < wanted and time.monotonic() < end_s:
            time.sleep(0.001)
        time.sleep(rng.uniform(0.0, 0.1))  # somewhere within the next one
        collector.kill()
        collector.join()
        announced = count.value
        assert announced >= wanted
        assert core_main(["recover", str(folder)]) == 0
        dataset = read_dataset(folder / "dataset.json")
        assert len(dataset.collections) in (announced, announced + 1)
        for key in dataset.collections:
            for name, sensor in scene.sensors.items():
                assert dataset.data.has_data(key, name)
                if sensor.modality == LIDAR3D:
                    assert len(dataset.data.read(key, name)) == len(frames[name].data)
                elif sensor.modality == DEPTH:
                    assert dataset.data.read(key, name).shape == frames[name].data.shape
                else:
                    assert dataset.data.read(key, name).shape == frames[name].data.shape
        assert len(list(dataset.detections())) == len(frames) * len(dataset.collections)
