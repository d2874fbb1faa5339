"""Sensors that the joint solution does not fit: named, and no `converged`."""

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.judge.misfit import misfits
from atom_core.solvers.choice import SOLVERS
from atom_core.solvers.free_fit import distances, distances_alone
from atom_core.synthetic import paper_cell, scenes
from atom_core.synthetic.mistakes import (
    with_edge_off,
    with_scaled_focal_length,
    with_shifted_prints,
)


@pytest.mark.parametrize("seed", range(3))
def test_a_healthy_cell_fits(seed):
    result = calibrate(paper_cell(seed, disturbance=(0.1, 0.1)).dataset)
    assert (result.status, result.misfits) == ("converged", ())


def test_gross_errors_of_single_corners_and_points_are_no_misfit():
    from atom_core.synthetic import Noise

    result = calibrate(paper_cell(0, noise=Noise(gross_fraction=0.1)).dataset)
    assert result.misfits == ()


@pytest.mark.sampled(1)
@pytest.mark.parametrize("factor", [1.02, 1.10])
def test_a_wrong_focal_length_is_inconsistent_and_the_camera_named(factor):
    scene = paper_cell(1, disturbance=(0.1, 0.1))
    result = calibrate(with_scaled_focal_length(scene.dataset, "rgb_1", factor))
    assert result.status == "inconsistent"
    assert result.message.startswith("the focal length of rgb_1 is given ")
    worst = result.misfits[0]
    assert worst.why.startswith("corners of rgb_1 are ") and "intrinsics" in worst.why
    assert worst.joint > 1.5 * worst.alone and len(worst.collections) > 3


def test_an_error_that_explains_a_misfit_is_named_before_it():
    """A misfit makes all sigmas so wide that what explains it seems to matter little."""
    scene = scenes.random_scene(53, rgb=1, depth=1, lidar3d=0, collections=20)
    result = calibrate(with_shifted_prints(scene.dataset, (0.01, -0.015)))
    assert result.status == "inconsistent" and result.misfits
    assert result.message.startswith("the border of pattern_1 lies 17")
    assert "--board_border pattern_1" in result.message
    assert any(why.startswith("corners of rgb_1 are 4") for why in result.contradictions[1:])


def test_an_arm_that_is_not_where_it_says_is_inconsistent():
    scene = scenes.hand_eye(0, collections=15, disturbance=(0.05, 0.05))
    assert calibrate(scene.dataset).status == "converged"
    off = with_edge_off(scene.dataset, "flange", 0.005, 1.0, np.random.default_rng(0))
    result = calibrate(off)
    assert result.status == "inconsistent"
    assert result.message.startswith("the poses of 'flange' in 'rig_base' do not fit")
    assert "poses of links that move" in result.misfits[0].why
    # By itself each picture fits as well as corners are exact.
    assert 0.2 < result.misfits[0].alone < 0.5


def test_a_detection_alone_fits_better_than_with_all_others():
    result = calibrate(paper_cell(0, disturbance=(0.1, 0.1)).dataset)
    make = SOLVERS["ceres"]
    solver, x, sigmas = make(result.problem), result.summary.x, result.summary.sigmas
    joint = distances(solver, x, sigmas)
    alone = distances_alone(result.problem, x, sigmas, "cauchy", make)
    for block, together, own in zip(result.problem.residual_blocks, joint, alone):
        assert 0.7 < np.median(own) / np.median(together) < 1.02, (block.sensor, block.kind)


def test_both_solvers_find_the_same():
    scene = paper_cell(1, disturbance=(0.1, 0.1))
    result = calibrate(with_scaled_focal_length(scene.dataset, "rgb_1", 1.05))
    found = []
    for make in SOLVERS.values():
        solver = make(result.problem)
        found.append(misfits(solver, result.summary.x, result.summary.sigmas, "cauchy", make))
    (one,), (two,) = found
    assert one[:2] == two[:2] == ("rgb_1", "reprojection")
    np.testing.assert_allclose(one[2:4], two[2:4], rtol=0.02)
