"""Has the rig moved? In short; over 200 rigs: tests/benchmarks/bench_drift.py."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import OFF, CalibrationOptions
from atom_core.errors import CalibrationError
from atom_core.evaluation.drift import drift
from atom_core.evaluation.edge_spread import known_spread
from atom_core.evaluation.spreads import Spread
from atom_core.geometry import se3
from atom_core.report.drift_report import drift_verdict
from atom_core.report.edge_results import selected_edges
from atom_core.synthetic import Noise, scenes
from atom_core.synthetic.realism import PLAIN

NEW = 3


def rig(seed, **scene):
    """Return three new boards that all sensors see, and what the other boards tell of the rig."""
    scene = {"rgb": 3, "depth": 0, "lidar3d": 0, "collections": 20, **scene}
    dataset = scenes.random_scene(seed, **scene).dataset
    whole = [k for k, c in dataset.collections.items() if len(c.labels) == len(dataset.sensors)]
    new = whole[:NEW]
    rest = dataset.selected(collections=[k for k in dataset.collections if k not in new])
    solved = calibrate(rest, CalibrationOptions(model_errors=OFF))
    edges = selected_edges(solved)
    spreads = {edge: known_spread(solved, edge) for edge in edges}
    return dataset.selected(collections=new), edges, spreads


@pytest.fixture(scope="module")
def rigs():
    return [rig(seed) for seed in (1, 2, 3, 5)]


def test_rigs_that_did_not_move_stand(rigs):
    for new, described, spreads in rigs:
        found = drift(new, described, spreads)
        assert not found.moved and found.boards == NEW and found.reference == ("rgb_1",)
        squares = [edge.chi_square for edge in found.edges]
        assert len(squares) == 2 and np.mean(squares) < found.limit


@pytest.mark.sampled(1)
@pytest.mark.parametrize("sensor", ["rgb_1", "rgb_3"])
def test_what_moved_by_5_mm_is_named_also_where_it_is_the_reference(rigs, sensor):
    rng = np.random.default_rng(0)
    named = 0
    for new, described, spreads in rigs:
        edge = new.sensors[sensor].edge
        moved = {**described, edge: se3.moved(described[edge], se3.random_move(0.005, 0.0, rng))}
        found = drift(new, moved, spreads)
        assert found.moved
        named += [edge.sensors for edge in found.moved] == [(sensor,)]
    assert named >= len(rigs) - 1


@pytest.mark.long
def test_a_turn_of_a_quarter_degree_is_found(rigs):
    rng = np.random.default_rng(1)
    for new, described, spreads in rigs:
        edge = new.sensors["rgb_2"].edge
        turn = se3.random_move(0.0, np.radians(0.25), rng)
        assert drift(new, {**described, edge: se3.moved(described[edge], turn)}, spreads).moved


def test_what_is_found_from_is_found(rigs):
    new, described, spreads = rigs[0]
    limit = drift(new, described, spreads).edges[0]
    assert 0.0005 < limit.found_m < 0.02 and limit.told
    move = se3.random_move(1.5 * limit.found_m, 0.0, np.random.default_rng(2))
    moved = {**described, limit.edge: se3.moved(described[limit.edge], move)}
    assert drift(new, moved, spreads).moved


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "shift_m, turn_rad", [(0.0004, 0.0), (0.0, 0.0003), (0.0006, 0.0), (0.0, 0.0004)]
)
def test_a_trifle_is_no_move_however_sure(shift_m, turn_rad):
    new, described, _ = rig(1, noise=Noise(corner_px=1e-3))
    rng, edge = np.random.default_rng(3), new.sensors["rgb_2"].edge
    known = dict.fromkeys(described, Spread(1e-12 * np.eye(6), 1e-12 * np.eye(6)))
    moved = se3.moved(described[edge], se3.random_move(shift_m, turn_rad, rng))
    found = drift(new, {**described, edge: moved}, known)
    of_edge = next(e for e in found.edges if e.edge == edge)
    assert of_edge.chi_square > 10.0 * found.limit
    assert of_edge.moved == (shift_m > 0.0005 or turn_rad > np.radians(0.02))


def test_a_range_sensors_move_is_told_later_where_few_detections_told_its_scatter():
    new, described, spreads = rig(4, rgb=2, lidar3d=1)
    edge, by_count = new.sensors["lidar_1"].edge, {}
    move = se3.random_move(0.015, 0.0, np.random.default_rng(0))
    described = {**described, edge: se3.moved(described[edge], move)}
    for count in (3, 3000):
        known = {edge: spread._replace(detections=count) for edge, spread in spreads.items()}
        found = drift(new, described, known)
        by_count[count] = {name: e for e in found.edges for name in e.sensors}
    few, many = by_count[3], by_count[3000]
    assert few["lidar_1"].found_m > 1.5 * many["lidar_1"].found_m
    assert few["lidar_1"].chi_square < many["lidar_1"].chi_square
    assert few["rgb_2"].found_m == pytest.approx(many["rgb_2"].found_m)


def test_what_usual_errors_explain_is_marked(rigs):
    new, described, spreads = rigs[0]
    edge = new.sensors["rgb_2"].edge
    move = se3.random_move(0.2, 0.0, np.random.default_rng(4))
    moved = {**described, edge: se3.moved(described[edge], move)}
    for usual, beyond in ((1e-12, True), (1.0, False)):
        loose = {e: spread._replace(usual=usual * np.eye(6)) for e, spread in spreads.items()}
        (found,) = (e for e in drift(new, moved, loose).edges if e.edge == edge)
        assert found.moved and found.beyond_usual == beyond


def test_one_board_is_refused(rigs):
    new, described, spreads = rigs[0]
    one = new.selected(collections=list(new.collections)[:1])
    with pytest.raises(CalibrationError, match="takes 2 or more"):
        drift(one, described, spreads)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("shift_px, least", [(3.0, 3), (8.0, 0)])
def test_a_wrong_label_is_not_told_as_a_move_alone(rigs, shift_px, least):
    """A board that moved between two pictures, say: the others do not say so."""
    named = 0
    for new, described, spreads in rigs:
        key = list(new.collections)[1]
        label = new.collections[key].labels["rgb_2", "pattern_1"]
        wrong = replace(label, pixels=label.pixels + [shift_px, 0.0])
        bad = new.with_labels(key, {("rgb_2", "pattern_1"): wrong})
        try:
            found = drift(bad, described, spreads)
        except CalibrationError as refused:
            assert "detections contradict the others" in str(refused)
            continue
        said = drift_verdict(found).sentence
        if found.disagreement is not None:
            assert not found.moved and "the new boards disagree on" in said
            named += found.disagreement.odd.collection == key
        elif found.moved:
            assert found.rests_on == key or found.contradiction is not None
            assert f"collection {key}" in said or "contradict themselves" in said
            named += found.rests_on == key
        else:
            assert found.left_out or found.contested
            named += [r.key.collection for r in found.left_out] == [key]
    assert named >= least


def test_boards_agree_on_what_moved(rigs):
    move = se3.random_move(0.01, np.radians(0.3), np.random.default_rng(4))
    for new, described, spreads in rigs:
        edge = new.sensors["rgb_2"].edge
        found = drift(new, {**described, edge: se3.moved(described[edge], move)}, spreads)
        assert found.moved and found.disagreement is None and found.rests_on is None
        assert drift_verdict(found).sentence.startswith("the rig has moved: rgb_2 by")


@pytest.mark.sampled(2)
@pytest.mark.parametrize("kind", ["hand_eye", "board_on_arm"])
@pytest.mark.parametrize("seed", [0, 1])
def test_an_arm_that_repeats_to_half_a_millimetre_is_no_move(kind, seed):
    realism = replace(PLAIN, moving_edge_sigma_m=0.0005, moving_edge_sigma_rad=0.0009)
    dataset = getattr(scenes, kind)(seed, collections=24, realism=realism).dataset
    keys = list(dataset.collections)
    new, rest = (dataset.selected(collections=part) for part in (keys[:4], keys[4:]))
    solved = calibrate(rest)
    edges = selected_edges(solved)
    spreads = {edge: known_spread(solved, edge) for edge in edges}
    moving = {edge.child: (p.sigma_m, p.sigma_rad) for edge, p in solved.free.moving.items()}
    assert list(moving) == ["flange"]
    found = drift(new, edges, spreads, moving=moving)
    assert not found.moved and not found.contested
    (edge,) = edges
    move = se3.random_move(2.0 * found.edges[0].found_m, 0.0, np.random.default_rng(seed))
    moved = {edge: se3.moved(edges[edge], move)}
    assert drift(new, moved, spreads, moving=moving).moved
