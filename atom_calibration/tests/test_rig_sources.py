"""What a configuration says of a sensor reaches its labeler, whatever the recording is."""

from types import SimpleNamespace

import numpy as np
import pytest
import rospy
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header

from atom_calibration.messages.poses import transform_message
from atom_calibration.sources.rig import Rig, check_frames, rig_from_bag, sensor_from_bag
from atom_calibration.sources.transform_tree import TransformTree
from atom_core.errors import AtomError
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.config import SensorConfig
from atom_core.model.sensor import DEPTH, LIDAR3D, RGB, Sensor
from atom_core.model.transforms import Edge


def source(topic, message):
    return SimpleNamespace(types={topic: message}, path="a.bag")


def entry(**more):
    return SensorConfig("lidar", "world", "lidar_base", "/points", **more)


def test_the_width_of_beams_is_that_of_the_configuration():
    bag = source("/points", "sensor_msgs/PointCloud2")
    for width, expected in ((None, 0.0), (0.0134, 0.0134)):
        _, sensor = sensor_from_bag("lidar", entry(beam_width=width), bag)
        assert sensor.beam_width_rad == expected


def test_only_3d_lidars_have_it():
    scans = source("/points", "sensor_msgs/LaserScan")
    with pytest.raises(AtomError, match="'lidar': its data are .*LaserScan, and beam_width is of"):
        sensor_from_bag("lidar", entry(beam_width=0.01), scans)


@pytest.mark.parametrize(
    "modality, taken", [(DEPTH, "/cam/image/compressedDepth"), (RGB, "/cam/image/compressed")]
)
def test_of_two_compressed_topics_a_depth_camera_has_the_one_with_depths(make, modality, taken):
    images = ("/cam/image/compressed", "/cam/image/compressedDepth")
    types = dict.fromkeys(images, "sensor_msgs/CompressedImage")
    types["/cam/camera_info"] = "sensor_msgs/CameraInfo"
    bag = SimpleNamespace(types=types, path="a.bag", first=lambda _: make.camera_info())
    camera = SensorConfig("cam", "world", "cam", "/cam/image", modality=modality)
    assert sensor_from_bag("cam", camera, bag)[0] == taken


HERE = np.eye(4)


def tree_with(base_T_data, fixed=True, data_frame="lidar", link="lidar_base", world_T_base=HERE):
    tree, stamp = TransformTree(), rospy.Time.from_sec(1.0)
    tree.add([transform_message(Edge("world", "lidar_base"), world_T_base, stamp)], fixed=True)
    for frame, pose in ((link, np.eye(4)), (data_frame, base_T_data)):
        if frame not in ("", "lidar_base", "world"):
            tree.add([transform_message(Edge("lidar_base", frame), pose, stamp)], fixed)
    return tree


def checked(
    base_T_data,
    data_frame,
    fixed=True,
    link="lidar_base",
    camera=None,
    world_T_base=HERE,
    patterns=None,
):
    edge, modality = Edge("world", "lidar_base"), LIDAR3D if camera is None else RGB
    sensor = Sensor("left", modality, link, edge, camera, "/points", 0.0)
    rig = Rig({"left": sensor}, {"/points": sensor}, {}, (), data_frames={"left": data_frame})
    config = SimpleNamespace(world_link="world", calibration_patterns=patterns or {})
    return check_frames(rig, config, tree_with(base_T_data, fixed, data_frame, link, world_T_base))


ABOVE = se3.transform(np.eye(3), np.array([0.0, 0.0, 0.0377]))
TURNED = se3.from_rpy(np.zeros(3), np.array([0.0, 0.0, np.pi]))


def test_clouds_of_another_frame_are_refused_with_how_far_it_is():
    told = "'left': its data are in frame 'lidar' .* 37.7 mm and 0.00 deg .* write `link: lidar`"
    with pytest.raises(AtomError, match=told):
        checked(ABOVE, "lidar")
    with pytest.raises(AtomError, match="0.0 mm and 180.00 deg"):
        checked(TURNED, "lidar")


def test_clouds_whose_frame_no_fixed_transform_tells_are_in_doubt():
    assert checked(np.eye(4), "lidar") == checked(np.eye(4), "lidar_base") == []
    assert checked(ABOVE, "") == []  # a driver that names no frame contradicts nothing
    (caveat,) = checked(ABOVE, "lidar", fixed=False)
    assert caveat.sensors == ("left",) and "no fixed transform tells where" in caveat.what


CAMERA = Camera(64, 48, np.diag([50.0, 50.0, 1.0]), np.zeros(5))


@pytest.mark.parametrize("base_T_data", [ABOVE, TURNED])
def test_images_of_an_optical_frame_are_refused_where_the_link_is_none(base_T_data):
    with pytest.raises(AtomError, match="write `link: lidar_optical`"):
        checked(base_T_data, "lidar_optical", camera=CAMERA)
    assert checked(np.eye(4), "lidar_optical", camera=CAMERA) == []


def test_images_whose_header_names_the_body_are_not_in_doubt_and_those_of_a_neighbour_are():
    assert checked(ABOVE, "lidar", camera=CAMERA, link="lidar_base_optical") == []
    assert checked(ABOVE, "lidar", fixed=False, camera=CAMERA) == []
    (caveat,) = checked(ABOVE, "lidar", camera=CAMERA)
    assert "37.7 mm" in caveat.what and "write `link: lidar`" in caveat.remedy


