"""Which cameras OpenCV's hand-eye methods solve, and how each answer is scored on a test set."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from atom_core.errors import DatasetError
from atom_core.evaluation import hand_eye_baselines as module
from atom_core.evaluation import hand_eye_comparison as comparison
from atom_core.evaluation.hand_eye_baselines import METHODS, Baseline, hand_eye_baselines, solved_by
from atom_core.evaluation.hand_eye_comparison import CALIBRATION, compare_hand_eye, hand_eye_score
from atom_core.geometry import se3
from atom_core.geometry.pose_solvers import HAND_EYE_METHODS, ROBOT_WORLD_METHODS
from atom_core.model.dataset import pose
from atom_core.model.sensor import RGB, Sensor
from atom_core.model.truth import Truth
from atom_core.synthetic import Noise, scenes

CAMERA, BOARD = "rgb_1", "pattern_1"


@pytest.fixture(scope="module")
def scene():
    return scenes.hand_eye(2, collections=4, noise=Noise.none())


@pytest.fixture(scope="module")
def three(scene):
    """Return the camera three times; the second one sees no board."""
    dataset = scene.dataset
    names = ("rgb_1", "blind", "rgb_3")
    sensors = {name: replace(dataset.sensors[CAMERA], name=name) for name in names}
    collections = {
        key: replace(c, labels={(n, BOARD): c.labels[CAMERA, BOARD] for n in names[::2]})
        for key, c in dataset.collections.items()
    }
    return replace(dataset, sensors=sensors, collections=collections)


def moved(*metres):
    return se3.transform(np.eye(3), np.array(metres, dtype=float))


# ---- which cameras


def test_a_camera_that_cannot_be_solved_is_told_and_costs_the_later_ones_nothing(three):
    found, remarks = hand_eye_baselines(three)
    assert [baseline.method for baseline in found] == list(METHODS)
    solved = [baseline for baseline in found if baseline.dataset is not None]
    assert solved
    for baseline in solved:
        assert baseline.boards == {"rgb_1": BOARD, "rgb_3": BOARD} and baseline.skipped is None
    (remark,) = remarks
    assert remark.startswith("no hand-eye baseline of 'blind': hand_eye: camera 'blind' sees no")


def test_sensors_that_are_no_cameras_are_passed_over_in_silence(scene):
    dataset = scene.dataset
    other = Sensor("lidar_1", "lidar3d", "rgb_1_link", dataset.sensors[CAMERA].edge)
    sensors = {"lidar_1": other, **dataset.sensors}
    found, remarks = hand_eye_baselines(replace(dataset, sensors=sensors))
    assert found[0].boards == {CAMERA: BOARD} and remarks == []


def test_where_no_camera_can_be_solved_the_first_reason_is_told(three):
    blind = three
    for key in three.collections:
        blind = blind.with_labels(key, {("rgb_3", BOARD): None, ("rgb_1", BOARD): None})
    with pytest.raises(DatasetError) as refusal:
        hand_eye_baselines(blind)
    assert str(refusal.value).startswith("--baseline hand_eye: hand_eye: camera 'rgb_1' sees no")


def test_only_of_several_fixed_boards_the_one_is_named(scene):
    dataset = scene.dataset
    for fixed in (False, True):
        other = replace(dataset.patterns[BOARD], name="other", frame="other", fixed=fixed)
        two = replace(dataset, patterns={**dataset.patterns, "other": other})
        _, remarks = hand_eye_baselines(two)
        wanted = [f"hand-eye baselines of '{CAMERA}' are by board '{BOARD}' alone"]
        assert remarks == (wanted if fixed else [])


# ---- one method


def one_method(monkeypatch, dataset, answers, lacking=""):
    """Return a method's baseline; its answers (4, 4) by camera, None where it finds none."""
    put = []

    def with_answer(before, camera, board, views, X):
        put.append((camera, board, views, X[0, 3]))
        return before

    monkeypatch.setattr(module, "lacking", lambda method: lacking)
    monkeypatch.setattr(module, "solved_by", lambda method, views: answers[views])
    monkeypatch.setattr(module, "with_hand_eye", with_answer)
    views = {camera: (f"board of {camera}", camera) for camera in answers}
    return module._baseline(dataset, "park", views), put


