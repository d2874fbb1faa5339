"""``rosrun atom_calibration convert --to kalibr``: the bag is read back and compared."""

import cv2
import numpy as np
import rosbag

from atom_calibration.nodes.bags.convert import main
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes


def test_the_bag_holds_the_images_at_common_stamps(tmp_path, capsys):
    scene = scenes.random_scene(3, rgb=2, depth=0, lidar3d=1, collections=3)
    write_dataset_folder(scene.dataset, tmp_path / "data", name="data")
    source = tmp_path / "data" / "dataset.json"
    line = ["--to", "kalibr", "--dataset", str(source), "--output", str(tmp_path / "out")]
    assert main(line) == 0
    said = capsys.readouterr().out
    dataset = read_dataset(source)
    topics = {dataset.sensors[name].topic: name for name in ("rgb_1", "rgb_2")}
    assert f"--topics {' '.join(topics)} --models pinhole-radtan pinhole-radtan" in said
    with rosbag.Bag(str(tmp_path / "out" / "images.bag")) as bag:
        entries = [(topic, message, time) for topic, message, time in bag.read_messages()]
    assert {topic for topic, _, _ in entries} == set(topics)
    assert len(entries) == 2 * len(dataset.collections)
    stamps = {topic: [] for topic in topics}
    for topic, message, time in entries:
        key = list(dataset.collections)[len(stamps[topic])]
        stamps[topic].append(message.header.stamp)
        assert message.header.stamp == time and message.encoding == "mono8"
        found = np.frombuffer(message.data, np.uint8).reshape(message.height, message.step)
        image = dataset.data.read(key, topics[topic])
        np.testing.assert_array_equal(found, cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))
    one, other = stamps.values()
    assert one == other and one == sorted(set(one))
    assert (tmp_path / "out" / "target.yaml").read_text().startswith("target_type: 'checkerboard'")
    assert main(line) == 2  # the folder is not empty
