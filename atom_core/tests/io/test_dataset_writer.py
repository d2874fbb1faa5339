"""What is simulated in memory is the same when it is read back from the disk."""

import json

import cv2
import numpy as np
import pytest

from atom_core.errors import OutputError
from atom_core.geometry.camera import Camera
from atom_core.io.data_files import FileDataSource
from atom_core.io.dataset_json import dumps, read_dataset
from atom_core.io.dataset_writer import (
    camera_info_document,
    new_document,
    write_dataset_folder,
)
from atom_core.model.dataset import range_points
from atom_core.model.labels import RgbLabel
from atom_core.synthetic import paper_cell, scenes

NOISY = {"disturbance": (0.1, 0.1)}
WRITTEN = {
    "random_scene": lambda: scenes.random_scene(0, collections=4, **NOISY),
    "two_patterns": lambda: scenes.two_patterns(1, collections=3, **NOISY),
    "hand_eye": lambda: scenes.hand_eye(2, collections=3, **NOISY),
    "shared_edge": lambda: scenes.shared_edge(3, collections=3, **NOISY),
    "equidistant": lambda: scenes.two_cameras(
        0,
        collections=3,
        camera=Camera(
            1280,
            800,
            np.array([[700.0, 0, 640], [0, 700, 400], [0, 0, 1]]),
            np.array([0.02, -0.01, 0.003, -0.001]),
            "equidistant",
        ),
    ),
}


@pytest.fixture(scope="module", params=WRITTEN)
def there_and_back(request, tmp_path_factory):
    dataset = WRITTEN[request.param]().dataset
    folder = tmp_path_factory.mktemp("dataset") / request.param
    return dataset, read_dataset(write_dataset_folder(dataset, folder, name=request.param))


@pytest.fixture(scope="module")
def document():
    return new_document(scenes.random_scene(0, collections=3).dataset, name="some", time_s=1.5)


def test_labels_are_the_same(there_and_back):
    memory, disk = there_and_back
    assert {k for k, _ in memory.detections()} == {k for k, _ in disk.detections()}
    for key, label in memory.detections():
        for name, array in vars(label).items():
            np.testing.assert_array_equal(array, getattr(disk.label(key), name))


def test_labeled_points_are_the_same(there_and_back):
    memory, disk = there_and_back
    for key, label in memory.detections():
        if isinstance(label, RgbLabel):
            continue
        lidar = memory.sensors[key.sensor].camera is None
        one, other = range_points(memory, key), range_points(disk, key)
        assert one.dropped == other.dropped
        for a, b in zip(one[:2], other[:2]):
            # a depth file has steps of 0.1 mm along z, a cloud loses nothing
            np.testing.assert_allclose(a[:, 2], b[:, 2], rtol=0, atol=0 if lidar else 5.1e-5)
            np.testing.assert_allclose(a, b, rtol=0, atol=0 if lidar else 1e-4)


def test_transforms_and_their_types_are_the_same(there_and_back):
    memory, disk = there_and_back
    assert memory.edge_types == disk.edge_types
    for key, collection in memory.collections.items():
        assert set(collection.transforms) == set(disk.collections[key].transforms)
        for edge, matrix in collection.transforms.items():
            read = disk.collections[key].transforms[edge]
            np.testing.assert_allclose(matrix, read, rtol=0, atol=1e-12)


def test_sensors_and_patterns_are_the_same(there_and_back):
    memory, disk = there_and_back
    assert set(memory.sensors) == set(disk.sensors)
    for name, sensor in memory.sensors.items():
        read = disk.sensors[name]
        assert (sensor.modality, sensor.frame, sensor.edge, sensor.topic) == (
            read.modality,
            read.frame,
            read.edge,
            read.topic,
        )
        if sensor.camera is not None:
            np.testing.assert_array_equal(sensor.camera.K, read.camera.K)
            np.testing.assert_array_equal(sensor.camera.D, read.camera.D)
            assert sensor.camera.model == read.camera.model
    for name, pattern in memory.patterns.items():
        read = disk.patterns[name]
        np.testing.assert_allclose(pattern.corners_by_id, read.corners_by_id, atol=1e-15)
        np.testing.assert_allclose(pattern.border.corners, read.border.corners, atol=1e-15)
        assert (pattern.frame, pattern.parent_frame, pattern.fixed) == (
            read.frame,
            read.parent_frame,
            read.fixed,
        )


