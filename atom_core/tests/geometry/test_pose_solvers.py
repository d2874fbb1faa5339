"""OpenCV's solvers of poses against poses that are known, whichever version of OpenCV it is."""

import cv2
import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.geometry.pose_solvers import (
    HAND_EYE_METHODS,
    ROBOT_WORLD_METHODS,
    hand_eye_pose,
    lacking,
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


HERE = [method for method in HAND_EYE_METHODS if not lacking(method)]


@pytest.mark.parametrize("method", HERE)
@pytest.mark.parametrize("seed", range(5))
def test_hand_eye_returns_the_pose_that_closes_the_loop(seed, method):
    G, H, X, _ = loop(seed)
    np.testing.assert_allclose(hand_eye_pose(G, H, method), X, atol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_where_opencv_has_no_solver_parks_answers_alike(seed, monkeypatch):
    G, H, X, _ = loop(seed)
    rng = np.random.default_rng(seed + 100)
    noisy = [h @ random_pose(rng, 0.002, 0.001) for h in H]
    by_opencv = hand_eye_pose(G, noisy) if list(HAND_EYE_METHODS) == HERE else None
    monkeypatch.delattr(cv2, "calibrateHandEye", raising=False)
    np.testing.assert_allclose(hand_eye_pose(G, H), X, atol=1e-9)
    found = hand_eye_pose(G, noisy)
    assert np.linalg.norm(found[:3, 3] - X[:3, 3]) < 0.02
    if by_opencv is not None:
        np.testing.assert_allclose(found, by_opencv, atol=2e-3)
    assert "OpenCV" in lacking("tsai") and lacking("park") == ""


def test_motion_about_one_axis_tells_no_pose(monkeypatch):
    monkeypatch.delattr(cv2, "calibrateHandEye", raising=False)
    _, _, X, fixed = loop(1)
    turns = [se3.rotation_from_rotation_vector(np.array([0.0, 0.0, 0.3 * i])) for i in range(5)]
    G = [se3.transform(turn, np.array([0.1 * i, 0.0, 0.0])) for i, turn in enumerate(turns)]
    assert hand_eye_pose(G, [se3.inverse(g @ X) @ fixed for g in G]) is None


@pytest.mark.skipif(bool(lacking("shah")), reason="no calibrateRobotWorldHandEye")
@pytest.mark.parametrize("method", ROBOT_WORLD_METHODS)
@pytest.mark.parametrize("seed", range(5))
def test_robot_world_returns_both_poses_that_close_the_loop(seed, method):
    G, H, X, fixed = loop(seed)
    eye, board = robot_world_poses(G, H, method)
    np.testing.assert_allclose(eye, X, atol=1e-6)
    np.testing.assert_allclose(board, fixed, atol=1e-6)


@pytest.mark.skipif(not hasattr(cv2, "calibrateRobotWorldHandEye"), reason="an older OpenCV")
@pytest.mark.parametrize("wrong", [0, 1])
def test_one_pose_that_is_none_is_no_answer(wrong, monkeypatch):
    G, H, _, _ = loop(0)
    found = [[np.eye(3), np.zeros(3)], [np.eye(3), np.zeros(3)]]
    found[wrong][0] = np.full((3, 3), np.nan)
    monkeypatch.setattr(cv2, "calibrateRobotWorldHandEye", lambda *_, **__: sum(found, []))
    assert robot_world_poses(G, H, "shah") is None
