"""Images that a driver cuts to a region or bins have the intrinsics of what is left."""

import cv2
import numpy as np
import pytest
from sensor_msgs.msg import CompressedImage

from atom_calibration.errors import BagError
from atom_calibration.messages.cameras import (
    camera_from_info,
    camera_info_message,
    camera_of_images,
    is_cut_or_binned,
)
from atom_calibration.messages.images import image_message, image_size
from atom_calibration.sources.bag_reader import BagReader
from atom_calibration.sources.contradictions import MessageWatch
from atom_calibration.sources.rig import sensor_from_bag
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.labeling.rgb import RgbLabeler
from atom_core.model.config import SensorConfig
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import RGB, Sensor
from atom_core.model.transforms import Edge
from atom_core.synthetic.board import charuco
from atom_core.synthetic.board_image import render

WHOLE = Camera(1600, 1200, [[1100, 0, 803.7], [0, 1105, 590.2], [0, 0, 1]], [-0.1, 0.02, 0, 0, 0])
CAMERA_T_BOARD = se3.from_rpy(np.array([-0.35, -0.2, 1.1]), np.array([0.2, -0.3, 0.1]))


def info_of(binning=(0, 0), region=(0, 0, 0, 0)):
    """Return a CameraInfo; the region is x, y, width, height [px of the sensor]."""
    message = camera_info_message(WHOLE)
    message.binning_x, message.binning_y = binning
    message.roi.x_offset, message.roi.y_offset, message.roi.width, message.roi.height = region
    return message


def picture_of(binning, region):
    """Return the part of the picture of a board that such a driver sends."""
    config = charuco()
    whole = render(WHOLE, [((pattern_from_config("b", config), config), CAMERA_T_BOARD)])
    x, y, width, height = region if region[2] else (0, 0, WHOLE.width, WHOLE.height)
    bx, by = (max(b, 1) for b in binning)
    part = whole[y : y + height // by * by, x : x + width // bx * bx]
    return cv2.resize(part, (width // bx, height // by), interpolation=cv2.INTER_AREA)


@pytest.mark.parametrize("binning", [(0, 0), (2, 2), (2, 1)])
@pytest.mark.parametrize("region", [(0, 0, 0, 0), (301, 140, 1001, 903)])
def test_corners_are_where_its_camera_has_them(binning, region):
    picture = picture_of(binning, region)
    camera = camera_of_images(info_of(binning, region), picture.shape[1::-1])
    assert (camera.height, camera.width) == picture.shape[:2]
    pattern = pattern_from_config("b", charuco())
    sensor = Sensor("cam", RGB, "cam", Edge("world", "cam"), camera)
    label = RgbLabeler(sensor, pattern, charuco()).label(picture).label
    points = se3.apply(CAMERA_T_BOARD, pattern.corners_of(label.ids))
    off = label.pixels - camera.project(points)
    assert len(label.ids) > 0.8 * pattern.corner_count
    assert np.max(np.abs(np.mean(off, axis=0))) < 0.03
    if max(binning) > 1 or region[2]:
        whole = camera_from_info(info_of()).project(points)
        assert np.min(np.linalg.norm(label.pixels - whole, axis=1)) > 5.0


def test_a_driver_that_tells_the_intrinsics_of_its_images_is_believed():
    message = info_of(binning=(2, 2))
    assert camera_of_images(message, (1600, 1200)).K[0, 0] == WHOLE.K[0, 0]


@pytest.mark.parametrize("size", [(640, 480), (801, 600), (800, 599), None])
def test_what_does_not_explain_the_size_changes_nothing(size):
    camera = camera_of_images(info_of(binning=(2, 2)), size)
    assert (camera.width, camera.height) == (1600, 1200)
    np.testing.assert_array_equal(camera.K, WHOLE.K)


def test_a_region_or_binning_is_noticed():
    assert not is_cut_or_binned(info_of()) and not is_cut_or_binned(info_of(binning=(1, 1)))
    assert is_cut_or_binned(info_of(binning=(1, 2)))
    assert is_cut_or_binned(info_of(region=(0, 0, 800, 600)))


def test_images_tell_their_size_packed_or_not():
    image = np.zeros((30, 50, 3), dtype=np.uint8)
    assert image_size(image_message(image, "bgr8")) == (50, 30)
    for form in ("jpg", "png"):
        data = cv2.imencode(f".{form}", image)[1].tobytes()
        assert image_size(CompressedImage(format=form, data=data)) == (50, 30)
    depth = bytes(12) + cv2.imencode(".png", image[..., 0])[1].tobytes()
    assert image_size(CompressedImage(format="16UC1; compressedDepth png", data=depth)) == (50, 30)
    assert image_size(CompressedImage(format="jpeg", data=b"nothing")) is None


@pytest.mark.parametrize("packed", [False, True])
def test_a_recording_of_such_a_camera_has_the_camera_of_its_images(make, tmp_path, packed):
    region = (300, 140, 1000, 900)
    picture = picture_of((2, 2), region)
    message = image_message(picture, "mono8")
    if packed:
        message = CompressedImage(format="png", data=cv2.imencode(".png", picture)[1].tobytes())
    topic = "/cam/image_raw" + "/compressed" * packed
    content = [("/cam/camera_info", info_of((2, 2), region), 1.0), (topic, message, 1.1)]
    entry = SensorConfig("cam", "world", "cam", "/cam/image_raw", RGB)
    with BagReader(make.bag(tmp_path / "a.bag", content)) as bag:
        _, sensor = sensor_from_bag("cam", entry, bag)
    assert (sensor.camera.width, sensor.camera.height) == (500, 450)
    assert sensor.camera.K[0, 0] == 550.0
    assert sensor.camera.K[0, 2] == pytest.approx((803.7 - 300 + 0.5) / 2 - 0.5)
    np.testing.assert_array_equal(sensor.camera.D, WHOLE.D)


def test_a_region_that_moves_within_a_recording_is_refused():
    sensor = Sensor("cam", RGB, "cam", Edge("world", "cam"), WHOLE)
    watch = MessageWatch("a.bag", {"/cam/camera_info": sensor}, 0.0)
    watch.see_info("/cam/camera_info", info_of(region=(0, 0, 800, 600)), 1.0)
    with pytest.raises(BagError, match=r"from \(0, 0\), then .* from \(8, 0\)"):
        watch.see_info("/cam/camera_info", info_of(region=(8, 0, 800, 600)), 2.0)