def test_the_configuration_is_the_same_and_nothing_is_warned_of(there_and_back):
    memory, disk = there_and_back
    assert [w for w in disk.warnings if "shares its edge" not in w] == []
    assert memory.config == disk.config


def test_clouds_and_images_have_the_sizes_that_the_document_says(there_and_back):
    _, disk = there_and_back
    assert isinstance(disk.data, FileDataSource)
    for key in disk.collections:
        for name, sensor in disk.sensors.items():
            assert disk.data.has_data(key, name)
            if sensor.modality == "lidar3d":
                assert disk.data.read(key, name).shape[1] == 3
            elif sensor.modality == "depth":
                assert disk.data.read(key, name).shape == (480, 640)
            else:
                assert disk.data.read(key, name).shape == (800, 1280, 3)


def test_a_picture_shows_the_board_at_its_label(tmp_path):
    dataset = scenes.two_cameras(0, collections=2).dataset
    disk = read_dataset(write_dataset_folder(dataset, tmp_path / "out", name="x"))
    key, label = next(iter(disk.detections()))
    grey = cv2.cvtColor(disk.data.read(key.collection, key.sensor), cv2.COLOR_BGR2GRAY)
    found = label.pixels.astype(np.float32).reshape(-1, 1, 2).copy()
    cv2.cornerSubPix(grey, found, (3, 3), (-1, -1), (3, 100, 1e-4))
    assert np.median(np.linalg.norm(found[:, 0] - label.pixels, axis=1)) < 0.8  # 0.3 px noise


def test_the_paper_cell_goes_to_disk_and_back(tmp_path):
    memory = paper_cell(0, "test").dataset
    disk = read_dataset(write_dataset_folder(memory, tmp_path / "cell", name="cell"))
    assert len(disk.collections) == 17
    assert sum(1 for _ in memory.detections()) == sum(1 for _ in disk.detections())


def test_all_keys_of_the_format_are_there(document):
    assert set(document) == {
        "_metadata",
        "calibration_config",
        "additional_sensor_data",
        "sensors",
        "collections",
        "transforms",
        "patterns",
    }
    assert set(document["_metadata"]) == {
        "timestamp",
        "date",
        "user",
        "version",
        "robot_name",
        "dataset_name",
        "package_name",
    }
    assert document["_metadata"]["version"] == "3.0"
    assert document["_metadata"]["dataset_name"] == "some"
    assert document["calibration_config"]["additional_tfs"] is None
    pattern = document["patterns"]["pattern_1"]
    assert set(pattern) == {"corners", "frame", "transitions", "transforms_initial"}
    assert set(pattern["transforms_initial"]) == {"000", "001", "002"}
    assert len(pattern["frame"]["lines_sampled"]["top"]) == 40  # as in a file that ATOM wrote
    assert len(pattern["frame"]["lines_sampled"]["left"]) == 30


def test_every_pattern_and_sensor_has_a_label_detected_or_not():
    dataset = scenes.two_patterns(0, collections=2).dataset
    for collection in new_document(dataset, name="x")["collections"].values():
        assert set(collection["labels"]) == {"left", "right"}
        for by_sensor in collection["labels"].values():
            assert set(by_sensor) == set(dataset.sensors)
        assert collection["labels"]["right"]["rgb_1"] == {"detected": False, "idxs": []}
        empty = {"detected": False, "idxs": [], "idxs_limit_points": []}
        assert collection["labels"]["left"]["depth_1"] == empty
        assert collection["joints"] == {} and collection["additional_data"] == {}


