"""How a calibration is asked in parts: which parts, with what options, and what is not asked."""

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

sys.path.insert(0, str(Path(__file__).parent))  # trust_parts, which tests share

from trust_parts import BOARD, QUIET, calibration_of, parts_of, quiet_dataset, replaced

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.judge.judgement import INCONSISTENT
from atom_core.calibration.options import AUTO, DESCRIPTION, OFF, SUGGEST, CalibrationOptions
from atom_core.errors import CalibrationError
from atom_core.evaluation.trust import checks as module
from atom_core.evaluation.trust.checks import Compared, Predicted, limit_of, trust_checks
from atom_core.report.trust_report import contradictions
from atom_core.solvers.base import CONVERGED, FAILED, NOT_CONVERGED
from atom_core.synthetic import scenes


@pytest.fixture(scope="module")
def dataset():
    return quiet_dataset()


# ---- limits and figures


@pytest.mark.parametrize("count", [1, 2, 30])
def test_of_all_six_numbers_of_some_differences_a_hundredth_is_beyond_the_limit(count):
    chance = 2.0 * stats.norm.sf(limit_of(count))
    assert 6 * count * chance == pytest.approx(0.01)


def test_without_differences_the_limit_is_that_of_one():
    assert limit_of(0) == limit_of(1)


@pytest.mark.parametrize("joint, predicted, ratio", [(0.5, 1.75, 3.5), (0.0, 1e-12, 1.0)])
def test_residuals_grow_by_their_ratio(joint, predicted, ratio):
    compared = Compared(("a",), 1.0, 0.0, 0.0)
    assert Predicted(compared, "corner", joint, predicted).ratio == pytest.approx(ratio)


@pytest.mark.parametrize("ratio, told", [(1.49, False), (1.51, True)])
def test_residuals_that_grow_by_half_and_more_speak_against_a_calibration(ratio, told):
    one = Predicted(Compared(("a",), 1.0, 0.0, 0.0), "corner", 1.0, ratio)
    trust = module.Trust((), 0.0, (one,), 2.0, (), 0.0, ())
    assert bool(contradictions(trust)) == told


def test_a_difference_is_told_in_sigmas_metres_and_radians():
    numbers = np.array([0.3, 0.0, 0.4, 1.0, -2.0, 2.0])
    found = module._compared(("a", "b"), numbers, np.diag([1.0, 1, 1, 1, 0.25, 1]))
    assert found.names == ("a", "b") and found.sigmas == pytest.approx(4.0)
    assert found.translation_m == pytest.approx(3.0)
    assert found.rotation_rad == pytest.approx(0.5)


# ---- options of parts


@pytest.mark.parametrize("asked, of_parts", [(SUGGEST, OFF), (AUTO, AUTO), (OFF, OFF)])
def test_parts_look_for_errors_of_the_model_only_where_they_are_estimated(asked, of_parts):
    found = module._options(calibration_of(), CalibrationOptions(model_errors=asked))
    assert found.model_errors == of_parts


def test_parts_hold_and_estimate_what_the_whole_did_from_where_it_stands():
    asked = CalibrationOptions(
        initial_guess="none",
        noisy_initial_guess=(0.1, 0.2),
        keep_collections=("000",),
        keep_detections=(("000", "rgb_1"),),
        only_anchored_sensor=True,
        intrinsics=("rgb_1",),
    )
    found = module._options(calibration_of(("rgb_2",), ("tf",)), asked)
    assert found.anchor_sensors == ("rgb_2",) and found.additional_tfs == ("tf",)
    assert found.initial_guess == DESCRIPTION and found.noisy_initial_guess == (0.0, 0.0)
    assert found.keep_collections == () and found.keep_detections == ()
    assert found.only_anchored_sensor is False and found.intrinsics == ("rgb_1",)


def test_options_of_sensors_that_a_part_lacks_are_left_out(dataset):
    names = ("rgb_1", "lidar_1", "depth_1", "rgb_2")
    lists = ("anchor_sensors", "intrinsics", "range_offset", "range_scale")
    lists += ("depth_offset", "depth_scale")
    options = replace(QUIET, **dict.fromkeys(lists, names))
    part = dataset.selected(sensors=["rgb_2", "rgb_1"])
    found = module._of_sensors(options, part)
    assert all(getattr(found, name) == ("rgb_1", "rgb_2") for name in lists)
    assert module._of_sensors(options, dataset) == options


def test_only_collections_that_were_used_are_asked(dataset):
    calibration = calibration_of(dataset=dataset, unused=("000", "003"))
    keys = [key for key in dataset.collections if key not in ("000", "003")]
    assert module._used(calibration) == keys


# ---- what was read before


