"""Laws of rotations and transforms, at small angles, large ones, and half turns."""

import numpy as np
import pytest

from atom_core.geometry import se3

ANGLES = [0.0, 1e-9, 1e-5, 0.3, 2.0, np.pi - 1e-7, np.pi]


def random_transforms(count, seed=0):
    rng = np.random.default_rng(seed)
    vectors = rng.uniform(-2, 2, (count, 3))
    return se3.transform(se3.rotation_from_rotation_vector(vectors), rng.uniform(-5, 5, (count, 3)))


@pytest.mark.parametrize("angle", ANGLES)
def test_exponential_of_logarithm_is_identity(angle):
    axis = np.array([0.36, -0.48, 0.8])
    rotation = se3.rotation_from_rotation_vector(angle * axis)
    again = se3.rotation_from_rotation_vector(se3.rotation_vector_from_rotation(rotation))
    np.testing.assert_allclose(again, rotation, atol=1e-12)
    assert se3.rotation_angle(rotation) == pytest.approx(angle, abs=1e-7)


def test_rotation_matrices_are_orthonormal_and_proper():
    rotations = random_transforms(50)[:, :3, :3]
    np.testing.assert_allclose(
        rotations @ np.swapaxes(rotations, 1, 2), np.tile(np.eye(3), (50, 1, 1)), atol=1e-14
    )
    np.testing.assert_allclose(np.linalg.det(rotations), 1.0)


def test_inverse_composes_to_identity():
    a_T_b = random_transforms(20)
    np.testing.assert_allclose(
        a_T_b @ se3.inverse(a_T_b), np.tile(np.eye(4), (20, 1, 1)), atol=1e-13
    )


def test_composition_is_associative_with_points():
    a_T_b, b_T_c = random_transforms(2)
    points_in_c = np.random.default_rng(1).uniform(-1, 1, (10, 3))
    np.testing.assert_allclose(
        se3.apply(a_T_b @ b_T_c, points_in_c), se3.apply(a_T_b, se3.apply(b_T_c, points_in_c))
    )


def test_quaternion_round_trip_and_sign():
    rotations = random_transforms(100)[:, :3, :3]
    quaternions = se3.quaternion_from_rotation(rotations)
    assert np.all(quaternions[:, 3] >= 0)
    np.testing.assert_allclose(se3.rotation_from_quaternion(quaternions), rotations, atol=1e-14)
    np.testing.assert_allclose(se3.rotation_from_quaternion(-quaternions), rotations, atol=1e-14)


def test_quaternion_without_length_is_refused():
    with pytest.raises(ValueError, match="quaternion"):
        se3.rotation_from_quaternion([0, 0, 0, 0])


def test_rpy_is_about_fixed_axes_as_in_urdf():
    roll, pitch, yaw = 0.3, -0.7, 1.9
    c, s = np.cos, np.sin
    x = np.array([[1, 0, 0], [0, c(roll), -s(roll)], [0, s(roll), c(roll)]])
    y = np.array([[c(pitch), 0, s(pitch)], [0, 1, 0], [-s(pitch), 0, c(pitch)]])
    z = np.array([[c(yaw), -s(yaw), 0], [s(yaw), c(yaw), 0], [0, 0, 1]])
    np.testing.assert_allclose(se3.rotation_from_rpy([roll, pitch, yaw]), z @ y @ x, atol=1e-15)


@pytest.mark.parametrize("pitch", [0.0, 1.2, np.pi / 2, np.pi / 2 - 1e-9, -np.pi / 2])
def test_rpy_round_trip_also_at_gimbal_lock(pitch):
    rotation = se3.rotation_from_rpy([0.4, pitch, -2.0])
    again = se3.rotation_from_rpy(se3.rpy_from_rotation(rotation))
    np.testing.assert_allclose(again, rotation, atol=1e-14)


@pytest.mark.parametrize("angle", [1e-7, 1e-3, 0.5, 3.0])
def test_right_jacobian_against_central_differences(angle):
    vector = angle * np.array([0.6, 0.0, -0.8])
    rotation, jacobian = se3.rotation_from_rotation_vector(vector), se3.right_jacobian(vector)
    h = 1e-6
    for i in range(3):
        step = np.zeros(3)
        step[i] = h
        ahead = rotation.T @ se3.rotation_from_rotation_vector(vector + step)
        behind = rotation.T @ se3.rotation_from_rotation_vector(vector - step)
        numeric = (
            se3.rotation_vector_from_rotation(ahead) - se3.rotation_vector_from_rotation(behind)
        ) / (2 * h)
        np.testing.assert_allclose(numeric, jacobian[:, i], atol=1e-8)


def test_adjoint_carries_twists():
    a_T_b = random_transforms(1)[0]
    twist, h = np.array([0.3, -0.2, 0.5, 1.0, 2.0, -0.7]), 1e-6
    turn = se3.rotation_from_rotation_vector(h * twist[:3])
    moved = a_T_b @ se3.transform(turn, h * twist[3:]) @ se3.inverse(a_T_b)
    carried = se3.adjoint(a_T_b) @ twist
    np.testing.assert_allclose(moved[:3, 3] / h, carried[3:], atol=1e-5)
    np.testing.assert_allclose(
        se3.rotation_vector_from_rotation(moved[:3, :3]) / h, carried[:3], atol=1e-8
    )


def test_random_direction_is_isotropic():
    rng = np.random.default_rng(3)
    directions = np.array([se3.random_direction(rng) for _ in range(4000)])
    np.testing.assert_allclose(directions.mean(axis=0), 0.0, atol=0.05)
    np.testing.assert_allclose(directions.T @ directions / 4000, np.eye(3) / 3, atol=0.03)


def test_a_random_move_has_the_length_and_angle_asked_for():
    rng = np.random.default_rng(3)
    a_T_b = se3.transform(se3.random_rotation(1.0, rng), np.array([1.0, -2.0, 3.0]))
    moved = se3.moved(a_T_b, se3.random_move(0.2, 0.3, rng))
    assert np.linalg.norm(moved[:3, 3] - a_T_b[:3, 3]) == pytest.approx(0.2)
    assert se3.rotation_angle(a_T_b[:3, :3].T @ moved[:3, :3]) == pytest.approx(0.3)


def test_stacks_of_poses_differ_as_each_pair_does():
    poses, others = random_transforms(5), random_transforms(5, seed=1)
    shifts_m, angles_rad = se3.pose_differences(poses[0], others)
    each = np.array([se3.pose_difference(poses[0], other) for other in others])
    np.testing.assert_allclose(np.column_stack([shifts_m, angles_rad]), each, atol=1e-12)
    np.testing.assert_allclose(se3.pose_differences(poses, poses), 0.0, atol=1e-7)
