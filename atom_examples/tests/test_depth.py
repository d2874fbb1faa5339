import cell_boards as boards
import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_examples.cell_simulator.depth import DepthCamera, DepthNoise, millimetres


@pytest.fixture
def view(world):
    """A board before the depth camera; device, scene, exact depths of the pixels on the plate."""
    device, scene = world.depths["depth_1"], world.scene
    pose = boards.before(1.9, 0.5, 0.4, (0.1, 0.1), scene.board.pattern)
    scene.place_person(boards.AWAY)
    scene.place_board(scene.pose(device.frame) @ pose)
    pixels = device.plate_pixels(scene)
    row, column = np.divmod(pixels, device.camera.width)
    rays = device.camera.ray_points(np.column_stack([column, row]), np.ones(len(pixels)))
    normal = pose[:3, 2]
    return device, scene, pixels, (pose[:3, 3] @ normal) / (rays @ normal)


def test_depths_on_the_board_are_exact_without_noise(view):
    device, scene, pixels, exact = view
    depth = device.capture(scene)
    assert depth.dtype == np.float32 and len(pixels) > 20000
    errors = np.abs(depth.ravel()[pixels] - exact)
    assert np.median(errors) <= 1e-4
    assert np.quantile(errors, 0.99) <= 1e-4


def test_noise_has_the_deviation_of_the_settings(view):
    device, scene, pixels, exact = view
    noise = device.noise
    assert (noise.sigma_m, noise.sigma_per_square_m, noise.sigma_from_m) == (0.0012, 0.0019, 0.4)
    errors = device.capture(scene, np.random.default_rng(3)).ravel()[pixels] - exact
    sigma = 0.0012 + 0.0019 * (exact - 0.4) ** 2
    good = np.isfinite(errors) & (np.abs(errors) < 0.05)  # without the bleeding edge
    assert np.std(errors[good] / sigma[good]) == pytest.approx(1.0, abs=0.02)
    assert np.mean(~np.isfinite(errors)) == pytest.approx(0.01, abs=0.003)


def test_the_edge_bleeds_one_pixel_and_no_further(view):
    device, scene, pixels, _ = view
    only_bleeding = DepthCamera(
        device.name, device.frame, device.camera, device.range_m, DepthNoise(0.0, 0.0, 0.4, 0.0, 1)
    )
    exact = device.exact(scene)
    bled = only_bleeding.capture(scene, np.random.default_rng(0))
    changed = np.flatnonzero(np.isfinite(bled) & (np.abs(bled - exact) > 1e-6))
    shape = exact.shape
    on_plate = np.zeros(exact.size, dtype=bool)
    on_plate[pixels] = True
    beside = np.zeros(shape, dtype=bool)
    plate = on_plate.reshape(shape)
    for axis in (0, 1):
        for step in (-1, 1):
            beside |= np.roll(plate, step, axis)
    beside &= ~plate
    assert 0.5 * beside.sum() < np.isin(np.flatnonzero(beside), changed).sum()
    near = exact.copy()
    for axis in (0, 1):
        for step in (-1, 1):
            near = np.minimum(near, np.roll(exact, step, axis))
    assert np.all(bled.flat[changed] >= near.flat[changed] - 1e-6)
    assert np.all(bled.flat[changed] <= exact.flat[changed] + 1e-6)


def test_a_distorted_depth_camera_measures_along_its_rays(view):
    device, scene, _, _ = view
    bent = Camera(640, 480, device.camera.K, np.array([-0.05, 0.01, 0, 0, 0]))
    other = DepthCamera(device.name, device.frame, bent, device.range_m, device.noise)
    pixels = other.plate_pixels(scene)
    row, column = np.divmod(pixels, bent.width)
    points = bent.ray_points(np.column_stack([column, row]), other.exact(scene).ravel()[pixels])
    in_pattern = se3.apply(
        se3.inverse(scene.world_T_pattern) @ scene.pose(device.frame), points.astype(float)
    )
    assert np.abs(in_pattern[:, 2]).max() < 1e-3 + 1e-6  # the plate's edge is 1 mm deep
    assert np.median(np.abs(in_pattern[:, 2])) < 1e-5


def test_rays_without_distortion_agree_with_drawing(view):
    device, scene, pixels, _ = view
    z = device._cast(scene).distance * device._along_z
    drawn = device.exact(scene).ravel()
    assert np.median(np.abs(z[pixels] - drawn[pixels])) < 1e-5
    same = np.isclose(z, drawn, atol=2e-3)
    assert same.mean() > 0.995  # but for pixels that an edge divides


def test_millimetres_have_zero_where_nothing_is_measured():
    depth = np.array([[np.nan, 1.2344], [0.4, 7.9996]], dtype=np.float32)
    assert millimetres(depth).tolist() == [[0, 1234], [400, 8000]]
    assert millimetres(depth).dtype == np.uint16
