"""A board that is configured fixed and moves, or the other way round, is said to be so."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.judge.judgement import INCONSISTENT
from atom_core.calibration.preflight import preflight
from atom_core.calibration.prepare.fixed_boards import check_fixed_boards
from atom_core.calibration.prepare.input_changes import with_first_boards
from atom_core.errors import CalibrationError
from atom_core.geometry import se3
from atom_core.io.dataset_entries import transform_document
from atom_core.model.dataset import board_edge
from atom_core.problem.measurements import read_measurements
from atom_core.report.check_verdict import check_verdict
from atom_core.report.verdict import WRONG
from atom_core.solvers.base import CONVERGED
from atom_core.synthetic import scenes


def configured(dataset, fixed):
    patterns = {name: replace(p, fixed=fixed) for name, p in dataset.patterns.items()}
    return replace(dataset, patterns=patterns)


def said_of(dataset):
    """What `check` says, and `calibrate` where it refuses."""
    verdict = check_verdict(dataset, preflight(dataset))
    with pytest.raises(CalibrationError) as refusal:
        calibrate(dataset)
    assert verdict.grade == WRONG
    assert str(refusal.value) in verdict.sentence
    return str(refusal.value)


@pytest.mark.parametrize(
    "scene", [scenes.random_scene, scenes.two_cameras, scenes.shared_edge, scenes.two_patterns]
)
def test_a_board_that_moves_and_is_configured_fixed_is_refused_before_solving(scene):
    said = said_of(configured(scene(1).dataset, fixed=True))
    assert "is configured `fixed: true`, but sensor 'rgb_" in said
    assert "m apart; set `fixed: false` of it" in said


@pytest.mark.parametrize("scene", [scenes.hand_eye, scenes.board_on_arm])
def test_one_camera_and_a_board_that_is_not_configured_fixed_name_the_key(scene):
    said = said_of(configured(scene(1).dataset, fixed=False))
    assert "nothing ties it to the rig; if pattern 'pattern_1' does not move" in said
    assert "set `fixed: true` of it" in said and "-ssf" not in said


@pytest.mark.parametrize("seed", range(4))
def test_a_board_that_stands_still_is_not_accused(seed):
    dataset = scenes.two_cameras(seed, collections=6).dataset
    first = next(iter(dataset.collections.values()))
    read, _ = read_measurements(dataset)
    of_first = [m for m in read if m.key.collection == first.key]
    assert of_first
    same = [
        replace(m, key=m.key._replace(collection=key))
        for m in of_first
        for key in dataset.collections
    ]
    check_fixed_boards(configured(dataset, fixed=True), same)
    with pytest.raises(CalibrationError):
        check_fixed_boards(configured(dataset, fixed=True), read)


@pytest.mark.parametrize("scene", [scenes.hand_eye, scenes.board_on_arm])
def test_a_robot_that_moves_before_a_fixed_board_is_calibrated(scene):
    assert calibrate(scene(2).dataset).status == CONVERGED


def test_a_fixed_board_that_was_moved_before_a_robot_is_named_as_a_cause():
    dataset = scenes.hand_eye(1).dataset
    elsewhere = se3.transform(
        se3.rotation_from_rotation_vector(np.array([0.0, 0.0, 0.3])), np.array([0.2, 0.1, 0.0])
    )
    flange = next(
        e for c in dataset.collections.values() for e in c.transforms if e.child == "flange"
    )
    last = list(dataset.collections)[-2:]
    collections = {
        key: replace(c, transforms={**c.transforms, flange: elsewhere @ c.transforms[flange]})
        if key in last
        else c
        for key, c in dataset.collections.items()
    }
    calibration = calibrate(replace(dataset, collections=collections))
    assert calibration.status == INCONSISTENT
    assert "if board 'pattern_1', configured `fixed: true`, was moved" in calibration.message


def test_a_sensor_that_a_joint_below_its_edge_moves_does_not_stand_still():
    dataset = scenes.two_cameras(1, collections=6).dataset
    sensor, axis = dataset.sensors["rgb_1"], np.array([0.0, 0.0, 1.0])
    last = dataset.graph.chain(dataset.world, sensor.frame)[-1].edge
    assert last != sensor.edge
    collections = {}
    for i, (key, c) in enumerate(dataset.collections.items()):
        turn = se3.transform(se3.rotation_from_rotation_vector(0.1 * i * axis), np.zeros(3))
        collections[key] = replace(c, transforms={**c.transforms, last: turn @ c.transforms[last]})
    fixed = configured(replace(dataset, collections=collections), fixed=True)
    read, _ = read_measurements(fixed)
    check_fixed_boards(fixed, [m for m in read if m.key.sensor == "rgb_1"])
    with pytest.raises(CalibrationError, match="sensor 'rgb_2', which stands still"):
        check_fixed_boards(fixed, read)


def test_a_fixed_board_is_held_at_one_place_though_a_part_of_the_dataset_knows_it():
    """As where a calibrated dataset and one as collected are merged."""
    dataset = configured(scenes.hand_eye(0, collections=4).dataset, fixed=True)
    (pattern,) = dataset.patterns.values()
    edge, known = board_edge(pattern), se3.from_rpy(np.array([0.0, 0.1, 1.5]), np.zeros(3))
    first = {"detected": True, **transform_document(edge, np.eye(4))}
    stored = {pattern.name: {"transforms_initial": dict.fromkeys(dataset.collections, first)}}
    raw = replace(dataset, document={"patterns": stored})
    begun, told = with_first_boards(raw)
    assert all(np.array_equal(c.transforms[edge], np.eye(4)) for c in begun.collections.values())
    assert "where one sensor saw it first" in told[0]
    held, told = with_first_boards(raw.with_transforms({"002": {edge: known}}))
    assert all(np.array_equal(c.transforms[edge], known) for c in held.collections.values())
    assert told == []
