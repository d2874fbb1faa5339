"""Whatever bytes a recording holds, reading it ends with its messages or with one sentence.

The first draws run in `make test`, many more in `make test-long`.
"""

import random

import cv2
import numpy as np
import pytest
import rosbag
import rospy
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, LaserScan, PointCloud2, PointField
from tf2_msgs.msg import TFMessage

from atom_calibration.errors import BagError, MessageError
from atom_calibration.messages.cameras import camera_from_info
from atom_calibration.messages.clouds import cloud_message, cloud_xyz, point_cloud
from atom_calibration.messages.images import colour_image, depth_image
from atom_calibration.messages.scans import laser_scan
from atom_calibration.sources.bag_reader import BagReader

DRAWS = [pytest.param(0, 400), *(pytest.param(s, 5000, marks=pytest.mark.long) for s in (1, 2, 3))]
COUNTS = [0, 1, 2, 3, 5, 255, 2**16, 2**31 - 1, 2**31, 2**32 - 1]
CODECS = ["", " png", " rvl"]
NUMBERS = [0.0, 1.0, -1.0, 1e-30, 1e30, 1e308, np.nan, np.inf]
CLOUD = cloud_message(np.zeros(50, [(n, "<f4") for n in "xyz"] + [("ring", "<u2")]), is_dense=True)


def damaged_cloud(drawn):
    message = PointCloud2(**{n: getattr(CLOUD, n) for n in CLOUD.__slots__ if n != "fields"})
    message.fields = [PointField(f.name, f.offset, f.datatype, f.count) for f in CLOUD.fields]
    for _ in range(drawn.randint(1, 3)):
        name = drawn.choice(["height", "width", "point_step", "row_step", "data", "fields"])
        if name == "data":
            message.data = message.data[: drawn.randint(0, len(message.data))]
        elif name == "fields":
            field = drawn.choice(message.fields)
            field.name = drawn.choice(["x", "", "y", "ring", "\0"])
            field.offset, field.count = drawn.choice(COUNTS), drawn.choice(COUNTS)
            field.datatype = drawn.choice([0, 1, 2, 7, 8, 9, 255])
        else:
            setattr(message, name, drawn.choice(COUNTS))
    return message


def damaged_image(drawn):
    encodings = ["bgr8", "mono8", "32FC1", "16UC1", "bayer_rggb8", "", "?", "64FC4", "yuv422"]
    message = Image(height=10, width=12, step=36, encoding=drawn.choice(encodings))
    message.data = bytes(drawn.choice([0, 1, 100, 360, 1000]))
    setattr(message, drawn.choice(["height", "width", "step"]), drawn.choice(COUNTS))
    return message


def damaged_compressed(drawn):
    pixels = np.zeros((8, 8), drawn.choice([np.uint8, np.uint16]))
    data = bytearray(cv2.imencode(drawn.choice([".png", ".jpg", ".bmp"]), pixels)[1].tobytes())
    for _ in range(drawn.randint(0, 4)):
        data[drawn.randrange(len(data))] = drawn.getrandbits(8)
    header = bytes(drawn.choice([0, 12]))
    depths = [
        f"{encoding}; compressedDepth{codec}" for encoding in ("16UC1", "32FC1") for codec in CODECS
    ]
    kind = drawn.choice(["jpeg", "", *depths])
    return CompressedImage(format=kind, data=header + bytes(data[: drawn.choice([20, 10_000])]))


def damaged_scan(drawn):
    message = LaserScan(angle_min=-1, angle_max=1, angle_increment=0.02, range_max=10)
    message.ranges = [drawn.choice(NUMBERS) for _ in range(drawn.choice([0, 1, 2, 101, 102]))]
    for _ in range(drawn.randint(0, 2)):
        name = drawn.choice(["angle_min", "angle_max", "angle_increment", "range_min", "range_max"])
        setattr(message, name, drawn.choice(NUMBERS))
    return message


def damaged_info(drawn):
    message = CameraInfo(width=drawn.choice(COUNTS), height=drawn.choice(COUNTS))
    message.distortion_model = drawn.choice(["", "?", "plumb_bob", "equidistant"])
    message.K = [drawn.choice(NUMBERS) for _ in range(9)]
    message.D = [drawn.choice(NUMBERS) for _ in range(drawn.choice([0, 1, 4, 5, 8, 14, 20]))]
    return message


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of numbers that no camera has
@pytest.mark.parametrize("seed, draws", DRAWS)
@pytest.mark.parametrize(
    "damaged, convert",
    [
        (damaged_cloud, lambda message: cloud_xyz(point_cloud(message))),
        (damaged_image, colour_image),
        (damaged_image, depth_image),
        (damaged_compressed, colour_image),
        (damaged_compressed, depth_image),
        (damaged_scan, laser_scan),
        (damaged_info, camera_from_info),
    ],
)
def test_a_message_is_converted_or_refused(damaged, convert, seed, draws):
    drawn = random.Random(seed)
    refused = 0
    for _ in range(draws):
        message = damaged(drawn)
        try:
            convert(message)
        except MessageError as error:
            assert str(error) and "\n" not in str(error)
            refused += 1
    assert refused > draws / 10, "damage is noticed"


@pytest.mark.parametrize(
    "seed, draws", [pytest.param(0, 60), pytest.param(1, 3000, marks=pytest.mark.long)]
)
@pytest.mark.parametrize("compression", ["none", "lz4"])
def test_a_bag_is_read_or_refused(tmp_path, seed, draws, compression):
    path = tmp_path / "a.bag"
    with rosbag.Bag(str(path), "w", compression=compression) as bag:
        for second in range(1, 3):
            bag.write("/cloud", CLOUD, rospy.Time(second))
            bag.write("/tf", TFMessage([TransformStamped()]), rospy.Time(second))
            bag.write("/scan", LaserScan(ranges=[1.0] * 5), rospy.Time(second))
    whole, drawn = path.read_bytes(), random.Random(seed)
    read = 0
    for _ in range(draws):
        data = bytearray(whole)
        for _ in range(drawn.randint(1, 4)):
            place = drawn.randrange(len(data))
            length = drawn.choice([1, 4])
            data[place : place + length] = drawn.choice([b"\xff" * length, bytes(length), b""])
        path.write_bytes(bytes(data))
        try:
            with BagReader(path) as reader:
                read += all(found.topic for found in reader.messages(list(reader.types)))
        except BagError as error:
            assert str(error).startswith(str(path))
    assert 0 < read < draws