def test_cameras_that_a_method_solves_stay_and_the_others_go(monkeypatch, three):
    answers = {"rgb_1": None, "blind": moved(1.0, 0, 0), "rgb_3": None}
    found, put = one_method(monkeypatch, three, answers)
    assert put == [("blind", "board of blind", "blind", 1.0)]
    assert found.boards == {"blind": "board of blind"}
    assert list(found.dataset.sensors) == ["blind"]
    assert found.skipped == "park finds no pose of 'rgb_1', 'rgb_3'"


def test_cameras_that_were_not_asked_for_stay(monkeypatch, three):
    found, _ = one_method(monkeypatch, three, {"rgb_1": moved(1, 0, 0), "rgb_3": None})
    assert list(found.dataset.sensors) == ["rgb_1", "blind"]


def test_where_all_are_solved_nothing_is_skipped(monkeypatch, three):
    answers = {"rgb_1": moved(1, 0, 0), "rgb_3": moved(2, 0, 0)}
    found, put = one_method(monkeypatch, three, answers)
    assert found.skipped is None and found.dataset is three
    assert [entry[3] for entry in put] == [1.0, 2.0]


def test_where_none_is_solved_there_is_no_dataset(monkeypatch, three):
    found, put = one_method(monkeypatch, three, {"rgb_1": None, "rgb_3": None})
    assert found == Baseline("park", None, {}, "park finds no pose of 'rgb_1', 'rgb_3'")
    assert put == []


def test_a_method_that_this_opencv_lacks_is_skipped(monkeypatch, three):
    found, put = one_method(monkeypatch, three, {"rgb_1": moved(1, 0, 0)}, "no such method")
    assert found == Baseline("park", None, {}, "no such method") and put == []
    with pytest.raises(DatasetError, match="no such method"):
        solved_by("park", None)


@pytest.mark.parametrize("method", METHODS)
def test_each_method_is_asked_by_its_own_solver_for_the_camera(monkeypatch, method):
    X, F = moved(1, 0, 0), moved(2, 0, 0)
    views = SimpleNamespace(G=["g"], H=["h"])
    monkeypatch.setattr(module, "lacking", lambda method: "")
    monkeypatch.setattr(module, "hand_eye_pose", lambda *args: (X, "hand_eye", args))
    monkeypatch.setattr(module, "robot_world_poses", lambda *args: ((X, "robot", args), F))
    found, kind, args = solved_by(method, views)
    assert found is X and args == (["g"], ["h"], method)
    assert (kind == "hand_eye") == (method in HAND_EYE_METHODS)
    monkeypatch.setattr(module, "robot_world_poses", lambda *args: None)
    monkeypatch.setattr(module, "hand_eye_pose", lambda *args: None)
    assert solved_by(method, views) is None


# ---- scores


def figures(mean_px):
    return None if mean_px is None else SimpleNamespace(pooled=SimpleNamespace(mean=mean_px))


def single(sensor, mean_px, tells=True):
    return SimpleNamespace(sensor=sensor, tells_of_calibration=tells, measured=figures(mean_px))


def spread(sensor, *numbers):
    names = ("rms", "translation_mm", "rotation_deg")
    measured = SimpleNamespace(**dict(zip(names, numbers))) if numbers else None
    return SimpleNamespace(pair=SimpleNamespace(source=sensor), measured=measured)


def evaluated(singles, spreads=()):
    return SimpleNamespace(single=singles, spread=spreads)


def test_reprojection_is_the_mean_over_boards_that_tell_of_the_cameras_place(scene):
    singles = [
        single(CAMERA, 1.0),
        single("other", 50.0),
        single(CAMERA, 9.0, tells=False),
        single(CAMERA, None),
        single(CAMERA, 2.0),
    ]
    found = hand_eye_score(CAMERA, scene.dataset, evaluated(singles))
    assert found == (1.5, None, None, None, None, None)
    assert hand_eye_score("rgb_1", scene.dataset, evaluated([]))[0] is None


def test_the_spread_is_the_cameras_own(scene):
    spreads = [spread("other", 7.0, 8.0, 9.0), spread(CAMERA, 1.0, 2.0, 3.0)]
    found = hand_eye_score(CAMERA, scene.dataset, evaluated([], spreads))
    assert (found.spread_px, found.spread_mm, found.spread_deg) == (1.0, 2.0, 3.0)
    for unmeasured in ([spread(CAMERA)], [spread("other", 7.0, 8.0, 9.0)]):
        found = hand_eye_score(CAMERA, scene.dataset, evaluated([], unmeasured))
        assert (found.spread_px, found.spread_mm, found.spread_deg) == (None, None, None)


