"""Rays spread over what sensors see: which directions, and in which order."""

import numpy as np
import pytest

from atom_core.geometry.camera import Camera
from atom_core.geometry.rays import camera_rays, spinning_rays

K = np.array([[500.0, 0.0, 300.0], [0.0, 480.0, 200.0], [0.0, 0.0, 1.0]])
CAMERAS = {
    "pinhole": Camera(641, 401, K, [], "none"),
    "distorted": Camera(641, 401, K, [-0.2, 0.05, 0.001, -0.002, 0.01], "plumb_bob"),
}
AXES = {"camera": np.array([0.0, 0.0, 1.0]), "spinning": np.array([1.0, 0.0, 0.0])}


def rays_of(kind):
    return camera_rays(CAMERAS["pinhole"]) if kind == "camera" else spinning_rays([-10.0, 5.0])


@pytest.mark.parametrize("kind", AXES)
def test_rays_have_unit_length_and_their_angle_to_the_axis_grows(kind):
    rays, axis = rays_of(kind), AXES[kind]
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1.0)
    np.testing.assert_array_equal(rays[0], axis)
    assert np.all(np.diff(rays @ axis) <= 1e-15)


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=list(CAMERAS))
def test_rays_of_a_camera_meet_an_even_grid_from_corner_to_corner(camera):
    pixels = camera.project(camera_rays(camera)[1:])
    assert len(pixels) == 17 * 11
    columns, rows = (np.unique(np.round(pixels[:, i], 6) + 0.0) for i in range(2))
    np.testing.assert_allclose(columns, np.linspace(0.0, 640.0, 17), atol=1e-5)
    np.testing.assert_allclose(rows, np.linspace(0.0, 400.0, 11), atol=1e-5)
    assert len(np.unique(np.round(pixels, 4), axis=0)) == len(pixels)


def test_rays_of_a_spinning_lidar_are_even_around_and_at_its_elevations():
    elevations_deg = [-15.0, 0.0, 20.0]
    rays = spinning_rays(elevations_deg)[1:]
    assert len(rays) == 3 * 48
    found_deg = np.rad2deg(np.arcsin(rays[:, 2]))
    azimuth_deg = np.rad2deg(np.arctan2(rays[:, 1], rays[:, 0]))
    for elevation_deg in elevations_deg:
        mine = np.sort(azimuth_deg[np.abs(found_deg - elevation_deg) < 1e-6] % 360.0)
        np.testing.assert_allclose(mine % 360.0, np.arange(0.0, 360.0, 7.5), atol=1e-6)


def test_rays_of_a_level_scan_have_no_height():
    rays = spinning_rays([0.0])
    np.testing.assert_allclose(rays[:, 2], 0.0, atol=1e-15)
    np.testing.assert_allclose(rays.sum(axis=0), [1.0, 0.0, 0.0], atol=1e-12)  # the axis twice