def test_a_cloud_in_a_frame_that_its_edge_does_not_carry_gets_no_advice_that_is_refused_next():
    with pytest.raises(AtomError, match="from link 'lidar_base' .*; record the data as they come"):
        checked(np.eye(4), "world", world_T_base=ABOVE)


def test_intrinsics_of_another_camera_of_the_rig_are_in_doubt():
    def info(frame):
        return CameraInfo(
            header=Header(frame_id=frame), width=64, height=48, K=[50, 0, 32, 0, 50, 24, 0, 0, 1]
        )

    def image(frame):
        return SimpleNamespace(header=Header(frame_id=frame))

    def caveats(frames):
        first = {}
        for name, frame in zip(("left", "right"), frames):
            first[f"/{name}/camera_info"] = info(frame)
            first[f"/{name}/image_raw"] = image(f"{name}_optical")
        types = dict.fromkeys(first, "sensor_msgs/CameraInfo")
        types.update({t: "sensor_msgs/Image" for t in first if "image" in t})
        bag = SimpleNamespace(types=types, path="a.bag", first=first.__getitem__)
        sensors = {
            name: SensorConfig(f"{name}_optical", "world", name, f"/{name}/image_raw", "rgb")
            for name in ("left", "right")
        }
        return rig_from_bag(SimpleNamespace(sensors=sensors), bag).caveats

    assert caveats(["left_optical", "right_optical"]) == caveats(["left", "right"]) == ()
    assert caveats(["", ""]) == ()
    one, two = caveats(["right_optical", "left_optical"])
    assert one.sensors == ("left",) and "as the images of 'right' are" in one.what
    assert two.sensors == ("right",)
    (one,) = caveats(["left_optical", "left_optical"])
    assert one.sensors == ("right",)


def test_the_topic_of_compressed_images_is_refused_with_the_raw_one_to_write():
    entry = SensorConfig("left_optical", "world", "left", "/left/image_raw/compressed", "rgb")
    types = {entry.topic_name: "sensor_msgs/CompressedImage"}
    types["/left/camera_info"] = "sensor_msgs/CameraInfo"
    bag = SimpleNamespace(types=types, path="a.bag")
    with pytest.raises(AtomError, match="compressed; write /left/image_raw, of which"):
        rig_from_bag(SimpleNamespace(sensors={"left": entry}), bag)


def test_a_topic_of_no_sensor_is_refused_without_a_modality_that_nobody_wrote():
    entry = SensorConfig("left_optical", "world", "left", "/left/camera_info", None)
    types = {entry.topic_name: "sensor_msgs/CameraInfo"}
    with pytest.raises(AtomError, match="carries sensor_msgs/CameraInfo, it has to be livox"):
        rig_from_bag(
            SimpleNamespace(sensors={"left": entry}), SimpleNamespace(types=types, path="a.bag")
        )


def test_two_sensors_of_one_topic_are_refused_by_name():
    bag = source("/points", "sensor_msgs/PointCloud2")
    bag.first = lambda _topic: SimpleNamespace(header=Header(frame_id="lidar"))
    config = SimpleNamespace(sensors={"left": entry(), "right": entry()})
    with pytest.raises(AtomError, match="sensors 'left' and 'right' have one topic .*/points"):
        rig_from_bag(config, bag)


def test_a_board_whose_frame_carries_a_sensor_is_refused():
    board = SimpleNamespace(link="lidar_base", parent_link="world")
    with pytest.raises(AtomError, match="pattern 'board': its link 'lidar_base' is a frame of"):
        checked(np.eye(4), "lidar", patterns={"board": board})
    checked(np.eye(4), "lidar", patterns={"board": SimpleNamespace(link="b", parent_link="world")})


def of_two(frames, cameras):
    """Return what is in doubt of two sensors 37.7 mm apart, whose headers have these frames."""
    tree = tree_with(ABOVE, data_frame="right_optical", link="left_optical")
    sensors = {
        name: Sensor(
            name,
            RGB if cameras else LIDAR3D,
            f"{name}_optical",
            Edge("world", "lidar_base"),
            CAMERA if cameras else None,
            f"/{name}",
            0.0,
        )
        for name in ("left", "right")
    }
    rig = Rig(sensors, {}, {}, (), data_frames=dict(zip(sensors, frames)))
    return check_frames(rig, SimpleNamespace(world_link="world", calibration_patterns={}), tree)


@pytest.mark.parametrize("cameras", [True, False])
def test_exchanged_topics_are_named(cameras):
    assert of_two(["left_optical", "right_optical"], cameras) == []
    with pytest.raises(AtomError, match="'left' and 'right': .* exchange topic_name of the two"):
        of_two(["right_optical", "left_optical"], cameras)


def test_a_stereo_pair_may_have_one_frame_and_two_lidars_may_not():
    assert of_two(["left_optical", "left_optical"], True) == []
    with pytest.raises(AtomError, match="'right': its data are in frame 'left_optical'"):
        of_two(["left_optical", "left_optical"], False)
