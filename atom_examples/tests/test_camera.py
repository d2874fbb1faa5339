import gc

import cell_boards as boards
import cv2
import numpy as np
import pytest

from atom_core.geometry.camera import Camera
from atom_examples.cell_simulator.camera import ColourCamera, pinhole_view
from atom_examples.cell_simulator.errors import SimulatorError
from atom_examples.cell_simulator.world import World

LIMIT_RMS_PX, LIMIT_BIAS_PX = 0.15, 0.05


def refined(grey, corner, square_px):
    """The saddle point near a corner; OpenCV's sub-pixel search alone has no bias."""
    half = max(2, int(0.12 * square_px))  # the markers' edges begin at 12.5 % of a square
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 50, 1e-4)
    start = corner.astype(np.float32).reshape(1, 1, 2)
    return cv2.cornerSubPix(grey, start, (half, half), (-1, -1), stop)[0, 0]


@pytest.mark.parametrize("name", ["rgb_1", "rgb_2", "rgb_3"])
def test_corners_are_drawn_where_the_distorted_camera_sees_them(world, name):
    device, scene, pattern = world.colours[name], world.scene, world.scene.board.pattern
    camera, rng = device.camera, np.random.default_rng(7)
    assert np.any(camera.D)
    world_T_optical = scene.pose(world.rig.sensors[name].frame)
    scene.place_person(boards.AWAY)
    errors = []
    for _ in range(8):
        pose, corners, squares = boards.random_view(camera, pattern, rng)
        scene.place_board(world_T_optical @ pose)
        grey = cv2.cvtColor(device.capture(scene), cv2.COLOR_RGB2GRAY)
        exact = camera.project(corners)
        for corner, square in zip(exact[camera.in_image(corners, 12.0)], squares):
            errors.append(refined(grey, corner + rng.uniform(-0.7, 0.7, 2), square) - corner)
    errors = np.array(errors)
    near = np.linalg.norm(errors, axis=1) < 2.0  # what a detector keeps
    assert near.mean() > 0.98
    assert np.all(np.sqrt(np.mean(errors[near] ** 2, axis=0)) <= LIMIT_RMS_PX)
    assert np.all(np.abs(errors[near].mean(axis=0)) <= LIMIT_BIAS_PX)


def test_the_markers_can_be_read(world):
    aruco = pytest.importorskip("atom_core.aruco")
    device, scene = world.colours["rgb_1"], world.scene
    pose = boards.before(1.8, 0.3, 0.2, (0.0, 0.0), scene.board.pattern)
    scene.place_person(boards.AWAY)
    scene.place_board(scene.pose("rgb_1_optical_frame") @ pose)
    picture = device.capture(scene, np.random.default_rng(0))
    ids, _ = aruco.detect_markers(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), "DICT_5X5_100")
    assert sorted(ids) == list(range(54))


def test_the_back_of_the_board_is_blank(world):
    device, scene = world.colours["rgb_1"], world.scene
    pose = boards.before(1.5, np.pi - 0.01, 0.0, (0.0, 0.0), scene.board.pattern)
    scene.place_board(scene.pose("rgb_1_optical_frame") @ pose)
    middle = device.camera.centre_px.astype(int)
    around = device.capture(scene)[middle[1] - 190 : middle[1] - 120, middle[0] - 200 : middle[0]]
    assert around.astype(int).std() < 3


def test_noise_has_its_deviation_and_its_seed(world):
    device, scene = world.colours["rgb_3"], world.scene
    clean = device.capture(scene).astype(int)
    noisy = device.capture(scene, np.random.default_rng(1))
    inside = (clean > 20) & (clean < 235)
    assert np.std((noisy.astype(int) - clean)[inside]) == pytest.approx(2.0, abs=0.1)
    assert np.array_equal(noisy, device.capture(scene, np.random.default_rng(1)))
    assert not np.array_equal(noisy, device.capture(scene, np.random.default_rng(2)))


def test_an_undistorted_camera_is_its_own_pinhole():
    camera = Camera(64, 48, np.array([[50, 0, 30], [0, 51, 25], [0, 0, 1.0]]), model="none")
    view = pinhole_view("c", "f", camera).camera
    assert view.width >= 66 and view.height >= 50
    np.testing.assert_allclose(view.focal_px, camera.focal_px)
    assert ColourCamera("c", camera, 0.0).camera is camera


def test_a_fisheye_that_no_pinhole_holds_is_refused():
    fisheye = Camera(
        640, 480, np.array([[160, 0, 320], [0, 160, 240], [0, 0, 1.0]]), np.zeros(4), "equidistant"
    )
    with pytest.raises(SimulatorError, match="wide_1.*too wide"):
        pinhole_view("wide_1", "f", fisheye)


def test_a_second_cell_does_not_draw_into_the_first_ones_pictures(world):
    before = world.scene.colours("rgb_1")
    other = World(1)
    assert not np.array_equal(other.scene.colours("rgb_1"), before)
    assert np.array_equal(world.scene.colours("rgb_1"), before)
    del other  # not closed
    gc.collect()
    assert np.array_equal(world.scene.colours("rgb_1"), before)
