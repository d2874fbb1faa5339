"""OpenCV's solvers of poses against poses that are known, whichever version of OpenCV it is."""

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.geometry.pose_solvers import (
    HAND_EYE_METHODS,
    ROBOT_WORLD_METHODS,
    hand_eye_pose,
    has_robot_world,
    planar_poses,
    robot_world_poses,
)


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


def loop(seed):
    """Return G, H, X and F of a loop that closes."""
    rng = np.random.default_rng(seed)
    X, fixed = random_pose(rng, 1.0, 0.5), random_pose(rng, 1.0, 1.0)
    G = [random_pose(rng, 0.4, 0.5) for _ in range(6)]  # Tsai fails at half turns
    return G, [se3.inverse(g @ X) @ fixed for g in G], X, fixed


@pytest.mark.parametrize("method", HAND_EYE_METHODS)
@pytest.mark.parametrize("seed", range(5))
def test_hand_eye_returns_the_pose_that_closes_the_loop(seed, method):
    G, H, X, _ = loop(seed)
    np.testing.assert_allclose(hand_eye_pose(G, H, method), X, atol=1e-6)


@pytest.mark.skipif(not has_robot_world(), reason="this OpenCV has no calibrateRobotWorldHandEye")
@pytest.mark.parametrize("method", ROBOT_WORLD_METHODS)
@pytest.mark.parametrize("seed", range(5))
def test_robot_world_returns_both_poses_that_close_the_loop(seed, method):
    G, H, X, fixed = loop(seed)
    eye, board = robot_world_poses(G, H, method)
    np.testing.assert_allclose(eye, X, atol=1e-6)
    np.testing.assert_allclose(board, fixed, atol=1e-6)
