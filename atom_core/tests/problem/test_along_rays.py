"""Noise along the rays of a range sensor turns no board: heights are those along the rays."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.geometry import se3
from atom_core.geometry.rectangle import Rectangle
from atom_core.problem.board_errors import Bend
from atom_core.problem.model_errors import RangeOffset, rows_of
from atom_core.problem.residuals import OrthogonalBlock
from atom_core.solvers.base import SolverOptions
from atom_core.synthetic import scenes

BOARD = Rectangle(-0.4, -0.3, 0.4, 0.3)
NOISE_M = 0.02
COUNT = 160


def slanted(tilt_deg):
    """Return ``sensor_T_pattern`` (1, 4, 4) of a board 2 m ahead, turned about an axis across."""
    axis = np.array([0.3, 1.0, 0.2]) / np.linalg.norm([0.3, 1.0, 0.2])
    turned = se3.rotation_from_rotation_vector(np.radians(tilt_deg) * axis)
    return se3.transform(turned, np.array([0.3, -0.2, 2.0]))[None]


def heights(pose, noise_m, rng, along_rays=True):
    """Return the block of points on a board whose ranges are off by some noise."""
    in_plane = rng.uniform(-1.0, 1.0, (COUNT, 2)) * BOARD.half_size
    points = se3.apply(pose[0], np.column_stack([in_plane, np.zeros(COUNT)]))
    distance = np.linalg.norm(points, axis=1, keepdims=True)
    points = points * (1.0 + noise_m * rng.standard_normal(distance.shape) / distance)
    return OrthogonalBlock(
        sensor="lidar_1",
        modality="lidar3d",
        detection=np.zeros(COUNT, dtype=int),
        sigma=np.full(COUNT, NOISE_M),
        ids=np.arange(COUNT),
        points=points,
        range_offset_m=np.zeros(COUNT),
        range_scale=np.zeros(COUNT),
        unturned=None,
        along_rays=along_rays,
    )


def moved(pose, twist):
    turned = se3.rotation_from_rotation_vector(twist[:3])
    return se3.transform(turned, twist[3:])[None] @ pose


def fitted(block, pose):
    """Return the plane's normal (3,) that least squares end at, in the frame of a pose."""
    there = pose
    for _ in range(8):
        rows, by_twist = block.linearise(there)
        step = np.linalg.lstsq(by_twist[:, 0], -rows[:, 0], rcond=1e-9)[0]
        there = moved(there, step)
    return pose[0, :3, :3].T @ there[0, :3, 2]


@pytest.mark.parametrize("along_rays", [True, False])
@pytest.mark.parametrize("tilt_deg", [0.0, 50.0, 80.0, 86.0, 89.5, 95.0])
def test_jacobian_at_any_slant(tilt_deg, along_rays):
    """Also far from the board, where rays graze it, and where it turns through them."""
    rng = np.random.default_rng(0)
    block, pose = heights(slanted(40.0), 0.1, rng, along_rays), slanted(tilt_deg)
    for surface_m in (None, 0.01 * rng.standard_normal(block.count)):
        here = replace(block, surface_m=surface_m)
        analytic = here.linearise(pose)[1][:, 0]
        numeric = np.empty_like(analytic)
        for i, twist in enumerate(1e-6 * np.eye(6)):
            ahead, behind = (here.residuals(moved(pose, s * twist)) for s in (1.0, -1.0))
            numeric[:, i] = (ahead - behind)[:, 0] / 2e-6
        scale = np.max(np.abs(analytic), axis=1, keepdims=True)
        np.testing.assert_allclose(analytic / scale, numeric / scale, atol=1e-5)


def test_noise_of_ranges_turns_a_slanted_board_only_by_atoms_heights():
    """The mean of fitted normals is the true one, within four of its standard deviations."""
    pose, rng = slanted(50.0), np.random.default_rng(3)
    blocks = [heights(pose, NOISE_M, rng) for _ in range(150)]
    off = {}
    for along_rays in (True, False):
        normals = [fitted(replace(b, along_rays=along_rays), pose)[:2] for b in blocks]
        deviation = np.std(normals, axis=0, ddof=1) / np.sqrt(len(normals))
        off[along_rays] = np.max(np.abs(np.mean(normals, axis=0)) / deviation)
    assert off[True] < 4.0
    assert off[False] > 6.0


def test_heights_are_those_of_atom_where_the_board_stands_as_its_points_do():
    pose = slanted(50.0)
    block = heights(pose, 0.003, np.random.default_rng(0))
    plain = replace(block, along_rays=False)
    np.testing.assert_allclose(block.residuals(pose), plain.residuals(pose), rtol=0.02)


def test_a_line_or_a_single_point_has_no_cosine_of_its_own():
    pose = slanted(50.0)
    block = heights(pose, 0.0, np.random.default_rng(0))
    on_line = se3.apply(pose[0], np.linspace(-0.3, 0.3, COUNT)[:, None] * [1.0, 0.5, 0.0])
    for points in (on_line, np.tile(block.points[:1], (COUNT, 1))):
        alone = replace(block, points=points)
        np.testing.assert_allclose(alone.facing, [alone.rays.mean(axis=0)])


def test_heights_change_by_model_errors_as_their_derivatives_say():
    pose, h = slanted(50.0), 1e-6
    bend = Bend.of_board("pattern_1", BOARD)[0]
    block = heights(pose, 0.005, np.random.default_rng(2))
    zero = np.zeros(block.count)
    rows = rows_of(block, pose, np.array(["pattern_1"]), *block.linearise(pose))
    longer = block.with_range_errors(zero + h, zero)
    bent = replace(block, surface_m=h * bend.height(rows.in_plane))
    for error, other in ((RangeOffset("lidar_1"), longer), (bend, bent)):
        change = (other.residuals(pose) - rows.residual) / h
        np.testing.assert_allclose(error.derivatives(rows), change, atol=1e-6)


def test_atoms_weights_come_with_its_heights():
    scene = scenes.random_scene(1, collections=4)
    for weights in ("sigma", "atom"):
        options = CalibrationOptions(SolverOptions(weights=weights, loss="none"))
        blocks = calibrate(scene.dataset, options).problem.residual_blocks
        along = [block.along_rays for block in blocks if isinstance(block, OrthogonalBlock)]
        assert along and all(one == (weights == "sigma") for one in along)
