"""How far moving parts are off: their spread, from how far each collection has them off."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.labels import DetectionKey
from atom_core.model.transforms import Edge
from atom_core.problem.moving_blocks import FAR, MOVING, MovingBlock, MovingPart
from atom_core.problem.parameters import Parameters
from atom_core.problem.problem import PoseChains, Problem
from atom_core.problem.residuals import ReprojectionBlock
from atom_core.solvers import losses
from atom_core.solvers.levenberg_marquardt import LevenbergMarquardt
from atom_core.solvers.moving_spread import (
    LEAST_M,
    LEAST_RAD,
    _as_if_gaussian,
    _estimated,
    _weight,
    _with_weights,
    estimated_spreads,
    is_near,
    moving_blocks,
)

EDGE = Edge("base", "flange")
PART = MovingPart(0.01, 0.002, {})
KEYS = [f"{i:03}" for i in range(20)]
GIVEN = se3.from_rpy(np.array([-0.1, -0.1, 1.2]), np.array([0.4, -0.3, 0.1]))
CAMERA = Camera(1280, 800, np.array([[900.0, 0, 640], [0, 900, 400], [0, 0, 1]]), [], "none")
CORNERS = np.array([[x, y, 0.05 * (x == y)] for x in (0.0, 0.1, 0.2) for y in (0.0, 0.1, 0.2)])


# --- two spreads ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name, least", [("sigma_m", LEAST_M), ("sigma_rad", LEAST_RAD)])
@pytest.mark.parametrize("off, near", [(0.099, True), (0.101, False), (-0.099, True)])
def test_spreads_are_near_one_another_up_to_a_share(name, least, off, near):
    large = replace(PART, **{name: 100.0 * least})
    other = replace(large, **{name: (1.0 + off) * 100.0 * least})
    assert is_near(large, other, 0.1) == near


@pytest.mark.parametrize("name, least", [("sigma_m", LEAST_M), ("sigma_rad", LEAST_RAD)])
@pytest.mark.parametrize("off, near", [(0.099, True), (0.101, False)])
def test_a_tenth_of_the_least_spread_does_not_matter(name, least, off, near):
    small = replace(PART, **{name: least})
    other = replace(small, **{name: (1.0 + off) * least})
    assert is_near(small, other, 1e-6) == is_near(other, small, 1e-6) == near


def test_spreads_with_other_collections_far_are_not_near():
    assert is_near(PART, PART, 0.01)
    assert not is_near(PART, replace(PART, far=frozenset(["000"])), 0.01)


def test_the_least_spreads_are_ten_micrometres_and_a_thousandth_of_a_degree():
    assert LEAST_M == 1e-5 and np.rad2deg(LEAST_RAD) == pytest.approx(1e-3)


def test_the_weight_is_one_over_the_variance_of_angles_and_then_of_lengths():
    np.testing.assert_allclose(_weight((0.01, 0.002)), [1 / 0.002**2] * 3 + [1 / 0.01**2] * 3)


# --- the spread of deviations --------------------------------------------------------------------


def deviations(sigma_m, sigma_rad, seed=0, count=20):
    """Return (n, 6), of which the mean squares are exactly those of the sigmas."""
    values = np.random.default_rng(seed).uniform(0.5, 1.5, (count, 6))
    for axes, sigma in ((slice(0, 3), sigma_rad), (slice(3, 6), sigma_m)):
        values[:, axes] *= sigma / np.sqrt(np.mean(values[:, axes] ** 2))
    return values


def test_deviations_that_are_known_exactly_have_the_spread_of_their_mean_square():
    found = _estimated(PART, KEYS, deviations(0.02, 0.001), np.zeros((20, 6)))
    assert found.sigma_m == pytest.approx(0.02) and found.sigma_rad == pytest.approx(0.001)
    assert found.far == frozenset() and found.given is PART.given


def test_a_variance_says_how_little_of_the_deviations_is_told():
    """The sum of squares over how many are told: the rest has been drawn to zero."""
    untold = np.random.default_rng(1).uniform(0.1, 0.8, (20, 6))
    variance = untold * ([0.002**2] * 3 + [0.01**2] * 3)
    off = deviations(0.012, 0.0015)
    found = _estimated(PART, KEYS, off, variance)
    told = 20.0 - np.sum(np.mean(untold[:, 3:], axis=1))
    squares = np.sum(np.mean(off[:, 3:] ** 2, axis=1))
    assert found.sigma_m == pytest.approx(np.sqrt(squares / told))
    told = 20.0 - np.sum(np.mean(untold[:, :3], axis=1))
    assert found.sigma_rad == pytest.approx(np.sqrt(20.0 * 0.0015**2 / told))


@pytest.mark.parametrize("times, expected", [(0.2, 0.3), (0.4, 0.4), (2.9, 2.9), (5.0, 3.0)])
def test_a_round_changes_a_spread_by_a_factor_of_three_at_most(times, expected):
    found = _estimated(PART, KEYS, deviations(times * 0.01, times * 0.002), np.zeros((20, 6)))
    assert found.sigma_m == pytest.approx(expected * 0.01)
    assert found.sigma_rad == pytest.approx(expected * 0.002)


def test_a_spread_is_not_below_the_least():
    still = _estimated(MovingPart(2e-5, 3e-5, {}), KEYS, np.zeros((20, 6)), np.zeros((20, 6)))
    assert still.sigma_m == LEAST_M and still.sigma_rad == LEAST_RAD


@pytest.mark.parametrize("axes", [slice(0, 3), slice(3, 6)])
@pytest.mark.parametrize("times, is_far", [(11.9, False), (12.1, True)])
def test_a_collection_is_far_beyond_twelve_times_the_square_in_the_middle(axes, times, is_far):
    off = np.tile([0.002] * 3 + [0.01] * 3, (20, 1))
    off[7, axes] *= np.sqrt(times)
    found = _estimated(PART, KEYS, off, np.zeros((20, 6)))
    assert found.far == (frozenset(["007"]) if is_far else frozenset())
    if is_far:  # it says nothing of the spread
        assert found.sigma_m == pytest.approx(0.01) and found.sigma_rad == pytest.approx(0.002)


@pytest.mark.parametrize("times, is_far", [(0.119, False), (0.121, True)])
def test_where_most_do_not_move_a_hundredth_is_the_middle(times, is_far):
    off = np.zeros((20, 6))
    off[3, 3:] = 0.01 * np.sqrt(times)  # against 12 * 0.01 of the variance
    found = _estimated(PART, KEYS, off, np.zeros((20, 6)))
    assert ("003" in found.far) == is_far


@pytest.mark.parametrize("times, is_far", [(23.9, False), (24.1, True)])
def test_what_was_far_was_not_drawn_to_zero(times, is_far):
    """Its square is the spread's and its own variance's; here these are alike."""
    part = replace(PART, far=frozenset(["007"]))
    off = np.tile([0.002] * 3 + [0.01] * 3, (20, 1))
    variance = np.zeros((20, 6))
    off[7, 3:], variance[7] = 0.01 * np.sqrt(times), [0.002**2] * 3 + [0.01**2] * 3
    assert (_estimated(part, KEYS, off, variance).far == frozenset(["007"])) == is_far


# --- a whole problem -----------------------------------------------------------------------------


def problem_of(parts_off, part=PART, noise_px=0.0, sigma_px=0.2, seed=0):
    """Return a problem of flanges before a camera, which are off by parts_off (n, 6)."""
    rng, keys, blocks, rows = np.random.default_rng(seed), [], [], []
    for i, off in enumerate(parts_off):
        keys.append(DetectionKey(f"{i:03}", "rgb_1", "pattern_1"))
        sigmas = part.sigmas(keys[-1].collection)
        mine = EDGE, MOVING, keys[-1].collection, ("flange",), GIVEN, GIVEN, *sigmas
        blocks.append(MovingBlock(*mine))
        seen = CAMERA.project(se3.apply(blocks[-1].pose(off), CORNERS))
        rows.append(seen + noise_px * rng.standard_normal(seen.shape))
    count = len(keys)
    chains = PoseChains(
        np.tile(np.eye(4), (count, 2, 1, 1)),
        np.arange(count)[:, None],
        np.zeros((count, 1), dtype=bool),
    )
    detection = np.repeat(np.arange(count), len(CORNERS))
    corners = np.tile(CORNERS, (count, 1))
    ids, sigma = np.arange(len(corners)), np.full(len(corners), sigma_px)
    fields = "rgb_1", "rgb", detection, sigma, ids, CAMERA, corners, np.concatenate(rows)
    return Problem(Parameters(blocks), tuple(keys), chains, (ReprojectionBlock(*fields),))


def solved(problem, loss):
    solver, sigmas = LevenbergMarquardt(problem), [problem.residual_blocks[0].sigma]
    start = np.zeros(problem.parameters.size)
    return solver, solver.minimise(start, sigmas, loss, 100).x, sigmas


def test_blocks_of_each_part_are_found_among_the_parameters():
    problem = problem_of(np.zeros((4, 6)))
    assert moving_blocks(problem) == {EDGE: [0, 1, 2, 3]}


def test_the_spread_of_well_seen_parts_is_that_of_where_they_are():
    off = deviations(0.03, 0.004) * np.random.default_rng(2).choice([-1.0, 1.0], (20, 6))
    solver, x, sigmas = solved(problem_of(off, sigma_px=0.02), losses.NONE)
    found = estimated_spreads(solver, x, sigmas, losses.NONE, {EDGE: PART})[EDGE]
    assert found.sigma_m == pytest.approx(0.03, rel=0.01)
    assert found.sigma_rad == pytest.approx(0.004, rel=0.01)


def test_parts_that_are_not_asked_for_stay_as_they_are():
    solver, x, sigmas = solved(problem_of(deviations(0.03, 0.004, count=4)), losses.NONE)
    assert estimated_spreads(solver, x, sigmas, losses.NONE, {}) == {}


def test_estimated_again_a_spread_stays():
    off = deviations(0.02, 0.003) * np.random.default_rng(3).choice([-1.0, 1.0], (20, 6))
    solver, x, sigmas = solved(problem_of(off, noise_px=0.2), losses.NONE)
    once = estimated_spreads(solver, x, sigmas, losses.NONE, {EDGE: PART})
    again_solver, x, sigmas = solved(problem_of(off, once[EDGE], noise_px=0.2), losses.NONE)
    again = estimated_spreads(again_solver, x, sigmas, losses.NONE, once)
    assert is_near(once[EDGE], again[EDGE], 0.02)


def test_a_part_that_is_off_once_is_far_there_and_nowhere_else():
    off = deviations(0.01, 0.002) * np.random.default_rng(4).choice([-1.0, 1.0], (20, 6))
    off[5, 3:] = 0.15, -0.1, 0.1
    solver, x, sigmas = solved(problem_of(off), losses.NONE)
    found = estimated_spreads(solver, x, sigmas, losses.NONE, {EDGE: PART})[EDGE]
    assert found.far == frozenset(["005"])
    assert found.sigma_m == pytest.approx(0.01, rel=0.2)
    assert found.sigmas("005")[0] == FAR * found.sigma_m


@pytest.mark.parametrize("loss", losses.LOSSES)
def test_without_the_loss_equations_say_what_least_squares_would(loss):
    problem = problem_of(deviations(0.01, 0.002, count=3))
    solver, x, sigmas = solved(problem, loss)
    weighted = solver.equations(x, sigmas, loss)
    plain = _as_if_gaussian(problem, weighted, loss)
    more, force = losses.told(loss, 2)
    prior = np.tile(problem.parameters.prior_weight[0], (3, 1))
    slope = problem.parameters.prior_gradient(x).reshape(3, 6)
    data = weighted.local.copy()
    data[:, range(6), range(6)] -= prior
    np.testing.assert_allclose(plain.local, more * data, rtol=1e-6, atol=1e-2)
    expected = force * (weighted.gradient_local - slope)
    np.testing.assert_allclose(plain.gradient_local, expected, rtol=1e-6, atol=1e-4)


def test_what_is_expected_stands_in_the_equations_as_weights_and_their_pull():
    problem = problem_of(deviations(0.01, 0.002, count=3))
    solver, x, sigmas = solved(problem, losses.NONE)
    data = _as_if_gaussian(problem, solver.equations(x, sigmas, losses.NONE), losses.NONE)
    rng = np.random.default_rng(5)
    weight, off = rng.uniform(1e4, 1e5, (3, 6)), rng.standard_normal((3, 6))
    both = _with_weights(data, weight, off)
    for c in range(3):
        np.testing.assert_allclose(both.local[c], data.local[c] + np.diag(weight[c]))
    np.testing.assert_allclose(both.gradient_local, data.gradient_local + weight * off)
    whole = solver.equations(x, sigmas, losses.NONE)  # with the problem's own expectation
    parameters = problem.parameters
    same = _with_weights(data, parameters.prior_weight, parameters.by_block(x))
    np.testing.assert_allclose(same.local, whole.local, rtol=1e-9)
    np.testing.assert_allclose(same.gradient_local, whole.gradient_local, atol=1e-4)
