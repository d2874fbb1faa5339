"""Messages and the core's types say the same."""

import copy
import struct

import cv2
import numpy as np
import pytest
from sensor_msgs import point_cloud2
from sensor_msgs.msg import CompressedImage, Image, LaserScan

from atom_calibration.errors import MessageError
from atom_calibration.messages import images
from atom_calibration.messages.cameras import camera_from_info
from atom_calibration.messages.clouds import (
    POINT_CLOUD,
    cloud_message,
    cloud_xyz,
    point_cloud,
)
from atom_calibration.messages.images import colour_image, depth_image, image_size
from atom_calibration.messages.poses import edge_of, transform_matrix
from atom_calibration.messages.scans import laser_scan
from atom_calibration.sources.bag_reader import BagReader
from atom_core.model.transforms import Edge

RNG = np.random.default_rng(0)
PICTURE = RNG.integers(0, 256, (6, 9, 3), dtype=np.uint8)


@pytest.mark.parametrize(
    "encoding, shown",
    [
        ("bgr8", PICTURE),
        ("rgb8", PICTURE[..., ::-1]),
        ("bgra8", np.dstack([PICTURE, PICTURE[..., :1]])),
        ("rgba8", np.dstack([PICTURE[..., ::-1], PICTURE[..., :1]])),
        ("8UC4", np.dstack([PICTURE, PICTURE[..., :1]])),
        ("16UC3", PICTURE.astype("<u2") << 8),
        ("bgra16", np.dstack([PICTURE, PICTURE[..., :1]]).astype("<u2") << 8),
        ("rgba16", np.dstack([PICTURE[..., ::-1], PICTURE[..., :1]]).astype("<u2") << 8),
        ("16UC4", np.dstack([PICTURE, PICTURE[..., :1]]).astype("<u2") << 8),
    ],
)
@pytest.mark.parametrize("padding", [0, 5])
def test_colours_arrive_in_the_order_blue_green_red(make, encoding, shown, padding):
    message = make.image(np.ascontiguousarray(shown), encoding, padding=padding)
    np.testing.assert_array_equal(colour_image(message), PICTURE)


def test_grey_images_of_8_and_16_bits_become_three_equal_channels(make):
    grey = PICTURE[..., 0].copy()
    for message in (make.image(grey, "mono8"), make.image(grey.astype("<u2") << 8, "mono16")):
        np.testing.assert_array_equal(colour_image(message), np.dstack([grey] * 3))


@pytest.mark.parametrize("bits", [8, 10, 12])
def test_fewer_bits_in_16_are_not_black_and_said_once(make, caplog, bits):
    images._say_depth.cache_clear()
    grey = PICTURE[..., 0].copy()
    grey[0, 0] = 255
    message = make.image(grey.astype("<u2") << (bits - 8), "mono16")
    for _ in range(3):
        np.testing.assert_array_equal(colour_image(message), np.dstack([grey] * 3))
    assert [record.getMessage() for record in caplog.records] == [
        f"an image of 16 bits holds values below {2**bits} only; "
        f"they are taken as values of {bits} bits"
    ]


def test_a_full_fourth_channel_does_not_darken_a_picture_of_twelve_bits(make):
    full = np.full((*PICTURE.shape[:2], 1), 65535, "<u2")
    colours = np.where(PICTURE > 200, 255, PICTURE).astype("<u2") << 4
    shown = colour_image(make.image(np.dstack([colours, full]), "bgra16"))
    np.testing.assert_array_equal(shown, colours >> 4)


def test_a_hot_pixel_makes_no_picture_black(make):
    grey = np.random.default_rng(2).integers(0, 256, (120, 160)).astype("<u2")
    stored = grey << 4
    stored[7, 9] = 65535
    image = colour_image(make.image(stored, "mono16"))[..., 0]
    assert image[7, 9] == 255
    image[7, 9] = grey[7, 9]
    np.testing.assert_array_equal(image, grey)


@pytest.mark.parametrize("bits", [8, 12, 16])
def test_so_they_are_in_a_compressed_picture(bits):
    images._say_depth.cache_clear()
    grey = PICTURE[..., 0].copy()
    grey[0, 0] = 255
    _, data = cv2.imencode(".png", grey.astype("<u2") << (bits - 8))
    message = CompressedImage(format="mono16; png compressed ", data=data.tobytes())
    np.testing.assert_array_equal(colour_image(message), np.dstack([grey] * 3))


