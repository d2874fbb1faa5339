"""Two calibrations against one another."""

import json

import numpy as np
import pytest

from atom_core.evaluation.changes import changes, held_apart, held_elsewhere, limit_of
from atom_core.evaluation.spreads import spreads_of
from atom_core.geometry import se3
from atom_core.model.edge_state import EdgeState, ParameterState
from atom_core.model.transforms import Edge
from atom_core.report.changes_report import (
    changes_document,
    changes_sentence,
    changes_table,
    changes_verdict,
)
from atom_core.report.page.given import Given
from atom_core.report.page.trust_sections import changes_section

SIGMA = np.array([1e-4] * 3 + [1e-3] * 3)


def test_of_what_is_known_to_decimetres_nothing_is_told():
    known, loose = state("a"), state("b")._replace(sigma=1e2 * SIGMA)
    loose = loose._replace(covariance=np.diag(loose.sigma**2), model_sigma=loose.sigma)
    found = changes([known, loose], [known, loose])
    assert not found.moved and [change.edge.child for change in found.untold] == ["b"]
    assert changes_sentence(found) == "nothing is seen to differ, but of b nothing is told"
    document = changes_document(found, "before", "after")
    assert [edge["verdict"] for edge in document["edges"].values()] == ["same", "not_told"]


def state(name, anchored=False, pose=None, combined=None):
    pose = np.eye(4) if pose is None else pose
    spread = np.diag(SIGMA**2)
    return EdgeState(Edge("base", name), (name,), anchored, pose, SIGMA, spread, SIGMA, combined)


def shifted(metres):
    return se3.transform(np.eye(3), np.array([metres, 0.0, 0.0]))


def test_a_difference_counts_in_the_joint_covariance():
    found = changes([state("a")], [state("a", pose=shifted(0.003))])
    (change,) = found.edges
    assert change.chi_square == pytest.approx(9.0 / 2.0)
    assert not change.moved and not found.moved
    (change,) = changes([state("a")], [state("a", pose=shifted(0.010))]).edges
    assert change.moved and change.beyond_usual


def test_a_turn_counts_about_the_parents_axes():
    turn = se3.transform(se3.rotation_from_rotation_vector(np.array([0, 1e-3, 0])), np.zeros(3))
    (change,) = changes([state("a")], [state("a", pose=turn)]).edges
    assert change.moved and change.change.turn_rad[1] == pytest.approx(1e-3)


def test_usual_errors_may_explain_it():
    wide = 20.0 * SIGMA
    before, after = state("a", combined=wide), state("a", pose=shifted(0.010), combined=wide)
    (change,) = changes([before], [after]).edges
    assert change.moved and not change.beyond_usual


def test_what_is_held_or_in_one_only_is_not_compared():
    before = [state("held", True), state("a"), state("gone")]
    found = changes(before, [state("held", True), state("a"), state("new")])
    assert [c.edge.child for c in found.edges] == ["a"]
    assert [edge.child for edge in found.held] == ["held"]
    assert list(found.only_in_one) == ["base-gone", "base-new"]
    assert held_apart([state("a", True)], [state("a")]) == [Edge("base", "a")]


def test_of_a_sensor_that_one_of_the_two_lacks_nothing_is_told():
    found = changes([state("a"), state("gone")], [state("a")])
    assert not found.moved and changes_verdict(found).grade == "weak"
    assert changes_sentence(found).endswith("of gone nothing is told: it is in one of the two only")


def test_where_all_seem_to_have_moved_it_may_be_the_one_that_is_held():
    held, still, moved = state("held", True), state("b"), state("a", pose=shifted(0.1))
    found = changes([held, state("a")], [held, moved])
    assert "a moved (or held, against which the others are told)" in changes_sentence(found)
    found = changes([held, state("a"), still], [held, moved, still])
    assert changes_sentence(found).endswith("differ: a moved")


def test_what_is_held_in_two_places_is_named_with_how_far():
    before, after = [state("held", True), state("a")], [state("held", True, shifted(0.005))]
    ((found, error),) = held_elsewhere(before, [*after, state("a", pose=shifted(0.1))])
    assert found.edge.child == "held" and error.translation_m == pytest.approx(0.005)
    assert not held_elsewhere(before, [state("held", True, shifted(1e-6)), state("a")])


def test_the_limit_is_that_of_six_numbers_shared_by_the_edges():
    assert limit_of(1) == pytest.approx(16.812, abs=1e-3)  # chi-square tables, 6 degrees, 1 %
    assert limit_of(2) == pytest.approx(18.548, abs=1e-3)  # 0.5 %
    assert limit_of(0) == limit_of(1)