def test_what_was_read_is_shared_where_label_sensor_and_pattern_are_the_same(dataset):
    known = {key: f"read {key}" for key, _ in dataset.detections() if key.collection != "002"}
    part = dataset.selected(sensors=["rgb_1", "lidar_1"], collections=["000", "002"])
    parts = parts_of(dataset, known=known)
    wanted = [k for k in known if k.collection == "000" and k.sensor in ("rgb_1", "lidar_1")]
    assert wanted and parts.known_of(part) == {key: known[key] for key in wanted}
    label = dataset.collections["000"].labels["rgb_1", BOARD]
    relabeled = part.with_labels("000", {("rgb_1", BOARD): replace(label)})
    other = {**part.sensors, "rgb_1": replace(part.sensors["rgb_1"], topic="another")}
    of_lidar = [key for key in wanted if key.sensor == "lidar_1"]
    for changed in (relabeled, replace(part, sensors=other)):
        assert list(parts.known_of(changed)) == of_lidar
    patterns = {BOARD: replace(part.patterns[BOARD])}
    assert parts.known_of(replace(part, patterns=patterns)) == {}


# ---- a part is solved


def solved_part(monkeypatch, dataset, status, **changed):
    """Return what a part's calibration is, why it is untold, and the options it was asked with."""
    asked = []

    def solve(part, options, known):
        asked.append(options)
        if status is None:
            raise CalibrationError("nothing ties it")
        return SimpleNamespace(status=status, message="it is so")

    replaced(monkeypatch, solved=solve, judged=lambda found: found)
    parts = parts_of(dataset)
    return module._solved(dataset, parts, "a part", **changed), parts.untold, asked


@pytest.mark.parametrize("status", [CONVERGED, INCONSISTENT])
def test_a_part_that_converged_or_contradicts_itself_is_told(monkeypatch, dataset, status):
    found, untold, (options,) = solved_part(monkeypatch, dataset, status, anchor_patterns=True)
    assert found.status == status and untold == []
    assert options == replace(QUIET, anchor_patterns=True)


@pytest.mark.parametrize(
    "status, why", [(FAILED, "it is so"), (NOT_CONVERGED, "it is so"), (None, "nothing ties it")]
)
def test_why_a_part_has_no_answer_is_told(monkeypatch, dataset, status, why):
    found, untold, _ = solved_part(monkeypatch, dataset, status)
    assert found is None and untold == [f"a part: {why}"]


@pytest.mark.parametrize(
    "status, asked", [(CONVERGED, True), (INCONSISTENT, True), (FAILED, False)]
)
def test_only_what_can_be_trusted_is_asked(monkeypatch, dataset, status, asked):
    replaced(
        monkeypatch,
        stops_of=lambda problem, x: {problem: x},
        _halves=lambda whole, stops, parts: ["half"] if stops == {"problem": "x"} else [],
        _left_out=lambda c, whole, parts, name: None if name == "depth_1" else name,
        _loops=lambda whole, parts: parts.untold.extend(["why", "other", "why"]) or ["x", "y"],
        measured_detections=lambda whole: {},
    )
    trust = trust_checks(calibration_of(dataset=dataset, status=status))
    if not asked:
        why = "nothing was asked: the calibration is failed"
        assert trust == module.Trust((), 0.0, (), 0.0, (), 0.0, (why,))
        return
    assert trust.halves == ("half",) and trust.loops == ("x", "y")
    assert trust.left_out == ("rgb_1", "rgb_2", "lidar_1") and trust.untold == ("why", "other")
    limits = (trust.halves_limit, trust.left_out_limit, trust.loops_limit)
    assert limits == (limit_of(1), limit_of(3), limit_of(2))


# ---- two halves


def halves(monkeypatch, dataset, refused=(), stops=None):
    """Return what two halves differ in, why not, and the collections of each."""
    solved_of = []

    def solve(part, parts, what):
        solved_of.append(list(part.collections))
        free = SimpleNamespace(held_edges=lambda d: {d.sensors["rgb_1"].edge})
        index = len(solved_of) - 1
        return None if index in refused else SimpleNamespace(free=free, index=index)

    def differ(one, other, edge):
        assert (one.index, other.index) == (0, 1)
        return np.full(6, 2.0), np.eye(6)

    replaced(monkeypatch, _solved=solve, edge_difference=differ)
    parts = parts_of(dataset)
    return module._halves(dataset, stops or {}, parts), parts.untold, solved_of


def test_eight_collections_are_halved_in_turn_and_held_edges_are_not_told(monkeypatch, dataset):
    found, untold, (even, odd) = halves(monkeypatch, dataset)
    assert [one.names for one in found] == [("rgb_2",), ("depth_1",), ("lidar_1",)]
    keys = list(dataset.collections)
    assert (even, odd) == (keys[::2], keys[1::2]) and untold == []
    assert found[0].sigmas == pytest.approx(2.0)


