"""Camera models against OpenCV, their Jacobians, their inverses, and points behind them."""

import cv2
import numpy as np
import pytest

from atom_core.geometry.camera import Camera, distortion_model_name

K = np.array([[1040.0, 0, 663.0], [0, 1027.0, 401.0], [0, 0, 1]])
CAMERAS = {
    "none": Camera(1280, 800, K, [], "none"),
    "plumb_bob": Camera(1280, 800, K, [-0.25, 0.1, 0.001, -0.002, -0.03], "plumb_bob"),
    "plumb_bob_4": Camera(1280, 800, K, [-0.25, 0.1, 0.001, -0.002], "plumb_bob"),
    "rational_polynomial": Camera(
        1280, 800, K, [0.3, -0.1, 0.001, -0.002, 0.01, 0.5, -0.1, 0.02], "rational_polynomial"
    ),
    "equidistant": Camera(1280, 800, K, [-0.03, 0.01, -0.004, 0.001], "equidistant"),
}


def points_in_view(count=200, seed=0):
    rng = np.random.default_rng(seed)
    xy = rng.uniform([-0.6, -0.38], [0.58, 0.38], (count, 2))
    depth = rng.uniform(0.4, 5.0, count)
    return np.column_stack([xy * depth[:, None], depth])


@pytest.mark.parametrize(
    "numbers, what",
    [
        ([1040, 15, 663, 0, 1027, 401, 0, 0, 1], "skew of 15 px"),
        ([1040, 0, 0, 0, 1027, 0, 663, 401, 1], "written column by column"),
        ([1.04, 0, 0.663, 0, 1.027, 0.401, 0, 0, 0.001], "scaled as a whole"),
    ],
)
def test_a_matrix_that_says_more_than_the_models_know_is_refused(numbers, what):
    with pytest.raises(ValueError, match=what):
        Camera(1280, 800, numbers, np.zeros(5))


def test_a_skew_below_what_corners_tell_is_none():
    Camera(1280, 800, [1040, 1e-3, 663, 0, 1027, 401, 0, 0, 1], np.zeros(5))


def test_a_fisheye_without_coefficients_is_no_pinhole():
    with pytest.raises(ValueError, match="D has 0 numbers, the model equidistant needs 4"):
        Camera(1280, 800, K, [], "equidistant")


@pytest.mark.parametrize("name", CAMERAS)
def test_a_binned_part_sees_a_point_amid_the_pixels_that_saw_it(name):
    camera, points = CAMERAS[name], points_in_view()
    part = camera.part((100, 40), (2, 4), (500, 150))
    assert (part.width, part.height, part.model) == (500, 150, camera.model)
    expected = (camera.project(points) - [100, 40] - [0.5, 1.5]) / [2, 4]
    np.testing.assert_allclose(part.project(points), expected, atol=1e-9)


@pytest.mark.parametrize("name", [n for n in CAMERAS if n != "equidistant"])
def test_projection_is_opencvs(name):
    camera, points = CAMERAS[name], points_in_view()
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, camera.D)
    np.testing.assert_allclose(camera.project(points), expected[:, 0], atol=1e-9)


def test_equidistant_is_opencvs_fisheye():
    camera, points = CAMERAS["equidistant"], points_in_view()
    expected, _ = cv2.fisheye.projectPoints(points[:, None], np.zeros(3), np.zeros(3), K, camera.D)
    np.testing.assert_allclose(camera.project(points), expected[:, 0], atol=1e-9)


@pytest.mark.parametrize("name", CAMERAS)
def test_jacobian_against_central_differences(name):
    camera, points, h = CAMERAS[name], points_in_view(), 1e-6
    _, jacobian = camera.project_with_jacobian(points)
    for i in range(3):
        step = np.zeros(3)
        step[i] = h
        numeric = (camera.project(points + step) - camera.project(points - step)) / (2 * h)
        scale = np.max(np.abs(jacobian))
        np.testing.assert_allclose(jacobian[:, :, i], numeric, atol=1e-6 * scale)


@pytest.mark.parametrize("name", CAMERAS)
def test_jacobian_outside_the_view_and_behind(name):
    camera, h = CAMERAS[name], 1e-6
    rng = np.random.default_rng(5)
    points = rng.uniform(-2, 2, (300, 3))
    _, jacobian = camera.project_with_jacobian(points)
    for i in range(3):
        step = np.zeros(3)
        step[i] = h
        numeric = (camera.project(points + step) - camera.project(points - step)) / (2 * h)
        scale = np.maximum(np.max(np.abs(jacobian), axis=(1, 2)), 1.0)[:, None]
        close = np.abs(jacobian[:, :, i] - numeric) < 1e-4 * scale
        assert np.mean(close) > 0.99  # the limit itself has a kink, a sample may straddle it


