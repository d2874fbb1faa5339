"""Insets in steps of the sampling, as metres of a solver's problem."""

from types import SimpleNamespace

import numpy as np

from atom_core.solvers.insets import MOST_STEPS, apply_insets


class Told:
    """A solver and its problem in one, which note what they are told."""

    def __init__(self):
        self.insets, self.taken = [], []
        self.problem = self

    def with_insets(self, insets):
        self.insets.append(insets)
        return "the problem with insets"

    def take_insets(self, problem):
        self.taken.append(problem)


def test_each_block_gets_its_share_of_its_steps():
    across_m = {2: np.array([[0.01, 0.02]]), 5: np.array([[0.03, 0.04], [0.05, 0.06]])}
    columns = [SimpleNamespace(block=i, across=steps) for i, steps in across_m.items()]
    solver = Told()
    apply_insets(solver, columns, np.array([9.0, 9.0, 0.5, 9.0, 9.0, 2.0]))
    (insets,) = solver.insets
    assert set(insets) == {2, 5}
    np.testing.assert_allclose(insets[2], [[0.005, 0.01]])
    np.testing.assert_allclose(insets[5], [[0.06, 0.08], [0.10, 0.12]])
    assert solver.taken == ["the problem with insets"]


def test_without_border_blocks_nothing_is_done():
    solver = Told()
    apply_insets(solver, [], np.zeros(3))
    assert solver.insets == solver.taken == []


def test_the_last_sample_is_at_most_one_step_inside():
    assert MOST_STEPS == 1.0