def test_seven_collections_are_not_halved(monkeypatch, dataset):
    seven = dataset.selected(collections=list(dataset.collections)[:7])
    assert halves(monkeypatch, seven) == ([], ["two halves: 7 collections, it takes 8"], [])


def test_pictures_of_one_stop_are_in_one_half(monkeypatch, dataset):
    """They share what is wrong there: apart, both halves would be wrong alike, and agree."""
    collections = {
        f"{key}{picture}": collection
        for key, collection in dataset.collections.items()
        for picture in "ab"
    }
    twice = replace(dataset, collections=collections)
    stops = {key: f"{key[:-1]}a" for key in collections}
    _, untold, (even, odd) = halves(monkeypatch, twice, stops=stops)
    assert {key[:-1] for key in even} == set(list(dataset.collections)[::2])
    assert {key[:-1] for key in odd} == set(list(dataset.collections)[1::2])
    assert len(even) == len(odd) == len(dataset.collections) and untold == []


def test_eight_pictures_of_four_stops_are_not_halved(monkeypatch, dataset):
    stops = {key: f"{int(key) // 2}" for key in dataset.collections}
    why = "two halves: 8 collections in 4 place(s) only, it takes 8"
    assert halves(monkeypatch, dataset, stops=stops) == ([], [why], [])


@pytest.mark.parametrize("refused", [(0,), (1,), (0, 1)])
def test_one_half_without_an_answer_tells_nothing(monkeypatch, dataset, refused):
    assert halves(monkeypatch, dataset, refused)[0] == []


# ---- one sensor left out


def without(dataset, sensor):
    for key in dataset.collections:
        dataset = dataset.with_labels(key, {(sensor, BOARD): None})
    return dataset


@pytest.mark.parametrize("name, of_use", [("rgb_1", False), ("depth_1", True), ("lidar_1", True)])
def test_a_camera_needs_another_camera_to_place_a_board_and_a_range_sensor_any(
    dataset, name, of_use
):
    fewer = without(dataset, "rgb_2")
    others = [other for other in dataset.sensors if other not in (name, "rgb_1")]
    found = module._of_use(fewer, others, name, dataset)
    seen = [
        key
        for key, c in fewer.collections.items()
        if (name, BOARD) in c.labels and any((other, BOARD) in c.labels for other in others)
    ]
    assert seen and found == (seen if of_use else [])


def test_only_collections_in_which_another_camera_sees_the_same_board_are_of_use(dataset):
    both = [
        key
        for key, c in dataset.collections.items()
        if {("rgb_1", BOARD), ("rgb_2", BOARD)} <= set(c.labels)
    ]
    assert len(both) > 2
    gone = dataset.with_labels(both[0], {("rgb_2", BOARD): None})
    label = gone.collections[both[1]].labels["rgb_2", BOARD]
    gone = gone.with_labels(both[1], {("rgb_2", BOARD): None, ("rgb_2", "other"): label})
    found = module._of_use(gone, ["rgb_2", "lidar_1"], "rgb_1", dataset)
    assert found == both[2:]


def left_out(monkeypatch, whole, name, *, anchored=("rgb_1",), seen=None, solved=None):
    """Return a sensor by the boards of the others, why not, and how both parts were asked."""
    calls = []

    def solve(part, parts, what, **changed):
        calls.append((part, what, changed))
        found = None if solved is None else solved[len(calls) - 1]
        return None if found is False else SimpleNamespace(dataset=part, unused={})

    of_use = list(whole.collections)[1:3] if seen is None else seen
    replaced(
        monkeypatch,
        _solved=solve,
        _of_use=lambda alone, others, name, dataset: of_use,
        _grown=lambda before, after, name: ("corner", 1.0, 2.0),
        _spread=lambda calibration, edge: 2.0 * np.eye(6),
    )
    parts = parts_of(whole, replace(QUIET, anchor_sensors=anchored))
    calibration = calibration_of(dataset=whole)
    return module._left_out(calibration, whole, parts, name), parts.untold, calls


