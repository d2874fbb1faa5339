"""Intrinsics as numbers: what each moves, how far, and the derivatives of pixels by them."""

import numpy as np
import pytest

from atom_core.geometry.camera import Camera
from atom_core.geometry.intrinsics import (
    COUNT,
    MOST_LOG,
    distortion_by_coefficients,
    intrinsics_names,
    intrinsics_values,
    moved_camera,
    number_scales,
    numbers_between,
    pixels_by_numbers,
    project_with_derivatives,
)

K = np.array([[900.0, 0.0, 600.0], [0.0, 700.0, 420.0], [0.0, 0.0, 1.0]])
CORNER = np.array([680.0 / 900.0, 420.0 / 700.0])  # the farthest of 1280 x 800, normalised
RADIUS = float(np.linalg.norm(CORNER))
COEFFICIENTS = {
    "none": [],
    "plumb_bob": [-0.2, 0.05, 0.001, -0.002, 0.01],
    "rational_polynomial": [0.3, -0.1, 0.001, -0.002, 0.01, 0.5, -0.1, 0.02],
    "equidistant": [-0.03, 0.01, -0.004, 0.001],
}
CAMERAS = {model: Camera(1280, 800, K, D, model) for model, D in COEFFICIENTS.items()}
CAMERAS["plumb_bob of four"] = Camera(1280, 800, K, COEFFICIENTS["plumb_bob"][:4], "plumb_bob")
NUMBERS = 0.01 * np.array([2.0, -3.0, 1.0, -2.0, 1.5, -0.5, 0.3, -0.2, 0.4, 0.2, -0.3, 0.1])


@pytest.fixture(params=CAMERAS)
def camera(request):
    return CAMERAS[request.param]


def points_ahead():
    rng = np.random.default_rng(0)
    z_m = rng.uniform(1.0, 4.0, 60)
    return np.column_stack(
        [rng.uniform(-0.8, 0.8, 60) * z_m, rng.uniform(-0.6, 0.6, 60) * z_m, z_m]
    )


def test_values_stand_in_the_order_of_their_names():
    names = intrinsics_names(CAMERAS["rational_polynomial"])
    assert names == ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    values = dict(zip(names, intrinsics_values(CAMERAS["rational_polynomial"])))
    assert (values["fx"], values["fy"], values["cx"], values["cy"]) == (900.0, 700.0, 600.0, 420.0)
    assert (values["p2"], values["k3"], values["k6"]) == (-0.002, 0.01, 0.02)
    fisheye = intrinsics_names(CAMERAS["equidistant"])
    assert fisheye == ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4")


def test_a_camera_has_as_many_names_as_values_and_scales(camera):
    count = 4 + camera.D.size
    assert len(intrinsics_names(camera)) == len(intrinsics_values(camera)) == count
    assert len(number_scales(camera)) == count <= COUNT


@pytest.mark.parametrize("centre", [(600.0, 420.0), (680.0, 420.0), (600.0, 380.0), (680.0, 380.0)])
def test_the_farthest_corner_is_found_on_any_side(centre):
    matrix = np.array([[900.0, 0.0, centre[0]], [0.0, 700.0, centre[1]], [0.0, 0.0, 1.0]])
    camera = Camera(1280, 800, matrix, np.zeros(5), "plumb_bob")
    assert number_scales(camera)[4] == pytest.approx(RADIUS**-3)


@pytest.mark.parametrize("model", ["plumb_bob", "equidistant"])
def test_a_coefficient_displaces_the_farthest_corner_by_its_number(model):
    """Radial ones by as much; of tangential ones along an axis a term is two or three times it."""
    plain, number = Camera(1280, 800, K, np.zeros(len(COEFFICIENTS[model])), model), 1e-3
    ray = np.array([*CORNER, 1.0])
    if model == "equidistant":
        ray = np.array([*(np.sin(RADIUS) * CORNER / RADIUS), np.cos(RADIUS)])  # seen at this angle
    for place, name in list(enumerate(intrinsics_names(plain)))[4:]:
        numbers = np.zeros(COUNT)
        numbers[place] = number
        moved = moved_camera(plain, numbers)
        shift = (moved.project(ray[None]) - plain.project(ray[None]))[0] / plain.focal_px
        x, y = CORNER / RADIUS
        expected = {"p1": (2 * x * y, 1 + 2 * y * y), "p2": (1 + 2 * x * x, 2 * x * y)}
        np.testing.assert_allclose(shift, number * np.array(expected.get(name, (x, y))), rtol=1e-6)


def test_the_coefficients_below_the_fraction_have_the_scales_of_those_above():
    scales = dict(
        zip(
            intrinsics_names(CAMERAS["rational_polynomial"]),
            number_scales(CAMERAS["rational_polynomial"]),
        )
    )
    for above, below, power in (("k1", "k4", 3), ("k2", "k5", 5), ("k3", "k6", 7)):
        assert scales[above] == scales[below] == pytest.approx(RADIUS**-power)
    assert scales["p1"] == scales["p2"] == pytest.approx(RADIUS**-2)


