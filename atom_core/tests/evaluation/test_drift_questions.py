"""How new boards are asked: what is held, which boards, and how exactly the rig was known."""

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))  # drift_results, which tests share

from drift_results import rig_of

from atom_core.calibration.judge.judgement import INCONSISTENT
from atom_core.calibration.options import OFF, CalibrationOptions
from atom_core.calibration.refine.rejection import Rejected
from atom_core.errors import CalibrationError
from atom_core.evaluation import drift as module
from atom_core.evaluation.changes import limit_of
from atom_core.evaluation.drift import Drift, drift
from atom_core.evaluation.drift_question import Question, scatter_of, with_common_scatter
from atom_core.evaluation.spreads import NO_SPREAD, Spread
from atom_core.model.labels import DetectionKey
from atom_core.model.transforms import Edge
from atom_core.solvers.base import CONVERGED, FAILED, NOT_CONVERGED
from atom_core.synthetic import scenes

BOARD = "pattern_1"


@pytest.fixture(scope="module")
def dataset():
    """Return three cameras before boards that all of them see."""
    return scenes.random_scene(1, rgb=3, depth=0, lidar3d=0, collections=5).dataset


@pytest.fixture(scope="module")
def asked(dataset):
    return Question(dataset, {}, {"some": "error"}, {"flange": (0.001, 0.002)})


# ---- the question


def test_nothing_is_held_but_what_must_be(asked):
    found = asked.options(())
    assert found == CalibrationOptions(
        model_errors=OFF,
        known_errors={"some": "error"},
        moving_edge_sigma={"flange": (0.001, 0.002)},
    )
    assert not found.ignore_anchored_sensor and found.anchor_sensors == ()


def test_only_those_are_held_that_are_named_not_the_anchored_sensor(asked):
    found = asked.options(["rgb_3", "rgb_2"])
    assert found.anchor_sensors == ("rgb_3", "rgb_2") and found.ignore_anchored_sensor
    assert found.model_errors == OFF and found.known_errors == {"some": "error"}
    assert found.moving_edge_sigma == {"flange": (0.001, 0.002)}


def test_one_board_and_all_but_one_make_the_whole(asked):
    keys = list(asked.standing.collections)
    for key in keys:
        one, others = asked.of_collection(key), asked.without_collection(key)
        assert list(one.standing.collections) == [key]
        assert list(others.standing.collections) == [other for other in keys if other != key]
        assert one[1:] == others[1:] == asked[1:]
    assert list(asked.standing.collections) == keys


def test_labels_that_are_left_out_are_gone_and_no_other(asked):
    gone = [DetectionKey("001", "rgb_2", BOARD), DetectionKey("003", "rgb_1", BOARD)]
    left = asked.without([Rejected(key, "odd", 9.0) for key in gone])
    before = [key for key, _ in asked.standing.detections()]
    assert set(gone) < set(before)
    assert [key for key, _ in left.standing.detections()] == [k for k in before if k not in gone]
    assert asked.without([]).standing is asked.standing


# ---- how much detections scatter


@pytest.mark.parametrize("least", [1.0, 2.5])
def test_scatter_is_the_mean_of_stated_over_assumed_or_the_least(least):
    of_model = np.diag([1.0, 2, 3, 4, 5, 6])
    for ratios in ([1.0, 2, 3, 4, 5, 6], [1.0, 1, 1, 1, 1, 2]):
        known = Spread(of_model * np.diag(ratios), of_model, scatter=least)
        assert scatter_of(known) == pytest.approx(max(least, np.mean(ratios)))


def test_scatter_of_what_was_held_is_the_least_that_is_given():
    assert scatter_of(NO_SPREAD) == 1.0
    assert scatter_of(NO_SPREAD._replace(scatter=3.0)) == 3.0


def test_tiny_covariances_have_a_scatter_too():
    of_model = 1e-12 * np.eye(6)
    assert scatter_of(Spread(4.0 * of_model, of_model)) == pytest.approx(4.0, rel=1e-5)


def test_variances_have_a_least_one_that_is_added():
    of_model = 1e-18 * np.eye(6)
    assert scatter_of(Spread(8.0 * of_model, of_model)) == pytest.approx(4.0)


def standing(**kinds):
    """Return what has sensors of a modality, (modality, measures range) by name."""
    known = {pair: SimpleNamespace(measures_range=pair[1]) for pair in kinds.values()}
    sensors = {
        name: SimpleNamespace(modality=pair[0], kind=known[pair], edge=Edge("base", name))
        for name, pair in kinds.items()
    }
    return SimpleNamespace(sensors=sensors)


