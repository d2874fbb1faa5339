import json
import struct
import time

import cv2
import numpy as np
import pytest
import rosbag
from sensor_msgs import point_cloud2

from atom_core.geometry import se3
from atom_core.io.truth_json import read_truth
from atom_core.model.transforms import Edge, FrameGraph, chain_transform
from atom_examples.cell_simulator import recorder
from atom_examples.cell_simulator.recorder import Recording, record
from atom_examples.cell_simulator.trajectory import Trajectory
from atom_examples.cell_simulator.truth import PATTERN

pytestmark = pytest.mark.slow
SHORT = {"collections": 2, "stop_s": 0.6, "moving_image_hz": 0.2}
SHORTEST = {**SHORT, "collections": 1}
SENSORS = ("rgb_1", "rgb_2", "rgb_3", "depth_1", "lidar_1", "lidar_2", "lidar_3")


@pytest.fixture(scope="module")
def bags(tmp_path_factory, world, plans):
    """Short recordings by name."""
    folder = tmp_path_factory.mktemp("bags")
    wanted = {
        "train": Recording(**SHORT),
        "test": Recording(scenario="test", **SHORTEST),
        "exact": Recording(scenario="test", initial_estimate="exact", noise=False, **SHORTEST),
        "packed": Recording(scenario="test", compressed=True, **SHORTEST),
        "metres": Recording(scenario="test", depth_encoding="32FC1", noise=False, **SHORTEST),
    }
    paths = {name: folder / f"{name}.bag" for name in wanted}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recorder, "plan_stops", plans)
        for name, recording in wanted.items():
            record(world, recording, paths[name], progress=False)
    return paths


def raw_messages(path):
    with rosbag.Bag(str(path)) as bag:
        return [(t, data[1], stamp) for t, data, stamp in bag.read_messages(raw=True)]


def messages_of(path, topic):
    with rosbag.Bag(str(path)) as bag:
        return [message for _, message, _ in bag.read_messages(topics=[topic])]


def edges_of(path):
    (static,) = messages_of(path, "/tf_static")
    moving = messages_of(path, "/tf")[0].transforms
    return {
        Edge(t.header.frame_id, t.child_frame_id): se3.from_quaternion(
            np.array(
                [t.transform.translation.x, t.transform.translation.y, t.transform.translation.z]
            ),
            np.array(
                [
                    t.transform.rotation.x,
                    t.transform.rotation.y,
                    t.transform.rotation.z,
                    t.transform.rotation.w,
                ]
            ),
        )
        for t in [*static.transforms, *moving]
    }


# ---- what is in a bag


def test_every_sensor_is_recorded_under_its_names(bags, world):
    with rosbag.Bag(str(bags["train"])) as bag:
        info = bag.get_type_and_topic_info().topics
        frames = {t: m.header.frame_id for t, m, _ in bag.read_messages() if hasattr(m, "header")}
    for name, sensor in world.rig.sensors.items():
        assert frames[sensor.topic] == sensor.frame
        kind = "PointCloud2" if name.startswith("lidar") else "Image"
        assert info[sensor.topic].msg_type == f"sensor_msgs/{kind}"
    for topic in ("/tf", "/tf_static", "/joint_states", "/depth_1_rgb/image_raw"):
        assert topic in info
    assert "/clock" not in info  # `rosbag play --clock` makes it


def test_stamps_are_whole_ticks_and_agree_with_the_times_in_the_bag(bags):
    with rosbag.Bag(str(bags["train"])) as bag:
        for _, message, time in bag.read_messages():
            if hasattr(message, "header"):
                assert message.header.stamp == time
                assert message.header.stamp.nsecs % 100_000_000 == 0


def test_rates_are_two_and_five_hertz_at_stops_and_ten_in_between(bags):
    stops = json.loads(bags["train"].with_suffix(".truth.json").read_text())["stops"]
    assert list(stops) == ["000", "001"]
    first = stops["000"]
    assert first["end_s"] - first["start_s"] == pytest.approx(0.6)
    times = {
        topic: np.array([m.header.stamp.to_sec() for m in messages_of(bags["train"], topic)])
        for topic in ("/rgb_1/image_raw", "/lidar_1/points", "/depth_1/image_raw")
    }
    still = {t: s[(s >= first["start_s"]) & (s < first["end_s"] - 1e-6)] for t, s in times.items()}
    np.testing.assert_allclose(np.diff(still["/rgb_1/image_raw"]), 0.5)
    np.testing.assert_allclose(np.diff(still["/lidar_1/points"]), 0.2)
    between = [first["end_s"], stops["001"]["start_s"]]
    for topic in ("/lidar_1/points", "/depth_1/image_raw"):
        moving = times[topic][(times[topic] >= between[0] - 1e-6) & (times[topic] < between[1])]
        assert len(moving) > 5
        np.testing.assert_allclose(np.diff(moving), 0.1)


