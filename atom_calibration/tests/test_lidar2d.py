"""2D LiDARs: their messages, and the way from a bag to a calibration."""

import json
from xml.etree import ElementTree

import numpy as np
import pytest
import rosbag
import yaml
from scan_scene import STOPS, make_scene, messages, seed, stamps
from sensor_msgs.msg import LaserScan
from small_rig import CONFIG, write_package

from atom_calibration.configure import configure_package
from atom_calibration.configure.render import RVIZ_FILES
from atom_calibration.errors import MessageError
from atom_calibration.messages.scans import laser_scan, scan_message
from atom_calibration.modalities.frames import Frame, decode
from atom_calibration.modalities.table import ros_modality
from atom_calibration.nodes.collecting.collect_from_bag import main
from atom_calibration.show.annotation import POINT, annotated
from atom_core.cli import main as core_main
from atom_core.editing.label_corrections import LabelCorrections
from atom_core.io.config_yaml import write_config
from atom_core.io.dataset_json import read_dataset
from atom_core.labeling.base import labeler_for
from atom_core.model.sensor import LIDAR2D, Sensor
from atom_core.model.transforms import Edge

HEADER = {"seq": 0, "stamp": {"secs": 1, "nsecs": 0}, "frame_id": "scan"}
SENSOR = Sensor("scan", LIDAR2D, "scan", Edge("world", "scan"), topic="/scan")


def message(ranges=(2.0, 3.0, 4.0), step=np.pi / 2, **changed):
    made = LaserScan(angle_min=0.0, angle_increment=step, range_min=0.1, range_max=9.0)
    made.angle_max = step * (len(ranges) - 1)
    made.ranges = list(ranges)
    for name, value in changed.items():
        setattr(made, name, value)
    return made


# ---------------------------------------------------------------------------- messages


@pytest.mark.parametrize("sign", [1, -1], ids=["counterclockwise", "clockwise"])
def test_beams_follow_the_sensors_rotation(sign):
    scan = decode(SENSOR, message(step=sign * np.pi / 2)).data
    expected = [[2, 0, 0], [0, 3 * sign, 0], [-4, 0, 0]]
    np.testing.assert_allclose(scan.points, expected, atol=1e-9)


def test_what_is_no_return_keeps_its_place():
    ranges = (2.0, np.inf, -np.inf, np.nan, 0.0, 0.05, 20.0, 5.0)
    scan = laser_scan(message(ranges, step=0.5))
    np.testing.assert_array_equal(scan.valid, [True] + 6 * [False] + [True])
    assert np.isnan(scan.points[1:-1, 0]).all() and ros_modality(LIDAR2D).size(scan) == 8


def test_intensities_are_optional():
    assert laser_scan(message()).intensities is None
    scan = laser_scan(message(intensities=[7.0, 8.0, 9.0]))
    np.testing.assert_array_equal(scan.intensities, [7, 8, 9])


