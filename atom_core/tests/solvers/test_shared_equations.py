"""What each collection says of the shared numbers: together it is what the solver has."""

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.problem.board_errors import BoardSize
from atom_core.problem.model_errors import RangeOffset
from atom_core.problem.residuals import BorderBlock
from atom_core.solvers.choice import SOLVERS
from atom_core.solvers.covariance import Covariance
from atom_core.solvers.robust_covariance import sigma_factors
from atom_core.solvers.scalar_columns import scalars_of
from atom_core.solvers.shared_equations import inverse, shared_equations
from atom_core.synthetic import scenes

LOSS = "cauchy"


@pytest.fixture(scope="module", params=["plain", "with intrinsics"])
def solved(request):
    scene = scenes.random_scene(3, collections=12)
    intrinsics = ("rgb_1",) if request.param == "with intrinsics" else ()
    result = calibrate(scene.dataset, CalibrationOptions(intrinsics=intrinsics))
    assert result.status == "converged"
    return result


def equations_of(result, errors=(), common=None):
    solver, summary = SOLVERS["scipy"](result.problem), result.summary
    equations = solver.equations(summary.x, summary.sigmas, LOSS)
    scalars = scalars_of(solver, summary.x, summary.sigmas, LOSS, errors)
    common = common or [0.0] * len(result.problem.residual_blocks)
    found = shared_equations(result.problem, equations, scalars, summary.sigmas, {}, common)
    return equations, found


def test_all_collections_together_are_the_solvers_equations(solved):
    equations, found = equations_of(solved)
    size = 6 * found.blocks
    total = found.total[:size, :size]
    free = solved.problem.parameters.free[: found.blocks].ravel()
    expected = Covariance(equations).shared
    np.testing.assert_allclose(
        inverse(total)[np.ix_(free, free)], expected[np.ix_(free, free)], rtol=1e-5, atol=1e-16
    )


def test_at_the_solution_nothing_pulls(solved):
    _, found = equations_of(solved, [RangeOffset("lidar_1")])
    pull = found.gradient.sum(axis=0) + found.held_gradient
    scale = np.sqrt(np.diagonal(found.total))
    size = 6 * found.blocks
    assert np.max(np.abs(pull / scale)[:size]) < 0.01  # in sigmas that others leave free
    # No single collection is at rest by itself.
    assert np.max(np.abs(found.gradient / scale)[:, :size]) > 0.3


def test_columns_are_derivatives_of_the_cost(solved):
    error = BoardSize("pattern_1")
    _, found = equations_of(solved, [error])
    assert found.errors == (error,)
    borders = sum(isinstance(b, BorderBlock) for b in solved.problem.residual_blocks)
    assert found.shared == 6 * found.blocks + borders
    assert found.total.shape == (found.shared + 1, found.shared + 1)


def test_what_detections_have_in_common_makes_all_less_sure(solved):
    blocks = solved.problem.residual_blocks
    common = [0.05 if b.dimension == 2 else 0.002 for b in blocks]
    variances = []
    for parts in (None, common):
        _, found = equations_of(solved, common=parts)
        variances.append(np.diagonal(inverse(found.total)))
    free = np.flatnonzero(solved.problem.parameters.free[: found.blocks].ravel())
    assert np.all(variances[1][free] > variances[0][free])


def test_sigmas_of_a_healthy_rig_are_hardly_larger_and_never_smaller(solved):
    _, found = equations_of(solved)
    factors = sigma_factors(found, found, [])
    assert np.all(factors >= 1.0) and np.median(factors[: 6 * found.blocks]) < 1.5