@pytest.mark.parametrize("turn_rad", [0.0, 0.1])
def test_the_error_is_that_of_the_data_frame_in_metres_and_degrees(scene, turn_rad):
    dataset, edge = scene.dataset, scene.dataset.sensors[CAMERA].edge
    first = dataset.collections["000"]
    child_T_camera = pose(first, dataset.graph, edge.child, dataset.sensors[CAMERA].frame)
    turn = se3.rotation_from_rotation_vector(np.array([turn_rad, 0.0, 0.0]))
    wrong = dataset.first_value(edge) @ se3.transform(turn, np.array([0.0, 0.003, 0.004]))
    found = hand_eye_score(CAMERA, dataset, evaluated([]), Truth({edge: wrong}))
    arm = (turn - np.eye(3)) @ child_T_camera[:3, 3] + [0.0, 0.003, 0.004]
    assert found.error_m == pytest.approx(np.linalg.norm(arm))
    assert found.error_deg == pytest.approx(np.degrees(turn_rad), abs=1e-6)


def test_a_truth_without_the_edge_tells_no_error(scene):
    found = hand_eye_score(CAMERA, scene.dataset, evaluated([]), Truth({}))
    assert found.error_m is None and found.error_deg is None


# ---- side by side


def compared(monkeypatch, dataset, baselines, **asked):
    """Compare baselines; return the comparison, what was solved, and what was evaluated."""
    trained, evaluations = [], []

    def evaluate(solved, test, truth=None, sensors=None):
        evaluations.append((solved, test, truth, sensors))
        return f"evaluation {len(evaluations)}"

    def solve(train):
        trained.append(train)
        return baselines, ["a remark"]

    def score(camera, solved, evaluation, truth=None):
        return (camera, solved, evaluation, truth)

    monkeypatch.setattr(comparison, "hand_eye_baselines", solve)
    monkeypatch.setattr(comparison, "evaluate", evaluate)
    monkeypatch.setattr(comparison, "hand_eye_score", score)
    found = compare_hand_eye(dataset, dataset, "own", **asked)
    return found, trained, evaluations


def test_methods_without_an_answer_cost_the_later_ones_nothing(monkeypatch, three):
    answers = [
        Baseline("tsai", None, skipped="none"),
        Baseline("park", three, {"rgb_3": BOARD}),
        Baseline("shah", three, {"rgb_1": BOARD, "rgb_3": BOARD}),
    ]
    found, _, evaluations = compared(monkeypatch, three, answers, truth="truth")
    assert found.baselines == tuple(answers) and found.remarks == ("a remark",)
    assert found.evaluations == {"park": "evaluation 1", "shah": "evaluation 2"}
    assert [call[3] for call in evaluations] == [["rgb_3"], ["rgb_1", "rgb_3"]]
    assert all(call[2] == "truth" for call in evaluations)
    assert list(found.scores) == [
        (CALIBRATION, "rgb_3"),
        (CALIBRATION, "rgb_1"),
        ("park", "rgb_3"),
        ("shah", "rgb_1"),
        ("shah", "rgb_3"),
    ]
    for (method, camera), score in found.scores.items():
        own = "own" if method == CALIBRATION else found.evaluations[method]
        assert score == (camera, three, own, "truth")


def test_methods_are_given_the_selected_sensors_and_the_test_sets_patterns(monkeypatch, three):
    _, (train,), _ = compared(monkeypatch, three, [], sensors=["rgb_1", "blind"])
    assert list(train.sensors) == ["rgb_1", "blind"] and list(train.patterns) == [BOARD]
    assert {s.modality for s in train.sensors.values()} == {RGB}
    _, (train,), _ = compared(monkeypatch, three, [])
    assert list(train.sensors) == list(three.sensors)


def test_there_are_as_many_methods_as_opencv_has():
    assert len(METHODS) == len(set(METHODS)) == 7
    assert (*HAND_EYE_METHODS, *ROBOT_WORLD_METHODS) == METHODS
