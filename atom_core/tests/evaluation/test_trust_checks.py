"""A calibration that is asked without a truth: sound rigs agree, planted errors are named."""

import json
from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import OFF, CalibrationOptions
from atom_core.evaluation.trust.checks import limit_of, trust_checks
from atom_core.evaluation.trust.relative import (
    difference,
    jacobian,
    largest_in_sigmas,
    relative_pose,
    stepped,
)
from atom_core.geometry import se3
from atom_core.model.config_entries import PriorConfig
from atom_core.model.dataset import pose
from atom_core.report.calibration_document import calibration_document
from atom_core.report.calibration_results import calibration_results
from atom_core.report.calibration_tables import calibration_report
from atom_core.report.calibration_verdict import calibration_verdict
from atom_core.report.trust_report import contradictions
from atom_core.synthetic import PLAIN, paper_cell, scenes

SENSORS = {"rgb": 2, "depth": 1, "lidar3d": 0, "collections": 12}
QUIET = CalibrationOptions(model_errors=OFF)


@pytest.fixture(scope="module")
def sound():
    calibration = calibrate(scenes.random_scene(11, **SENSORS).dataset, QUIET)
    return calibration, trust_checks(calibration)


def test_a_sound_rig_agrees_with_itself(sound):
    calibration, trust = sound
    assert not contradictions(trust) and not trust.untold
    assert [one.names for one in trust.halves] == [("rgb_2",), ("depth_1",)]
    assert [one.compared.names[0] for one in trust.left_out] == ["rgb_1", "rgb_2", "depth_1"]
    assert [one.names for one in trust.loops] == [("rgb_1", "rgb_2", "depth_1")]
    results = calibration_results(calibration, "any", None, trust)
    assert calibration_verdict(results).grade != "wrong"
    assert "1 loops of three sensors: agree" in calibration_report(results).replace("\n", " ")
    document = json.loads(json.dumps(calibration_document(results, {})))["trust_checks"]
    assert document["agree"] and set(document["split_half"]["sensors"]) == {"rgb_2", "depth_1"}


def test_what_a_depth_camera_adds_shows_without_any_model_check():
    """By its share of the range: then no sensor is where the others' boards want it."""
    wrong = replace(PLAIN, depth_scale=0.03)
    calibration = calibrate(scenes.random_scene(11, realism=wrong, **SENSORS).dataset, QUIET)
    trust = trust_checks(calibration)
    assert contradictions(trust)
    verdict = calibration_verdict(calibration_results(calibration, "any", None, trust))
    assert verdict.grade != "good"


def test_too_few_collections_are_told():
    calibration = calibrate(scenes.two_cameras(1, collections=5).dataset, QUIET)
    trust = trust_checks(calibration)
    assert trust.halves == () and any("it takes 8" in why for why in trust.untold)


def test_range_sensors_do_not_tell_a_camera_which_way_round_a_board_is():
    scene = scenes.random_scene(4, rgb=1, depth=1, lidar3d=1, collections=8)
    trust = trust_checks(calibrate(scene.dataset, QUIET))
    assert not contradictions(trust)
    assert any("without rgb_1: no other sensor tells which way" in why for why in trust.untold)


def test_what_did_not_converge_is_not_asked(sound):
    trust = trust_checks(replace(sound[0], status="failed"))
    assert trust.untold == ("nothing was asked: the calibration is failed",)


def test_a_relative_pose_has_the_covariance_of_the_edge_in_between(sound):
    calibration, _ = sound
    found = relative_pose(calibration, "rgb_1", "rgb_2")
    dataset = calibration.dataset
    first = next(iter(dataset.collections.values()))
    frames = (dataset.sensors[name].frame for name in ("rgb_1", "rgb_2"))
    np.testing.assert_allclose(found.target_T_source, pose(first, dataset.graph, *frames))
    sigma = np.sqrt(np.diagonal(found.covariance))
    assert np.all(sigma > 0.0) and np.all(sigma[3:] < 0.02)


def test_steps_and_differences_are_inverse():
    rng = np.random.default_rng(0)
    start, numbers = se3.random_move(1.0, 2.0, rng), 0.1 * rng.standard_normal(6)
    np.testing.assert_allclose(difference(start, stepped(start, numbers)), numbers, atol=1e-12)
    slope = jacobian(lambda step: stepped(start, step), start)
    np.testing.assert_allclose(slope, np.eye(6), atol=1e-5)
    assert limit_of(1) < limit_of(30)


PLANTED = {
    "board 1 % large": (replace(PLAIN, board_scale=0.01), "board pattern_1 is"),
    "one focal length 1 % long": (
        replace(PLAIN, focal_scale=0.01, sensors=("rgb_2",)),
        "the focal length of rgb_2 is given",
    ),
    "LiDAR 30 mm long": (
        replace(PLAIN, lidar_offset_m=0.03, sensors=("lidar_2",)),
        "lidar_2 reads 3",
    ),
    "depth 2 % far": (replace(PLAIN, depth_scale=0.02), "depth_1 reads"),
    "print 15 mm beside": (replace(PLAIN, print_shift_m=(0.015, 0.0)), "the border of pattern_1"),
}


@pytest.mark.parametrize("name", PLANTED)
def test_planted_errors_are_named(name):
    """By model checks alone; with the questions above as well, the verdict is no better."""
    realism, words = PLANTED[name]
    verdict = calibration_verdict(
        calibration_results(calibrate(paper_cell(0, realism=realism).dataset), "any")
    )
    assert verdict.grade != "good" and words in verdict.sentence


@pytest.mark.parametrize("pair", [([1.0, 3.0], 1.5), ([-9.0, 3.0], 9.0)])
def test_the_largest_is_told_in_its_own_sigma(pair):
    numbers, largest = pair
    assert largest_in_sigmas(np.array(numbers), np.diag([1.0, 4.0])) == pytest.approx(largest)


def test_parts_begin_where_the_whole_ended():
    """However far from the description the user let the whole begin."""
    dataset = scenes.two_cameras(1, collections=12).dataset
    plain, far = (
        trust_checks(calibrate(dataset, asked), asked)
        for asked in (QUIET, replace(QUIET, noisy_initial_guess=(0.05, 0.05)))
    )
    assert far.halves[0].sigmas == pytest.approx(plain.halves[0].sigmas, rel=1e-3)
    assert not any("loops" in why for why in plain.untold)  # two sensors have none


@pytest.mark.parametrize("where", ["asked for", "configured"])
def test_parts_are_asked_where_what_they_hold_has_a_prior(where):
    """Each was refused: "--prior rgb_2: edge ... is not estimated (it is held)"."""
    dataset = scenes.random_scene(11, **SENSORS).dataset
    known, options = {"rgb_2": (0.01, 0.01), "depth_1": (0.02, 0.02)}, QUIET
    if where == "asked for":
        options = replace(QUIET, priors=known)
    else:
        priors = {name: PriorConfig(*sigmas) for name, sigmas in known.items()}
        dataset = replace(dataset, config=replace(dataset.config, priors=priors))
    trust = trust_checks(calibrate(dataset, options), options)
    assert trust.untold == () and len(trust.loops) == 1
    assert [one.compared.names[0] for one in trust.left_out] == ["rgb_1", "rgb_2", "depth_1"]
