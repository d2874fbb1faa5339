"""Normal equations and covariance in blocks against the same in one dense matrix."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from problems import problem_of, rows  # noqa: E402

from atom_core.solvers import losses
from atom_core.solvers.covariance import Covariance
from atom_core.solvers.levenberg_marquardt import LevenbergMarquardt
from atom_core.solvers.normal_equations import Factor
from atom_core.synthetic import scenes

SCENES = {
    "many sensors": scenes.random_scene,
    "hand-eye": scenes.hand_eye,
    "two boards": scenes.two_patterns,
}
SCALE = 2.5  # of all variances


class Dense:
    """A problem a little away from its start: its equations in blocks, and as one matrix."""

    def __init__(self, problem):
        rng = np.random.default_rng(5)
        self.problem, sigmas = problem, problem.initial_sigmas
        self.free = np.flatnonzero(problem.parameters.free.ravel())
        x = np.zeros(problem.parameters.size)
        x[self.free] = 1e-3 * rng.standard_normal(len(self.free))
        self.equations = LevenbergMarquardt(problem).equations(x, sigmas, losses.NONE)
        self.jacobian = problem.jacobian(x, sigmas).toarray()
        self.matrix = self.jacobian.T @ self.jacobian
        self.gradient = self.jacobian.T @ rows(problem, x, sigmas)
        self.rng = rng

    def solved(self, right, damping=0.0):
        """Solve with the numbers that exist; the others are zero."""
        kept = np.ix_(self.free, self.free)
        matrix = self.matrix[kept] + damping * np.diag(np.diagonal(self.matrix)[self.free])
        result = np.zeros_like(right)
        result[self.free] = np.linalg.solve(matrix, right[self.free])
        return result

    @property
    def covariance(self):
        return self.solved(np.eye(len(self.matrix)))


@pytest.fixture(scope="module", params=SCENES)
def dense(request):
    return Dense(problem_of(SCENES[request.param]))


def test_a_vector_is_split_and_joined(dense):
    layout, x = dense.equations.layout, dense.rng.standard_normal(len(dense.gradient))
    shared, local = layout.split(x)
    np.testing.assert_array_equal(layout.join(shared, local), x)
    assert shared.shape == (6 * layout.shared,) and len(local) == layout.groups
    assert np.count_nonzero(shared) + np.count_nonzero(local) == len(x)


def test_blocks_and_gradient_are_those_of_the_dense_matrix(dense):
    equations, layout = dense.equations, dense.equations.layout
    gradient = layout.join(equations.gradient_shared, equations.gradient_local)
    scale = np.sqrt(np.maximum(np.diagonal(dense.matrix), 1.0))
    np.testing.assert_allclose(gradient / scale, dense.gradient / scale, atol=1e-7)
    vector = np.zeros(len(dense.gradient))
    vector[dense.free] = dense.rng.standard_normal(len(dense.free))
    shared, local = layout.split(vector)
    product = layout.join(
        equations.shared @ shared + np.einsum("gws,gw->s", equations.cross, local),
        np.einsum("gwv,gv->gw", equations.local, local)
        + np.einsum("gws,s->gw", equations.cross, shared),
    )
    expected = dense.matrix @ vector
    np.testing.assert_allclose(product / scale, expected / scale, rtol=1e-6, atol=1e-5)


@pytest.mark.parametrize("damping", [0.0, 1e-3, 2.0])
def test_a_step_solves_the_damped_equations_and_predicts_the_decrease(dense, damping):
    step, predicted = dense.equations.solve(damping)
    expected = dense.solved(-dense.gradient, damping)
    scale = np.sqrt(np.maximum(np.diagonal(dense.matrix), 1.0))
    np.testing.assert_allclose(step * scale, expected * scale, rtol=1e-5, atol=1e-6)
    by_model = -(dense.gradient @ expected + 0.5 * expected @ dense.matrix @ expected)
    assert predicted == pytest.approx(by_model, rel=1e-6)
    if damping == 0.0:
        assert dense.equations.newton_decrease() == pytest.approx(by_model, rel=1e-6)


def test_what_a_step_would_gain_is_unknown_where_no_minimum_is(dense):
    saddle = dataclasses.replace(dense.equations, shared=-dense.equations.shared)
    assert saddle.newton_decrease() == np.inf
    with pytest.raises(np.linalg.LinAlgError):
        saddle.solve(0.0)


def test_a_factor_solves_any_right_side(dense):
    right, damping = dense.rng.standard_normal(len(dense.gradient)), 0.1
    layout = dense.equations.layout
    kept = np.zeros_like(right)
    kept[dense.free] = right[dense.free]
    found = layout.join(*Factor(dense.equations, damping).solve(*layout.split(kept)))
    np.testing.assert_allclose(found, dense.solved(kept, damping), rtol=1e-6, atol=1e-12)


def test_the_covariance_is_the_inverse_in_all_its_blocks(dense):
    found, expected = Covariance(dense.equations, SCALE), SCALE * dense.covariance
    size = 6 * dense.equations.layout.shared
    deviation = np.sqrt(np.maximum(np.diagonal(expected), 1e-30))
    relative = deviation[:, None] * deviation

    def compare(block, other, rows_):
        inside = np.ix_(range(6 * block, 6 * block + 6), range(6 * other, 6 * other + 6))
        np.testing.assert_allclose(
            rows_ / relative[inside], expected[inside] / relative[inside], atol=1e-6
        )

    np.testing.assert_allclose(
        found.shared / relative[:size, :size],
        expected[:size, :size] / relative[:size, :size],
        atol=1e-6,
    )
    group = dense.equations.layout.group
    for one in range(len(group)):
        compare(one, one, found.block(one))
        for other in range(len(group)):
            pair = (np.array([one]), np.array([other]))
            if group[one] >= 0 and group[other] >= 0 and group[one] != group[other]:
                with pytest.raises(ValueError, match="different collections"):
                    found.pairs(*pair)
            else:
                compare(one, other, found.pairs(*pair)[0])


def test_of_every_detection_the_pose_is_as_sure_as_the_dense_inverse_has_it(dense):
    problem, covariance = dense.problem, Covariance(dense.equations, SCALE)
    found = covariance.states(problem.dependencies, dense.equations.state_jacobians)
    expected = dense.covariance
    for i, index in enumerate(problem.dependencies):
        used = index >= 0
        jacobian = np.hstack(dense.equations.state_jacobians[i][used])
        numbers = (6 * index[used, None] + np.arange(6)).ravel()
        wanted = SCALE * jacobian @ expected[np.ix_(numbers, numbers)] @ jacobian.T
        np.testing.assert_allclose(found[i], wanted, rtol=1e-4, atol=1e-6 * np.abs(wanted).max())


def test_rows_explain_as_many_numbers_as_there_are(dense):
    explained = Covariance(dense.equations, SCALE).explained(dense.problem, dense.equations)
    hat = np.sum((dense.jacobian @ dense.covariance) * dense.jacobian, axis=1)
    ends = np.cumsum([block.count * block.dimension for block in dense.problem.residual_blocks])
    expected = [np.sum(part) for part in np.split(hat, ends[:-1])]
    np.testing.assert_allclose(explained, expected, rtol=1e-5)
    assert sum(explained) == pytest.approx(len(dense.free), rel=1e-6)


def test_wider_sigmas_scale_their_numbers_and_keep_the_correlations(dense):
    covariance, layout = Covariance(dense.equations, SCALE), dense.equations.layout
    factors = 1.0 + dense.rng.random(6 * layout.shared)
    wider = covariance.robust(factors, {})
    assert wider.of_model is covariance and covariance.of_model is covariance
    np.testing.assert_allclose(wider.shared, covariance.shared * np.outer(factors, factors))
    locals_ = np.flatnonzero(layout.group >= 0)
    for one in locals_[:2]:
        pair = (np.array([one]), np.array([0]))
        np.testing.assert_allclose(wider.pairs(*pair)[0], covariance.pairs(*pair)[0] * factors[:6])
        np.testing.assert_array_equal(wider.block(one), covariance.block(one))


def test_what_all_collections_have_in_common_is_added_once(dense):
    covariance, size = Covariance(dense.equations, SCALE), 6 * dense.equations.layout.shared
    half = dense.rng.standard_normal((size, size))
    systematic = 1e-8 * half @ half.T
    before = systematic.copy()
    known = covariance.with_combined(systematic)
    assert not covariance.has_combined and covariance.combined is covariance
    assert known.has_combined
    np.testing.assert_array_equal(systematic, before)
    np.testing.assert_array_equal(known.shared, covariance.shared)
    free = dense.free[dense.free < size]
    kept = np.ix_(free, free)
    expected = covariance.shared[kept] + systematic[kept]
    np.testing.assert_allclose(known.combined.shared[kept], expected, rtol=1e-9)
    idle = dense.equations.layout.idle
    assert not known.combined.shared[idle].any() and not known.combined.shared[:, idle].any()
