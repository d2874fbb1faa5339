"""One board, fitted to some of its detections while all sensors stay where they are."""

from __future__ import annotations

from typing import Dict, List, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.calibration.refine.disagreement import FAR_SQUARE, MOST
from atom_core.geometry import se3
from atom_core.problem.blocks import BLOCK_SIZE, PoseBlock
from atom_core.problem.measurements import Measurement
from atom_core.problem.parameters import Parameters
from atom_core.problem.problem import PoseChains, Problem
from atom_core.solvers import losses
from atom_core.solvers.base import Solver, SolverFactory
from atom_core.solvers.criteria import SETTLING

_STARTS = 3  # of the candidate poses, so many are followed to their minimum
_ITERATIONS = 50
_SAME = 1e-9  # of the cost


class Fit(NamedTuple):
    """A board's pose for some of its detections.

    Attributes:
        parent_T_pattern: (4, 4).
        cost: robust cost of these detections.
        outlier_share: of their corners and points, those grossly off.
    """

    parent_T_pattern: np.ndarray
    cost: float
    outlier_share: float


class BoardFits:
    """Fits of one board to subsets of its detections; each subset is solved once."""

    def __init__(
        self,
        problem: Problem,
        x: np.ndarray,
        sigmas: Sequence[np.ndarray],
        block: int,
        measurements: Dict[int, Measurement],
        loss: str,
        make_solver: SolverFactory,
    ):
        """Take over the state of a problem.

        Args:
            problem: whose board.
            x: where all sensors stay.
            sigmas: for each residual block, (n,).
            block: index of the board's parameter block.
            measurements: the board's, by the index of their detection.
            loss: robust loss.
            make_solver: which solver.
        """
        self._problem, self._sigmas, self._loss = problem.with_cameras(x), sigmas, loss
        self._make_solver, self._zero = make_solver, np.zeros(BLOCK_SIZE)
        poses = problem.parameters.poses(x)
        self._own, self.now = problem.parameters.blocks[block], poses[block]
        self._around = {d: problem.chains.around(poses, d, block) for d in measurements}
        self._candidates = {d: self._as_board(d, m) for d, m in measurements.items()}
        self._found: Dict[Tuple[int, ...], Fit] = {}

    def _as_board(self, detection: int, measurement: Measurement) -> List[np.ndarray]:
        before, after, inverted = self._around[detection]
        boards = [
            se3.inverse(before) @ pose @ se3.inverse(after) for pose in measurement.candidates()
        ]
        return [se3.inverse(b) for b in boards] if inverted else boards

    def fit(self, detections: Sequence[int]) -> Fit:
        """Return the best pose for some of the detections."""
        key = tuple(sorted(detections))
        if key not in self._found:
            self._found[key] = self._fit(key)
        return self._found[key]

    def _fit(self, detections: Tuple[int, ...]) -> Fit:
        problem, sigmas = self._restricted(detections)
        solver = self._make_solver(problem)
        starts = [self._numbers(p) for d in detections for p in self._candidates[d]]
        starts.append(self._zero)
        costs = [self._cost(solver, x, sigmas) for x in starts]
        ends = [
            solver.minimise(starts[i], sigmas, self._loss, _ITERATIONS, SETTLING)
            for i in _different(costs)[:_STARTS]
        ]
        best = min(ends, key=lambda end: end.cost)
        squares = np.concatenate(solver.squares(best.x, sigmas))
        share = float(np.mean(squares > FAR_SQUARE))
        return Fit(problem.parameters.poses(best.x)[0], best.cost, share)

    def cost_now(self, detections: Sequence[int]) -> float:
        """Return the robust cost of some of the detections where the board stands."""
        problem, sigmas = self._restricted(tuple(sorted(detections)))
        return self._cost(self._make_solver(problem), self._zero, sigmas)

    def _cost(self, solver: Solver, x: np.ndarray, sigmas: Sequence[np.ndarray]) -> float:
        return sum(losses.cost(self._loss, s) for s in solver.squares(x, sigmas))

    def is_garbage(self, detection: int) -> bool:
        """Tell whether no pose of the board explains most of a detection."""
        return self.fit([detection]).outlier_share > MOST

    def disagreement(self, detections: Sequence[int]) -> float:
        """Return a chi-square: what it costs that all of them share one pose."""
        own = sum(self.fit([d]).cost for d in detections)
        return 2.0 * (self.fit(detections).cost - own)

    def _numbers(self, pose: np.ndarray) -> np.ndarray:
        turn = se3.rotation_vector_from_rotation(self.now[:3, :3].T @ pose[:3, :3])
        return np.concatenate([turn, pose[:3, 3] - self.now[:3, 3]])

    def _restricted(self, detections: Tuple[int, ...]) -> Tuple[Problem, List[np.ndarray]]:
        """Return the problem of the board alone, and its sigmas."""
        own, n = self._own, len(detections)
        parameters = Parameters([PoseBlock(own.edge, own.kind, None, own.names, self.now)])
        around = [self._around[d] for d in detections]
        constants = np.array([[before, after] for before, after, _ in around])
        inverted = np.array([[turned] for _, _, turned in around])
        chains = PoseChains(constants, np.zeros((n, 1), dtype=int), inverted)
        number = np.full(len(self._problem.detections), -1)
        number[list(detections)] = np.arange(n)
        blocks, sigmas = [], []
        for block, sigma in zip(self._problem.residual_blocks, self._sigmas):
            chosen = number[block.detection] >= 0
            if np.any(chosen):
                blocks.append(block.of_items(chosen, number[block.detection[chosen]]))
                sigmas.append(sigma[chosen])
        keys = tuple(self._problem.detections[d] for d in detections)
        return Problem(parameters, keys, chains, tuple(blocks)), sigmas


def _different(costs: Sequence[float]) -> List[int]:
    """Return the order of rising costs, without those that equal the one before.

    Poses that range sensors cannot tell apart cost the same and lead to the same minimum.
    """
    order = [int(i) for i in np.argsort(costs)]
    return [
        i
        for last, i in zip([None, *order], order)
        if last is None or costs[i] - costs[last] > _SAME * costs[i]
    ]
