"""Errors of the model: named where they are, not where they are not, and estimated on demand."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.refine.error_words import described
from atom_core.errors import AtomError
from atom_core.problem.model_errors import RangeOffset, RangeScale
from atom_core.report.calibration_results import calibration_results
from atom_core.solvers.choice import SOLVERS
from atom_core.synthetic import paper_cell, scenes
from atom_core.synthetic.realism import PLAIN, ROUGH

PLANTED = {
    "range offset": ({"lidar_offset_m": 0.015, "sensors": ("lidar_2",)}, "lidar_2", -0.015),
    "range scale": ({"lidar_scale": 0.005, "sensors": ("lidar_2",)}, "lidar_2", -0.005),
    "depth scale": ({"depth_scale": 0.005}, "depth_1", -0.005),
    "board size": ({"board_scale": 0.005}, "pattern_1", 0.005),
    "border shift x": ({"print_shift_m": (0.010, 0.0)}, "pattern_1", -0.010),
    "focal length": ({"focal_scale": 0.005, "sensors": ("rgb_1",)}, "rgb_1", 0.005),
    "bend x": ({"bend_m": 0.002}, "pattern_1", 0.002),
}

AUTO = ("range offset", "board size", "bend x", "focal length")


def rig(kind, seed=2):
    return paper_cell(seed, realism=replace(PLAIN, **PLANTED[kind][0]), disturbance=(0.05, 0.05))


@pytest.mark.sampled(4)
@pytest.mark.parametrize("kind", PLANTED)
def test_what_is_planted_is_named_alone_with_its_size(kind):
    _, target, value = PLANTED[kind]
    (check,) = calibrate(rig(kind).dataset).checks
    assert check.error.title == f"{kind} of {target}" and check.rivals == ()
    assert check.value == pytest.approx(value, rel=0.35)


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    ("kind", "solver"),
    [
        *((kind, "ceres") for kind in AUTO),
        *(pytest.param(kind, "scipy", marks=pytest.mark.long) for kind in AUTO),
    ],
)
def test_auto_estimates_it(kind, solver):
    _, target, value = PLANTED[kind]
    scene = rig(kind)
    options = CalibrationOptions(model_errors="auto", solver_name=solver)
    result = calibrate(scene.dataset, options)
    assert result.status == "converged", result.message
    values = {error.title: number for error, number in result.summary.model_errors.items()}
    assert values[f"{kind} of {target}"] == pytest.approx(value, rel=0.2)
    for edge in calibration_results(result, solver).edges:
        off = edge.parent_T_child[:3, 3] - scene.truth.edges[edge.edge][:3, 3]
        assert edge.anchored or np.all(np.abs(off) < 4.0 * edge.sigma_translation_m), edge.edge


@pytest.mark.sampled(1)
@pytest.mark.parametrize("solver", SOLVERS)
def test_a_bent_board_is_estimated_when_asked_for(solver):
    check_bend(rig("bend x"), solver)


@pytest.mark.long
def test_a_bend_is_known_to_a_fifth_in_nine_rigs_of_ten():
    assert sum(bend_is_right(rig("bend x", seed)) for seed in range(10)) >= 9


def bend_is_right(scene):
    try:
        check_bend(scene, "ceres")
    except AssertionError:
        return False
    return True


def check_bend(scene, solver):
    options = CalibrationOptions(board_bend=("pattern_1",), solver_name=solver)
    result = calibrate(scene.dataset, options)
    assert (result.status, result.checks) == ("converged", ())
    along_x, along_y = calibration_results(result, solver).model_errors
    assert (along_x.name, along_y.name) == ("bend_x", "bend_y") and along_x.estimated
    assert along_x.value == pytest.approx(0.002, rel=0.2)
    assert abs(along_x.value - 0.002) < 3.0 * along_x.sigma
    assert abs(along_y.value) < 4.0 * along_y.sigma


def test_the_option_that_is_named_for_a_bend_exists():
    (check,) = calibrate(rig("bend x").dataset).checks
    assert check.error.option == "--board_bend pattern_1"
    assert CalibrationOptions(board_bend=("pattern_1",)).board_bend


def test_what_cannot_be_told_apart_is_named_with_its_rival():
    """In this rig the LiDAR sees its boards at much the same distance."""
    result = calibrate(rig("range offset", seed=1).dataset)
    (check,) = result.checks
    assert {check.error, *check.rivals} == {RangeOffset("lidar_2"), RangeScale("lidar_2")}
    (shown,) = calibration_results(result, "ceres").model_errors
    assert shown.rivals == ("range scale of lidar_2",) and not shown.estimated


def test_a_strong_one_is_inconsistent_and_the_message_has_the_option():
    result = calibrate(rig("range offset").dataset)
    assert result.status == "inconsistent"
    assert result.message.endswith("mm long: --range_offset lidar_2 estimates it")
    off = calibrate(rig("range offset").dataset, CalibrationOptions(model_errors="off"))
    assert (off.status, off.checks) == ("converged", ())


@pytest.mark.sampled(4)
@pytest.mark.parametrize("kind", ["random_scene", "lidar_only", "two_patterns", "hand_eye"])
@pytest.mark.parametrize("seed", [0, 3, pytest.param(13, marks=pytest.mark.long)])
def test_healthy_rigs_show_nothing(kind, seed):
    result = calibrate(getattr(scenes, kind)(seed, collections=12).dataset)
    assert result.checks == ()


@pytest.mark.parametrize("seed", [0, *(pytest.param(s, marks=pytest.mark.long) for s in (1, 2))])
def test_in_rough_rigs_the_default_never_says_that_all_is_well(seed):
    result = calibrate(paper_cell(seed, realism=ROUGH, disturbance=(0.05, 0.05)).dataset)
    assert result.status == "inconsistent" and result.checks


@pytest.mark.long(minutes=1)
@pytest.mark.parametrize("seed", [1, 4])
def test_in_rough_rigs_auto_is_better_and_its_sigmas_true(seed):
    scene = paper_cell(seed, realism=ROUGH, disturbance=(0.05, 0.05))
    errors = {}
    for mode in ("suggest", "auto"):
        result = calibrate(scene.dataset, CalibrationOptions(model_errors=mode))
        edges = [e for e in calibration_results(result, "ceres").edges if not e.anchored]
        off = [e.parent_T_child[:3, 3] - scene.truth.edges[e.edge][:3, 3] for e in edges]
        errors[mode] = np.mean([np.linalg.norm(o) for o in off])
        sigmas = np.abs(off) / [e.sigma_translation_m for e in edges]
    assert errors["auto"] < 0.4 * errors["suggest"] and errors["auto"] < 0.003
    assert np.median(sigmas) < 1.5 * 0.6745 and np.mean(sigmas < 1.96) > 0.85


@pytest.mark.parametrize(
    "option, named",
    [
        ("range_scale", "depth_1"),
        ("depth_scale", "lidar_1"),
        ("board_size", "pattern_9"),
        ("board_bend", "pattern_9"),
    ],
)
def test_options_for_what_is_not_there_are_refused_by_name(option, named):
    scene = paper_cell(0)
    with pytest.raises(AtomError, match=f"--{option} {named}: there is no such"):
        calibrate(scene.dataset, CalibrationOptions(**{option: (named,)}))


def test_sentences_tell_the_direction():
    assert described(RangeOffset("lidar_1"), -0.0298, 0.0004) == "lidar_1 reads 29.8 +- 0.4 mm long"
    assert described(RangeOffset("lidar_1"), 0.0298, 0.0004) == "lidar_1 reads 29.8 +- 0.4 mm short"


def test_what_is_strong_together_is_inconsistent_though_nothing_is_alone():
    """5.4 sigmas off; each of the five errors named would move it by less than three."""
    result = calibrate(paper_cell(7, realism=ROUGH, disturbance=(0.05, 0.05)).dataset)
    assert len(result.checks) > 1 and result.status == "inconsistent"
