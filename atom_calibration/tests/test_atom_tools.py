"""ATOM's small programs around configurations and bags."""

import numpy as np
import pytest
import rosbag
import rospy
from small_rig import write_package
from tf2_msgs.msg import TFMessage

from atom_calibration.configure import create_package, update_config, update_script, view_config
from atom_calibration.messages.poses import transforms_message
from atom_calibration.nodes.bags import tf_static_to_dataset
from atom_core.geometry import se3
from atom_core.io.config_yaml import read_config
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.model.transforms import Edge
from atom_core.synthetic import Noise, scenes

OF_VERSION_2 = """\
world_link: base
anchored_sensor: cam
max_duration_between_msgs: 1000
sensors:
  cam: {link: cam_optical, parent_link: base, child_link: cam_link, topic_name: /cam/image_raw}
calibration_pattern:
  {link: board, parent_link: base, fixed: false, pattern_type: charuco, dictionary: DICT_5X5_100,
   border_size: 0.04, dimension: {x: 11, y: 8}, size: 0.06, inner_size: 0.045}
"""


@pytest.fixture
def old_package(tmp_path):
    create_package.create_package(str(tmp_path / "old_calibration"))
    path = tmp_path / "old_calibration" / "calibration" / "config.yml"
    path.write_text(OF_VERSION_2)
    return path


def test_an_older_configuration_is_written_anew_and_stays(old_package, capsys):
    line = ["-pn", str(old_package.parents[1])]
    assert update_config.main(line) == 0
    new = read_config(old_package.with_name("config_version_3.yml"))
    assert new.anchored_sensor == "cam" and list(new.calibration_patterns) == ["pattern_1"]
    assert new.warnings == () and old_package.read_text() == OF_VERSION_2
    assert update_config.main(line) == 2 and "exists already" in capsys.readouterr().err
    assert update_config.main([*line, "--in_place"]) == 0
    assert old_package.with_name("config.yml.old").read_text() == OF_VERSION_2
    assert read_config(old_package).calibration_patterns == new.calibration_patterns


def test_the_script_configure_is_written_again(old_package, capsys):
    folder = old_package.parents[1]
    script = folder / "scripts" / "configure"
    text = script.read_text()
    assert update_script.main(["-n", str(folder)]) == 0
    assert "is as it should be" in capsys.readouterr().out
    script.write_text("old")
    assert update_script.main(["-n", str(folder)]) == 0
    assert script.read_text() == text and script.stat().st_mode & 0o111
    assert script.with_name("configure.old").read_text() == "old"


def test_a_configuration_is_shown_and_nothing_is_written(tmp_path, make, capsys):
    folder = write_package(tmp_path, make, seconds=1.0)
    before = sorted(path for path in folder.rglob("*"))
    assert view_config.main(["-n", str(folder)]) == 0
    out = capsys.readouterr().out
    config = read_config(folder / "calibration" / "config.yml")
    for name, sensor in config.sensors.items():
        assert name in out and f"> {sensor.link}" in out
    assert sorted(path for path in folder.rglob("*")) == before
    path = folder / "calibration" / "config.yml"
    path.write_text(path.read_text().replace("camera_optical", "nowhere"))
    assert view_config.main(["-n", str(folder)]) == 2
    assert "config.yml:" in capsys.readouterr().err


def test_static_transforms_of_a_bag_become_those_of_a_dataset(tmp_path, capsys):
    scene = scenes.random_scene(2, rgb=2, depth=0, lidar3d=0, collections=2, noise=Noise.none())
    dataset, edge = scene.dataset, scene.dataset.sensors["rgb_2"].edge
    path = write_dataset_folder(dataset, tmp_path / "set", name="two")
    factory = dataset.first_value(edge) @ se3.random_move(0.01, 0.01, np.random.default_rng(0))
    bag = tmp_path / "a.bag"
    time = rospy.Time.from_sec(1.0)
    for edges in ({Edge("nowhere", "else"): np.eye(4)}, {edge: factory}):
        with rosbag.Bag(str(bag), "w") as written:
            written.write("/tf_static", transforms_message(edges, time), time)
        line = ["-json", str(path), "-b", str(bag)]
        code = tf_static_to_dataset.main(line)
        said = capsys.readouterr()
        if edge not in edges:
            assert code == 2 and "it has: nowhere-else" in said.err
    assert code == 0 and str(edge) in said.out
    found = read_dataset(tmp_path / "set" / "factory_calibration.json")
    for collection in found.collections.values():
        np.testing.assert_allclose(collection.transforms[edge], factory, atol=1e-9)
    with rosbag.Bag(str(bag), "w") as written:
        written.write("/tf", TFMessage(), time)
    assert tf_static_to_dataset.main([*line, "--overwrite"]) == 2
    assert "there is no /tf_static" in capsys.readouterr().err
