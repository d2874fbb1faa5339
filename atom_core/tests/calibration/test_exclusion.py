"""Too many rejections of a sensor, or all of one sort: named, and no `converged`."""

import itertools

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.judge import exclusion
from atom_core.calibration.judge.exclusion import DISTANCE, WHEN, chance_of_ranks, exclusions
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.preparation import prepare
from atom_core.calibration.refine.rejection import DISAGREES, GARBAGE, Rejected
from atom_core.synthetic import paper_cell, scenes
from atom_core.synthetic.mistakes import exchange, with_exchanged_data

DISTURBED = (0.05, 0.05)


def exchanged(dataset, sensor, share, rng):
    """Return the dataset with a sensor's labels and data exchanged among some collections."""
    taken_from = exchange(dataset, sensor, share, rng)
    return with_exchanged_data(dataset, sensor, taken_from), list(taken_from)


@pytest.fixture(scope="module")
def prepared():
    return prepare(scenes.random_scene(0, collections=80).dataset, CalibrationOptions())


def of(prepared, sensor, reason=DISAGREES):
    """Return the function: indices of a sensor's detections, nearest first -> their exclusions."""
    mine = [m for m in prepared.measurements if m.key.sensor == sensor]
    middle = np.append(next(iter(prepared.dataset.patterns.values())).border.centre, [0.0, 1.0])
    mine.sort(key=lambda m: np.linalg.norm((m.likely_candidates()[0] @ middle)[:3]))

    def judged(chosen):
        out = [Rejected(mine[i].key, reason, 1.0 + i) for i in chosen]
        return exclusions(prepared.dataset, prepared.measurements, out), mine

    return judged


@pytest.mark.parametrize("ties", [False, True])
def test_the_chance_is_that_of_all_choices(ties):
    rng = np.random.default_rng(0)
    values = rng.integers(0, 4, 9).astype(float) if ties else rng.normal(size=9)
    ranks = np.array([np.mean(np.flatnonzero(np.sort(values) == v)) for v in values])
    off = [abs(np.mean(ranks[list(c)]) - 4.0) for c in itertools.combinations(range(9), 3)]
    chosen = np.isin(np.arange(9), [1, 4, 7])
    expected = np.mean(np.array(off) >= abs(np.mean(ranks[chosen]) - 4.0) - 1e-9)
    assert chance_of_ranks(values, chosen) == pytest.approx(expected)
    assert chance_of_ranks(values, ~chosen) == pytest.approx(expected)


def test_many_are_judged_by_a_normal_distribution(monkeypatch):
    """Just beyond the limit the two ways give the same."""
    rng = np.random.default_rng(6)
    values = rng.normal(size=60)
    chosen = np.isin(np.arange(60), np.argsort(values + rng.normal(size=60))[:13])
    approximate = chance_of_ranks(values, chosen)
    monkeypatch.setattr(exclusion, "_EXACT", 13)
    exact = chance_of_ranks(values, chosen)
    assert 1e-6 < exact < 0.01 and exact != approximate
    assert approximate == pytest.approx(exact, rel=0.5)


def test_single_rejections_are_nothing(prepared):
    sensor = next(iter(prepared.dataset.sensors))
    found, mine = of(prepared, sensor)([0, len(prepared.dataset.collections) // 4])
    assert len(mine) > 30 and found == []


def test_few_that_are_all_near_are_of_one_sort(prepared):
    """Three of them, fewer than a tenth; the same number here and there is nothing."""
    sensor = next(iter(prepared.dataset.sensors))
    judged = of(prepared, sensor)
    (one,), mine = judged([0, 1, 2])
    assert len(mine) > 30 and one[:3] == (sensor, 3, len(mine))
    assert one.shared.feature == DISTANCE and one.shared.rejected < one.shared.kept
    assert one.collections == tuple(mine[i].key.collection for i in (2, 1, 0))
    assert "nearer" in one.why and "focal length" in one.likely[0]
    assert judged([0, len(mine) // 2, len(mine) - 1])[0] == []


def test_more_than_a_tenth_is_too_much(prepared):
    sensor = next(iter(prepared.dataset.sensors))
    judged = of(prepared, sensor)
    _, mine = judged([])
    spread = np.linspace(0, len(mine) - 1, len(mine) // 10 + 1).astype(int)
    (one,), _ = judged(spread)
    assert one.why.startswith(f"{len(spread)} of {len(mine)} detections of {sensor} contradict")
    assert "labels" in one.likely[0] and "most of them" not in one.why
    (garbage,), _ = of(prepared, sensor, GARBAGE)(spread)
    assert "fit no board" in garbage.likely[0]


@pytest.mark.parametrize("share", [pytest.param(0.2, marks=pytest.mark.long), 0.3])
def test_exchanged_labels_are_left_out_and_inconsistent(share):
    """The answer is right; that it is, a third of a sensor's labels being wrong, none can say."""
    scene = paper_cell(2, disturbance=DISTURBED)
    dataset, chosen = exchanged(scene.dataset, "lidar_1", share, np.random.default_rng([2, 77]))
    result = calibrate(dataset)
    assert {r.key for r in result.rejected} == {(key, "lidar_1", "pattern_1") for key in chosen}
    assert result.status == "inconsistent"
    (one,) = result.exclusions
    assert (one.sensor, one.rejected) == ("lidar_1", len(chosen))
    assert result.message == one.why and set(one.collections) == set(chosen)
    assert "labels and data belong to these collections" in one.likely[0]


@pytest.mark.long
def test_where_the_exchanged_ones_win_the_labels_are_named():
    """Four of ten exchanged: what is left may agree on something else, but never quietly."""
    scene = paper_cell(0, disturbance=(0.1, 0.1))
    dataset, _ = exchanged(scene.dataset, "lidar_1", 0.4, np.random.default_rng([0, 77]))
    result = calibrate(dataset)
    assert result.status == "inconsistent"
    assert "lidar_1" in result.message
    assert "labels and data belong to these collections" in result.message


def test_those_of_later_collections_alone_are_of_a_sensor_that_was_moved(prepared):
    judged = of(prepared, "rgb_2")
    mine = judged([])[1]
    later = [i for i, m in enumerate(mine) if m.key.collection >= "060"]
    (found,), _ = judged(later)
    assert found.shared.feature == WHEN and "most of them collected later" in found.why
    assert found.likely[0].startswith("whether it was moved meanwhile")
