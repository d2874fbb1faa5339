"""Cameras on an arm, or before one: their own figures, the spread of boards, OpenCV's methods."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.preflight import preflight
from atom_core.errors import CalibrationError, DatasetError
from atom_core.evaluation import hand_eye_baselines as baselines
from atom_core.evaluation.evaluate import evaluate
from atom_core.evaluation.hand_eye_baselines import METHODS, hand_eye_baselines
from atom_core.evaluation.hand_eye_comparison import CALIBRATION, compare_hand_eye
from atom_core.evaluation.hand_eye_views import hand_eye_views
from atom_core.geometry import se3
from atom_core.geometry.pose_solvers import lacking
from atom_core.geometry.se3 import pose_difference
from atom_core.model.dataset import pose
from atom_core.model.transforms import Edge
from atom_core.synthetic import Noise, degenerate, scenes

SCENES = {"camera moves": scenes.hand_eye, "board moves": scenes.board_on_arm}
NOT_FOR_HALF_TURNS = ("tsai", "daniilidis")  # the arm with the board makes some
CAMERA, BOARD = "rgb_1", "pattern_1"


@pytest.fixture(scope="module", params=SCENES)
def exact(request):
    return SCENES[request.param](2, collections=8, noise=Noise.none())


def moved_camera(dataset, shift):
    """Return the dataset with the camera's edge shifted in its parent [m]."""
    edge = dataset.sensors[CAMERA].edge
    value = se3.transform(np.eye(3), np.asarray(shift)) @ dataset.first_value(edge)
    return dataset.with_transforms(dict.fromkeys(dataset.collections, {edge: value}))


def standing(dataset):
    """Return the dataset with the robot in one place."""
    first = next(iter(dataset.collections.values()))
    return dataset.with_transforms(dict.fromkeys(dataset.collections, dict(first.transforms)))


def test_without_noise_nothing_is_left_at_the_truth(exact):
    found = evaluate(exact.dataset, exact.dataset, truth=exact.truth)
    (single,), (spread,) = found.single, found.spread
    assert found.measured and not found.pairs
    assert (single.one_pose, single.tells_of_calibration) == (True, True)
    for figures in (single.measured, single.at_truth, spread.measured, spread.at_truth):
        assert figures.pooled.rms < 1e-4
    assert spread.measured.translation_mm < 1e-3


def test_the_spread_is_what_a_shifted_camera_does(exact):
    """A camera off by d puts the board off by R d, which differs as the arm turns."""
    dataset, shift = exact.dataset, np.array([0.004, -0.003, 0.005])
    found = evaluate(moved_camera(dataset, shift), dataset)
    graph, parent = dataset.graph, dataset.sensors[CAMERA].edge.parent
    side = dataset.patterns[BOARD].parent_frame
    turns = {k: pose(c, graph, side, parent)[:3, :3] for k, c in dataset.collections.items()}
    (spread,) = found.spread
    pairs = [(a, b) for i, a in enumerate(turns) for b in list(turns)[i + 1 :]]
    wanted = {f"{a}-{b}": 1e3 * np.linalg.norm((turns[a] - turns[b]) @ shift) for a, b in pairs}
    measured = {key: f.translation_mm for key, f in spread.measured.per_collection.items()}
    assert measured == pytest.approx(wanted, abs=1e-3)
    assert found.single[0].measured.rms > 0.5


def test_at_the_truth_the_labels_noise_is_left():
    noisy = scenes.hand_eye(3, collections=8)
    (single,) = evaluate(noisy.dataset, noisy.dataset, truth=noisy.truth).single
    expected_px = 0.3 * np.sqrt(np.pi / 2.0)  # mean length of two errors of 0.3 px
    assert single.at_truth.pooled.mean == pytest.approx(expected_px, rel=0.1)


def test_boards_that_are_moved_by_hand_tell_nothing_of_the_camera_s_place():
    scene = scenes.two_cameras(1, collections=4)
    found = evaluate(moved_camera(scene.dataset, [0.1, 0.0, 0.0]), scene.dataset, truth=scene.truth)
    assert not found.spread
    for single in found.single:
        assert (single.one_pose, single.tells_of_calibration) == (False, False)
        assert single.measured.pooled.mean < 0.5 and single.at_truth is None


def test_where_nothing_moves_no_spread_is_told(exact):
    still = standing(exact.dataset)
    found = evaluate(still, still)
    (spread,) = found.spread
    assert spread.measured is None and "any calibration gives the same" in spread.skipped
    assert not found.measured and not found.single[0].tells_of_calibration