def spread(times, detections=4):
    return Spread(times * np.eye(6), np.eye(6), detections, freedom=9.0)


def test_range_sensors_of_a_modality_scatter_as_much_in_the_mean():
    rig = standing(a=("lidar", True), b=("lidar", True), c=("rgb", False), d=("depth", True))
    spreads = {Edge("base", n): spread(t) for n, t in zip("abcd", (2.0, 6.0, 5.0, 3.0))}
    found = with_common_scatter(rig, spreads)
    assert list(found) == list(spreads)
    for name, scatter in (("a", 4.0), ("b", 4.0), ("d", 3.0)):
        one = found[Edge("base", name)]
        assert one.scatter == pytest.approx(scatter) and np.isinf(one.freedom)
        assert one.stated is spreads[Edge("base", name)].stated and one.detections == 4
    camera = Edge("base", "c")
    assert found[camera] is spreads[camera] and spreads[Edge("base", "a")].scatter == 1.0


def test_one_that_was_held_or_is_unknown_neither_counts_nor_changes():
    rig = standing(a=("lidar", True), b=("lidar", True), c=("lidar", True))
    held = Edge("base", "b")
    spreads = {Edge("base", "a"): spread(5.0), held: NO_SPREAD}
    found = with_common_scatter(rig, spreads)
    assert found[held] is NO_SPREAD and list(found) == list(spreads)
    assert found[Edge("base", "a")].scatter == pytest.approx(5.0)
    assert with_common_scatter(rig, {held: NO_SPREAD}) == {held: NO_SPREAD}


# ---- one answer


def solved_as(status, edges, message="it is so", rejected=(), collections=("0", "1")):
    detections = [SimpleNamespace(collection=key) for key in collections]
    return SimpleNamespace(
        status=status,
        message=message,
        free=SimpleNamespace(anchored_sensors=("a",)),
        problem=SimpleNamespace(detections=detections),
        rejected=dict.fromkeys(rejected),
        edges=edges,
    )


def answer(monkeypatch, solved, told=lambda name: True, spreads=None):
    """Return one answer of four sensors, and how exactly each edge's description is known."""
    sensors = {name: SimpleNamespace(name=name, edge=Edge("base", name)) for name in "abcd"}
    extra = SimpleNamespace(edge=Edge("base", "extra"))
    rig = rig_of(sensors, extra=extra, twice=sensors["b"])
    known = {}

    def one_edge(solved, standing, edge, described, limit):
        known[edge.child] = described.stated[0, 0]
        names = (edge.child,) if edge.child in sensors else ()
        return SimpleNamespace(sensors=names, told=told(edge.child), limit=limit)

    monkeypatch.setattr(module, "calibrate", lambda standing, options: solved)
    monkeypatch.setattr(module, "edge_spread", lambda s, edge: 1 if edge.child in s.edges else None)
    monkeypatch.setattr(module, "_edge_drift", one_edge)
    question = SimpleNamespace(
        standing=rig, spreads=spreads or {}, options=lambda held: tuple(held)
    )
    return module._drift(question, ()), known


@pytest.mark.parametrize("status", [FAILED, NOT_CONVERGED])
def test_boards_that_cannot_be_solved_are_refused(monkeypatch, status):
    with pytest.raises(CalibrationError) as refusal:
        answer(monkeypatch, solved_as(status, ()))
    assert str(refusal.value) == (
        "new boards: the new boards alone cannot be solved (it is so); collect others, and see "
        "what `check` says of them"
    )


@pytest.mark.parametrize("status, said", [(CONVERGED, None), (INCONSISTENT, "it is so")])
def test_a_contradiction_is_told_in_the_calibrations_words(monkeypatch, status, said):
    found, _ = answer(monkeypatch, solved_as(status, ("b",)))
    assert found.contradiction == said and found.reference == ("a",)


def test_the_limit_is_for_all_edges_that_were_estimated(monkeypatch):
    found, known = answer(monkeypatch, solved_as(CONVERGED, ("b", "c", "extra")))
    assert list(known) == ["b", "c", "extra"]
    assert found.limit == limit_of(3) and {edge.limit for edge in found.edges} == {found.limit}


def test_sensors_of_which_boards_say_nothing_or_too_little_are_untold(monkeypatch):
    solved = solved_as(CONVERGED, ("b", "c", "extra"))
    found, _ = answer(monkeypatch, solved, told=lambda name: name != "b")
    assert found.untold == ("d", "b")


