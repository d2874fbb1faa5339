"""A board that shines: its lamps are where a mirror has them; a matt one is drawn as before."""

import cell_boards as boards
import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.geometry.rectangle import Rectangle
from atom_core.labeling.rgb import RgbLabeler
from atom_core.synthetic.board import charuco
from atom_examples.cell_simulator import main as program
from atom_examples.cell_simulator.gloss import Gloss, gloss_in, shining
from atom_examples.cell_simulator.recorder import Recording

K = np.array([[400.0, 0.0, 159.5], [0.0, 400.0, 119.5], [0.0, 0.0, 1.0]])
CAMERA = Camera(320, 240, K, model="none")
BORDER = Rectangle(-0.4, -0.3, 0.4, 0.3)
BOARD = se3.from_rpy(np.array([0.0, 0.0, 1.5]), np.array([0.2, -0.1, 0.0]))


def everything(directions):
    return np.ones(len(directions), bool)


def light_of(lamp, world_T_pattern=BOARD, is_seen=everything, brightness=0.5):
    dark = np.zeros((480, 640, 3), np.uint8)  # twice as fine, bottom row first
    gloss = Gloss(brightness, np.array([lamp]))
    where = (CAMERA, np.eye(4)), (BORDER, world_T_pattern)
    return shining(dark, gloss, *where, is_seen)[::-1, :, 0]


def test_a_lamp_is_brightest_where_a_mirror_shows_it():
    point = se3.apply(BOARD, np.array([[0.1, -0.05, 0.0]]))[0]
    ray, normal = point / np.linalg.norm(point), BOARD[:3, 2]
    mirrored = ray - 2.0 * (ray @ normal) * normal
    light = light_of(point + 3.0 * mirrored)
    row, column = np.unravel_index(np.argmax(light), light.shape)
    brightest = (np.array([column, row]) + 0.5) / 2.0 - 0.5
    np.testing.assert_allclose(brightest, CAMERA.project(point[None])[0], atol=1.0)
    assert light.max() == pytest.approx(0.5 * 255.0, abs=0.5)


def test_only_the_front_shines_and_only_where_nothing_hides_it():
    lamp = np.array([0.3, 0.2, -2.0])
    front = light_of(lamp)
    assert front.max() > 20.0
    turned = BOARD @ se3.from_rpy(np.zeros(3), np.array([np.pi, 0.0, 0.0]))
    assert light_of(lamp, turned).max() == 0.0
    half = light_of(lamp, is_seen=lambda directions: directions[:, 0] > 0.0)
    assert np.array_equal(half[:, 330:], front[:, 330:]) and half[:, :310].max() == 0.0
    behind = se3.from_rpy(np.array([0.0, 0.0, -1.5]), np.zeros(3))
    assert light_of(lamp, behind).max() == 0.0


def test_pictures_of_the_cell_shine_and_the_matt_board_is_as_before(world):
    device, scene, pattern = world.colours["rgb_1"], world.scene, world.scene.board.pattern
    pose = boards.before(1.3, 0.2, 0.1, (0.0, 0.0), pattern)
    scene.place_person(boards.AWAY)
    world_T_camera = scene.pose("rgb_1_optical_frame")
    scene.place_board(world_T_camera @ pose)
    matt = device.capture(scene)
    towards = world_T_camera[:3, 3]  # a lamp at the camera: straight reflections are in the board
    scene.gloss = Gloss(0.3, towards[None])
    try:
        picture = device.capture(scene)
        scene.gloss = Gloss(0.0, towards[None])
        np.testing.assert_allclose(device.capture(scene).astype(int), matt, atol=1)  # rounding
    finally:
        scene.gloss = None
    brighter = picture.astype(int) - matt
    assert brighter.min() >= -1 and brighter.max() > 40 and picture.dtype == np.uint8
    found = RgbLabeler(world.rig.sensors["rgb_1"], pattern, charuco()).label(picture)
    corners = device.camera.project(se3.apply(pose, pattern.corners_of(found.label.ids)))
    assert found.detected and np.abs(found.label.pixels - corners).max() < 0.5
    assert np.array_equal(device.capture(scene), matt)


def test_lamps_hang_on_the_walls_and_what_cannot_shine_is_refused(world, tmp_path, capsys):
    lamps, room = gloss_in(world.rig.room, 1.0).lamps, world.rig.room
    on_wall = [np.isclose(lamps[:, k], end[k]) for k in (0, 1) for end in (room.low, room.high)]
    assert np.all(np.any(on_wall, axis=0)) and len(lamps) == 8
    assert "gloss" not in Recording().document()
    for share in ("-0.1", "nan", "11"):
        assert program.main(["--bag", str(tmp_path / "a.bag"), "--gloss", share]) == 2
        assert "give 0 (matt) to 10" in capsys.readouterr().err