@pytest.mark.parametrize(("kind", "bits"), [("u1", 8), ("<u2", 12), ("<u2", 16)])
@pytest.mark.parametrize(("pattern", "red"), [("rggb", 0), ("grbg", 1), ("gbrg", 2), ("bggr", 3)])
def test_a_bayer_image_keeps_its_colours(make, pattern, red, kind, bits):
    mosaic = np.zeros((8, 8), kind)
    mosaic[red // 2 :: 2, red % 2 :: 2] = 255 << (bits - 8)
    colours = colour_image(make.image(mosaic, f"bayer_{pattern}{8 * mosaic.itemsize}"))
    assert colours[4, 4].tolist() == [0, 0, 255]


@pytest.mark.parametrize("packed", [".png", ".jpg"])
@pytest.mark.parametrize(("pattern", "red"), [("rggb", 0), ("grbg", 1), ("gbrg", 2), ("bggr", 3)])
def test_a_bayer_image_keeps_its_colours_when_it_is_compressed(pattern, red, packed):
    """compressed_image_transport packs its pixels as if they were grey."""
    mosaic = np.zeros((16, 16), np.uint8)
    mosaic[red // 2 :: 2, red % 2 :: 2] = 255
    _, data = cv2.imencode(packed, mosaic, [cv2.IMWRITE_JPEG_QUALITY, 100])
    kind = "jpeg" if packed == ".jpg" else "png"
    message = CompressedImage(format=f"bayer_{pattern}8; {kind} compressed ", data=data.tobytes())
    assert np.max(np.abs(colour_image(message)[8, 8].astype(int) - [0, 0, 255])) <= 3
    _, data = cv2.imencode(packed, np.full((16, 16, 3), [0, 0, 255], np.uint8))
    message = CompressedImage(
        format=f"bayer_{pattern}8; {kind} compressed bgr8", data=data.tobytes()
    )
    assert np.max(np.abs(colour_image(message)[8, 8].astype(int) - [0, 0, 255])) <= 3


@pytest.mark.parametrize("encoding, grey", [("yuv422", b"\x80\x50"), ("yuv422_yuy2", b"\x50\x80")])
def test_yuv_images_share_colours_by_pairs_of_columns(encoding, grey):
    data = grey * 2
    shown = colour_image(Image(height=1, width=2, step=4, encoding=encoding, data=data))
    assert shown.shape == (1, 2, 3) and np.ptp(shown) <= 1
    with pytest.raises(MessageError, match="has 3 columns; .* their number is even"):
        # decoded, it would write beyond the picture's memory and end whatever comes later
        colour_image(Image(height=1, width=3, step=6, encoding=encoding, data=data + grey))


def test_a_compressed_picture_is_decoded_in_the_right_order():
    _, data = cv2.imencode(".png", PICTURE)
    message = CompressedImage(format="rgb8; png compressed bgr8", data=data.tobytes())
    np.testing.assert_array_equal(colour_image(message), PICTURE)


@pytest.mark.parametrize("kind, big", [("<u2", False), (">u2", True)])
def test_whole_depths_are_millimetres_and_zero_is_none(make, kind, big):
    message = make.image(np.array([[0, 1500, 65535]], kind), "16UC1", big=big)
    np.testing.assert_allclose(depth_image(message), [[np.nan, 1.5, 65.535]], rtol=1e-6)


def test_other_depths_are_metres_and_what_is_no_depth_becomes_nan(make):
    stored = np.array([[np.nan, np.inf, -1.0, 0.0, 2.5]], "<f4")
    depth = depth_image(make.image(stored, "32FC1"))
    np.testing.assert_array_equal(depth, np.array([[np.nan] * 4 + [2.5]], np.float32))


def test_depths_packed_by_either_transport_are_the_same():
    stored = np.array([[0, 1234], [999, 4000]], np.uint16)
    _, data = cv2.imencode(".png", stored)
    plain = CompressedImage(format="16UC1; png compressed ", data=data.tobytes())
    header = struct.pack("<iff", 0, 0.0, 0.0)
    packed = CompressedImage(format="16UC1; compressedDepth png", data=header + data.tobytes())
    expected = np.where(stored > 0, stored * np.float32(0.001), np.nan)
    for message in (plain, packed):
        np.testing.assert_allclose(depth_image(message), expected, rtol=1e-6)


@pytest.mark.parametrize("form", ["16UC1; png compressed ", "32FC1; compressedDepth png"])
def test_a_depth_image_is_no_colour_image(make, form):
    encoding, stored = form.split(";")[0], cv2.imencode(".png", np.ones((4, 4), np.uint16))[1]
    kind = np.uint16 if encoding == "16UC1" else np.float32
    for message in (
        make.image(np.ones((4, 4), kind), encoding),
        CompressedImage(format=form, data=stored.tobytes()),
    ):
        with pytest.raises(MessageError, match=f"{encoding}.*but a depth image; set `modality: "):
            colour_image(message)


@pytest.mark.parametrize("convert", [colour_image, depth_image])
def test_empty_and_cut_off_images_are_refused(make, convert):
    encoding = "bgr8" if convert is colour_image else "16UC1"
    whole = make.image(PICTURE if encoding == "bgr8" else PICTURE[..., 0].astype("<u2"), encoding)
    whole.data, data = b"", whole.data
    with pytest.raises(MessageError, match="empty"):
        convert(whole)
    whole.data = data[:-4]
    with pytest.raises(MessageError, match="cut off"):
        convert(whole)
    with pytest.raises(MessageError, match="cannot be decoded"):
        convert(CompressedImage(format="jpeg", data=b"\xff\xd8\xff broken"))


def test_images_of_the_wrong_kind_are_refused_by_name(make):
    with pytest.raises(MessageError, match="bgr8.*no depth"):
        depth_image(make.image(PICTURE, "bgr8"))
    with pytest.raises(MessageError, match="32FC1.*no colour"):
        colour_image(make.image(PICTURE[..., 0].astype("<f4"), "32FC1"))


@pytest.mark.parametrize(
    "change, complaint",
    [
        ({"offset": 2**31 - 1}, "field 'x' does not fit into a point of 12 bytes"),
        ({"count": 2**32 - 1}, "field 'x' does not fit into a point of 12 bytes"),
        ({"count": 3}, "field x has several values in each point"),
        ({"datatype": 9}, "field 'x' has the datatype 9"),
        ({"name": "a"}, "no field x"),
    ],
    ids=str,
)
def test_fields_that_claim_what_is_not_there_are_refused(change, complaint):
    """An offset beyond 31 bits once made numpy read beyond all memory."""
    message = cloud_message(np.zeros(5, LAYOUTS["packed"]), is_dense=True)
    for name, value in change.items():
        setattr(message.fields[0], name, value)
    with pytest.raises(MessageError, match=complaint):
        point_cloud(message)


def test_headers_that_claim_what_is_not_there_are_refused():
    message = cloud_message(np.zeros(5, LAYOUTS["packed"]), is_dense=True)
    for name in ("point_step", "width", "height", "row_step"):
        changed = copy.deepcopy(message)
        setattr(changed, name, 2**32 - 1)
        if name == "row_step":
            changed.height = 2
        with pytest.raises(MessageError):
            point_cloud(changed)


def test_other_encodings_of_a_compressed_image_are_refused():
    bmp = cv2.imencode(".bmp", PICTURE)[1].tobytes()
    with pytest.raises(MessageError, match="neither JPEG nor PNG"):
        colour_image(CompressedImage(format="bmp", data=bmp))


# What rvl 1.0.4 and pyrvl 0.0.1, other packages than ours, make of the depths below.
RVL = struct.pack("<II", 3, 2) + bytes.fromhex("23e58f1300000020")


def test_depth_that_is_packed_by_rvl_is_read():
    message = CompressedImage(format="16UC1; compressedDepth rvl", data=bytes(12) + RVL)
    nan = np.nan
    np.testing.assert_allclose(depth_image(message), [[nan, 1.5, 1.501], [1.499, nan, nan]], 1e-6)
    assert image_size(message) == (3, 2)
    for data in (bytes(12) + RVL[:-4], bytes(12), bytes(12) + b"\xff" * 40):
        with pytest.raises(
            MessageError, match="compressedDepth rvl.* cannot be decoded: .*record it"
        ):
            depth_image(CompressedImage(format=message.format, data=data))


def test_inverse_depth_is_read_without_a_trend():
    """The transport stores the inverse depth rounded down; it is right in the mean all the same."""
    depth_m = np.linspace(0.5, 5.0, 40_000).astype(np.float32).reshape(200, 200)
    a = np.float32(100.0 * 101.0)
    b = np.float32(1.0 - a / 10.0)
    stored = (a / depth_m + b).astype(np.uint16)
    header = struct.pack("<iff", 1, a, b)
    data = header + cv2.imencode(".png", stored)[1].tobytes()
    read_m = depth_image(CompressedImage(format="32FC1; compressedDepth png", data=data))
    errors_steps = (a / read_m - a / depth_m).ravel()
    assert np.max(np.abs(errors_steps)) < 0.51
    assert np.abs(np.mean(errors_steps)) < 0.01


LAYOUTS = {
    "packed": np.dtype([(n, "<f4") for n in "xyz"]),
    "padded": np.dtype(
        {
            "names": ["x", "y", "z", "ring"],
            "formats": ["<f4", "<f4", "<f4", "<u2"],
            "offsets": [0, 4, 8, 20],
            "itemsize": 32,
        }
    ),
    "unaligned": np.dtype([("ring", "u1"), ("z", "<f8"), ("y", "<f8"), ("x", "<f8"), ("t", "<u4")]),
    "big endian": np.dtype([(n, ">f4") for n in "xyz"]),
    "several values": np.dtype([("normal", "<f4", (3,)), ("x", "<f4"), ("y", "<f4"), ("z", "<f4")]),
}


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("height, row_padding", [(1, 0), (4, 0), (4, 12)])
def test_any_layout_of_a_cloud_gives_the_same_points(make, layout, height, row_padding):
    positions = RNG.normal(size=(20, 3)).astype(np.float32)
    positions[3] = np.nan
    table = np.zeros(20, LAYOUTS[layout])
    for column, axis in enumerate("xyz"):
        table[axis] = positions[:, column]
    if "ring" in table.dtype.names:
        table["ring"] = np.arange(20)
    points = point_cloud(make.cloud(table, height, row_padding))
    np.testing.assert_array_equal(cloud_xyz(points), positions)
    if "ring" in table.dtype.names:
        np.testing.assert_array_equal(points["ring"], np.arange(20))


def test_a_cloud_without_positions_or_cut_off_is_refused(make):
    table = np.zeros(3, [("x", "<f4"), ("y", "<f4"), ("range", "<f4")])
    with pytest.raises(MessageError, match="no field z.*x, y, range"):
        point_cloud(make.cloud(table))
    message = make.xyz_cloud(np.ones((3, 3)))
    message.data = message.data[:-1]
    with pytest.raises(MessageError, match="cut off"):
        point_cloud(message)


def test_an_empty_cloud_is_a_cloud_without_points(make):
    message = make.xyz_cloud(np.ones((0, 3)))
    assert cloud_xyz(point_cloud(message)).shape == (0, 3)


def test_the_real_padded_cloud_equals_rosbags_own_decoding(real_data):
    with BagReader(real_data("bag_padded_cloud") / "test.bag") as bag:
        found = [m.message for m in bag.messages(sorted(bag.types))]
    kinds = [m._type for m in found]
    assert len(found) == 15 and all(kinds.count(kind) == 5 for kind in set(kinds))
    clouds = [m for m in found if m._type == POINT_CLOUD]
    names = ["x", "y", "z", "intensity", "time_sec", "time_nsec", "laser_id"]
    for message in clouds:
        points = point_cloud(message)
        reference = np.array(list(point_cloud2.read_points(message, names)))
        assert len(points) == message.width > 35000
        for column, name in enumerate(names):
            np.testing.assert_array_equal(points[name].astype(float), reference[:, column])
    scans = [m for m in found if m._type == "sensor_msgs/LaserScan"]
    assert all(len(laser_scan(m).points) == len(m.ranges) for m in scans)


def test_a_scan_becomes_points_and_keeps_invalid_ranges_as_nan():
    scan = LaserScan(angle_min=0.0, angle_increment=np.pi / 2, range_min=0.1, range_max=9.0)
    scan.ranges, scan.angle_max = [2.0, 3.0, 20.0], np.pi
    expected = [[2, 0, 0], [0, 3, 0], [np.nan] * 3]
    np.testing.assert_allclose(laser_scan(scan).points, expected, atol=1e-12)


def test_a_camera_keeps_its_model_and_an_uncalibrated_one_is_refused(make):
    message = make.camera_info(model="equidistant", D=[0.1, 0.0, 0.0, 0.0])
    camera = camera_from_info(message)
    assert (camera.model, camera.width, camera.K[0, 0]) == ("equidistant", 64, 50.0)
    message.D = [0.1]
    with pytest.raises(MessageError, match="camera_info: D has 1"):
        camera_from_info(message)
    message.K = [0.0] * 9
    with pytest.raises(MessageError, match="not calibrated"):
        camera_from_info(message)


def test_a_transform_loses_the_slash_of_its_frames_and_must_be_a_pose(make):
    matrix = np.eye(4)
    matrix[:3, 3] = 1.0, 2.0, 3.0
    message = make.tf("/world", "/base", matrix).transforms[0]
    assert edge_of(message) == Edge("world", "base")
    np.testing.assert_allclose(transform_matrix(message), matrix)
    message.transform.rotation.w = 0.0
    with pytest.raises(MessageError, match="'world-base' is no pose"):
        transform_matrix(message)
