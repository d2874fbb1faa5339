"""A board that moves while a LiDAR turns: its label is where it was when the beams passed it."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from lidar_scenes import BORDER, many_scenes, scan  # noqa: E402

from atom_core import native
from atom_core.geometry import se3  # noqa: E402
from atom_core.geometry.plane import fit_plane  # noqa: E402
from atom_core.labeling.lidar3d import Cloud, board_at  # noqa: E402

pytestmark = pytest.mark.skipif(not native.available(), reason="the compiled core is not built")
TURN_S, HALF_DEG, SLICES = 0.1, 40.0, 8  # the board is seen within so many degrees


def cloud_of_a_turn(scene, velocity, seed):
    """Return a cloud whose beams measure one after the other, and the board's middle in it.

    The beams pass the middle of the board when it is at the scene's place.
    """
    middle = se3.apply(scene.world_T_board, np.append(BORDER.centre, 0.0)[None])
    in_lidar = se3.apply(se3.inverse(scene.world_T_lidar), middle)[0]
    points, rings = [], []
    edges = np.linspace(-HALF_DEG, HALF_DEG, SLICES + 1)
    for low, high in zip(edges, edges[1:]):
        moved = scene.world_T_board.copy()
        moved[:3, 3] += velocity * TURN_S * (low + high) / 2.0 / 360.0
        part = scan(scene._replace(world_T_board=moved), seed)
        azimuth = np.arctan2(part.points[:, 1], part.points[:, 0])
        beside = azimuth - np.arctan2(in_lidar[1], in_lidar[0])
        beside_deg = np.degrees((beside + np.pi) % (2.0 * np.pi) - np.pi)
        inside = (beside_deg >= low) & (beside_deg < high)
        points.append(part.points[inside])
        rings.append(part.ring[inside])
    return Cloud(np.concatenate(points).astype(np.float32), np.concatenate(rings)), in_lidar


@pytest.mark.parametrize("speed_m_s", [0.0, 1.0])
def test_the_plane_is_where_the_board_was_at_that_moment(speed_m_s):
    rng = np.random.default_rng(5)
    for number, scene in enumerate(many_scenes(2, 3)):
        direction = rng.standard_normal(3)
        velocity = speed_m_s * direction / np.linalg.norm(direction)
        cloud, middle = cloud_of_a_turn(scene, velocity, number)
        found = board_at(cloud, BORDER, middle).labeled
        assert found.detected, found.reason
        centre, normal, _ = fit_plane(cloud.points[found.label.indices].astype(float))
        truth = se3.inverse(scene.world_T_lidar) @ scene.world_T_board
        off_deg = np.degrees(np.arccos(min(abs(float(normal @ truth[:3, 2])), 1.0)))
        off_m = abs(float((centre - truth[:3, 3]) @ truth[:3, 2]))
        assert off_deg < 0.6 and off_m < 0.002
