"""A dataset becomes a bag, of which the collector makes the same dataset again."""

import numpy as np
import pytest
import rosbag

from atom_calibration.messages.images import colour_image
from atom_calibration.messages.poses import edge_of, transform_matrix
from atom_calibration.nodes.bags.atom_dataset_to_rosbag import constant_edges, main
from atom_calibration.nodes.collecting import collect_from_bag
from atom_core.io.config_yaml import write_config
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import Noise, arm, scenes


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a folder with a dataset of an arm that carries a camera, and its configuration."""
    folder = tmp_path_factory.mktemp("made")
    scene = arm.camera_on_arm(1, errors={}, collections=3, noise=Noise.none())
    write_dataset_folder(scene.dataset, folder / "data", name="arm")
    write_config(folder / "config.yml", scene.dataset.config)
    assert main(["-i", str(folder / "data" / "dataset.json"), "-o", str(folder / "a.bag")]) == 0
    return folder, scene.dataset


def read(path):
    with rosbag.Bag(str(path)) as bag:
        return [(topic, message, time.to_sec()) for topic, message, time in bag.read_messages()]


def test_the_collector_finds_the_same_collections(made):
    folder, old = made
    line = ["-c", folder / "config.yml", "-b", folder / "a.bag", "-o", folder / "again"]
    assert collect_from_bag.main([str(word) for word in line]) == 0
    new = read_dataset(folder / "again" / "dataset.json")
    assert list(new.collections) == list(old.collections)
    for key, collection in old.collections.items():
        found = new.collections[key]
        a, b = (d.labels["rgb_1", "pattern_1"] for d in (collection, found))
        both = np.intersect1d(a.ids, b.ids)
        assert len(both) > 0.8 * len(a.ids)
        one, other = (x.pixels[np.searchsorted(x.ids, both)] for x in (a, b))
        assert np.max(np.abs(one - other)) < 0.5
        for edge, value in collection.transforms.items():
            if edge in found.transforms:
                np.testing.assert_allclose(found.transforms[edge], value, atol=1e-9)
        assert len(found.transforms) >= len(collection.transforms) - len(old.patterns)


def test_images_and_transforms_are_those_of_the_dataset(made):
    folder, old = made
    entries = read(folder / "a.bag")
    assert [time for _, _, time in entries] == sorted(time for _, _, time in entries)
    topic = old.sensors["rgb_1"].topic
    images = [(time, m) for t, m, time in entries if t == topic]
    assert len(images) == 30 and images[-1][0] - images[0][0] == pytest.approx(5.8, abs=1e-6)
    stored = read_dataset(folder / "data" / "dataset.json").data.read("002", "rgb_1")
    np.testing.assert_array_equal(colour_image(images[-1][1]), stored)
    (static,) = [m for t, m, _ in entries if t == "/tf_static"]
    fixed = {edge_of(t): transform_matrix(t) for t in static.transforms}
    assert fixed.keys() == constant_edges(old).keys()
    moving = [m for t, m, _ in entries if t == "/tf"][-1]
    for message in moving.transforms:
        value = old.collections["002"].transforms[edge_of(message)]
        np.testing.assert_allclose(transform_matrix(message), value, atol=1e-12)
    states = [m for t, m, _ in entries if t == "/joint_states"]
    joints = old.collections["002"].joints
    assert dict(zip(states[-1].name, states[-1].position)) == {
        name: joint.position for name, joint in joints.items()
    }


def test_all_modalities_once_at_their_own_stamps(tmp_path):
    scene = scenes.random_scene(2, rgb=1, depth=1, lidar3d=1, collections=2, noise=Noise.none())
    stamps = {
        (k, s): 100.0 + i + 0.25 * j
        for i, k in enumerate(scene.dataset.collections)
        for j, s in enumerate(scene.dataset.sensors)
    }
    path = write_dataset_folder(scene.dataset, tmp_path / "data", name="x", stamps=stamps)
    assert main(["-i", str(path), "-o", str(tmp_path / "b.bag"), "--hold", "0"]) == 0
    topics = {sensor.topic: name for name, sensor in scene.dataset.sensors.items()}
    seen = [
        (topics[t], m.header.stamp.to_sec()) for t, m, _ in read(tmp_path / "b.bag") if t in topics
    ]
    assert sorted(seen) == sorted((s, stamp) for (_, s), stamp in stamps.items())


def test_what_cannot_be_written_is_refused_in_one_line(made, tmp_path, capsys):
    folder, _ = made
    data = str(folder / "data" / "dataset.json")
    copy = tmp_path / "alone.json"
    copy.write_text((folder / "data" / "dataset.json").read_text())
    for line, words in (
        (["-i", data, "-o", str(folder / "a.bag")], "exists already"),
        (["-i", str(copy), "-o", str(tmp_path / "x.bag")], "no data of any sensor"),
        (["-i", data, "-o", str(tmp_path / "x.bag"), "--hold", "-1"], "give seconds up to 600"),
        (["-i", data, "-o", str(tmp_path / "x.bag"), "--hold", "1e9"], "give seconds up to 600"),
        (["-i", data, "-o", str(tmp_path / "no" / "x.bag")], "cannot be written"),
    ):
        capsys.readouterr()
        assert main(line) == 2
        error = capsys.readouterr().err
        assert words in error and error.count("\n") == 1
    assert not list(tmp_path.glob("*.bag")) and not list(tmp_path.glob(".*"))