@pytest.mark.parametrize("name", CAMERAS)
def test_normalise_inverts_projection(name):
    camera, points = CAMERAS[name], points_in_view()
    rays = camera.normalise(camera.project(points))
    np.testing.assert_allclose(rays, points[:, :2] / points[:, 2:], atol=1e-10)


@pytest.mark.parametrize("name", CAMERAS)
def test_ray_points_return_the_points(name):
    camera, points = CAMERAS[name], points_in_view()
    again = camera.ray_points(camera.project(points), points[:, 2])
    np.testing.assert_allclose(again, points, atol=1e-9)


@pytest.mark.parametrize("name", CAMERAS)
def test_a_point_behind_is_not_taken_for_one_in_front(name):
    camera, points = CAMERAS[name], points_in_view()
    mirrored = -points  # a pinhole without a guard would project these into the same pixels
    distance = np.linalg.norm(camera.project(mirrored) - camera.project(points), axis=1)
    assert np.min(distance) > 100.0
    assert not np.any(camera.in_image(mirrored))


@pytest.mark.parametrize("name", CAMERAS)
def test_moving_backwards_moves_out_of_the_image(name):
    camera = CAMERAS[name]
    depth = np.linspace(1.0, -3.0, 400)
    points = np.column_stack([np.full(400, 0.3), np.full(400, 0.2), depth])
    radius = np.linalg.norm(camera.project(points) - camera.centre_px, axis=1)
    assert np.all(np.diff(radius) > 0)


def test_names_of_models():
    assert distortion_model_name("fisheye") == "equidistant"
    with pytest.raises(ValueError, match="division"):
        distortion_model_name("division")


@pytest.mark.parametrize(
    "model, D",
    [("plumb_bob", [0.1] * 3), ("rational_polynomial", [0.1] * 5), ("equidistant", [1, 2])],
)
def test_wrong_number_of_coefficients_is_refused(model, D):
    with pytest.raises(ValueError, match=f"D has {len(D)} numbers"):
        Camera(640, 480, K, D, model)


def test_wrong_length_of_K_is_refused():
    with pytest.raises(ValueError, match="K has 8 numbers"):
        Camera(640, 480, np.ones(8), [])


def test_integer_K_and_D_are_numbers_like_others():
    camera = Camera(640, 480, [[600, 0, 320], [0, 600, 240], [0, 0, 1]], [0, 0, 0, 0, 0])
    np.testing.assert_allclose(camera.project(np.array([[0.5, 0.0, 1.0]])), [[620, 240]])


@pytest.mark.parametrize(
    "model, count, told",
    [
        ("", 8, "plumb_bob needs 4 or 5; they would be of rational_polynomial"),
        ("plumb_bob", 8, "they would be of rational_polynomial: correct distortion_model"),
        ("equidistant", 5, "they would be of plumb_bob"),
        ("plumb_bob", 7, "the model plumb_bob needs 4 or 5$"),
    ],
)
def test_coefficients_of_another_model_name_it(model, count, told):
    K = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])
    with pytest.raises(ValueError, match=told):
        Camera(640, 480, K, np.full(count, 0.01), model)


@pytest.mark.parametrize("model", ["equidistant", "plumb_bob"])
def test_a_point_on_the_optical_axis_is_in_the_middle_of_the_image(model):
    K = np.array([[500.0, 0, 320], [0, 490, 240], [0, 0, 1]])
    camera = Camera(640, 480, K, np.array([0.1, -0.05, 0.01, 0.002]), model)
    pixel, by_point = camera.project_with_jacobian(np.array([[0.0, 0.0, 2.0]]))
    np.testing.assert_allclose(pixel, [[320.0, 240.0]])
    np.testing.assert_allclose(by_point[0], [[250.0, 0, 0], [0, 245.0, 0]], atol=1e-9)


def test_coefficients_padded_with_zeros_are_those_of_the_shorter_model():
    K, padded = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]]), [*(5 * [0.01]), 0, 0]
    with pytest.raises(ValueError, match="equidistant needs 4; they would be of plumb_bob:"):
        Camera(640, 480, K, np.array(padded), "equidistant")
