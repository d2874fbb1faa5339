"""Whole bad detections and collections are found, named and left out; healthy ones are not."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.refine import rejection
from atom_core.calibration.refine.disagreement import chi_squares
from atom_core.calibration.refine.rejection import DISAGREES, NO_MAJORITY
from atom_core.geometry import se3
from atom_core.model.labels import RgbLabel
from atom_core.solvers.base import SolverOptions
from atom_core.solvers.choice import SOLVERS, solver_factory
from atom_core.synthetic import Noise, paper_cell, scenes
from atom_core.synthetic.cell import cell_rig
from atom_core.synthetic.mistakes import (
    MIRRORED,
    TURNED,
    Origin,
    move_about,
    with_detections_from,
    with_moved_board,
    with_renumbered_corners,
)

PATTERN = "pattern_1"
DISTURBED = (0.05, 0.05)
# One of the twenty rigs is for every day.
RIGS = pytest.mark.parametrize(
    "seeds",
    [
        pytest.param((17,), id="1 rig"),
        pytest.param(range(20), id="20 rigs", marks=pytest.mark.long),
    ],
)


def cell(seed, gross_fraction=0.0):
    return paper_cell(seed, "train", Noise(gross_fraction=gross_fraction), DISTURBED)


def sensors_in(dataset, collection):
    return [key.sensor for key, _ in dataset.detections() if key.collection == collection]


def collections_of(dataset, sensor):
    return [key.collection for key, _ in dataset.detections() if key.sensor == sensor]


def rejected(result):
    return {(r.key.collection, r.key.sensor) for r in result.rejected}


def mean_error_m(result, scene):
    transforms = next(iter(result.dataset.collections.values())).transforms
    distances = [transforms[e][:3, 3] - true[:3, 3] for e, true in scene.truth.edges.items()]
    return float(np.mean(np.linalg.norm(distances, axis=1)))


def label_of_another_collection(scene, collection, sensor, rng):
    others = [k for k in collections_of(scene.dataset, sensor) if k != collection]
    origin = Origin(scene.dataset, others[rng.integers(len(others))])
    return with_detections_from(scene.dataset, {(collection, sensor): origin})


def board_that_moved(scene, seed, collection, sensors, rng, shift_m):
    """Move the board before each of the sensors looks at it, otherwise each time."""
    pose = scene.truth.boards[(PATTERN, collection)]
    centre = (pose @ np.array([0.4, 0.3, 0.0, 1.0]))[:3]
    moves = {}
    for sensor in sensors:
        turn = rng.uniform(0.1, 0.5) * se3.random_direction(rng)
        shift = rng.uniform(*shift_m) * se3.random_direction(rng)
        moves[(collection, sensor)] = move_about(centre, turn, shift)
    return with_moved_board(scene, cell_rig(seed), moves, rng)


def wholly_wrong(scene, seed, collection, how, rng):
    """Return the dataset in which no two sensors saw the same board in a collection."""
    seen = sensors_in(scene.dataset, collection)
    if how == "moved":
        return board_that_moved(scene, seed, collection, seen, rng, (0.05, 0.2))
    dataset = scene.dataset
    for sensor in seen:
        own = replace(scene, dataset=dataset)
        dataset = label_of_another_collection(own, collection, sensor, rng)
    return dataset


@pytest.fixture(scope="module")
def healthy():
    return cell(0)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("gross_fraction", [0.0, 0.1])
def test_nothing_is_left_out_of_a_healthy_rig(gross_fraction):
    assert calibrate(cell(1, gross_fraction).dataset).rejected == ()


@pytest.mark.long
@pytest.mark.slow
@RIGS
def test_nothing_is_left_out_of_healthy_rigs(seeds):
    assert {calibrate(cell(20 + seed).dataset).rejected for seed in seeds} == {()}


@pytest.mark.parametrize("scene", ["lidar_only", "shared_edge", "two_patterns", "board_on_arm"])
def test_nothing_is_left_out_of_small_rigs(scene):
    assert calibrate(getattr(scenes, scene)(0, collections=12).dataset).rejected == ()


@pytest.mark.sampled(1)
@pytest.mark.parametrize("sensor", ["rgb_1", "lidar_2"])
def test_the_label_of_another_collection_is_left_out(healthy, sensor):
    key = "021"
    assert sensor in sensors_in(healthy.dataset, key)
    dataset = label_of_another_collection(healthy, key, sensor, np.random.default_rng(0))
    result = calibrate(dataset)
    assert rejected(result) == {(key, sensor)}
    assert result.rejected[0].reason == DISAGREES and result.rejected[0].excess > 1
    assert key not in result.unused
    assert any(f"--keep_detections {key}:{sensor}" in warning for warning in result.warnings)
    assert mean_error_m(result, healthy) < 0.001


@pytest.mark.sampled(1)
@pytest.mark.parametrize("how", [TURNED, MIRRORED])
def test_corners_numbered_from_another_side_are_left_out(healthy, how):
    assert "rgb_2" in sensors_in(healthy.dataset, "019")
    result = calibrate(with_renumbered_corners(healthy.dataset, "019", "rgb_2", how))
    assert rejected(result) == {("019", "rgb_2")}


def test_a_sensor_that_was_pushed_aside_by_three_centimetres_is_left_out(healthy):
    rng = np.random.default_rng(1)
    move = se3.transform(np.eye(3), 0.03 * se3.random_direction(rng))
    dataset = with_moved_board(healthy, cell_rig(0), {("021", "rgb_3"): move}, rng)
    assert rejected(calibrate(dataset)) == {("021", "rgb_3")}


@pytest.mark.long
@pytest.mark.slow
@RIGS
def test_a_wrong_detection_is_named_in_every_rig(seeds):
    """Cameras in turn with range sensors; boards that at least three sensors see."""
    for seed in seeds:
        scene, rng = cell(seed), np.random.default_rng(seed)
        sensor = list(scene.dataset.sensors)[seed % 7]
        seen = [
            key
            for key in collections_of(scene.dataset, sensor)
            if len(sensors_in(scene.dataset, key)) > 2
        ]
        key = seen[rng.integers(len(seen))]
        if seed % 2:
            dataset = board_that_moved(scene, seed, key, [sensor], rng, (0.05, 0.2))
        else:
            dataset = label_of_another_collection(scene, key, sensor, rng)
        if sensor not in sensors_in(dataset, key):  # it went out of sight: nothing is wrong
            dataset = label_of_another_collection(scene, key, sensor, rng)
        assert rejected(calibrate(dataset)) == {(key, sensor)}, seed


@pytest.mark.sampled(1)
@pytest.mark.parametrize("how", ["moved", "others"])
def test_a_wholly_wrong_collection_is_named_and_left_out(healthy, how):
    dataset = wholly_wrong(healthy, 0, "019", how, np.random.default_rng(0))
    result = calibrate(dataset)
    assert result.status == "converged"
    assert list(result.unused) == ["019"] and NO_MAJORITY in result.unused["019"]
    assert {key for key, _ in rejected(result)} == {"019"}
    assert any("--keep_collections 019" in warning for warning in result.warnings)
    assert mean_error_m(result, healthy) < 1.2 * mean_error_m(calibrate(healthy.dataset), healthy)


@pytest.mark.long
@pytest.mark.slow
@RIGS
def test_a_wholly_wrong_collection_is_named_in_every_rig(seeds):
    for seed in seeds:
        scene, rng = cell(seed), np.random.default_rng(seed)
        keys = list(scene.dataset.collections)
        key = keys[rng.integers(len(keys))]
        how = "moved" if seed % 2 else "others"
        result = calibrate(wholly_wrong(scene, seed, key, how, rng))
        assert list(result.unused) == [key], (seed, how)
        assert {key for key, _ in rejected(result)} == {key}, (seed, how)


def test_where_two_sensors_contradict_each_other_nothing_tells_who_is_right():
    scene = scenes.two_cameras(0, collections=14)
    unused = calibrate(scene.dataset).unused
    key = next(key for key in scene.dataset.collections if key not in unused)
    wrong = label_of_another_collection(scene, key, "rgb_1", np.random.default_rng(0))
    result = calibrate(wrong)
    assert set(result.unused) == {*unused, key}
    assert rejected(result) == {(key, "rgb_1"), (key, "rgb_2")}


def test_a_wrong_pose_of_the_arm_is_found_by_a_board_that_stays():
    scene = scenes.hand_eye(0, collections=12)
    (moving,) = {e for e, kind in scene.dataset.edge_types.items() if kind == "multiple"}
    now = scene.dataset.collections["004"].transforms[moving]
    wrong = {moving: se3.moved(now, se3.transform(np.eye(3), np.array([0.05, 0.0, 0.0])))}
    result = calibrate(scene.dataset.with_transforms({"004": wrong}))
    assert rejected(result) == {("004", "rgb_1")} and list(result.unused) == ["004"]


def test_what_is_to_be_kept_is_kept(healthy):
    dataset = wholly_wrong(healthy, 0, "019", "others", np.random.default_rng(0))
    whole = calibrate(dataset, CalibrationOptions(keep_collections=("019",)))
    assert "019" not in whole.unused and not rejected(whole)
    wrong = label_of_another_collection(healthy, "021", "rgb_1", np.random.default_rng(0))
    single = calibrate(wrong, CalibrationOptions(keep_detections=(("021", "rgb_1"),)))
    assert ("021", "rgb_1") not in rejected(single)


@pytest.mark.long
def test_both_solvers_leave_out_the_same(healthy):
    dataset = label_of_another_collection(healthy, "021", "lidar_1", np.random.default_rng(0))
    results = [calibrate(dataset, CalibrationOptions(solver_name=n)) for n in ("ceres", "scipy")]
    assert rejected(results[0]) == rejected(results[1]) == {("021", "lidar_1")}
    edges = [next(iter(r.dataset.collections.values())).transforms for r in results]
    for sensor in dataset.sensors.values():
        np.testing.assert_allclose(edges[0][sensor.edge], edges[1][sensor.edge], atol=1e-6)


def test_without_a_robust_loss_everything_is_used(healthy):
    dataset = wholly_wrong(healthy, 0, "019", "others", np.random.default_rng(0))
    result = calibrate(dataset, CalibrationOptions(solver=SolverOptions(loss="none")))
    assert not result.rejected


def test_when_what_is_left_cannot_be_calibrated_the_status_says_so(healthy, monkeypatch):
    def condemn(judge):
        keys = [m.key for m in judge._measurements.values() if m.key.sensor == "lidar_1"]
        return [rejection.Rejected(key, DISAGREES, 2.0) for key in keys]

    monkeypatch.setattr(rejection._Judge, "verdict", condemn)
    result = calibrate(healthy.dataset)
    assert result.status == "failed" and not result.rejected
    assert "detections contradict the others (lidar_1 in " in result.message
    assert "nothing is left of what sensor 'lidar_1' saw" in result.message
    assert "--keep_collections" in result.message


@pytest.mark.long
def test_the_statistic_has_its_distribution():
    """Without gross errors and robust loss the chi-squares are chi-squares."""
    sums, freedoms = 0.0, 0
    for seed in range(6):
        sampling = scenes.Sampling(exact_border=True)
        scene = scenes.random_scene(seed, collections=12, sampling=sampling)
        plain = CalibrationOptions(solver=SolverOptions(loss="none"))
        result = calibrate(scene.dataset, plain)
        solver, x = solver_factory(None)(result.problem), result.summary.x
        equations = solver.equations(x, result.summary.sigmas, "none")
        values, freedom = chi_squares(result.problem, equations, np.zeros((1, 6, 6)))
        sums, freedoms = sums + np.sum(values), freedoms + np.sum(freedom)
    assert freedoms > 1000  # so that the ratio is known to 5 %
    assert sums / freedoms == pytest.approx(1.0, abs=0.15)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("seed", [1, 2])
def test_a_wrong_label_is_left_out_where_the_start_is_right_already(seed, solver):
    """As of a simulated robot, or a dataset that is calibrated again."""
    sensors = {"rgb": 2, "depth": 0, "lidar3d": 2}
    scene = scenes.random_scene(seed, **sensors, collections=24)
    whole = [k for k, c in scene.dataset.collections.items() if len(c.labels) == 4]
    label = scene.dataset.collections[whole[0]].labels[("rgb_2", PATTERN)]
    moved = RgbLabel(label.ids, label.pixels + np.array([60.0, -25.0]))
    wrong = scene.dataset.with_labels(whole[0], {("rgb_2", PATTERN): moved})
    result = calibrate(wrong, CalibrationOptions(solver_name=solver))
    assert result.status == "converged", result.message
    assert rejected(result) == {(whole[0], "rgb_2")}
    assert mean_error_m(result, scene) < 0.005