def test_tf_static_is_latched(bags):
    with rosbag.Bag(str(bags["train"])) as bag:
        (connection,) = bag._get_connections(["/tf_static"])
    assert connection.header["latching"] in (b"1", "1")


def test_camera_info_says_how_the_images_are_distorted(bags, world):
    info = messages_of(bags["train"], "/rgb_2/camera_info")[0]
    camera = world.rig.sensors["rgb_2"].camera
    assert info.distortion_model == "plumb_bob" and list(info.D) == camera.D.tolist()
    assert list(info.K) == camera.K.ravel().tolist() and (info.width, info.height) == (1280, 800)


def test_clouds_have_the_fields_of_the_velodyne_driver(bags):
    cloud = messages_of(bags["train"], "/lidar_2/points")[0]
    assert [f.name for f in cloud.fields] == ["x", "y", "z", "intensity", "ring", "time"]
    assert cloud.row_step == len(cloud.data) == cloud.point_step * cloud.width

    points = np.array(list(point_cloud2.read_points(cloud)))
    assert np.all(np.isfinite(points)) and len(points) > 20000
    elevation = np.degrees(np.arcsin(points[:, 2] / np.linalg.norm(points[:, :3], axis=1)))
    np.testing.assert_allclose(elevation, -15 + 2 * points[:, 4], atol=1e-3)


def test_depth_is_in_millimetres_or_metres(bags):
    millimetres = messages_of(bags["exact"], "/depth_1/image_raw")[0]
    metres = messages_of(bags["metres"], "/depth_1/image_raw")[0]
    assert (millimetres.encoding, metres.encoding) == ("16UC1", "32FC1")
    first = np.frombuffer(millimetres.data, np.uint16).astype(float)
    second = np.frombuffer(metres.data, np.float32).astype(float)
    assert np.array_equal(first > 0, np.isfinite(second))
    assert np.nanmax(np.abs(first / 1000.0 - second)[first > 0]) <= 0.0005 + 1e-6


