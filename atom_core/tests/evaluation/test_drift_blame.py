"""Who is said to have moved, by what each sensor alone and all together tell."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))  # drift_results, which tests share

from drift_results import LIMIT, edge_drift, edge_of, moved_names, question, replaced, result

from atom_core.calibration.judge.judgement import INCONSISTENT
from atom_core.errors import CalibrationError
from atom_core.evaluation import drift as module
from atom_core.evaluation.changes import TOLD_M, TOLD_RAD, limit_of
from atom_core.evaluation.drift import Drift
from atom_core.evaluation.spreads import NO_SPREAD, Spread
from atom_core.model.caveats import Caveat
from atom_core.report.drift_report import drift_verdict
from atom_core.solvers.base import CONVERGED, FAILED, NOT_CONVERGED

# ---- what a result says of itself


@pytest.mark.parametrize("of_m, of_rad", [(1.0, 1.0), (1.001, 1.0), (1.0, 1.001)])
def test_an_edge_is_told_where_both_a_shift_and_a_turn_that_matter_are_found(of_m, of_rad):
    found = edge_drift("a", found_m=of_m * TOLD_M, found_rad=of_rad * TOLD_RAD)
    assert found.told == (of_m == of_rad == 1.0)


@pytest.mark.parametrize("moved", [(), ("b",)])
def test_a_sensor_whose_new_data_are_in_doubt_is_not_good_and_the_doubt_is_told_first(moved):
    doubt = Caveat(("b",), "two programs publish its mount", "record again")
    still = [(name, 1.0) for name in ("b", "c") if name not in moved]
    verdict = drift_verdict(result("a", moved=moved, still=still, caveats=(doubt,)))
    assert verdict.grade == ("wrong" if moved else "weak")
    assert verdict.sensors["b"].sentence.startswith(doubt.what)
    assert verdict.sensors["b"].advice == doubt.remedy
    assert verdict.sensors["c"].grade == verdict.sensors["a"].grade == "good"
    assert verdict.sentence.endswith("; but the new recording leaves b in doubt")


def test_only_moved_edges_are_among_those_that_moved():
    assert moved_names(result("a", moved=("c", "b"), still=[("d", 99.0)])) == ["c", "b"]


@pytest.mark.parametrize("disagreement", [None, "some"])
@pytest.mark.parametrize("contradiction", [None, "some"])
@pytest.mark.parametrize("moved", [(), ("b",)])
def test_boards_contest_a_result_by_disagreement_or_by_a_contradiction_that_no_move_explains(
    disagreement, contradiction, moved
):
    found = result("a", moved=moved, contradiction=contradiction, disagreement=disagreement)
    assert found.contested == bool(disagreement or (contradiction and not moved))


def test_where_boards_disagree_nobody_moved_and_figures_stay():
    found = result("a", moved=("b",), still=[("c", 3.0)])
    less = found.without_moved("some")
    assert not less.moved and less.disagreement == "some" and found.moved
    assert [edge.chi_square for edge in less.edges] == [100.0, 3.0]


# ---- the fewest that explain it


def test_whom_a_refusal_leaves_without_a_result_is_none(monkeypatch):
    def refuses(asked, held):
        raise CalibrationError(f"{asked} holds {held}")

    replaced(monkeypatch, _drift=refuses)
    assert module._or_none("question", "a") is None
    replaced(monkeypatch, _drift=lambda asked, held: (asked, held))
    assert module._or_none("question", "a") == ("question", ("a",))


def test_other_mistakes_are_not_hidden(monkeypatch):
    def fails(asked, held):
        raise KeyError(held)

    replaced(monkeypatch, _drift=fails)
    with pytest.raises(KeyError):
        module._or_none("question", "a")


def blamed(monkeypatch, first, rivals):
    """Return what is blamed, and who was held in turn."""
    held = []

    def or_none(asked, name):
        held.append(name)
        return rivals.get(name)

    replaced(monkeypatch, _or_none=or_none)
    return module._blamed(question("a", "b", "c", "d"), first), held


@pytest.mark.parametrize("moved", [(), ("b",)])
def test_one_that_moved_needs_no_other_explanation(monkeypatch, moved):
    first = result("a", moved=moved)
    rivals = {"b": result("b", moved=("a",))}
    assert blamed(monkeypatch, first, rivals) == (first, [])


def test_each_other_sensor_is_held_in_turn_and_the_fewest_are_blamed(monkeypatch):
    first = result("a", moved=("b", "c", "d"))
    two, one = result("b", moved=("a", "c")), result("d", moved=("a",))
    found, held = blamed(monkeypatch, first, {"b": two, "c": None, "d": one})
    assert found is one and held == ["b", "c", "d"]


@pytest.mark.parametrize("moved", [(), ("a", "c"), ("a", "c", "d")])
def test_who_explains_it_by_nobody_or_by_as_many_is_no_rival(monkeypatch, moved):
    first = result("a", moved=("b", "c"))
    found, _ = blamed(monkeypatch, first, {"b": result("b", moved=moved)})
    assert found is first


def test_of_as_few_the_one_that_leaves_least_is_blamed(monkeypatch):
    first = result("a", moved=("b", "c"))
    worse = result("b", moved=("a",), still=[("c", 5.0), ("d", 1.0)])
    better = result("c", moved=("a",), still=[("b", 4.0), ("d", 4.0)])
    for rivals in ({"b": worse, "c": better}, {"b": better, "c": worse}):
        assert blamed(monkeypatch, first, rivals)[0] is better


def test_what_is_left_is_the_largest_of_those_that_did_not_move():
    assert module._worst_left(result("a", moved=("b",), still=[("c", 2.0), ("d", 7.0)])) == 7.0
    assert module._worst_left(result("a", moved=("b",))) == 0.0


# ---- each alone


class Solved:
    """What stands for a calibration of which all but one edge were held."""

    def __init__(self, status, edge, spread):
        self.status, self.edge, self.spread = status, edge, spread


def each_alone(monkeypatch, answers, spreads=None):
    """Return who is told alone and whether others disagree, who was held, and known spreads."""
    names, held, known = list(answers), [], {}

    def calibrate(standing, options):
        held.append(options)
        (name,) = set(names) - set(options)
        if answers[name] is None:
            raise CalibrationError("nothing ties it")
        return Solved(answers[name], edge_of(name), "some")

    def one_edge(solved, standing, edge, described, limit):
        assert solved.edge == edge and limit == LIMIT
        known[edge.child] = described
        return edge_drift(edge.child)

    replaced(
        monkeypatch,
        calibrate=calibrate,
        edge_spread=lambda solved, edge: None if solved.status == "held" else np.eye(6),
        _edge_drift=one_edge,
    )
    asked = question(*names, spreads=spreads)
    found, disagree = module._each_alone(asked, [edge_of(name) for name in names], LIMIT)
    return [edge.child for edge in found], disagree, held, known


def test_each_is_asked_with_all_others_held(monkeypatch):
    found = each_alone(monkeypatch, dict.fromkeys("abc", CONVERGED))
    assert found[:2] == (["a", "b", "c"], False)
    assert found[2] == [("b", "c"), ("a", "c"), ("a", "b")]


@pytest.mark.parametrize("status", [None, FAILED, NOT_CONVERGED, "held"])
def test_one_that_cannot_be_solved_is_passed_over_and_no_disagreement(monkeypatch, status):
    answers = {"a": CONVERGED, "b": status, "c": CONVERGED}
    assert each_alone(monkeypatch, answers)[:2] == (["a", "c"], False)


def test_where_the_others_disagree_nothing_is_told_of_the_one(monkeypatch):
    answers = {"a": CONVERGED, "b": INCONSISTENT, "c": CONVERGED}
    assert each_alone(monkeypatch, answers)[:2] == (["a", "c"], True)


def test_one_that_was_held_is_known_as_the_others_are(monkeypatch):
    known = Spread(4.0 * np.eye(6), np.eye(6), 12)
    spreads = {edge_of("b"): known, edge_of("c"): NO_SPREAD}
    found = each_alone(monkeypatch, dict.fromkeys("abc", CONVERGED), spreads)[3]
    assert found["b"] is known
    for name in "ac":
        np.testing.assert_allclose(found[name].stated, 4.0 * np.eye(6))
        assert found[name].detections == 12


def test_what_is_held_is_known_as_the_best_of_the_others_in_the_mean_of_directions():
    one = Spread(np.diag([1.0, 2, 6, 10, 20, 30]), np.diag([9.0, 9, 9, 1, 1, 1]), 7)
    other = Spread(np.diag([4.0, 4, 4, 3, 3, 3]), np.diag([6.0, 7, 8, 2, 2, 2]), 5)
    found = module._of_the_held({edge_of("a"): one, edge_of("b"): other, edge_of("c"): NO_SPREAD})
    np.testing.assert_allclose(found.stated, np.diag([3.0, 3, 3, 3, 3, 3]))
    np.testing.assert_allclose(found.of_model, np.diag([7.0, 7, 7, 1, 1, 1]))
    assert found.detections == 5


def test_where_all_are_held_all_are_known_exactly():
    assert module._of_the_held({}) is NO_SPREAD
    assert module._of_the_held({edge_of("a"): NO_SPREAD}) is NO_SPREAD


# ---- both together


def told_apart(monkeypatch, first, alone, disagree=False, blames=None, names="abc"):
    """Return who moved, and who was held anew."""
    held = []

    def drift(asked, who):
        held.append(who)
        return result(who[0], still=[(n, 1.0) for n in names if n not in who])

    replaced(
        monkeypatch,
        _each_alone=lambda asked, edges, limit: ({e.edge: e for e in alone}, disagree),
        _blamed=lambda asked, found: blames or found,
        _drift=drift,
    )
    return module._told_apart(question(*names), first), held


def test_of_two_sensors_neither_can_be_asked_alone(monkeypatch):
    first, blames = result("a", moved=("b",)), result("b", moved=("a",))
    alone = [edge_drift("b", chi_square=3.0)]
    assert told_apart(monkeypatch, first, alone, blames=blames, names="ab") == (blames, [])


def test_of_three_nobody_moved_where_nobody_alone_did(monkeypatch):
    first = result("a", moved=("b",), still=[("c", 1.0)])
    found, held = told_apart(monkeypatch, first, [edge_drift("b", chi_square=3.0)])
    assert not found.moved and held == [] and found.edges[0].chi_square == 3.0
    assert found.limit == pytest.approx(limit_of(3))


def test_where_others_disagree_those_are_named_that_explain_it(monkeypatch):
    first = result("a", moved=("b", "c"))
    blames = result("c", moved=("a",), still=[("b", 1.0)])
    found, held = told_apart(monkeypatch, first, [], disagree=True, blames=blames)
    assert moved_names(found) == ["a"] and found.reference == ("c",) and held == []


def test_where_others_disagree_and_nothing_explains_it_nobody_moved(monkeypatch):
    first = result("a", still=[("b", 1.0), ("c", 1.0)])
    found, held = told_apart(monkeypatch, first, [edge_drift("c")], disagree=True)
    assert not found.moved and held == [] and found.reference == ("a",)


def test_who_explains_it_with_all_free_goes_before_who_seems_to_have_moved_alone(monkeypatch):
    first = result("a", moved=("b",), still=[("c", 1.0)])
    alone = [edge_drift("c", True, 500.0), edge_drift("b", False, 7.0)]
    found, held = told_apart(monkeypatch, first, alone)
    assert moved_names(found) == ["b"] and held == []
    assert {e.sensors[0]: e.chi_square for e in found.edges} == {"b": 7.0, "c": 500.0}


def test_else_the_one_that_moved_most_alone_is_named(monkeypatch):
    first = result("a", still=[("b", 1.0), ("c", 1.0)])
    alone = [edge_drift("b", True, 50.0), edge_drift("c", True, 60.0)]
    found, held = told_apart(monkeypatch, first, alone)
    assert moved_names(found) == ["c"] and held == []


def test_the_one_that_is_held_is_named_with_another_held(monkeypatch):
    first = result("a", still=[("b", 1.0), ("c", 1.0)])
    found, held = told_apart(monkeypatch, first, [edge_drift("a", True, 50.0)])
    assert held == [("b",)] and moved_names(found) == ["a"] and found.reference == ("b",)


def test_figures_are_those_of_each_alone_and_who_moved_is_told_apart():
    own = edge_drift(
        "b",
        moved=False,
        chi_square=9.0,
        beyond_detections=True,
        found_m=0.5,
        found_rad=0.25,
        beyond_usual=False,
    )
    found = module._asked_alone(
        result("a", still=[("b", 1.0), ("c", 2.0)]), {own.edge: own}, 11.0, [edge_of("b")]
    )
    of_b, of_c = found.edges
    assert of_b == own._replace(moved=True) and of_c == edge_drift("c", chi_square=2.0)
    assert found.limit == 11.0


def test_what_alone_is_told_is_no_longer_untold():
    blind = {"found_m": 1.0, "found_rad": 1.0}
    edges = (edge_drift("b", **blind), edge_drift("c", **blind))
    first = Drift(("a",), edges, LIMIT, 3, ("d", "b", "c"))
    found = module._asked_alone(first, {edge_of("b"): edge_drift("b")}, LIMIT, ())
    assert found.untold == ("d", "c")


# ---- on which board it rests


def rests_on(monkeypatch, moves, keys="012"):
    """Return the board that a move rests on; ``moves`` by the board left out, None: refused."""

    def drift(asked, held):
        if moves[asked] is None:
            raise CalibrationError("nothing ties it")
        return asked

    replaced(
        monkeypatch,
        _drift=drift,
        _told_apart=lambda asked, first: result("a", moved=("b",) if moves[asked] else ()),
    )
    return module._rests_on(question("a", "b", "c", collections=keys))


@pytest.mark.parametrize(
    "moves, rests",
    [
        ({"0": True, "1": False, "2": True}, "1"),
        ({"0": True, "1": True, "2": True}, None),
        ({"0": False, "1": True, "2": False}, None),
        ({"0": None, "1": True, "2": False}, "2"),
    ],
)
def test_a_move_rests_on_the_only_board_without_which_it_is_not_seen(monkeypatch, moves, rests):
    assert rests_on(monkeypatch, moves) == rests


def test_of_two_boards_none_can_be_spared(monkeypatch):
    assert rests_on(monkeypatch, {"0": True, "1": False}, "01") is None
