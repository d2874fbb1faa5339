"""Errors that are to be estimated and on which no label depends are told, and left alone."""

import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import OFF, CalibrationOptions
from atom_core.evaluation.trust.checks import trust_checks
from atom_core.solvers.choice import SOLVERS
from atom_core.synthetic.scenes import random_scene, two_cameras, two_patterns

SAID = "--board_border {}: no label depends on it, and it is not estimated"


@pytest.mark.parametrize("solver", sorted(SOLVERS))
def test_a_border_that_only_cameras_see_is_not_estimated_and_said(solver):
    """It was a traceback."""
    options = CalibrationOptions(board_border=("left", "right"), solver_name=solver)
    result = calibrate(two_patterns(1, collections=12).dataset, options)
    assert result.status == "converged"
    assert [w for w in result.warnings if "no label" in w] == [SAID.format("left")]
    assert {error.target for error in result.summary.model_errors} == {"right"}


def test_where_no_border_is_seen_none_is_estimated_and_all_else_is_as_without():
    dataset = two_cameras(1, collections=8).dataset
    plain = calibrate(dataset)
    result = calibrate(dataset, CalibrationOptions(board_border=("pattern_1",)))
    assert SAID.format("pattern_1") in result.warnings and not result.summary.model_errors
    assert result.summary.x == pytest.approx(plain.summary.x, abs=1e-12)


def test_what_parts_do_not_see_is_left_out_of_trust_checks():
    scene = random_scene(11, rgb=2, depth=1, lidar3d=0, collections=8)
    options = CalibrationOptions(model_errors=OFF, board_border=("pattern_1",))
    trust = trust_checks(calibrate(scene.dataset, options), options)
    assert len(trust.loops) == 1 and trust.untold == ()
