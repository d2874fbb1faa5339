"""Sigmas that do not settle: the data do not tell which of the sensors scatters.

Two cameras that see the same boards, and whose intrinsics or stamps are a little wrong, contradict
each other. The board stands between them, nearer to the one of the smaller sigma, which so gets
residuals that are smaller still: how the contradiction is divided is all but free, and the rounds
of reweighting drift. Then what is known is taken. The noise of a sensor's labels is what each of
its detections leaves by itself. What the joint fit leaves beyond that is the same for all sensors
of one kind, and shared by all items of a detection, which count as the few numbers of a pose.
"""

from __future__ import annotations

from typing import Dict, List, Mapping, Sequence, Tuple

import numpy as np

from atom_core.problem.residuals import BORDER, ORTHOGONAL, REPROJECTION, ResidualBlock
from atom_core.solvers.base import ATOM, Solver, SolverSetup, SolverSummary
from atom_core.solvers.free_fit import distances, distances_alone, medians
from atom_core.solvers.reweighting import solve_with_sigmas
from atom_core.solvers.variance_components import MEDIAN_OF_NORM, SMALLEST_SIGMA

_ROUNDS = 5
_NOTHING = 0.2  # of the noise's variance: so much more is left by chance
_NUMBERS = {REPROJECTION: 6, ORTHOGONAL: 3, BORDER: 3}  # of a pose that the items of a kind tell


def settled(
    solver: Solver, summary: SolverSummary, setup: SolverSetup
) -> Tuple[SolverSummary, Tuple[str, ...]]:
    """Return a solution whose sigmas have settled as it is, another one with bounded sigmas.

    Args:
        solver: of the problem.
        summary: its solution.
        setup: which solver.

    Returns:
        The solution, and what the user should know.
    """
    if summary.settled or summary.interrupted or setup.options.weights == ATOM:
        return summary, ()
    blocks, loss = solver.problem.residual_blocks, setup.options.loss
    initial = solver.problem.initial_sigmas
    alone = distances_alone(solver.problem, summary.x, initial, loss, setup.make)
    noise = [_noise(block, own) for block, own in zip(blocks, alone)]
    sigmas: Sequence[np.ndarray] = initial
    beyond: Mapping[str, float] = {}
    for _ in range(_ROUNDS):
        summary = solve_with_sigmas(solver, setup.options, summary, sigmas)
        if summary.interrupted:
            break
        beyond = _beyond_noise(blocks, noise, distances(solver, summary.x, sigmas))
        sigmas = _sigmas(blocks, noise, beyond)
    return summary, (_remark(blocks, beyond),)


def _noise(block: ResidualBlock, alone: np.ndarray) -> float:
    """Return the standard deviation of a block's labels, from the distances (n,) of free fits."""
    rows = block.count * block.dimension
    used = _NUMBERS[block.kind] * len(np.unique(block.detection))
    redundancy = max(rows - used, 0.05 * rows)
    middle = float(np.median(alone)) / MEDIAN_OF_NORM[block.dimension]
    return max(middle * float(np.sqrt(rows / redundancy)), SMALLEST_SIGMA[block.kind])


def _beyond_noise(
    blocks: Sequence[ResidualBlock], noise: Sequence[float], joint: Sequence[np.ndarray]
) -> Dict[str, float]:
    """Return by kind the variance that the joint fit leaves beyond the noise of labels.

    Args:
        blocks: of the problem.
        noise: the standard deviation of each block's labels.
        joint: for each block, distances (n,) in the joint fit.
    """
    shared: Dict[str, List[np.ndarray]] = {}
    for block, own_sigma, together in zip(blocks, noise, joint):
        of_detections = medians(block, together)[1] / MEDIAN_OF_NORM[block.dimension]
        excess = of_detections**2 - own_sigma**2
        if np.median(excess) < _NOTHING * own_sigma**2:
            excess = np.zeros_like(excess)
        shared.setdefault(block.kind, []).append(excess)
    middles = {kind: float(np.median(np.concatenate(each))) for kind, each in shared.items()}
    return {kind: max(middle, 0.0) for kind, middle in middles.items()}


def _sigmas(
    blocks: Sequence[ResidualBlock], noise: Sequence[float], beyond: Mapping[str, float]
) -> List[np.ndarray]:
    """Return for each block the sigmas (n,) at which its detections count as what they tell.

    Errors of size e that all n rows of a detection share leave of them the information of k
    independent numbers, k of a pose: as much as independent errors of variance e^2 n / k.
    """
    found = []
    for block, own_sigma in zip(blocks, noise):
        rows = block.dimension * float(np.median(np.bincount(block.detection)[block.detection]))
        share = max(rows / _NUMBERS[block.kind], 1.0)
        sigma = np.sqrt(own_sigma**2 + share * beyond[block.kind])
        found.append(block.sigma * (sigma / float(np.median(block.sigma))))
    return found


def _remark(blocks: Sequence[ResidualBlock], beyond: Mapping[str, float]) -> str:
    """Return what is not told; that cameras contradict the rest only where they do."""
    names = list(dict.fromkeys(block.sensor for block in blocks))
    told = (
        f"the data do not tell by how much each of {', '.join(names)} scatters (the sigmas do not "
        f"settle): the noise of their labels alone was taken"
    )
    if not any(beyond.values()):
        return f"{told}; beyond it nothing is left, the sensors agree; more boards tell more"
    told = f"{told}, and beyond it the same scatter for all sensors of a kind"
    if not beyond.get(REPROJECTION):  # few points on a border fit a pose of their own anyway
        return f"{told}; more boards tell more"
    return f"{told}; the cameras contradict the rest, look at their intrinsics"
