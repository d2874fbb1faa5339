"""Where a depth camera looks for a board that is expected: on what of it is in the image."""

import numpy as np

from atom_calibration.modalities.seeds import PixelSeeds
from atom_core.model.sensor import DEPTH
from atom_core.synthetic.cell import cell_rig

SENSOR = next(s for s in cell_rig(0).sensors.values() if s.modality == DEPTH)
NORMAL, REACH_M = np.array([0.0, 0.0, -1.0]), 0.5


def seed_at(column, row, z_m=2.0):
    """Return the seed of a board whose middle is seen at a pixel, in the image or beside it."""
    middle = SENSOR.camera.ray_points(np.array([[column, row]], float), np.array([z_m]))[0]
    return PixelSeeds().of_board(SENSOR, middle, NORMAL, REACH_M)


def test_a_board_in_the_image_is_looked_for_in_its_middle():
    np.testing.assert_allclose(seed_at(300.0, 200.0), [300.0, 200.0], atol=1e-6)


def test_of_a_board_that_the_edge_cuts_the_part_in_the_image_is_taken():
    camera = SENSOR.camera
    beside_px = 0.5 * REACH_M * camera.focal_px[0] / 2.0
    found = seed_at(camera.width + 0.9 * beside_px, 200.0)
    assert found is not None and camera.width - beside_px < found[0] < camera.width
    assert abs(found[1] - 200.0) < 0.5 * beside_px


def test_of_a_board_beside_the_image_there_is_none():
    assert seed_at(SENSOR.camera.width + 2.0 * REACH_M * SENSOR.camera.focal_px[0], 200.0) is None
