"""Numbers beside the poses by collection, against dense elimination of each collection's own."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from problems import problem_of  # noqa: E402

from atom_core.solvers import losses  # noqa: E402
from atom_core.solvers.detection_columns import DetectionColumns, collection_columns  # noqa: E402
from atom_core.solvers.levenberg_marquardt import LevenbergMarquardt  # noqa: E402
from atom_core.synthetic import scenes  # noqa: E402

COUNT = 3  # numbers beside the poses
SCENES = {
    "boards of their own": lambda: problem_of(scenes.random_scene, rgb=2, depth=0, lidar3d=1),
    "one board": lambda: problem_of(scenes.hand_eye),
}


class Dense:
    """A problem with random columns beside its poses, all rows at hand."""

    def __init__(self, problem):
        self.problem, sigmas = problem, problem.initial_sigmas
        x = np.full(problem.parameters.size, 1e-3)
        self.equations = LevenbergMarquardt(problem).equations(x, sigmas, losses.NONE)
        linearised = problem.linearise(x)
        self.jacobian = problem.jacobian(x, sigmas).toarray()
        rng, parts = np.random.default_rng(0), list(zip(problem.residual_blocks, sigmas))
        rows = [(r / s[:, None]).ravel() for r, (_, s) in zip(linearised.residuals, parts)]
        self.residual = np.concatenate(rows)
        states = [
            (j / s[:, None, None]).reshape(-1, 6) for j, (_, s) in zip(linearised.by_state, parts)
        ]
        self.by_state = np.concatenate(states)
        of_rows = [np.repeat(block.detection, block.dimension) for block, _ in parts]
        self.detection = np.concatenate(of_rows)
        self.columns = 0.1 * rng.standard_normal((len(self.residual), COUNT))
        names = np.array([key.collection for key in problem.detections])
        self.names, self.of_rows = sorted(set(names)), names[self.detection]

    def by_detection(self, apart=False):
        """Return the columns summed by detection; apart: the numbers' own squares only."""
        found = []
        for d in range(len(self.problem.detections)):
            mine = self.detection == d
            column, state = self.columns[mine], self.by_state[mine]
            information = column.T @ column
            information = np.diagonal(information) if apart else information
            found.append((information, column.T @ self.residual[mine], column.T @ state))
        return DetectionColumns(*(np.array(values) for values in zip(*found)))

    def found(self, columns, names=None):
        return collection_columns(self.problem, self.equations, names or self.names, columns)

    def expected(self, name, apart=False):
        """Return cross, information and gradient, own blocks eliminated from dense rows."""
        mine, size = self.of_rows == name, 6 * self.problem.parameters.shared_count
        shared, own = self.jacobian[mine, :size], self.jacobian[mine, size:]
        own = own[:, np.any(own != 0.0, axis=0)]
        column, residual = self.columns[mine], self.residual[mine]
        left, rest = column, residual
        if own.size:
            left = column - own @ np.linalg.lstsq(own, column, rcond=None)[0]
            rest = residual - own @ np.linalg.lstsq(own, residual, rcond=None)[0]
        information = column.T @ column
        information = np.diag(np.diagonal(information)) if apart else information
        gone = column.T @ (column - left)
        return shared.T @ left, information - gone, column.T @ rest


@pytest.fixture(scope="module", params=SCENES)
def dense(request):
    return Dense(SCENES[request.param]())


def close(found, expected):
    scale = np.max(np.abs(expected))
    np.testing.assert_allclose(found / scale, expected / scale, atol=1e-6)


@pytest.mark.parametrize("apart", [False, True], ids=["with common rows", "no row has two"])
def test_columns_of_a_collection_are_those_with_its_own_poses_eliminated(dense, apart):
    found = dense.found(dense.by_detection(apart))
    assert len(found.cross) == len(dense.names) > 2
    for g, name in enumerate(dense.names):
        cross, information, gradient = dense.expected(name, apart)
        close(found.cross[g], cross)
        close(found.information[g], information)
        close(found.gradient[g], gradient)


def test_collections_stand_in_the_order_asked_for(dense):
    columns = dense.by_detection()
    forwards, backwards = (dense.found(columns, dense.names[::s]) for s in (1, -1))
    for one, other in zip(forwards, backwards):
        np.testing.assert_array_equal(one, other[::-1])


def test_a_collection_that_tells_nothing_of_the_numbers_has_zeros(dense):
    columns = dense.by_detection()
    silent = np.array([k.collection == dense.names[0] for k in dense.problem.detections])
    for values in columns:
        values[silent] = 0.0
    found = dense.found(columns)
    for values in found:
        assert not values[0].any() and values[1].any()


def test_columns_are_linear_in_the_gradient(dense):
    columns = dense.by_detection()
    still = dense.found(columns._replace(gradient=np.zeros_like(columns.gradient)))
    moving = dense.found(columns)
    np.testing.assert_array_equal(still.cross, moving.cross)
    np.testing.assert_array_equal(still.information, moving.information)
    shift = moving.gradient - still.gradient
    for g, name in enumerate(dense.names):
        of_collection = [k.collection == name for k in dense.problem.detections]
        np.testing.assert_allclose(shift[g], columns.gradient[of_collection].sum(axis=0), rtol=1e-6)
