"""A calibration that is solved: what is judged."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Mapping

import numpy as np

from atom_core.calibration.judge.reasons import Solution
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.preparation import Prepared
from atom_core.calibration.refine.refinement import Refined
from atom_core.calibration.start.boards import solved_dataset
from atom_core.calibration.start.starts import ChosenStart, InitialProblem, Starts
from atom_core.model.dataset import Dataset
from atom_core.problem.problem import Problem
from atom_core.solvers.base import SolverSetup


@dataclass(frozen=True)
class Solved:
    """A calibration that is solved and not yet judged: poses without sigmas, status or verdict.

    Attributes:
        given: the dataset as it came.
        options: what to hold, how to solve.
        prepared, starts, chosen, refined: the steps' values.
        setup: which solver.
        seconds: time by step, so far.
    """

    given: Dataset
    options: CalibrationOptions
    prepared: Prepared
    starts: Starts
    chosen: ChosenStart
    refined: Refined
    setup: SolverSetup
    seconds: Mapping[str, float]

    @property
    def start(self) -> InitialProblem:
        """What the problem was built from."""
        return self.chosen.solution.start

    @property
    def problem(self) -> Problem:
        """As it is in the end."""
        return self.refined.solver.problem

    @property
    def dataset(self) -> Dataset:
        """The input with the calibrated edges and board poses in its transforms."""
        return self.solution.dataset

    @cached_property
    def solution(self) -> Solution:
        """The problem at its solution."""
        return self.at(self.refined.summary.x)

    def at(self, x: np.ndarray) -> Solution:
        """Return the problem at a vector (p,), with the boards that some detection is of."""
        initial, problem = self.start.initial, self.problem
        used = {initial.patterns[k.pattern].board_key(k.collection) for k in problem.detections}
        boards = {key: pose for key, pose in self.start.boards.items() if key in used}
        return Solution(solved_dataset(initial, problem, x, boards), problem, x)
