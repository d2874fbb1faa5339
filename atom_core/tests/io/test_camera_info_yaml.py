"""Intrinsics as ROS's camera_calibration and OpenCV's programs write them."""

import numpy as np
import pytest

from atom_core.errors import DatasetError
from atom_core.io.camera_info_yaml import read_camera_info

K = [900.5, 0.0, 639.5, 0.0, 901.5, 399.5, 0.0, 0.0, 1.0]
BROWN, RATIONAL = [-0.05, 0.01, 5e-4, -5e-4, 0.002], [-0.05, 0.01, 5e-4, -5e-4, 0.1, 0.2, 0.3, 0.4]
FISHEYE = [-0.05, 0.01, 5e-4, -5e-4]
OPENCV = """%YAML:1.0
---
calibration_time: "Sat 28 Nov 2026"
image_width: 1280
image_height: 800
fisheye_model: {fisheye}
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 9.005e+02, 0., 6.395e+02, 0., 9.015e+02, 3.995e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: {count}
   cols: 1
   dt: d
   data: {D}
"""
ROS = """image_width: 1280
image_height: 800
camera_name: narrow_stereo
camera_matrix: {{rows: 3, cols: 3, data: {K}}}
distortion_model: {model}
distortion_coefficients: {{rows: 1, cols: {count}, data: {D}}}
"""


@pytest.mark.parametrize(
    "D, fisheye, model, wanted",
    [
        (BROWN, 0, "plumb_bob", BROWN),
        (FISHEYE, 0, "plumb_bob", FISHEYE),
        (FISHEYE, 1, "equidistant", FISHEYE),
        (RATIONAL, 0, "rational_polynomial", RATIONAL),
        (RATIONAL + [0.0] * 6, 0, "rational_polynomial", RATIONAL),
        (BROWN + [0.0] * 9, 0, "plumb_bob", BROWN),
    ],
)
def test_opencv_s_model_is_told_by_its_coefficients(tmp_path, D, fisheye, model, wanted):
    path = tmp_path / "camera.yml"
    path.write_text(OPENCV.format(fisheye=fisheye, count=len(D), D=D))
    camera = read_camera_info(path)
    assert (camera.width, camera.height, camera.model) == (1280, 800, model)
    np.testing.assert_array_equal(camera.K.ravel(), K)
    np.testing.assert_array_equal(camera.D, wanted)


@pytest.mark.parametrize("begins", ["", "\ufeff"])
@pytest.mark.parametrize("line_ends", ["\n", "\r\n"])
def test_as_any_editor_saves_it(tmp_path, begins, line_ends):
    path = tmp_path / "camera.yaml"
    text = begins + ROS.format(K=K, D=FISHEYE, count=4, model="fisheye")
    path.write_bytes(text.replace("\n", line_ends).encode())
    camera = read_camera_info(path)
    assert camera.model == "equidistant"
    np.testing.assert_array_equal(camera.D, FISHEYE)


@pytest.mark.parametrize(
    "text, words",
    [
        ("", "it is empty"),
        ("- 1\n", "it has no names of values"),
        (ROS.split("distortion_model")[0].format(K=K), "it lacks 'distortion_coefficients'"),
        (OPENCV.format(fisheye=0, count=14, D=RATIONAL + [0.1] * 6), "D has 14 numbers"),
        (OPENCV.format(fisheye=0, count=12, D=RATIONAL + [0.1] * 4), "terms of thin prism are not"),
        (OPENCV.format(fisheye=0, count=14, D=RATIONAL + [0.0] * 4 + [0.1] * 2), "tilted sensor"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, text, words):
    path = tmp_path / "camera.yaml"
    path.write_text(text)
    with pytest.raises(DatasetError, match=words):
        read_camera_info(path)
