"""How dense a LiDAR's beams are, so that it is said how near the board has to be."""

import numpy as np
import pytest

pytest.importorskip("rospy")

from atom_calibration.modalities.lidar3d import beam_spacing
from atom_core import native
from atom_core.model.pattern import pattern_from_config
from atom_core.synthetic.board import charuco

pytestmark = pytest.mark.skipif(not native.available(), reason="the compiled core is not built")


def cloud(ring=True):
    """Return what 16 layers, 2 deg apart, see of a wall all around, a point every 0.2 deg."""
    layers, azimuth = np.radians(np.arange(-15.0, 16.0, 2.0)), np.radians(np.arange(0, 360, 0.2))
    elevation, azimuth = (grid.ravel() for grid in np.meshgrid(layers, azimuth, indexing="ij"))
    fields = [(axis, "<f4") for axis in "xyz"] + ([("ring", "<u2")] if ring else [])
    points = np.zeros(elevation.size, fields)
    points["x"] = 5.0 * np.cos(azimuth) * np.cos(elevation)
    points["y"] = 5.0 * np.sin(azimuth) * np.cos(elevation)
    points["z"] = 5.0 * np.sin(elevation)
    if ring:
        points["ring"] = np.repeat(np.arange(16), 1800)
    return points


def without_rings():
    points = cloud()
    points["ring"] = 0
    return points


@pytest.mark.parametrize("make", [cloud, lambda: cloud(ring=False), without_rings])
def test_it_is_that_of_the_beams_whatever_the_ring_field_says(make):
    spacing = beam_spacing(make())
    assert np.degrees([spacing.elevation, spacing.azimuth]) == pytest.approx([2.0, 0.2], rel=0.01)
    board = pattern_from_config("board", charuco())
    assert spacing.shortage(board, 1.0) == ""
    assert "only about" in spacing.shortage(board, 30.0)


def test_a_cloud_without_layers_has_none_and_one_of_few_points_is_refused():
    rng, points = np.random.default_rng(0), cloud(ring=False)[:5000]
    for axis in "xyz":
        points[axis] = rng.uniform(-5.0, 5.0, len(points))
    assert beam_spacing(points) is None
    with pytest.raises(ValueError, match="too few points"):
        beam_spacing(points[:50])
