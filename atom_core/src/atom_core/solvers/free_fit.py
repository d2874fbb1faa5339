"""Every detection fitted by itself, to a pose of the board of its own.

What is then left is the noise of its corners or points, and what is wrong within one detection.
"""

from __future__ import annotations

from typing import List, Sequence, Tuple

import numpy as np

from atom_core.model.transforms import Edge
from atom_core.problem.blocks import PATTERN, PoseBlock
from atom_core.problem.parameters import Parameters
from atom_core.problem.problem import PoseChains, Problem
from atom_core.problem.residuals import ResidualBlock
from atom_core.solvers.base import Solver, SolverFactory
from atom_core.solvers.criteria import ROUGH

_ITERATIONS = 20


def distances_alone(
    problem: Problem,
    x: np.ndarray,
    sigmas: Sequence[np.ndarray],
    loss: str,
    make_solver: SolverFactory,
) -> List[np.ndarray]:
    """Return for each residual block the distances (n,) where each detection has its own pose.

    Args:
        problem: whose detections.
        x: from where they are fitted.
        sigmas: for each residual block, (n,) in its unit.
        loss: robust loss.
        make_solver: which solver.
    """
    now = problem.with_cameras(x)
    poses, count = problem.poses(x), len(problem.detections)
    # Parameters stand in the order of their collections: names that sort as the detections do.
    names = [f"{i:0{len(str(count))}d}" for i in range(count)]
    blocks = [
        PoseBlock(Edge(key.sensor, f"{key.pattern}_{name}"), PATTERN, name, (key.pattern,), pose)
        for name, key, pose in zip(names, problem.detections, poses)
    ]
    chains = PoseChains(
        np.tile(np.eye(4), (count, 2, 1, 1)),
        np.arange(count)[:, None],
        np.zeros((count, 1), dtype=bool),
    )
    free = Problem(Parameters(blocks), problem.detections, chains, now.residual_blocks)
    solver = make_solver(free)
    end = solver.minimise(np.zeros(free.parameters.size), sigmas, loss, _ITERATIONS, ROUGH)
    return distances(solver, end.x, sigmas)


def distances(solver: Solver, x: np.ndarray, sigmas: Sequence[np.ndarray]) -> List[np.ndarray]:
    """Return for each residual block the norms (n,) of its residuals [px or m]."""
    return [np.sqrt(square) * s for square, s in zip(solver.squares(x, sigmas), sigmas)]


def medians(block: ResidualBlock, values: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return the detections (m,) of a block, and the median of what each one's items have (m,).

    Args:
        block: whose items.
        values: (n,) theirs.
    """
    detections = np.array([detection for detection, _ in block.segments], dtype=int)
    return detections, np.array([median(values[items]) for _, items in block.segments])


def median(values: np.ndarray) -> float:
    """Return the median of (n,), far sooner than numpy's function where there are few."""
    middle = len(values) // 2
    if len(values) % 2 == 1:
        return float(np.partition(values, middle)[middle])
    return float(np.partition(values, (middle - 1, middle))[middle - 1 : middle + 1].mean())