def test_what_the_noise_alone_tells_is_the_stated_covariance_in_its_own_sigmas():
    turned = np.diag(SIGMA) @ (np.eye(6) + 0.5 * np.eye(6, k=1) + 0.5 * np.eye(6, k=-1))
    covariance = turned @ turned.T
    sigma = np.sqrt(np.diagonal(covariance))
    ratio = np.array([1.0, 0.5, 0.25, 0.2, 0.1, 0.5])
    edge = state("a")._replace(sigma=sigma, covariance=covariance, model_sigma=ratio * sigma)
    spreads = spreads_of([edge._replace(detections=7), state("held", anchored=True)])
    found = spreads[edge.edge]
    np.testing.assert_allclose(found.stated, covariance)
    np.testing.assert_allclose(found.of_model, np.diag(ratio) @ covariance @ np.diag(ratio))
    assert found.detections == 7 and not np.any(spreads[Edge("base", "held")].stated)


def test_one_rig_in_a_hundred_is_called_moved_at_most():
    rng, edges, alarms = np.random.default_rng(0), 3, 0
    for _ in range(1500):
        after = []
        for i in range(edges):
            turn, shift = (np.sqrt(2.0) * SIGMA * rng.standard_normal(6)).reshape(2, 3)
            pose = se3.transform(se3.rotation_from_rotation_vector(turn), shift)
            after.append(state(str(i), pose=pose))
        alarms += bool(changes([state(str(i)) for i in range(edges)], after).moved)
    assert 0.003 < alarms / 1500 < 0.015
    assert limit_of(1) < limit_of(10)


def joint(bias, sigma=1e-3, name="elbow", unit="rad"):
    return ParameterState(name, "position_bias", unit, bias, sigma)


def test_a_joint_that_moved_is_named():
    same = [state("a")], [state("a")]
    found = changes(*same, [joint(0.02)], [joint(0.021)])
    assert not found.moved and changes_sentence(found).startswith("the two calibrations are the")
    found = changes(*same, [joint(0.02)], [joint(0.04)])
    assert changes_sentence(found) == "the two calibrations differ: elbow position_bias moved"
    document = changes_document(found, "before", "after")
    assert document["joints"]["elbow position_bias"]["verdict"] == "moved"
    assert document["verdict"]["grade"] == "wrong"
    assert "elbow position_bias" in changes_table(found)


def test_a_joints_one_number_has_a_limit_of_its_own_which_is_told():
    """Between the two limits a joint has moved, and an edge has not; tables name both."""
    found = changes([state("a")], [state("a")], [joint(0.02)], [joint(0.024)])
    (of_joint,) = found.joints
    assert of_joint.chi_square == pytest.approx(8.0) and of_joint.moved
    assert found.joint_limit < of_joint.chi_square < found.limit
    assert f"one number beyond {found.joint_limit:.1f}" in changes_table(found)
    document = json.loads(json.dumps(changes_document(found, "before", "after")))
    assert document["joints"]["elbow position_bias"]["chi_square"] == of_joint.chi_square
    (section,) = changes_section(Given(None, None, changes=(document,)))
    table = section.blocks[-1]
    assert table.rows[-1][-1] == "8.00" and "8.00" in changes_table(found)
    assert (
        f"beyond {found.limit:.1f} (of a joint's one number {found.joint_limit:.1f})" in table.note
    )
    alone = changes([state("a")], [state("a")])
    assert "one number" not in changes_table(alone)
    assert changes_document(alone, "a", "b")["limit_chi_square_of_joints"] is None


def test_a_full_turn_of_a_joint_is_no_move():
    found = changes([], [], [joint(-np.pi)], [joint(np.pi)])
    assert not found.moved and found.joints[0].change == pytest.approx(0.0, abs=1e-12)
    assert changes([], [], [joint(0.0, unit="m")], [joint(2 * np.pi, unit="m")]).moved


def test_a_joint_of_one_calibration_only_is_named_and_one_known_badly_tells_nothing():
    found = changes([], [], [joint(0.0), joint(0.0, 1.0, "wrist")], [joint(0.0, 1.0, "wrist")])
    assert found.only_in_one == ("elbow position_bias",)
    assert [change.name for change in found.untold] == ["wrist position_bias"]


def test_an_edge_with_a_value_for_each_collection_is_not_compared():
    odometry = state("base")._replace(collection="003")
    elsewhere = odometry._replace(parent_T_child=shifted(0.5))
    found = changes([state("a"), odometry], [state("a"), elsewhere])
    assert not found.moved and found.by_collection == (odometry.edge,)
    assert "has a value for each collection, not compared: base-base" in changes_table(found)


def test_nothing_compared_is_not_good():
    assert changes_verdict(changes([], [])).grade == "weak"
    same = changes([state("a")], [state("a")])
    assert changes_verdict(same).grade == "good"
    assert changes_verdict(same, ["the first one did not converge"]).grade == "weak"


def test_joints_raise_no_more_false_alarms():
    rng, alarms = np.random.default_rng(1), 0
    for _ in range(3000):
        old, new = (
            [joint(v, name=str(i)) for i, v in enumerate(row)]
            for row in 1e-3 * rng.standard_normal((2, 4))
        )
        alarms += bool(changes([], [], old, new).moved)
    assert 0.005 < alarms / 3000 < 0.015
