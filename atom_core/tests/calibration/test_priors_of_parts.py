"""Priors of the configuration, where a part of the rig is calibrated."""

import json
from dataclasses import replace

import numpy as np
import pytest

from atom_core import cli
from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.errors import CalibrationError
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.model.config import PriorConfig
from atom_core.synthetic import scenes

KNOWN = PriorConfig(0.01, 0.02)


def with_priors(dataset, *names, known=KNOWN):
    """Return a dataset whose configuration knows these beforehand."""
    return replace(dataset, config=replace(dataset.config, priors=dict.fromkeys(names, known)))


def values(result):
    dataset = result.dataset
    return {s.edge: dataset.first_value(s.edge) for s in dataset.sensors.values()}


def test_a_sensor_that_is_not_used_needs_no_prior():
    dataset = scenes.random_scene(0, collections=6).dataset
    part = dataset.selected(sensors=["rgb_1", "depth_1"])
    plain, known = (calibrate(d) for d in (part, with_priors(part, "rgb_2")))
    assert known.free.priors == {} and known.warnings == plain.warnings
    for edge, value in values(plain).items():
        np.testing.assert_array_equal(values(known)[edge], value)


def test_a_board_that_is_not_used_needs_no_prior():
    dataset = scenes.random_scene(0, collections=6).dataset
    (used,) = dataset.config.calibration_patterns.values()
    boards = {"pattern_1": used, "pattern_2": replace(used, link="wall", fixed=True)}
    config = replace(dataset.config, calibration_patterns=boards)
    part = with_priors(replace(dataset, config=config), "pattern_2")  # as -psf pattern_1 leaves it
    assert calibrate(part).free.priors == {}


def test_an_edge_that_a_sensor_shares_keeps_its_prior_though_the_sensor_is_not_used():
    dataset = scenes.shared_edge(0, collections=6).dataset
    edges = [sensor.edge for sensor in dataset.sensors.values()]
    twin, other = (n for n, s in dataset.sensors.items() if edges.count(s.edge) == 2)
    part = dataset.selected(sensors=[name for name in dataset.sensors if name != twin])
    result = calibrate(with_priors(part, twin, known=PriorConfig(1e-7, 1e-7)))
    edge = part.sensors[other].edge
    assert set(result.free.priors) == {edge}
    np.testing.assert_allclose(result.dataset.first_value(edge), part.first_value(edge), atol=1e-5)


def test_a_prior_that_is_asked_for_of_what_is_not_used_is_refused():
    part = scenes.random_scene(0, collections=6).dataset.selected(sensors=["rgb_1", "depth_1"])
    with pytest.raises(CalibrationError, match="--prior rgb_2: .*selection leaves it out"):
        calibrate(part, CalibrationOptions(priors={"rgb_2": (0.01, 0.02)}))


def test_the_configuration_is_named_where_its_priors_do_not_suit_the_weights():
    dataset = with_priors(scenes.random_scene(0, collections=6).dataset, "rgb_2")
    atom = replace(CalibrationOptions().solver, weights="atom")
    says = "priors of the configuration: rgb_2.* needs --weights sigma"
    with pytest.raises(CalibrationError, match=says):
        calibrate(dataset, CalibrationOptions(solver=atom))


def test_trust_checks_are_asked_where_the_configuration_knows_a_sensor_beforehand(tmp_path):
    dataset = with_priors(scenes.random_scene(0, collections=8).dataset, "rgb_2")
    path = write_dataset_folder(dataset, tmp_path / "data", name="train")
    out = tmp_path / "out"
    words = ["calibrate", "--dataset", str(path), "--output", str(out), "--trust_checks"]
    assert cli.main(words) == 0
    checks = json.loads((out / "calibration.json").read_text())["trust_checks"]
    assert not [text for text in checks["not_asked"] if "prior" in text]
    assert {"depth_1", "lidar_1"} <= set(checks["leave_one_out"]["sensors"])
