"""One edge before and now: what counts as a move, and by what it is judged."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

sys.path.insert(0, str(Path(__file__).parent))  # drift_results, which tests share

from drift_results import LIMIT, edge_drift, edge_of, replaced, rig_of

from atom_core.evaluation import drift as module
from atom_core.evaluation.changes import TOLD_M
from atom_core.evaluation.edge_errors import PoseError
from atom_core.evaluation.spreads import NO_SPREAD, Spread
from atom_core.problem.blocks import ROTATION, TRANSLATION

# ---- one edge


def of_edge(
    monkeypatch, shift_m=0.0, turn_rad=0.0, sigma=1e-4, freedom_of=None, new=NO_SPREAD, **spread
):
    """Return the drift of an edge that new boards tell so well, described with one sigma."""
    edge = edge_of("b")
    change = PoseError(np.array([shift_m, 0.0, 0.0]), np.array([turn_rad, 0.0, 0.0]))
    ranging = SimpleNamespace(measures_range=freedom_of == "range")
    sensors = {
        name: SimpleNamespace(name=name, edge=edge_of(name), kind=kind)
        for name, kind in (
            ("a", SimpleNamespace(measures_range=freedom_of == "another")),
            ("b", ranging),
        )
    }
    standing = rig_of(sensors, {"0": SimpleNamespace(transforms={edge: None})})
    solved = SimpleNamespace(dataset=standing)
    replaced(monkeypatch, known_spread=lambda s, e: new, pose_error=lambda one, other: change)
    described = Spread(sigma**2 * np.eye(6), sigma**2 * np.eye(6), **spread)
    return module._edge_drift(solved, standing, edge, described, LIMIT)


@pytest.mark.parametrize("part", ["shift_m", "turn_rad"])
@pytest.mark.parametrize("factor, moved", [(0.99, False), (1.01, True)])
def test_a_smaller_change_than_the_least_is_no_move_however_sure(monkeypatch, part, factor, moved):
    least = {"shift_m": module.LEAST_M, "turn_rad": module.LEAST_RAD}[part]
    found = of_edge(monkeypatch, sigma=1e-7, **{part: factor * least})
    assert found.chi_square > LIMIT and found.moved == moved
    assert found.edge == edge_of("b") and found.sensors == ("b",)


def test_the_least_is_half_a_millimetre_or_a_fiftieth_of_a_degree():
    assert pytest.approx(0.0005) == module.LEAST_M
    assert pytest.approx(np.pi / 180.0 / 50.0) == module.LEAST_RAD


def test_what_is_found_from_is_of_shifts_in_metres_and_of_turns_in_radians(monkeypatch):
    found = of_edge(monkeypatch)
    for part, size in ((TRANSLATION, found.found_m), (ROTATION, found.found_rad)):
        wanted = module.found_from(1e-8 * np.eye(6), LIMIT, np.inf, part)
        assert size == pytest.approx(wanted)
    wider = of_edge(monkeypatch, sigma=2e-4)
    assert wider.found_m == pytest.approx(2.0 * found.found_m, rel=1e-6)


def test_where_boards_tell_little_a_move_is_larger_than_what_they_would_notice(monkeypatch):
    sigma = 0.01  # of which no move below 2 cm is found
    found = of_edge(monkeypatch, shift_m=0.0, sigma=sigma)
    assert not found.told and found.found_m > TOLD_M
    least = 1.001 * just_beyond() * sigma / 1e-4
    assert of_edge(monkeypatch, shift_m=least, sigma=sigma).chi_square > LIMIT
    assert least < found.found_m
    assert not of_edge(monkeypatch, shift_m=least, sigma=sigma).moved
    assert of_edge(monkeypatch, shift_m=1.01 * found.found_m, sigma=sigma).moved
    assert of_edge(monkeypatch, turn_rad=1.01 * found.found_rad, sigma=sigma).moved


def test_usual_errors_are_added_to_what_both_are_known_by(monkeypatch):
    wide = {"usual": 1e-2 * np.eye(6)}
    assert of_edge(monkeypatch, shift_m=0.01, **wide).moved
    assert not of_edge(monkeypatch, shift_m=0.01, **wide).beyond_usual
    assert of_edge(monkeypatch, shift_m=0.01).beyond_usual


HALF = 0.5e-8 * np.eye(6)  # half as much again as the description's variance
ZERO_6 = np.zeros((6, 6))


def just_beyond():
    """Return the smallest shift [m] beyond the limit: asked with 0.45 of all false alarms."""
    alarms = stats.chi2.sf(LIMIT, 6)
    of_shifts = stats.chi2.isf(1.0 - (1.0 - alarms) ** 0.45, 3)
    return np.sqrt(of_shifts * 1e-8)


def beyond_at(monkeypatch, name, **known):
    """Tell at which multiples of the smallest shift a question is answered by yes."""
    least = just_beyond()
    return [
        getattr(of_edge(monkeypatch, shift_m=factor * least, **known), name)
        for factor in (1.1, 1.3, 1.5)
    ]


@pytest.mark.parametrize(
    "known, beyond",
    [
        ({}, [True, True, True]),
        ({"usual": HALF}, [False, True, True]),
        ({"new": NO_SPREAD._replace(usual=HALF)}, [False, True, True]),
        ({"usual": HALF, "new": NO_SPREAD._replace(usual=HALF)}, [False, False, True]),
    ],
)
def test_usual_errors_of_then_and_now_add_up(monkeypatch, known, beyond):
    assert beyond_at(monkeypatch, "beyond_usual", **known) == beyond


@pytest.mark.parametrize(
    "known, beyond",
    [
        ({}, [True, True, True]),
        ({"new": Spread(HALF, ZERO_6)}, [False, True, True]),
        ({"new": Spread(2.0 * HALF, ZERO_6)}, [False, False, True]),
        ({"new": Spread(ZERO_6, 2.0 * HALF)}, [True, True, True]),
    ],
)
def test_what_detections_are_off_as_a_whole_is_told_by_what_is_stated(monkeypatch, known, beyond):
    assert beyond_at(monkeypatch, "beyond_detections", **known) == beyond


@pytest.mark.parametrize(
    "known, beyond",
    [
        ({"new": Spread(2.0 * HALF, HALF)}, [False, True, True]),
        ({"new": Spread(ZERO_6, 2.0 * HALF)}, [False, False, True]),
        ({"new": Spread(ZERO_6, HALF), "scatter": 2.0}, [False, False, True]),
        ({"new": Spread(9.0 * HALF, ZERO_6)}, [True, True, True]),
    ],
)
def test_a_move_is_judged_by_the_assumed_noise_times_the_rigs_scatter(monkeypatch, known, beyond):
    least, squares = just_beyond(), []
    for factor in (1.1, 1.3, 1.5):
        found = of_edge(monkeypatch, shift_m=factor * least, **known)
        squares.append(found.chi_square > LIMIT)
    assert squares == beyond


def test_unless_usual_errors_are_known_a_change_is_beyond_them():
    assert edge_drift("a").beyond_usual


def test_only_a_range_sensors_own_scatter_is_estimated(monkeypatch):
    sizes = {
        kind: of_edge(monkeypatch, freedom_of=kind, detections=3).found_m
        for kind in (None, "another", "range")
    }
    assert sizes[None] == sizes["another"] < sizes["range"]


@pytest.mark.parametrize("detections, freedom", [(0, 30.0), (1, 3.0), (7, 21.0)])
def test_a_detection_counts_as_three_numbers_and_unknown_ones_as_ten_detections(
    detections, freedom
):
    assert module._freedom(Spread(np.eye(6), np.eye(6), detections)) == freedom


def test_what_was_held_has_no_scatter_of_its_own():
    assert np.isinf(module._freedom(NO_SPREAD._replace(detections=5)))


def test_what_is_held_is_known_by_its_edges_each_once():
    sensors = {
        name: SimpleNamespace(edge=edge_of(child))
        for name, child in (("a", "x"), ("b", "x"), ("c", "y"), ("d", "z"))
    }
    spreads = {edge_of(n): Spread(s * np.eye(6), np.eye(6)) for n, s in (("x", 1.0), ("z", 4.0))}
    dataset = SimpleNamespace(sensors=sensors)
    for names, total in ((("a", "b"), 1.0), (("a", "c", "d"), 5.0), (("c",), 0.0), ((), 0.0)):
        found = module._reference_spread(dataset, spreads, names)
        np.testing.assert_allclose(found.stated, total * np.eye(6))