def test_packed_images_hold_the_same_pictures(bags):
    plain = messages_of(bags["test"], "/rgb_1/image_raw")[0]
    packed = messages_of(bags["packed"], "/rgb_1/image_raw/compressed")[0]
    picture = np.frombuffer(plain.data, np.uint8).reshape(plain.height, plain.width, 3)
    decoded = cv2.imdecode(np.frombuffer(packed.data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    assert packed.header.stamp == plain.header.stamp
    assert packed.format.startswith("rgb8; jpeg")
    assert np.abs(decoded.astype(int) - picture).mean() < 2.5
    plain = messages_of(bags["test"], "/depth_1/image_raw")[0]
    packed = messages_of(bags["packed"], "/depth_1/image_raw/compressed")[0]
    decoded = cv2.imdecode(np.frombuffer(packed.data, np.uint8), cv2.IMREAD_UNCHANGED)
    assert decoded.dtype == np.uint16 and decoded.tobytes() == bytes(plain.data)


def test_train_and_test_of_one_seed_show_the_same_rig(bags):
    train, test = (read_truth(bags[name].with_suffix(".truth.json")) for name in ("train", "test"))
    assert train.edges.keys() == test.edges.keys() and len(train.edges) == 7
    for edge, matrix in train.edges.items():
        assert np.array_equal(matrix, test.edges[edge])
    first, second = edges_of(bags["train"]), edges_of(bags["test"])
    assert all(np.array_equal(matrix, second[edge]) for edge, matrix in first.items())
    assert not np.array_equal(train.boards[PATTERN, "000"], test.boards[PATTERN, "000"])


def test_tf_carries_the_estimate_that_was_asked_for(bags, world):
    truth = read_truth(bags["train"].with_suffix(".truth.json")).edges
    disturbed, exact = edges_of(bags["train"]), edges_of(bags["exact"])
    for edge, matrix in truth.items():
        np.testing.assert_allclose(exact[edge], matrix, atol=1e-9)
        off = 0.1 if edge in world.rig.free_edges else 0.0
        move = np.linalg.norm(disturbed[edge][:3, 3] - matrix[:3, 3])
        turn = se3.rotation_angle(matrix[:3, :3].T @ disturbed[edge][:3, :3])
        assert (move, turn) == (pytest.approx(off, abs=1e-9), pytest.approx(off, abs=1e-6))


# ---- truth


def test_no_trace_of_the_board_is_in_what_a_calibration_gets(bags):
    truth = read_truth(bags["train"].with_suffix(".truth.json"))
    allowed = {
        "/tf",
        "/tf_static",
        "/joint_states",
        "/depth_1_rgb/image_raw",
        "/depth_1_rgb/camera_info",
    }
    allowed |= {f"/{n}/{k}" for n in SENSORS for k in ("image_raw", "camera_info", "points")}
    with rosbag.Bag(str(bags["train"])) as bag:
        assert set(bag.get_type_and_topic_info().topics) <= allowed
    frames = {frame for edge in edges_of(bags["train"]) for frame in edge}
    assert not [f for f in frames if any(w in f for w in ("pattern", "tripod", "board"))]
    # No pose on tf, from any frame to any other, is that of a board; nor are its numbers anywhere.

    edges = edges_of(bags["train"])
    graph = FrameGraph(edges)
    poses = [chain_transform(graph.chain("world", frame), edges) for frame in frames]
    packed = {
        struct.pack("<d", value)
        for board in truth.boards.values()
        for matrix in (board, se3.inverse(board))
        for value in (*matrix[:3, 3], *se3.quaternion_from_rotation(matrix[:3, :3]))
    }
    for board in truth.boards.values():
        assert min(np.linalg.norm(pose[:3, 3] - board[:3, 3]) for pose in poses) > 0.01
    for topic, data, _ in raw_messages(bags["train"]):
        if "image" not in topic and "points" not in topic:
            assert not [number for number in packed if number in data], topic
            assert b"pattern" not in data and b"ground_truth" not in data


def test_labels_name_the_returns_the_pixels_and_the_corners_of_the_board(bags, world):
    truth = read_truth(bags["exact"].with_suffix(".truth.json"))
    labels = np.load(bags["exact"].with_suffix(".labels.npz"))
    pattern, edges = world.scene.board.pattern, edges_of(bags["exact"])

    graph = FrameGraph(edges)
    seen = 0
    for (_, stop), board in truth.boards.items():
        for name, sensor in world.rig.sensors.items():
            pose = chain_transform(graph.chain("world", sensor.frame), edges)
            sensor_T_pattern = se3.inverse(pose) @ board
            if name.startswith("rgb"):
                ids = labels[f"{stop}/{name}/corner_ids"]
                corners = se3.apply(sensor_T_pattern, pattern.corners_of(ids))
                exact = sensor.camera.project(corners)
                np.testing.assert_allclose(labels[f"{stop}/{name}/corners_px"], exact, atol=1e-6)
                seen += len(ids)
                continue
            if name.startswith("lidar"):
                stamps = labels[f"{stop}/{name}/stamps"]
                clouds = messages_of(bags["exact"], sensor.topic)
                (cloud,) = [c for c in clouds if c.header.stamp.to_sec() == stamps[1]]
                points = np.array(list(point_cloud2.read_points(cloud, ("x", "y", "z"))))
                points = points[labels[f"{stop}/{name}/returns_1"]]
            else:
                (info, *_) = messages_of(bags["exact"], sensor.topic)
                pixels = labels[f"{stop}/{name}/pixels"]
                image = np.frombuffer(info.data, np.uint16).reshape(info.height, info.width)
                row, column = np.divmod(pixels, info.width)
                points = sensor.camera.ray_points(
                    np.column_stack([column, row]), image[row, column] / 1000.0
                )
            if len(points):
                in_pattern = se3.apply(se3.inverse(sensor_T_pattern), points)
                assert np.median(np.abs(in_pattern[:, 2])) < 1e-3
                inside, _ = pattern.border.signed_distance(in_pattern[:, :2])
                assert inside.max() < 2e-3
                seen += len(points)
    assert seen > 1000


def test_truth_says_how_the_bag_was_made(bags):
    document = json.loads(bags["test"].with_suffix(".truth.json").read_text())
    assert document["seed"] == 0 and document["scenario"] == "test"
    assert document["version"] == "1.0"


# ---- sizes


@pytest.mark.long
@pytest.mark.parametrize(("name", "limit_gb"), [("train", 4.0), ("packed", 1.5)])
def test_a_whole_recording_stays_below_its_limits(bags, world, plans, name, limit_gb):
    """Sizes grow with the number of ticks, which are largest between stops."""
    stops = plans(world, "train", 2) if name == "train" else plans(world, "test", 1)
    assert bags[name].stat().st_size * times_longer(world, plans, stops, 0.6) < limit_gb * 1e9


@pytest.mark.long
@pytest.mark.parametrize(("compressed", "limit_gb"), [(False, 4.0), (True, 1.5)])
def test_a_whole_recording_takes_no_longer_than_its_limits(
    world, plans, tmp_path, compressed, limit_gb
):
    out = tmp_path / "part.bag"
    started = time.process_time()
    record(world, Recording(collections=2, compressed=compressed), out, progress=False)
    seconds = time.process_time() - started
    whole = times_longer(world, plans, plans(world, "train", 2), 1.5)
    assert out.stat().st_size * whole < limit_gb * 1e9
    assert seconds * whole < 2 * 300  # of two cores


def times_longer(world, plans, stops, stop_s):
    """Return how many times longer a whole recording is than one of these stops."""
    pattern = world.scene.board.pattern
    whole = Trajectory(plans(world, "train", 23), 1.5, pattern)
    return whole.ticks / Trajectory(stops, stop_s, pattern).ticks
