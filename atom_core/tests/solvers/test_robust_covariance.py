"""How sure the shared numbers are: the jackknife over collections, and who decides when."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from atom_core.problem.model_errors import RangeOffset
from atom_core.solvers.collection_part import CollectionPart
from atom_core.solvers.robust_covariance import (
    FEWEST,
    _jackknife_variance,
    _model_variance,
    degrees_of_freedom,
    sigma_factors,
    wider_by_students_t,
)
from atom_core.solvers.shared_equations import SharedEquations

ERROR, HELD = RangeOffset("lidar_1"), RangeOffset("depth_1")
LEFT_OUT = 0.95


def equations(count, seed=0, blocks=1, stated=0.0, known=0.0, scatter=1.0):
    """Return what collections say of blocks, an inset and two errors.

    Args:
        count: of collections.
        seed: of what they say.
        blocks: shared ones, of six numbers.
        stated: what the user knows of the blocks' numbers, one over variances.
        known: what priors say of all numbers.
        scatter: standard deviation of the collections' gradients, in that of the model.
    """
    rng, numbers = np.random.default_rng([seed, count]), 6 * blocks + 3
    parts, gradient = [], np.zeros((count, numbers))
    for c in range(count):
        rows = rng.standard_normal((2 * numbers, numbers))
        mine = np.arange(numbers) if c % 2 else np.delete(np.arange(numbers), [1, numbers - 2])
        rows = rows[:, mine]
        parts.append(CollectionPart.of(mine, rows.T @ rows))
        gradient[c, mine] = scatter * rows.T @ rng.standard_normal(2 * numbers)
    total = sum(whole(part, numbers) for part in parts)
    total[np.diag_indices(6 * blocks)] += stated
    total[np.diag_indices(numbers)] += known
    return SharedEquations(
        collections=tuple(f"{c:03}" for c in range(count)),
        errors=(ERROR, HELD),
        blocks=blocks,
        shared=6 * blocks + 1,
        of_fields=0,
        parts=tuple(parts),
        gradient=gradient,
        total=total,
        held_gradient=np.zeros(numbers),
        free=np.ones(6 * blocks, dtype=bool),
        stated=np.full(6 * blocks, stated),
    )


def whole(part, numbers):
    full = np.zeros((numbers, numbers))
    full[np.ix_(part.numbers, part.numbers)] = part.information
    return full


def jackknife(given, base):
    """Return the variances, from one dense solution for each collection that is left out."""
    total = given.total[np.ix_(base, base)]
    answers = []
    for part, gradient in zip(given.parts, given.gradient):
        own = whole(part, len(given.total))[np.ix_(base, base)]
        answers.append(np.linalg.solve(total - LEFT_OUT * own, gradient[base]))
    count = len(answers)
    return (count - 1.0) * np.var(answers, axis=0)


def model(given, base):
    return np.diagonal(np.linalg.inv(given.total[np.ix_(base, base)]))


BASE = [*range(7), 7]  # the block, the inset and the first error; the other error is held


@pytest.mark.parametrize("count", [2, 5, 9])
def test_the_jackknife_leaves_out_nearly_all_of_one_collection_after_another(count):
    given = equations(count)
    for base in (BASE, [*range(9)]):
        np.testing.assert_allclose(
            _jackknife_variance(given, base), jackknife(given, np.array(base)), rtol=1e-8
        )


def test_collections_that_agree_have_no_scatter():
    given = equations(3)
    alike = replace(given, parts=(given.parts[1],) * 3, gradient=given.gradient[[1, 1, 1]])
    np.testing.assert_allclose(_jackknife_variance(alike, BASE), 0.0, atol=1e-20)


def test_the_variance_of_the_model_is_the_inverse_and_its_known_part_what_is_stated():
    given = equations(5, stated=30.0)
    variance, known = _model_variance(given, BASE)
    total = given.total[np.ix_(BASE, BASE)]
    np.testing.assert_allclose(variance, model(given, BASE))
    inverse, stated = np.linalg.inv(total), np.diag([30.0] * 6 + [0.0] * 2)
    np.testing.assert_allclose(known, np.diagonal(inverse @ stated @ inverse), rtol=1e-9)
    assert np.all(known < variance) and not _model_variance(equations(5), BASE)[1].any()


# --- factors -------------------------------------------------------------------------------------


def in_triples(ratios):
    """Return the ratios with one for each three numbers of a block in common."""
    means = [np.mean(ratios[i : i + 3]) for i in range(0, 6, 3)]
    return np.concatenate([np.repeat(means, 3), ratios[6:]])


@pytest.mark.parametrize("error, place", [(ERROR, 7), (HELD, 8)])
@pytest.mark.parametrize("count", [8, 12])
def test_many_collections_decide_by_their_scatter(count, error, place):
    given, base = equations(count, scatter=5.0), [*range(7), place]
    careless = replace(given, total=1e-6 * given.total)
    wider = stats.t(count / 2.0).ppf(0.975) / stats.norm.ppf(0.975)
    ratios = wider**2 * jackknife(given, base) / model(given, base)
    found = sigma_factors(given, careless, [error])
    np.testing.assert_allclose(found, np.sqrt(in_triples(ratios)), rtol=1e-7)
    assert found.shape == (8,) and np.all(found > 1.0)


@pytest.mark.parametrize("count", [1, 3])
def test_too_few_collections_leave_it_to_the_cautious(count):
    given = equations(count, scatter=1e4, known=1.0)
    cautious = replace(given, total=given.total / 9.0)
    np.testing.assert_allclose(sigma_factors(given, cautious, [ERROR]), 3.0)


@pytest.mark.parametrize("count", [4, 7])
def test_of_few_collections_the_larger_factor_counts(count):
    given = equations(count, scatter=2.0)
    freedom = max(count / 2.0, 3.0)
    wider = stats.t(freedom).ppf(0.975) / stats.norm.ppf(0.975)
    scattered = wider**2 * jackknife(given, BASE) / model(given, BASE)
    for times in (1.01, float(np.median(scattered)), 1e6):
        cautious = replace(given, total=given.total / times)
        expected = np.sqrt(in_triples(np.maximum(scattered, times)))
        np.testing.assert_allclose(sigma_factors(given, cautious, [ERROR]), expected, rtol=1e-7)


def test_no_factor_is_below_one():
    given = equations(12, scatter=1e-6)
    np.testing.assert_array_equal(sigma_factors(given, given, [ERROR]), 1.0)


def test_errors_that_were_not_estimated_or_that_nothing_depends_on_have_no_factor():
    given = equations(12)
    assert len(sigma_factors(given, given, [])) == 7
    assert len(sigma_factors(given, given, [HELD, ERROR])) == 9
    assert len(sigma_factors(given, given, [RangeOffset("nobody")])) == 7
    both = sigma_factors(given, given, [HELD, ERROR])
    swapped = sigma_factors(given, given, [ERROR, HELD])
    np.testing.assert_allclose(both[[7, 8]], swapped[[8, 7]], rtol=1e-9)


def test_what_the_user_stated_is_no_less_sure_because_collections_differ():
    given = equations(12, stated=1e9, scatter=20.0)
    found = sigma_factors(given, given, [ERROR])
    np.testing.assert_allclose(found[:6], 1.0, atol=1e-6)
    assert np.all(found[6:] > 5.0)


def test_the_part_of_a_variance_that_collections_tell_grows_with_their_scatter():
    given = equations(12, stated=300.0, scatter=20.0)
    variance, known = _model_variance(given, BASE)
    told = variance - known
    wider = stats.t(6.0).ppf(0.975) / stats.norm.ppf(0.975)
    ratios = in_triples(wider**2 * jackknife(given, BASE) / told)
    expected = np.sqrt((known + ratios * told) / variance)
    np.testing.assert_allclose(sigma_factors(given, given, [ERROR]), expected, rtol=1e-7)


def test_numbers_that_are_not_estimated_do_not_count_among_their_three():
    given = equations(12, scatter=5.0)
    free = np.array([True, False, True, False, False, False])
    found = sigma_factors(replace(given, free=free), given, [ERROR])
    wider = stats.t(6.0).ppf(0.975) / stats.norm.ppf(0.975)
    ratios = wider**2 * jackknife(given, BASE) / model(given, BASE)
    np.testing.assert_allclose(found[:3], np.sqrt(np.mean(ratios[[0, 2]])), rtol=1e-7)
    np.testing.assert_array_equal(found[3:6], 1.0)


def test_each_block_has_factors_of_its_own():
    given = equations(12, blocks=2, scatter=5.0)
    found = sigma_factors(given, given, [ERROR])
    assert len(found) == 14 and len(np.unique(np.round(found[:12], 9))) == 4


# --- Student's t ---------------------------------------------------------------------------------


@pytest.mark.parametrize("freedom", [3.0, 4.5, 30.0])
def test_quantiles_are_wider_by_students_t(freedom):
    expected = stats.t(freedom).ppf(0.975) / stats.norm.ppf(0.975)
    assert wider_by_students_t(freedom) == pytest.approx(expected)


def test_many_degrees_of_freedom_are_the_normal_distribution():
    assert wider_by_students_t(1e9) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("count, freedom", [(3, np.inf), (7, np.inf), (8, 4.0), (21, 10.5)])
def test_half_the_collections_told_the_scatter(count, freedom):
    assert degrees_of_freedom(count) == freedom
    assert FEWEST == 4