def test_each_board_counts_once_and_labels_left_out_are_named(monkeypatch):
    solved = solved_as(CONVERGED, ("b",), rejected=("x", "y"), collections=("0", "1", "0", "2"))
    found, _ = answer(monkeypatch, solved)
    assert found.boards == 3 and found.left_out == ("x", "y")


def test_edges_are_known_against_the_held_one_by_both_descriptions(monkeypatch):
    spreads = {Edge("base", n): Spread(s * np.eye(6), np.eye(6)) for n, s in zip("ab", (1.0, 4.0))}
    _, known = answer(monkeypatch, solved_as(CONVERGED, ("b", "c")), spreads=spreads)
    assert known == {"b": 5.0, "c": 1.0}


# ---- the whole


def whole(monkeypatch, dataset, described, moved=(), disagree=None, extra=None):
    """Return what is said of a rig where some sensors moved, and what was asked on the way."""
    asked_of = []
    edges = [SimpleNamespace(edge=dataset.sensors[name].edge, moved=True) for name in moved]
    result = Drift(("rgb_1",), (), 20.0, 2, (), left_out=() if extra is None else (extra,))

    def told_apart(question, first):
        asked_of.append(question)
        return replace(result, edges=tuple(Marked(edge.edge) for edge in edges), left_out=())

    def disagreement(question, about):
        asked_of.append(about)
        return disagree

    monkeypatch.setattr(module, "_drift", lambda question, held: result)
    monkeypatch.setattr(module, "_told_apart", told_apart)
    monkeypatch.setattr(module, "disagreement", disagreement)
    monkeypatch.setattr(module, "_rests_on", lambda question: "000")
    return drift(dataset, described, {}), asked_of


class Marked(NamedTuple):
    """What stands for an edge that moved."""

    edge: Edge
    moved: bool = True


@pytest.fixture(scope="module")
def described(dataset):
    return {sensor.edge: np.eye(4) for sensor in dataset.sensors.values()}


def test_two_boards_are_enough_and_one_is_refused(monkeypatch, dataset, described):
    two = dataset.selected(collections=["000", "001"])
    assert whole(monkeypatch, two, described)[0].boards == 2
    unseen = two.with_labels("001", dict.fromkeys(two.collections["001"].labels))
    with pytest.raises(CalibrationError) as refusal:
        drift(unseen, described, {})
    assert str(refusal.value) == (
        f"{dataset.source}: 1 collection(s) with a board; whether the rig has moved takes 2 or more"
    )


def test_sensors_are_asked_where_they_are_described_in_all_collections(
    monkeypatch, dataset, described
):
    known = {edge: value for edge, value in described.items() if edge.child != "rgb_3_link"}
    known[Edge("another", "rig")] = np.eye(4)
    _, (question, _) = whole(monkeypatch, dataset, known)
    for key, collection in question.standing.collections.items():
        for name, sensor in dataset.sensors.items():
            own = dataset.collections[key].transforms[sensor.edge]
            wanted = own if name == "rgb_3" else np.eye(4)
            np.testing.assert_array_equal(collection.transforms[sensor.edge], wanted)
        assert Edge("another", "rig") not in collection.transforms


def test_labels_that_contradict_the_others_are_left_out_of_all_questions(
    monkeypatch, dataset, described
):
    odd = Rejected(DetectionKey("001", "rgb_2", BOARD), "odd", 9.0)
    found, (question, _) = whole(monkeypatch, dataset, described, extra=odd)
    assert found.left_out == (odd,) and question.standing.label(odd.key) is None


def test_boards_are_asked_of_those_that_moved_and_where_they_disagree_nobody_did(
    monkeypatch, dataset, described
):
    moved = ["rgb_2", "rgb_3"]
    found, (_, about) = whole(monkeypatch, dataset, described, moved, "they disagree")
    assert about == [dataset.sensors[name].edge for name in moved]
    assert found.disagreement == "they disagree" and not found.moved and found.rests_on is None


@pytest.mark.parametrize("moved, rests_on", [(["rgb_2"], "000"), ([], None)])
def test_only_a_move_rests_on_a_board(monkeypatch, dataset, described, moved, rests_on):
    found, _ = whole(monkeypatch, dataset, described, moved)
    assert len(found.moved) == len(moved) and found.rests_on == rests_on
    assert found.disagreement is None