def test_focal_lengths_grow_by_a_factor_and_the_centre_moves_by_parts_of_them(camera):
    numbers = np.zeros(COUNT)
    numbers[:4] = 0.1, -0.2, 0.03, -0.04
    moved = moved_camera(camera, numbers)
    np.testing.assert_allclose(moved.focal_px, [900.0 * np.exp(0.1), 700.0 * np.exp(-0.2)])
    np.testing.assert_allclose(moved.centre_px, [600.0 + 0.03 * 900.0, 420.0 - 0.04 * 700.0])
    np.testing.assert_array_equal(moved.D, camera.D)
    assert (moved.width, moved.height, moved.model) == (1280, 800, camera.model)
    np.testing.assert_array_equal(camera.K, K)  # it stays as it is


def test_numbers_between_a_camera_and_where_they_move_it_are_the_same(camera):
    used = 4 + camera.D.size
    found = numbers_between(camera, moved_camera(camera, NUMBERS))
    np.testing.assert_allclose(found[:used], NUMBERS[:used], atol=1e-12)
    assert not found[used:].any() and found.shape == (COUNT,)
    np.testing.assert_array_equal(numbers_between(camera, camera), 0.0)


def test_numbers_beyond_those_of_the_model_have_no_effect(camera):
    numbers = np.zeros(COUNT)
    numbers[4 + camera.D.size :] = 1.0
    moved = moved_camera(camera, numbers)
    np.testing.assert_array_equal(moved.K, camera.K)
    np.testing.assert_array_equal(moved.D, camera.D)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_focal_length_stays_positive_and_finite(sign):
    numbers = np.zeros(COUNT)
    numbers[:2] = sign * 1e4, sign * (MOST_LOG - 0.5)
    focal_px = moved_camera(CAMERAS["none"], numbers).focal_px
    expected = np.exp(sign * np.array([20.0, 19.5])) * [900.0, 700.0]
    np.testing.assert_allclose(focal_px, expected)


def differences(start, numbers, points, h=1e-6):
    """Return (n, 2, 12): derivatives of the pixels by the numbers, by central differences."""
    found = np.zeros((len(points), 2, COUNT))
    for i in range(COUNT):
        step = h * np.eye(COUNT)[i]
        ends = [moved_camera(start, numbers + s * step).project(points) for s in (1.0, -1.0)]
        found[:, :, i] = (ends[0] - ends[1]) / (2.0 * h)
    return found


def test_derivatives_by_numbers_against_central_differences(camera):
    points, moved = points_ahead(), moved_camera(camera, NUMBERS)
    pixels, by_point, by_number = project_with_derivatives(camera, moved, points)
    np.testing.assert_allclose(pixels, moved.project(points))
    np.testing.assert_allclose(by_point, moved.project_with_jacobian(points)[1])
    np.testing.assert_allclose(by_number, differences(camera, NUMBERS, points), atol=1e-3)
    again = pixels_by_numbers(camera, moved, points, pixels)
    np.testing.assert_array_equal(again, by_number)
    assert not by_number[:, :, 4 + camera.D.size :].any()


@pytest.mark.parametrize("model", ["plumb_bob", "rational_polynomial"])
def test_derivatives_outside_the_view_are_those_of_the_continued_distortion(model):
    camera = CAMERAS[model]
    radius = np.sqrt(camera.limit_square)
    angles = np.linspace(0.0, 6.0, 9)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    points = np.concatenate(
        [np.column_stack([share * radius * circle, np.ones(9)]) for share in (0.99, 1.5, 4.0)]
    )
    h = 1e-6
    found = distortion_by_coefficients(camera, points)
    for i in range(camera.D.size):
        ends = []
        for sign in (1.0, -1.0):
            other = Camera(1280, 800, K, camera.D + sign * h * np.eye(camera.D.size)[i], model)
            object.__setattr__(other, "_limit_square", camera.limit_square)  # the same view
            ends.append((other.project(points) - other.centre_px) / other.focal_px)
        np.testing.assert_allclose(found[:, :, i], (ends[0] - ends[1]) / (2 * h), atol=1e-5)


def test_outside_the_view_the_effect_of_a_coefficient_grows_as_the_radius():
    camera = CAMERAS["plumb_bob"]
    limit = np.sqrt(camera.limit_square)
    at, twice = (
        distortion_by_coefficients(camera, np.array([[r, 0.0, 1.0]])) for r in (limit, 2.0 * limit)
    )
    np.testing.assert_allclose(twice, 2.0 * at)


def test_without_distortion_there_is_nothing_to_derive_by():
    assert distortion_by_coefficients(CAMERAS["none"], points_ahead()).shape == (60, 2, 0)


def test_on_the_axis_no_coefficient_moves_a_point_of_a_fisheye():
    for z_m in (2.0, -2.0):
        points = np.array([[0.0, 0.0, z_m], [1e-10 * abs(z_m), 0.0, z_m]])
        assert not distortion_by_coefficients(CAMERAS["equidistant"], points).any()


def test_coefficients_of_a_fisheye_stand_before_odd_powers_of_the_angle():
    angles = np.array([1e-4, 0.3, 1.2, 2.0])
    points = 3.0 * np.column_stack([0.6 * np.sin(angles), 0.8 * np.sin(angles), np.cos(angles)])
    found = distortion_by_coefficients(CAMERAS["equidistant"], points)
    powers = np.stack([angles**3, angles**5, angles**7, angles**9], axis=1)
    np.testing.assert_allclose(found[:, 0], 0.6 * powers, rtol=1e-9)
    np.testing.assert_allclose(found[:, 1], 0.8 * powers, rtol=1e-9)
