"""OpenCV's solvers of poses against poses that are known, whichever version of OpenCV it is."""

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.geometry.pose_solvers import hand_eye_pose, planar_poses


def random_pose(rng, angle, distance):
    return se3.transform(
        se3.rotation_from_rotation_vector(rng.normal(scale=angle, size=3)),
        rng.normal(scale=distance, size=3),
    )


@pytest.mark.parametrize("seed", range(10))
def test_the_better_planar_pose_is_the_true_one(seed):
    rng = np.random.default_rng(seed)
    column, row = np.meshgrid(np.arange(6), np.arange(5))
    points = 0.1 * np.column_stack([column.ravel(), row.ravel(), np.zeros(30)])
    camera_T_points = random_pose(rng, 0.4, 0.3)
    camera_T_points[2, 3] += 3.0
    in_camera = se3.apply(camera_T_points, points)
    poses = planar_poses(points, in_camera[:, :2] / in_camera[:, 2:])
    assert 1 <= len(poses) <= 2
    np.testing.assert_allclose(poses[0], camera_T_points, atol=1e-6)


@pytest.mark.parametrize("seed", range(10))
def test_hand_eye_returns_the_pose_that_closes_the_loop(seed):
    rng = np.random.default_rng(seed)
    X, fixed = random_pose(rng, 1.0, 0.5), random_pose(rng, 1.0, 1.0)
    G = [random_pose(rng, 0.7, 0.5) for _ in range(5)]
    H = [se3.inverse(g @ X) @ fixed for g in G]
    np.testing.assert_allclose(hand_eye_pose(G, H), X, atol=1e-6)