@pytest.mark.parametrize(
    "name, anchored, held",
    [
        ("rgb_2", ("rgb_1",), ("rgb_1",)),
        ("rgb_1", ("rgb_1",), ("rgb_2",)),
        ("rgb_1", ("rgb_1", "lidar_1"), ("lidar_1",)),
        ("rgb_2", (), ("rgb_1",)),
    ],
)
def test_one_of_the_others_is_held_and_then_the_boards_are(
    monkeypatch, dataset, name, anchored, held
):
    found, untold, (rest, alone) = left_out(monkeypatch, dataset, name, anchored=anchored)
    assert untold == [] and rest[1] == alone[1] == f"without {name}"
    assert list(rest[0].sensors) == [other for other in dataset.sensors if other != name]
    assert rest[2] == {"anchor_sensors": held, "ignore_anchored_sensor": True}
    assert list(alone[0].sensors) == [name]
    assert list(alone[0].collections) == list(dataset.collections)[1:3]
    assert alone[2] == {
        "anchor_sensors": (),
        "anchor_patterns": True,
        "ignore_anchored_sensor": True,
    }
    assert found.compared == Compared((name,), 0.0, 0.0, 0.0) and found[1:] == ("corner", 1.0, 2.0)


@pytest.mark.parametrize("solved, asked", [((False, True), 1), ((True, False), 2)])
def test_without_the_others_or_without_itself_nothing_is_told(monkeypatch, dataset, solved, asked):
    found, _, calls = left_out(monkeypatch, dataset, "rgb_2", solved=solved)
    assert found is None and len(calls) == asked


def test_where_no_other_tells_which_way_round_it_is_said(monkeypatch, dataset):
    found, untold, calls = left_out(monkeypatch, dataset, "rgb_1", seen=[])
    assert found is None and len(calls) == 1
    assert untold == [
        "without rgb_1: no other sensor tells which way round a board is that it sees"
    ]


def test_that_one_of_two_is_not_calibrated_alone_goes_without_saying():
    calibration = calibrate(scenes.two_cameras(0, collections=8).dataset, QUIET)
    trust = trust_checks(calibration, QUIET)
    assert not trust.left_out and not [text for text in trust.untold if "without" in text]


def test_a_sensor_that_is_alone_is_not_left_out(monkeypatch, dataset):
    alone = dataset.selected(sensors=["rgb_1"])
    assert left_out(monkeypatch, alone, "rgb_1") == (None, [], [])


def test_the_kind_that_grows_most_is_told_of_those_that_both_have(monkeypatch):
    tables = [
        {
            ("a", "x", None): 2.0,
            ("a", "y", None): 1.0,
            ("a", "z", None): 1.0,
            ("b", "x", None): 1.0,
        },
        {
            ("a", "x", None): 6.4,
            ("a", "y", None): 3.9,
            ("a", "w", None): 9.0,
            ("b", "x", None): 9.0,
        },
    ]
    stated = [{k: SimpleNamespace(mean=v) for k, v in table.items()} for table in tables]
    calibrations = [SimpleNamespace(problem=i, summary=SimpleNamespace(x=None)) for i in (0, 1)]
    replaced(monkeypatch, residual_table=lambda problem, x: stated[problem])
    assert module._grown(*calibrations, "a") == ("y", 1.0, 3.9)


def test_residuals_of_nothing_grow_without_bound(monkeypatch):
    tables = [
        {("a", "x", None): 0.0, ("a", "y", None): 1.0},
        {("a", "x", None): 1e-9, ("a", "y", None): 9.0},
    ]
    stated = [{k: SimpleNamespace(mean=v) for k, v in table.items()} for table in tables]
    calibrations = [SimpleNamespace(problem=i, summary=SimpleNamespace(x=None)) for i in (0, 1)]
    replaced(monkeypatch, residual_table=lambda problem, x: stated[problem])
    assert module._grown(*calibrations, "a") == ("x", 0.0, 1e-9)


def test_an_edge_that_is_held_has_no_spread(monkeypatch):
    replaced(monkeypatch, edge_spread=lambda calibration, edge: calibration)
    np.testing.assert_array_equal(module._spread(None, "edge"), np.zeros((6, 6)))
    assert module._spread("some", "edge") == "some"


# ---- the whole


def test_a_sound_rig_is_within_the_limit_by_each_question():
    calibration = calibrate(
        scenes.random_scene(1, rgb=3, depth=0, lidar3d=0, collections=12).dataset, QUIET
    )
    trust = trust_checks(calibration, QUIET)
    names = ["rgb_1", "rgb_2", "rgb_3"]
    assert [one.names for one in trust.halves] == [("rgb_2",), ("rgb_3",)]
    assert [one.compared.names for one in trust.left_out] == [(name,) for name in names]
    assert [one.names for one in trust.loops] == [tuple(names)] and trust.untold == ()
    found = (*trust.halves, *(left.compared for left in trust.left_out), *trust.loops)
    for one in found:
        assert 0.0 < one.sigmas < limit_of(2)
        assert 0.0 < one.translation_m < 0.05 and 0.0 < one.rotation_rad < 0.05
    assert all(0.8 < left.ratio < 1.25 for left in trust.left_out)
