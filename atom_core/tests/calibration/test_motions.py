"""What the motions of a recording leave open is told before anything is solved."""

from dataclasses import replace

import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.preflight import preflight
from atom_core.model.config import PriorConfig
from atom_core.report.check_verdict import check_verdict
from atom_core.report.verdict import GOOD, WEAK
from atom_core.synthetic import degenerate, scenes
from atom_core.synthetic.arm import board_on_arm, camera_on_arm

OPEN = {
    "translating": (lambda: degenerate.translating_arm(1), "what moves never turns"),
    "planar": (lambda: degenerate.planar_motion(2), "'robot_base' turns about one axis only"),
}
TOLD = {
    "camera on an arm": lambda: scenes.hand_eye(0, collections=8),
    "board on an arm": lambda: scenes.board_on_arm(0, collections=8),
    "joints of an arm": lambda: camera_on_arm(3, errors={}, collections=8),
    "board on joints": lambda: board_on_arm(3, errors={}, collections=8),
    "a rig that stands": lambda: scenes.random_scene(1, collections=5),
}


@pytest.mark.parametrize("name", OPEN)
def test_what_stays_open_is_told_before_it_is_solved(name):
    made, says = OPEN[name]
    dataset = made().dataset
    result = preflight(dataset)
    assert says in result.open_motion and result.open_motion in result.warnings
    verdict = check_verdict(dataset, result)
    assert verdict.grade == WEAK and says in verdict.sentence
    assert calibrate(dataset, CalibrationOptions()).status == "rank_deficient"


@pytest.mark.parametrize("name", TOLD)
def test_motions_that_tell_all_are_no_reason_to_warn(name):
    dataset = TOLD[name]().dataset
    result = preflight(dataset)
    assert result.open_motion == ""
    assert check_verdict(dataset, result).grade == GOOD


def test_a_sensor_that_is_held_or_known_leaves_nothing_open():
    dataset = degenerate.planar_motion(2).dataset
    held = replace(dataset.config, anchored_sensor="rgb_1")
    known = replace(dataset.config, priors={"rgb_1": PriorConfig(0.01, 0.05)})
    for config in (held, known):
        assert preflight(replace(dataset, config=config)).open_motion == ""


def test_a_prior_that_calibrate_will_refuse_is_told_before():
    dataset = scenes.hand_eye(0, collections=6).dataset
    config = replace(dataset.config, priors={"pattern_1": PriorConfig(0.01, 0.02)})
    (problem,) = preflight(replace(dataset, config=config)).problems
    assert problem.startswith("priors of the configuration: pattern_1: the dataset does not say")
