"""A thick board: cameras see its print, range sensors on the other side its back."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.refine.candidates import candidates
from atom_core.evaluation.ground_truth import ground_truth_errors
from atom_core.problem.board_errors import BoardThickness
from atom_core.problem.corrections import corrected
from atom_core.problem.model_errors import rows_of
from atom_core.synthetic import scenes
from atom_core.synthetic.realism import PLAIN

THICK_M = 0.018  # plywood
AROUND = 1.4  # where prints and backs are seen


def rig(thickness_m, **options):
    realism = replace(PLAIN, thickness_m=thickness_m)
    chosen = {"seed": 2, "collections": 18, "disturbance": (0.05, 0.05), **options}
    return scenes.from_behind(realism=realism, **chosen)


@pytest.mark.parametrize(
    "sensors", [{}, {"bearing_rad": AROUND}, {"modality": "depth", "bearing_rad": 2.9}]
)
def test_it_is_named_with_how_thick_it_is(sensors):
    result = calibrate(rig(THICK_M, **sensors).dataset)
    assert result.status == "inconsistent"
    (found,) = result.checks
    assert found.error == BoardThickness("pattern_1")
    assert found.value == pytest.approx(THICK_M, abs=0.003)
    assert "the back of board pattern_1 lies" in result.message
    assert "--board_thickness pattern_1" in result.message


@pytest.mark.parametrize("options", [{"board_thickness": ("pattern_1",)}, {"model_errors": "auto"}])
def test_where_it_is_estimated_the_sensor_is_where_it_stands(options):
    synthetic = rig(THICK_M)
    result = calibrate(synthetic.dataset, CalibrationOptions(**options))
    assert result.status == "converged"
    thickness_m = result.summary.model_errors[BoardThickness("pattern_1")]
    assert thickness_m == pytest.approx(THICK_M, abs=0.003)
    errors = ground_truth_errors(result.dataset, synthetic.truth)
    assert errors.sensors["lidar3d_1"].translation_m < 0.008


def test_a_thin_board_is_none():
    result = calibrate(rig(0.0).dataset)
    assert result.status == "converged" and not result.checks


def test_a_sensor_that_reads_long_is_no_thick_board():
    synthetic = scenes.from_behind(
        2, collections=18, bearing_rad=AROUND, realism=replace(PLAIN, lidar_offset_m=0.02)
    )
    result = calibrate(synthetic.dataset)
    assert [check.error.kind for check in result.checks] == ["range_offset"]


def test_boards_of_which_all_sensors_see_the_print_have_no_thickness():
    result = calibrate(scenes.random_scene(1, collections=5).dataset)
    found = candidates(result.dataset, result.problem, result.summary.x)
    assert not [error for error in found if isinstance(error, BoardThickness)]


def test_only_what_is_seen_from_behind_changes_with_it():
    result = calibrate(rig(0.0, bearing_rad=AROUND, collections=8).dataset)
    problem, x, h = result.problem, result.summary.x, 1e-6
    error, poses = BoardThickness("pattern_1"), problem.poses(result.summary.x)
    now = problem.linearise(x)
    ahead, behind = (corrected(problem, {error: s * h}, x).residuals(x) for s in (1, -1))
    changed = {False: 0, True: 0}
    for i, block in enumerate(problem.residual_blocks):
        rows = rows_of(block, poses, problem.patterns, now.residuals[i], now.by_state[i])
        found = error.derivatives(rows)
        expected = (ahead[i] - behind[i]) / (2.0 * h)
        if found is None:
            np.testing.assert_array_equal(expected, 0.0)
            continue
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)
        for back in changed:
            changed[back] += np.count_nonzero(expected[rows.from_behind == back])
    assert changed[False] == 0 and changed[True] > 20
