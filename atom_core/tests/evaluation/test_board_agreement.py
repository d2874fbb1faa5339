"""Whether boards agree on a sensor: chi-square of their differences, and which of them is odd."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from atom_core.errors import CalibrationError
from atom_core.evaluation import board_agreement as module
from atom_core.evaluation.board_agreement import OneBoard, disagreement, of_one_board
from atom_core.evaluation.drift_question import Question
from atom_core.evaluation.edge_errors import PoseError, pose_error
from atom_core.evaluation.spreads import NO_SPREAD, Spread
from atom_core.geometry import se3
from atom_core.model.transforms import Edge
from atom_core.solvers.base import FAILED, NOT_CONVERGED
from atom_core.synthetic import Noise, scenes

ONE, OTHER = Edge("base", "one"), Edge("base", "other")
SIGMAS = np.array([1e-3, 2e-3, 3e-3, 0.01, 0.02, 0.03])  # turns [rad], shifts [m]
RARE = 0.001


def board(key, sigmas=(0.0,) * 6, scale=1.0):
    """Return a board that has a sensor off by so many sigmas in each number."""
    numbers = np.array(sigmas) * SIGMAS
    covariance = scale * np.diag(SIGMAS**2)
    return OneBoard(key, PoseError(shift_m=numbers[3:], turn_rad=numbers[:3]), covariance)


def along(number, sigmas):
    return sigmas * np.eye(6)[number]


def told(monkeypatch, boards, edges=None):
    """Return the disagreement of boards by edge."""
    monkeypatch.setattr(module, "_by_board", lambda question, edges: boards)
    return disagreement(None, list(boards) if edges is None else edges)


def limit_sigmas(numbers, edges=1):
    """Return how far two equally sure boards may be apart, in sigmas of one of them."""
    return np.sqrt(2.0 * stats.chi2.isf(RARE / edges, numbers))


def test_a_board_s_numbers_are_turns_then_shifts_as_in_its_covariance():
    one = board("a", [1, 2, 3, 4, 5, 6])
    np.testing.assert_allclose(one.numbers, np.array([1, 2, 3, 4, 5, 6]) * SIGMAS)
    np.testing.assert_allclose(one.information @ one.covariance, np.eye(6), atol=1e-9)


def test_a_board_that_knows_a_sensor_exactly_has_a_finite_information():
    exact = board("a", scale=0.0)
    np.testing.assert_allclose(exact.information, 1e18 * np.eye(6))


def test_boards_that_say_the_same_agree(monkeypatch):
    assert told(monkeypatch, {ONE: [board(key, [5.0] * 6) for key in "abc"]}) is None


@pytest.mark.parametrize("number", range(6))
@pytest.mark.parametrize("factor, is_told", [(0.999, False), (1.001, True)])
def test_two_boards_may_differ_as_much_as_one_rig_in_a_thousand_does(
    monkeypatch, number, factor, is_told
):
    apart = factor * limit_sigmas(6)
    found = told(monkeypatch, {ONE: [board("a"), board("b", along(number, apart))]})
    assert (found is not None) == is_told


@pytest.mark.parametrize("factor, is_told", [(0.999, False), (1.001, True)])
def test_of_many_edges_each_may_be_off_by_chance(monkeypatch, factor, is_told):
    apart = factor * limit_sigmas(6, edges=4)
    sound = [board("a"), board("b")]
    boards = {Edge("base", name): sound for name in "xyz"}
    boards[ONE] = [board("a"), board("b", along(3, apart))]
    assert (told(monkeypatch, boards) is not None) == is_told


@pytest.mark.parametrize("factor, is_told", [(0.999, False), (1.001, True)])
def test_three_boards_have_twelve_differences(monkeypatch, factor, is_told):
    """Of one that is d from two others the sum of squares about the mean is 2/3 d^2."""
    apart = factor * np.sqrt(1.5 * stats.chi2.isf(RARE, 12))
    boards = [board("a"), board("b", along(2, apart)), board("c")]
    found = told(monkeypatch, {ONE: boards})
    assert (found is not None) == is_told
    if found:
        assert (found.edge, found.odd.collection) == (ONE, "b")
        assert [other.collection for other in found.others] == ["a", "c"]


@pytest.mark.parametrize("factor, is_told", [(0.999, False), (1.001, True)])
def test_boards_of_unequal_certainty_differ_by_their_joint_variance(monkeypatch, factor, is_told):
    """Variances s^2 and 8 s^2: the difference has 9 s^2."""
    apart = factor * 3.0 * np.sqrt(stats.chi2.isf(RARE, 6))
    boards = [board("a"), board("b", along(4, apart), scale=8.0)]
    assert (told(monkeypatch, {ONE: boards}) is not None) == is_told


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_boards_cannot_disagree(monkeypatch, count):
    assert told(monkeypatch, {ONE: [board("a", [100.0] * 6)][:count]}) is None


def test_without_edges_nothing_is_asked(monkeypatch):
    assert told(monkeypatch, {}) is None


@pytest.mark.parametrize("order", [(ONE, OTHER), (OTHER, ONE)])
def test_the_edge_on_which_they_agree_worst_is_told(monkeypatch, order):
    bad = {ONE: [board("a"), board("b", along(0, 8.0)), board("c")]}
    bad[OTHER] = [board("a", along(0, 9.0)), board("b"), board("c")]
    found = told(monkeypatch, {edge: bad[edge] for edge in order})
    assert (found.edge, found.odd.collection) == (OTHER, "a")


def test_an_edge_on_which_they_agree_does_not_hide_a_later_one(monkeypatch):
    boards = {ONE: [board("a"), board("b")], OTHER: [board("a"), board("b", along(1, 20.0))]}
    assert told(monkeypatch, boards).edge == OTHER


# ------------------------------------------------------------------------------- real boards


@pytest.fixture(scope="module")
def rig():
    """Three boards that all of three cameras see, without noise; and where rgb_2 truly is."""
    scene = scenes.random_scene(1, rgb=3, depth=0, lidar3d=0, collections=20, noise=Noise.none())
    whole = [k for k, c in scene.dataset.collections.items() if len(c.labels) == 3][:3]
    dataset = scene.dataset.selected(collections=whole)
    return dataset, dataset.sensors["rgb_2"].edge, scene.truth


@pytest.fixture(scope="module")
def described(rig):
    """The rig as described before rgb_2 moved by 5 mm and 0.3 degrees."""
    dataset, edge, truth = rig
    move = se3.random_move(0.005, np.radians(0.3), np.random.default_rng(0))
    wrong = se3.moved(truth.edges[edge], move)
    return dataset.with_transforms(dict.fromkeys(dataset.collections, {edge: wrong}))


def question(dataset, spreads=None):
    return Question(dataset, spreads or {}, {}, {})


def boards_of(monkeypatch, asked, edges):
    """Return what each board says of some edges."""
    seen = {}
    by_board = module._by_board
    monkeypatch.setattr(
        module, "_by_board", lambda *args: seen.setdefault("boards", by_board(*args))
    )
    return disagreement(asked, edges), seen["boards"]


def test_each_board_alone_finds_how_a_sensor_moved_since_it_was_described(
    monkeypatch, rig, described
):
    dataset, edge, truth = rig
    expected = pose_error(described.first_value(edge), truth.edges[edge])
    found, boards = boards_of(monkeypatch, question(described), [edge])
    assert found is None
    assert [one.collection for one in boards[edge]] == list(dataset.collections)
    for one in boards[edge]:
        np.testing.assert_allclose(one.change.shift_m, expected.shift_m, atol=1e-6)
        np.testing.assert_allclose(one.change.turn_rad, expected.turn_rad, atol=1e-6)


def with_wrong_label(dataset, key):
    label = dataset.collections[key].labels["rgb_2", "pattern_1"]
    wrong = replace(label, pixels=label.pixels + [8.0, 0.0])
    return dataset.with_labels(key, {("rgb_2", "pattern_1"): wrong})


@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_board_that_moved_between_two_pictures_is_the_odd_one(rig, place):
    dataset, edge, _ = rig
    keys = list(dataset.collections)
    found = disagreement(question(with_wrong_label(dataset, keys[place])), [edge])
    assert (found.edge, found.odd.collection) == (edge, keys[place])
    assert [one.collection for one in found.others] == [k for k in keys if k != keys[place]]


@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_sensor_that_sees_nothing_of_a_board_says_nothing_by_it(monkeypatch, rig, place):
    dataset, edge, _ = rig
    keys = list(dataset.collections)
    fewer = dataset.with_labels(keys[place], {("rgb_2", "pattern_1"): None})
    _, boards = boards_of(monkeypatch, question(fewer), [edge])
    assert [one.collection for one in boards[edge]] == [k for k in keys if k != keys[place]]


@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_sensor_that_sees_nothing_of_a_board_hides_no_other_one(monkeypatch, rig, place):
    dataset, edge, _ = rig
    keys, other = list(dataset.collections), dataset.sensors["rgb_3"].edge
    fewer = dataset.with_labels(keys[place], {("rgb_2", "pattern_1"): None})
    _, boards = boards_of(monkeypatch, question(fewer), [edge, other])
    assert [one.collection for one in boards[other]] == keys
    assert len(boards[edge]) == 2


def test_an_edge_of_which_a_board_tells_nothing_does_not_hide_the_next_one(monkeypatch, rig):
    dataset, edge, _ = rig
    other, model = dataset.sensors["rgb_3"].edge, np.diag(SIGMAS**2)
    told_of = {edge: NO_SPREAD, other: Spread(model, model)}
    monkeypatch.setattr(module, "calibrate", Solver(["converged"] * 3))
    monkeypatch.setattr(module, "known_spread", lambda solved, edge: told_of[edge])
    _, boards = boards_of(monkeypatch, question(dataset), [edge, other])
    assert boards[edge] == []
    assert [one.collection for one in boards[other]] == list(dataset.collections)


def test_detections_that_scatter_beyond_their_noise_widen_each_board(monkeypatch, rig):
    dataset, edge, _ = rig
    _, plain = boards_of(monkeypatch, question(dataset), [edge])
    model = 1e-8 * np.eye(6)
    monkeypatch.undo()
    scattered = {edge: Spread(model, model, 10, scatter=5.0)}
    _, wide = boards_of(monkeypatch, question(dataset, scattered), [edge])
    monkeypatch.undo()
    _, thrice = boards_of(
        monkeypatch, question(dataset, {edge: Spread(model, model, 10, scatter=3.0)}), [edge]
    )
    for one, three, five in zip(plain[edge], thrice[edge], wide[edge]):
        np.testing.assert_allclose(
            five.covariance - three.covariance, three.covariance - one.covariance
        )
        assert np.all(np.diagonal(three.covariance) > np.diagonal(one.covariance))


class Solver:
    """Solves boards one by one, and fails or ends badly at some."""

    def __init__(self, endings):
        self.endings, self.held = list(endings), []

    def __call__(self, dataset, options):
        self.held.append(options.anchor_sensors)
        ending = self.endings.pop(0)
        if ending is None:
            raise CalibrationError("too few corners")
        return SimpleNamespace(status=ending, dataset=dataset)


@pytest.mark.parametrize("ending", [None, FAILED, NOT_CONVERGED])
def test_a_board_that_cannot_be_solved_is_passed_over_and_the_next_ones_count(
    monkeypatch, rig, ending
):
    dataset, edge, _ = rig
    monkeypatch.setattr(module, "calibrate", Solver(["converged", ending, "converged"]))
    model = np.diag(SIGMAS**2)
    monkeypatch.setattr(module, "known_spread", lambda solved, edge: Spread(2.0 * model, model))
    spreads = {edge: Spread(np.zeros((6, 6)), np.zeros((6, 6)), scatter=4.0)}
    _, boards = boards_of(monkeypatch, question(dataset, spreads), [edge])
    first, _, third = dataset.collections
    assert [one.collection for one in boards[edge]] == [first, third]
    for one in boards[edge]:
        np.testing.assert_allclose(one.covariance, 5.0 * model)
        np.testing.assert_allclose(one.numbers, 0.0, atol=1e-12)


def test_sensors_that_do_not_seem_to_have_moved_are_held(monkeypatch, rig):
    dataset, edge, _ = rig
    solver = Solver(["converged"] * 3)
    monkeypatch.setattr(module, "calibrate", solver)
    monkeypatch.setattr(module, "known_spread", lambda solved, edge: NO_SPREAD)
    _, boards = boards_of(monkeypatch, question(dataset), [edge])
    assert solver.held == [("rgb_1", "rgb_3")] * 3
    assert boards == {edge: []}


def test_what_one_board_leaves_open_is_a_turn_of_the_sensor_about_it():
    sensor_T_board_m = np.array([2.5, 0.0, 0.5])
    at_board = np.hstack([-se3.skew(sensor_T_board_m), np.eye(3)])  # how far the board is off
    about_board = np.vstack([np.eye(3), se3.skew(sensor_T_board_m)])
    of_model = 1e-6 * about_board @ about_board.T  # 1 mrad, and 0.1 mm of the board itself
    of_model[3:, 3:] += 1e-8 * np.eye(3)
    factors = np.repeat([10.0, 4.0], 3)  # of turns and of shifts
    stated = of_model * np.outer(factors, factors)
    assert np.sqrt(np.diagonal(at_board @ stated @ at_board.T)).max() > 0.01
    found = of_one_board(Spread(stated, of_model), scatter=1.0)
    board_m = np.sqrt(np.diagonal(at_board @ found @ at_board.T))
    np.testing.assert_allclose(board_m, 1e-4 * np.sqrt((100.0 + 16.0) / 2.0))
    np.testing.assert_allclose(np.diagonal(found)[:3], 1e-6 * (100.0 + 16.0) / 2.0)