@pytest.mark.parametrize("name", SCENES)
def test_without_noise_the_methods_find_the_truth(name):
    exact = SCENES[name](2, collections=8, noise=Noise.none(), disturbance=(0.1, 0.1))
    edge = exact.dataset.sensors[CAMERA].edge
    found, remarks = hand_eye_baselines(exact.dataset)
    assert [b.method for b in found] == list(METHODS) and not remarks
    for baseline in found:
        if baseline.skipped or (name == "board moves" and baseline.method in NOT_FOR_HALF_TURNS):
            continue
        np.testing.assert_allclose(
            baseline.dataset.first_value(edge), exact.truth.edges[edge], atol=1e-5
        )
        # The board is put where the result sees it.
        (single,) = evaluate(baseline.dataset, exact.dataset).single
        assert single.measured.pooled.mean < 0.01


def test_the_comparison_scores_the_calibration_and_every_method():
    scene = scenes.hand_eye(4, collections=10, aim_m=0.5, disturbance=(0.1, 0.1))
    solved = calibrate(scene.dataset).dataset
    found = evaluate(solved, scene.dataset, truth=scene.truth)
    compared = compare_hand_eye(solved, scene.dataset, found, truth=scene.truth)
    ours = compared.scores[CALIBRATION, CAMERA]
    assert ours.error_m == pytest.approx(found.ground_truth.sensors[CAMERA].translation_m)
    for method, evaluation in compared.evaluations.items():
        score = compared.scores[method, CAMERA]
        assert score.error_m == pytest.approx(evaluation.ground_truth.sensors[CAMERA].translation_m)
        assert ours.reprojection_px < score.reprojection_px
    assert set(compared.evaluations) == {m for m in baselines.METHODS if not lacking(m)}


@pytest.mark.parametrize("name", SCENES)
def test_the_calibration_is_nearer_the_truth_than_every_method_in_the_median(name):
    """In short; over many rigs, with arms that err: tests/benchmarks/bench_hand_eye.py."""
    partly = {"camera moves": {"aim_m": 0.5}, "board moves": {"spread_m": 0.6}}[name]
    errors = {}
    for seed in range(4):
        scene = SCENES[name](seed, collections=12, disturbance=(0.1, 0.1), **partly)
        edge = scene.dataset.sensors[CAMERA].edge
        answers = {b.method: b.dataset for b in hand_eye_baselines(scene.dataset)[0] if b.dataset}
        answers[CALIBRATION] = calibrate(scene.dataset).dataset
        for method, answer in answers.items():
            found = pose_difference(scene.truth.edges[edge], answer.first_value(edge))
            errors.setdefault(method, []).append(found)
    medians = {method: np.median(found, axis=0) for method, found in errors.items()}
    ours = medians.pop(CALIBRATION)
    for method, median in medians.items():
        assert np.all(2.0 * ours < median), method


def with_twin(dataset, name):
    """Return the dataset with a second camera in the place of the first, which sees the same."""
    sensors = {**dataset.sensors, name: replace(dataset.sensors[CAMERA], name=name)}
    collections = {
        key: replace(c, labels={**c.labels, (name, BOARD): c.labels[CAMERA, BOARD]})
        for key, c in dataset.collections.items()
    }
    return replace(dataset, sensors=sensors, collections=collections)


@pytest.mark.sampled(1)
@pytest.mark.skipif(bool(lacking("tsai")), reason="this OpenCV has no calibrateHandEye")
def test_a_camera_that_a_method_cannot_solve_costs_the_others_nothing(monkeypatch, exact):
    twins = with_twin(exact.dataset, "rgb_2")
    solve, calls = baselines.solved_by, []

    def fails_for_the_second(method, views):
        calls.append(method)
        second = method == "park" and calls.count("park") == 2
        return None if second else solve(method, views)

    monkeypatch.setattr(baselines, "solved_by", fails_for_the_second)
    compared = compare_hand_eye(twins, twins, evaluate(twins, twins), truth=exact.truth)
    park = next(b for b in compared.baselines if b.method == "park")
    assert park.skipped == "park finds no pose of 'rgb_2'" and list(park.boards) == [CAMERA]
    # Its place in the calibration is not the method's: the camera is not in the answer at all.
    assert list(park.dataset.sensors) == [CAMERA]
    assert ("park", CAMERA) in compared.scores and ("park", "rgb_2") not in compared.scores
    assert (CALIBRATION, "rgb_2") in compared.scores and ("horaud", "rgb_2") in compared.scores


def with_carried(dataset, name):
    """Return the dataset with a second camera on the first one, which sees the same."""
    edge, frame = Edge("rgb_1_link", f"{name}_link"), f"{name}_optical_frame"
    link_T_frame = se3.random_move(0.2, 0.5, np.random.default_rng(0))
    first = next(iter(dataset.collections.values()))
    place = pose(first, dataset.graph, "rgb_1_link", dataset.sensors[CAMERA].frame)
    values = {edge: place @ se3.inverse(link_T_frame), Edge(edge.child, frame): link_T_frame}
    twins = with_twin(dataset, name)
    carried = replace(twins.sensors[name], edge=edge, frame=frame)
    # It comes first, so that the order of the dataset is not the one in which they are solved.
    sensors = {name: carried, CAMERA: twins.sensors[CAMERA]}
    return replace(twins, sensors=sensors).with_transforms(dict.fromkeys(twins.collections, values))


