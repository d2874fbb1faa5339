"""Planes through points: the nearest one, bases of its normal, and how its sensor sees it."""

import itertools

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.geometry.plane import fit_plane, plane_as_seen, plane_basis

SQUARE = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
DIRECTIONS = [
    np.array(v) / np.linalg.norm(v) for v in itertools.product((-1.0, 0.0, 2.0), repeat=3) if any(v)
]


def test_the_plane_of_a_saddle_is_level_and_its_rms_the_height_of_its_corners():
    saddle = SQUARE + 0.1 * np.array([1.0, -1.0, 1.0, -1.0])[:, None] * [0.0, 0.0, 1.0]
    pose = se3.from_rpy(np.array([1.0, -2.0, 3.0]), np.array([0.4, -0.6, 1.0]))
    centroid, normal, rms_m = fit_plane(se3.apply(pose, saddle))
    np.testing.assert_allclose(centroid, pose[:3, 3], atol=1e-12)
    assert abs(normal @ pose[:3, 2]) == pytest.approx(1.0)
    assert rms_m == pytest.approx(0.1)


def test_the_plane_has_the_least_mean_square_of_all_through_the_middle():
    points = np.random.default_rng(0).normal(size=(30, 3)) * [2.0, 1.0, 0.2] + [0.0, 1.0, 4.0]
    centroid, normal, rms_m = fit_plane(points)
    heights = (points - points.mean(axis=0)) @ normal
    assert rms_m == pytest.approx(np.sqrt(np.mean(heights**2)))
    for change in 0.02 * np.vstack([np.eye(3), -np.eye(3)]):
        other = (normal + change) / np.linalg.norm(normal + change)
        assert np.mean(((points - centroid) @ other) ** 2) >= rms_m**2 - 1e-15


@pytest.mark.parametrize("count", [0, 1, 2])
def test_less_than_three_points_are_no_plane(count):
    with pytest.raises(ValueError, match=f"three points, found {count}"):
        fit_plane(np.eye(3)[:count])


def test_three_points_have_a_plane_without_rest():
    centroid, normal, rms_m = fit_plane(np.eye(3))
    np.testing.assert_allclose(np.abs(normal), 1.0 / np.sqrt(3.0))
    np.testing.assert_allclose(centroid, 1.0 / 3.0)
    assert rms_m == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("share, is_line", [(0.9e-9, True), (1.1e-9, False)])
def test_points_are_on_a_line_up_to_a_billionth_of_their_length(share, is_line):
    cross = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -share, 0.0], [0.0, share, 0.0]])
    if is_line:
        with pytest.raises(ValueError, match="on a line"):
            fit_plane(cross)
    else:
        assert abs(fit_plane(cross)[1][2]) == pytest.approx(1.0)


@pytest.mark.parametrize("size_m", [1e-11, 1.0, 1e6])
def test_the_size_of_the_points_does_not_matter(size_m):
    _, normal, rms_m = fit_plane(size_m * SQUARE)
    assert abs(normal[2]) == pytest.approx(1.0) and rms_m < 1e-15 * size_m
    with pytest.raises(ValueError, match="on a line"):
        fit_plane(size_m * np.outer([-1.0, 0.0, 1.0], [0.0, 1.0, 0.0]))


def test_one_place_is_no_plane():
    with pytest.raises(ValueError, match="on a line"):
        fit_plane(np.zeros((4, 3)))


@pytest.mark.parametrize("normal", DIRECTIONS, ids=str)
def test_a_basis_is_a_rotation_with_the_normal_last(normal):
    basis = plane_basis(normal)
    np.testing.assert_allclose(basis.T @ basis, np.eye(3), atol=1e-12)
    assert np.linalg.det(basis) == pytest.approx(1.0)
    np.testing.assert_array_equal(basis[:, 2], normal)


@pytest.mark.parametrize("normal", DIRECTIONS, ids=str)
def test_the_first_axis_of_a_basis_is_at_right_angles_to_the_smallest_of_the_normal(normal):
    """So the product of the two is the best conditioned."""
    first = plane_basis(normal)[:, 0]
    smallest = int(np.argmin(np.abs(normal)))
    assert first[smallest] == 0.0
    expected = np.cross(np.eye(3)[smallest], normal)
    np.testing.assert_allclose(first, expected / np.linalg.norm(expected), atol=1e-12)


@pytest.mark.parametrize("turn_deg", [-60.0, -20.0, 0.0, 20.0, 60.0])
@pytest.mark.parametrize("ahead", np.vstack([np.eye(3)[:2], -np.eye(3)[:2]]), ids=str)
def test_a_plane_is_seen_as_a_picture_in_an_upright_sensor(ahead, turn_deg):
    """A sensor whose z axis is up sees z of the plane point away from it, and y down."""
    about_z = se3.rotation_from_rotation_vector(np.array([0.0, 0.0, np.deg2rad(turn_deg)]))
    away = about_z @ ahead
    across = np.cross([0.0, 0.0, 1.0], away)
    points = 3.0 * ahead + SQUARE[:, :1] * across + SQUARE[:, 1:2] * [0.0, 0.0, 0.5]
    frame = plane_as_seen(points)
    np.testing.assert_allclose(frame[:3, 2], away, atol=1e-12)
    np.testing.assert_allclose(frame[:3, 1], [0.0, 0.0, -1.0], atol=1e-12)
    np.testing.assert_allclose(frame[:3, 0], -across, atol=1e-12)  # to the right
    np.testing.assert_allclose(frame[:3, 3], 3.0 * ahead, atol=1e-12)
    np.testing.assert_array_equal(frame[3], [0.0, 0.0, 0.0, 1.0])


@pytest.mark.parametrize("slope, what_is_up", [(0.94, 2), (0.96, 0), (-0.94, 2), (-0.96, 0)])
def test_x_is_up_where_the_normal_is_nearly_along_z(slope, what_is_up):
    normal = np.array([0.6 * np.sqrt(1.0 - slope**2), 0.8 * np.sqrt(1.0 - slope**2), slope])
    points = 2.0 * normal + SQUARE @ plane_basis(normal).T
    frame = plane_as_seen(points)
    np.testing.assert_allclose(frame[:3, 2], normal, atol=1e-9)
    assert np.linalg.det(frame[:3, :3]) == pytest.approx(1.0)
    np.testing.assert_allclose(frame[:3, :3].T @ frame[:3, :3], np.eye(3), atol=1e-9)
    up = np.eye(3)[what_is_up]
    across = np.cross(up, normal)
    assert frame[:3, 1] @ up < 0.0
    assert frame[:3, 1] @ across == pytest.approx(0.0, abs=1e-9)  # as steep as the plane allows


def test_a_plane_through_the_sensor_has_a_frame_still():
    frame = plane_as_seen(SQUARE)
    np.testing.assert_allclose(np.abs(frame[:3, 2]), [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(frame[:3, 1], [-1.0, 0.0, 0.0], atol=1e-12)