def test_intrinsics_are_floats_in_the_lengths_that_atom_expects(document):
    info = document["sensors"]["rgb_1"]["camera_info"]
    for key, length in (("D", 5), ("K", 9), ("R", 9), ("P", 12)):
        assert len(info[key]) == length and all(isinstance(v, float) for v in info[key])
    plain = Camera(640, 480, np.array([[500, 0, 320], [0, 500, 240], [0, 0, 1]]), model="none")
    written = camera_info_document(plain, "optical")
    assert (written["distortion_model"], written["D"]) == ("plumb_bob", [0.0] * 5)


def test_chains_run_from_the_world_to_the_data(document):
    for sensor in document["sensors"].values():
        chain = sensor["chain"]
        assert chain[0]["parent"] == "world" and chain[-1]["child"] == sensor["parent"]
        assert all(a["child"] == b["parent"] for a, b in zip(chain, chain[1:]))
        edge = f"{sensor['calibration_parent']}-{sensor['calibration_child']}"
        assert edge in [link["key"] for link in chain]
        assert document["transforms"][edge]["is_transformation_calibrated"]


def test_messages_describe_their_files(document):
    data = document["collections"]["001"]["data"]
    assert data["rgb_1"]["data_file"] == "rgb_1_001.jpg"
    assert data["depth_1"]["data_file"] == "depth_1_001.png"
    lidar = data["lidar_1"]
    assert lidar["data_file"] == "lidar_1_001.pcd" and lidar["height"] == 1
    assert lidar["row_step"] == 12 * lidar["width"] and [f["name"] for f in lidar["fields"]] == [
        "x",
        "y",
        "z",
    ]
    assert data["depth_1"]["encoding"] == "32FC1" and data["depth_1"]["step"] == 4 * 640
    assert set(lidar["header"]) == {"seq", "stamp", "frame_id"}


def test_stamps_and_initial_boards_are_written_where_known():
    dataset = scenes.two_cameras(0, collections=2).dataset
    pose = np.eye(4)
    pose[:3, 3] = 1, 2, 3
    document = new_document(
        dataset,
        name="x",
        stamps={("001", "rgb_1"): 12.25},
        initial_boards={("pattern_1", "001"): ("rgb_1", pose)},
    )
    stamp = document["collections"]["001"]["data"]["rgb_1"]["header"]["stamp"]
    assert stamp == {"secs": 12, "nsecs": 250000000}
    initial = document["patterns"]["pattern_1"]["transforms_initial"]
    assert initial["000"] == {"detected": False}
    assert initial["001"]["sensor"] == "rgb_1" and initial["001"]["trans"] == [1.0, 2.0, 3.0]


def test_the_same_dataset_gives_the_same_text():
    one, two = (
        dumps(new_document(scenes.random_scene(4, collections=2).dataset, name="x"))
        for _ in range(2)
    )
    assert one == two
    json.loads(one, parse_constant=lambda name: pytest.fail(f"{name} in the file"))


def test_a_folder_in_use_is_left_alone(tmp_path):
    dataset = scenes.two_cameras(0, collections=1).dataset
    (tmp_path / "mine.txt").write_text("keep")
    with pytest.raises(OutputError, match="not empty"):
        write_dataset_folder(dataset, tmp_path, name="x")
    assert [p.name for p in tmp_path.iterdir()] == ["mine.txt"]
    assert write_dataset_folder(dataset, tmp_path, name="x", overwrite=True).is_file()
    assert (tmp_path / "mine.txt").read_text() == "keep"


def test_the_json_comes_last(tmp_path, monkeypatch):
    """A dataset.json whose data files are not all there must never be seen."""
    dataset = scenes.random_scene(0, collections=2).dataset

    def fail(*_):
        raise OutputError("disk full")

    formats = type(dataset.sensors["lidar_1"].kind.data)
    monkeypatch.setattr(formats, "write", property(lambda _: fail), raising=False)
    with pytest.raises(OutputError, match="disk full"):
        write_dataset_folder(dataset, tmp_path / "out", name="x")
    assert not (tmp_path / "out" / "dataset.json").exists()