def test_a_camera_that_another_one_carries_stands_where_the_method_finds_it(exact):
    true = with_carried(exact.dataset, "rgb_2")
    off = {
        edge: true.first_value(edge) @ se3.random_move(0.05, 0.05, np.random.default_rng(seed))
        for seed, edge in enumerate(sensor.edge for sensor in true.sensors.values())
    }
    found, _ = hand_eye_baselines(true.with_transforms(dict.fromkeys(true.collections, off)))
    for baseline in found:
        if baseline.method in ("park", "shah") and baseline.dataset is not None:
            for edge in off:
                np.testing.assert_allclose(
                    baseline.dataset.first_value(edge), true.first_value(edge), atol=1e-5
                )


def test_an_old_opencv_is_named(monkeypatch, exact):
    monkeypatch.delattr(cv2, "calibrateRobotWorldHandEye", raising=False)
    found, _ = hand_eye_baselines(exact.dataset)
    without = {b.method: b.skipped for b in found if b.dataset is None}
    assert {"shah", "li"} <= set(without)
    assert "has no calibrateRobotWorldHandEye" in without["shah"]


def test_without_opencvs_solvers_one_is_left(monkeypatch, exact):
    for name in ("calibrateHandEye", "calibrateRobotWorldHandEye"):
        monkeypatch.delattr(cv2, name, raising=False)
    found, _ = hand_eye_baselines(exact.dataset)
    assert [b.method for b in found if b.dataset is not None] == ["park"]
    assert all("OpenCV" in b.skipped for b in found if b.dataset is None)


def not_fixed(dataset):
    board = replace(dataset.patterns[BOARD], fixed=False)
    return replace(dataset, patterns={BOARD: board})


@pytest.mark.parametrize(
    "scene, change, words",
    [
        (degenerate.translating_arm, None, "only translates, it never turns"),
        (degenerate.planar_motion, None, "turns about one axis only"),
        (scenes.hand_eye, standing, "neither of them moves"),
        (scenes.hand_eye, not_fixed, "sees no board that is fixed"),
        (scenes.hand_eye, lambda d: d.selected(collections=["000", "001"]), "in 2 collections"),
        (scenes.hand_eye, lambda d: d.selected(sensors=[]), "there is no rgb camera"),
    ],
)
def test_what_motion_does_not_tell_is_refused_in_one_sentence(scene, change, words):
    dataset = scene(1, collections=6).dataset
    with pytest.raises(DatasetError, match=words) as refusal:
        hand_eye_baselines(change(dataset) if change else dataset)
    assert "\n" not in str(refusal.value)


@pytest.mark.skipif(bool(lacking("tsai")), reason="this OpenCV has no calibrateHandEye")
def test_of_several_boards_the_one_seen_most_is_taken_and_named(exact):
    dataset = exact.dataset
    other = replace(dataset.patterns[BOARD], name="other", frame="other_link")
    label = dataset.collections["000"].labels[CAMERA, BOARD]
    two = replace(dataset, patterns={"other": other, **dataset.patterns})
    two = two.with_labels("000", {(CAMERA, "other"): label})
    found, remarks = hand_eye_baselines(two)
    assert found[0].boards == {CAMERA: BOARD}
    assert remarks == [f"hand-eye baselines of '{CAMERA}' are by board '{BOARD}' alone"]


def test_the_calibration_names_an_arm_that_only_translates():
    scene = degenerate.translating_arm(0, disturbance=(0.05, 0.05))
    result = calibrate(scene.dataset)
    assert result.status == "rank_deficient" and len(result.weak_directions) == 3
    for weak in result.weak_directions:
        assert weak.unit == "m" and any(name.startswith("rgb_1 ") for name in weak.parameters)
        assert "moves but never turns; collect with turns about two axes" in weak.why


def test_the_calibration_refuses_a_camera_that_nothing_ties_to_the_world(exact):
    """It would stay where it is, and be called converged."""
    why = "it is alone, and neither what carries it nor"
    with pytest.raises(CalibrationError, match=why):
        calibrate(standing(exact.dataset))
    assert any(why in problem for problem in preflight(standing(exact.dataset)).problems)
    assert not preflight(exact.dataset).problems


def test_the_calibration_names_one_camera_s_planar_robot():
    scene = degenerate.planar_motion(0, disturbance=(0.05, 0.05))
    (weak,) = calibrate(scene.dataset.selected(sensors=["rgb_1"])).weak_directions
    assert "turns about this axis only, as in planar motion" in weak.why


def test_the_cameras_that_there_are_are_named(exact):
    with pytest.raises(DatasetError, match="no rgb camera 'rgb_9'; there are: rgb_1"):
        hand_eye_views(exact.dataset, "rgb_9", BOARD)