@pytest.mark.parametrize("step", [0.01, -0.01])
def test_a_scan_that_is_encoded_is_the_message_again(step):
    was = message(np.linspace(1, 5, 300), step, scan_time=0.1, intensities=list(range(300)))
    again = scan_message(laser_scan(was))
    for name in LaserScan.__slots__[1:]:
        np.testing.assert_array_equal(getattr(again, name), getattr(was, name))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (message((np.inf, 0.0, 20.0)), "no valid range"),
        (message(angle_max=3.0 * np.pi), "3 ranges, but its angles make 7"),
        (message(intensities=[1.0, 2.0]), "3 ranges but 2 intensities"),
        (message(()), "0 ranges"),
        (message(angle_increment=0.0), "angle_increment is 0"),
        (message(angle_min=np.nan), "angle_min is nan"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_wrong_scan_is_refused_in_one_sentence(wrong, words):
    with pytest.raises(MessageError) as refused:
        decode(SENSOR, wrong)
    assert words in str(refused.value) and "\n" not in str(refused.value)
    assert refused.value.sensor == "scan" and "topic /scan, time 0.000" in str(refused.value)


def test_data_that_cannot_be_read_are_shown_as_an_empty_scan():
    ros = ros_modality(LIDAR2D)
    frame = Frame(SENSOR, 1.0, HEADER, ros.no_data(SENSOR))
    assert frame.size == 0 and len(ros.encode(frame.data).ranges) == 0
    assert not ros.draw(frame).any() and annotated(frame).width == 0


# ----------------------------------------------------------------------- bag to dataset


@pytest.fixture(scope="module")
def scene():
    return make_scene()


@pytest.fixture(scope="module")
def collected(scene, make, tmp_path_factory):
    """Collect the recording with seeds; return the folder of the dataset."""
    folder = tmp_path_factory.mktemp("scan")
    write_config(folder / "config.yml", scene.dataset.config)
    make.bag(folder / "a.bag", messages(make, scene.dataset))
    seeds = [
        {"stamp": stamp, "sensor": "scanner", "xyz_m": seed(scene, key).tolist()}
        for stop, key in enumerate(scene.dataset.collections)
        for stamp in stamps(stop)
    ]
    (folder / "seeds.yaml").write_text(json.dumps(seeds))  # JSON is YAML
    words = {"config": "config.yml", "bag": "a.bag", "seeds": "seeds.yaml", "output": "out"}
    arguments = [x for name, file in words.items() for x in (f"--{name}", str(folder / file))]
    assert main([*arguments, "--automatic_seeds", "off", "--pictures"]) == 0
    return folder / "out"


def test_each_stop_becomes_a_collection_with_its_scan(scene, collected):
    dataset = read_dataset(collected / "dataset.json")
    assert len(dataset.collections) == STOPS
    entry = dataset.document["collections"]["000"]["data"]["scanner"]
    assert "data_file" not in entry and entry["header"]["frame_id"] == "scanner"
    for mine, key in zip(dataset.collections, scene.dataset.collections):
        there, here = scene.dataset.data.read(key, "scanner"), dataset.data.read(mine, "scanner")
        np.testing.assert_allclose(here.points, there.points, atol=1e-5)
    assert len(list((collected / "pictures").glob("*scanner.jpg"))) == STOPS


def test_labels_are_the_labelers(scene, collected):
    dataset = read_dataset(collected / "dataset.json")
    (pattern,) = dataset.patterns.values()
    labeler = labeler_for(dataset.sensors["scanner"], pattern, None)
    for mine, key in zip(dataset.collections, scene.dataset.collections):
        sent = scan_message(scene.dataset.data.read(key, "scanner"))
        label = dataset.collections[mine].labels[("scanner", "pattern_1")]
        expected = labeler.label(laser_scan(sent), seed(scene, key)).label
        np.testing.assert_array_equal(label.indices, expected.indices)
        np.testing.assert_array_equal(label.limit_indices, expected.limit_indices)
        true = scene.dataset.collections[key].labels[("scanner", "pattern_1")]
        assert np.mean(np.isin(label.indices, true.indices)) > 0.95


def test_a_calibration_takes_it(scene, collected, tmp_path):
    dataset = str(collected / "dataset.json")
    arguments = ["calibrate", "--dataset", dataset, "--output", str(tmp_path / "out")]
    assert core_main(arguments) in (0, 1)
    answer = json.loads((tmp_path / "out" / "calibration.json").read_text())
    assert answer["status"] in ("converged", "rank_deficient")
    assert "scanner" in json.dumps(answer)


def test_the_labeled_points_are_a_cloud(scene):
    dataset = scene.dataset
    frame = Frame(dataset.sensors["scanner"], 1.0, HEADER, None)
    frame.data = dataset.data.read("000", "scanner")
    (pattern,) = dataset.patterns.values()
    labeled = labeler_for(frame.sensor, pattern, None).label(frame.data, seed(scene, "000"))
    frame.set_label(pattern.name, labeled)
    points = np.frombuffer(annotated(frame).data, POINT)
    np.testing.assert_array_equal(points["idx"], labeled.label.indices)
    np.testing.assert_allclose(points["x"], frame.data.points[labeled.label.indices, 0], atol=1e-6)
    assert ros_modality(LIDAR2D).draw(frame).any() and pattern.name in frame.sightings


def test_a_label_is_corrected_by_hand(scene):
    session = LabelCorrections(scene.dataset)
    (pattern,), scan = scene.dataset.patterns, scene.dataset.data.read("000", "scanner")
    before = session.labels("scanner")[pattern]
    session.remove_points("scanner", before.indices[:5])
    after = session.labels("scanner")[pattern]
    np.testing.assert_array_equal(after.indices, before.indices[5:])
    np.testing.assert_array_equal(after.limit_indices, before.limit_indices[1:])
    beside = np.setdiff1d(np.flatnonzero(scan.valid), before.indices)[:3]
    lost = np.flatnonzero(~scan.valid)[:4]
    session.add_points("scanner", np.concatenate([beside, lost]), border=True)
    after = session.labels("scanner")[pattern]
    assert set(beside) <= set(after.indices) & set(after.limit_indices)
    assert not set(lost) & set(after.indices)
    session.delete_label("scanner")
    assert not session.labels("scanner")
    while session.undo_steps:
        session.undo()
    assert session.labels("scanner")[pattern] is before


def test_a_recording_without_a_valid_range_is_refused(scene, make, tmp_path, capsys):
    write_config(tmp_path / "config.yml", scene.dataset.config)

    def covered():
        for topic, sent, stamp in messages(make, scene.dataset):
            if topic == scene.dataset.sensors["scanner"].topic:
                sent.ranges = [float("inf")] * len(sent.ranges)
            yield topic, sent, stamp

    bag = make.bag(tmp_path / "a.bag", covered())
    words = ["--config", str(tmp_path / "config.yml"), "--bag", str(bag)]
    assert main([*words, "--output", str(tmp_path / "out")]) == 2
    lines = [x for x in capsys.readouterr().err.split("\n") if x.startswith("collect_from_bag:")]
    assert len(lines) == 1 and "'scanner'" in lines[0] and "no valid range" in lines[0]


def test_scans_without_a_return_are_no_damaged_messages(scene, make, tmp_path, capsys):
    """A robot that turns to the open has nothing in reach for a while, and at the beginning."""
    write_config(tmp_path / "config.yml", scene.dataset.config)
    topic = scene.dataset.sensors["scanner"].topic
    content = list(messages(make, scene.dataset))
    for sent in [sent for name, sent, _ in content if name == topic][:5]:
        sent.ranges = [float("inf")] * len(sent.ranges)
    bag = make.bag(tmp_path / "a.bag", content)
    words = ["--config", str(tmp_path / "config.yml"), "--bag", str(bag)]
    assert main([*words, "--output", str(tmp_path / "out")]) == 0
    assert "left out" not in capsys.readouterr().err


# ------------------------------------------------------------------------------ configure

SCANNER = """  scanner:
    link: "lamp"
    parent_link: "base"
    child_link: "lamp"
    topic_name: "/scan"
    modality:
    throttle:
additional_tfs"""


@pytest.fixture(scope="module")
def package(make, tmp_path_factory):
    """Configure the small rig with a 2D LiDAR, whose modality its messages tell."""
    folder = write_package(tmp_path_factory.mktemp("package"), make, seconds=1.0)
    config = CONFIG.replace("additional_tfs", SCANNER)
    (folder / "calibration" / "config.yml").write_text(config, encoding="utf-8")
    sent = message(header=make.header("lamp", 10.5))
    with rosbag.Bag(str(folder / "calibration" / "rig.bag"), "a") as bag:
        bag.write("/scan", sent, sent.header.stamp)
    assert configure_package.main(["-n", str(folder)]) == 0
    return folder


def displays(package, name):
    """Return the classes of the displays of a layout by their topic."""
    view = yaml.safe_load((package / "rviz" / f"{name}.rviz").read_text("utf-8"))
    shown = view["Visualization Manager"]["Displays"]
    return {d.get("Topic") or d.get("Update Topic"): d["Class"] for d in shown}


@pytest.mark.parametrize("name", RVIZ_FILES)
def test_every_layout_shows_the_scan(package, name):
    assert displays(package, name)["/scan"] == "rviz/LaserScan"


@pytest.mark.parametrize(
    ("name", "topic", "kind"),
    [
        ("collect_data", "/scan/labeled", "rviz/PointCloud2"),
        ("collect_data", "/scanner/data_labeler/update", "rviz/InteractiveMarkers"),
        ("dataset_playback", "/scan/labeled3d", "rviz/PointCloud2"),
        ("calibrate", "/scan/labeled3d", "rviz/PointCloud2"),
    ],
)
def test_labels_and_seed_are_shown(package, name, topic, kind):
    assert displays(package, name)[topic] == kind


def test_the_summary_names_it(package):
    svg = ElementTree.parse(str(package / "calibration" / "summary.svg"))
    assert "scanner (lidar2d)" in {element.text for element in svg.iter()}
