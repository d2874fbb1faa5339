"""Whether the transforms of moving parts fit: an arm, a pan-tilt, odometry.

The dataset says where such a part was in each collection, and the solution believes it. Here it may
stand elsewhere in each collection, by six numbers of its own, one Gauss-Newton step from the
solution. What that explains, and how far it would be off, is told; nothing is solved again.
"""

from __future__ import annotations

from itertools import groupby
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.calibration.prepare.moving_parts import moves
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, board_edge, pose
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import BLOCK_SIZE, ROTATION, TRANSLATION
from atom_core.problem.problem import Problem
from atom_core.solvers import losses
from atom_core.solvers.base import Solver
from atom_core.solvers.normal_equations import NormalEquations, summed
from atom_core.solvers.shared_equations import inverse as inverse_of

_FEWEST = 4  # collections
_MUCH = 4.0  # times what chance allows, over all collections and in the middle of them
_SEEN = 1e-6  # part of its information that boards of a collection must leave a direction
_LEAST_M, _LEAST_RAD = 3e-4, float(np.radians(0.02))  # less is nobody's concern
_FIRST_M, _FIRST_RAD, _ROUNDS = 0.005, 0.01, 200
Run = Tuple[Edge, ...]


class MovingEdge(NamedTuple):
    """Transforms that do not fit from collection to collection.

    Attributes:
        parent, child: between which frames they are.
        last_parent: of the last edge between them.
        sigma_m, sigma_rad: by how much they are off, along and about each axis of the child.
        gain: by how much the cost (twice the negative logarithm of the likelihood) would fall.
        collections: the worst first.
    """

    parent: str
    child: str
    sigma_m: float
    sigma_rad: float
    gain: float
    collections: Tuple[str, ...]
    last_parent: str

    @property
    def why(self) -> str:
        """One sentence for the user."""
        worst = ", ".join(self.collections[:3])
        return (
            f"the poses of '{self.child}' in '{self.parent}' do not fit: they are off by "
            f"{1e3 * self.sigma_m:.2g} mm and {np.degrees(self.sigma_rad):.2g} deg along and about "
            f"each axis, from collection to collection (worst in {worst}); look at the arm's own "
            f"calibration, and at whether it stood still; --moving_edge_sigma {self.child} gives "
            f"it room in the solution"
        )


def moving_edges(
    dataset: Dataset, solver: Solver, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str
) -> List[MovingEdge]:
    """Return the transforms that do not fit, what explains most first.

    Args:
        dataset: with the solution in its transforms.
        solver: of the problem that was solved.
        x: its solution.
        sigmas: for each residual block, (n,) in its unit.
        loss: robust loss.
    """
    problem = solver.problem
    runs = moving_runs(dataset, problem)
    if not runs:
        return []
    equations, squares = solver.equations(x, sigmas, loss), solver.squares(x, sigmas)
    states = equations.state_jacobians.shape[2]
    sums = summed(equations.parts, len(problem.detections), states)
    graph, found = dataset.graph, []
    for run, walked in runs.items():
        keys = dict.fromkeys(problem.detections[d].collection for d in walked)
        child = run[-1].child
        parts = []
        for key in keys:
            sensors_T_child = {
                d: pose(dataset.collections[key], graph, _frame(dataset, problem, d), child)
                for d in walked
                if problem.detections[d].collection == key
            }
            twists = {d: walked[d] * se3.adjoint(T) for d, T in sensors_T_child.items()}
            parts.append(_part(problem, equations, sums, key, twists))
        rows = _weighted_squares(problem, squares, loss, walked)
        found.append(_judged(problem, run, parts, rows))
    return sorted((edge for edge in found if edge is not None), key=lambda e: -e.gain)


def moving_runs(dataset: Dataset, problem: Problem) -> Dict[Run, Dict[int, float]]:
    """Return runs of moving edges, base first; and by detection whether it walks there (+) or back.

    Moving is what changes from collection to collection and is not estimated. Boards are none of
    it: one that is held stays where it is said to be.
    """
    boards = {board_edge(pattern) for pattern in dataset.patterns.values()}
    estimated = boards | {block.edge for block in problem.parameters.blocks}
    graph = dataset.graph
    moving: Dict[Edge, bool] = {}
    by_pair: Dict[Tuple[str, str], List[int]] = {}
    for d, key in enumerate(problem.detections):
        by_pair.setdefault((key.sensor, key.pattern), []).append(d)
    runs: Dict[Run, Dict[int, float]] = {}
    for (sensor, pattern), detections in by_pair.items():
        chain = graph.chain(dataset.sensors[sensor].frame, dataset.patterns[pattern].frame)
        for step in chain:
            if step.edge not in moving:
                moving[step.edge] = step.edge not in estimated and moves(dataset, step.edge)
        for back, steps in groupby(chain, lambda s: s.inverted if moving[s.edge] else None):
            if back is None:
                continue
            edges = tuple(step.edge for step in steps)
            walked = dict.fromkeys(detections, -1.0 if back else 1.0)
            runs.setdefault(edges[::-1] if back else edges, {}).update(walked)
    return runs


class _Part(NamedTuple):
    """What one collection says of the moving part's twist, first, and of the shared numbers.

    Attributes:
        collection: its key.
        information: (6 + 6 s, 6 + 6 s), boards of the collection eliminated.
        gradient: (6 + 6 s,).
        gain: by how much the cost falls where the moving part is free in it.
        rank: how many of its six numbers the collection sees.
    """

    collection: str
    information: np.ndarray
    gradient: np.ndarray
    gain: float
    rank: int


def _weighted_squares(
    problem: Problem, squares: Sequence[np.ndarray], loss: str, walked: Mapping[int, float]
) -> Tuple[float, int]:
    """Return the weighted sum of the squares of some detections' rows, and their number."""
    total, count = 0.0, 0
    for block, square in zip(problem.residual_blocks, squares):
        mine = np.isin(block.detection, list(walked))
        total += float(np.sum(losses.weight(loss, square[mine]) * square[mine]))
        count += int(np.sum(mine)) * block.dimension
    return total, count


def _judged(
    problem: Problem, run: Run, parts: Sequence[_Part], rows: Tuple[float, int]
) -> Optional[MovingEdge]:
    """Return a run whose poses do not fit, else None."""
    gain, rank = (np.array([getattr(part, name) for part in parts]) for name in ("gain", "rank"))
    total = int(np.sum(rank))
    # What the solution has fitted to them already is lost to the test.
    left = total - min(BLOCK_SIZE * problem.parameters.shared_count, total // 2)
    # The weights take all residuals for noise: what the moving parts leave of it is the noise.
    noise = max(rows[0] - np.sum(gain), 0.0) / max(rows[1] - total, 1)
    chance = max(noise, 1e-9) * np.maximum(rank, 1)
    if np.sum(rank > 0) < _FEWEST or np.sum(gain) < _MUCH * noise * left:
        return None
    if np.median((gain / chance)[rank > 0]) < _MUCH:
        return None
    sigma_m, sigma_rad = _spread(parts, max(noise, 1e-9))
    if sigma_m < _LEAST_M and sigma_rad < _LEAST_RAD:
        return None
    order = np.argsort(-gain)
    worst = tuple(parts[i].collection for i in order)
    return MovingEdge(
        run[0].parent, run[-1].child, sigma_m, sigma_rad, float(np.sum(gain)), worst, run[-1].parent
    )


def _spread(parts: Sequence[_Part], noise: float) -> Tuple[float, float]:
    """Return the standard deviations [m, rad] of the moving part's place in the collections.

    Expectation maximisation: the twists given their spread, with the shared numbers free beside
    them; then the spread given the twists and how uncertain they are (Dempster, Laird, Rubin 1977).
    """
    n = BLOCK_SIZE
    information = np.array([part.information for part in parts]) / noise
    gradient = np.array([part.gradient for part in parts]) / noise
    own, cross = information[:, :n, :n], information[:, :n, n:]
    variance = np.array([_FIRST_RAD**2] * 3 + [_FIRST_M**2] * 3)
    for _ in range(_ROUNDS):
        inverse = np.linalg.inv(own + np.diag(1.0 / variance))
        gains = inverse @ cross
        shared = information[:, n:, n:] - np.swapaxes(cross, 1, 2) @ gains
        slope = gradient[:, n:] - np.einsum("cns,cn->cs", gains, gradient[:, :n])
        covariance = inverse_of(shared.sum(axis=0))
        step = -covariance @ slope.sum(axis=0)
        twist = -np.einsum("cnm,cm->cn", inverse, gradient[:, :n]) - gains @ step
        spread = inverse + gains @ covariance @ np.swapaxes(gains, 1, 2)
        square = np.mean(twist**2 + np.diagonal(spread, axis1=1, axis2=2), axis=0)
        after = np.repeat([np.mean(square[ROTATION]), np.mean(square[TRANSLATION])], 3)
        settled = np.allclose(after, variance, rtol=1e-3)
        variance = np.maximum(after, 1e-14)
        if settled:
            break
    return float(np.sqrt(variance[n - 1])), float(np.sqrt(variance[0]))


def _frame(dataset: Dataset, problem: Problem, detection: int) -> str:
    return dataset.sensors[problem.detections[detection].sensor].frame


def _part(
    problem: Problem,
    equations: NormalEquations,
    sums: Tuple[np.ndarray, np.ndarray],
    key: str,
    twists: Mapping[int, np.ndarray],
) -> _Part:
    """Return what a collection says of a twist of the moving part, boards eliminated.

    Args:
        problem: that was solved.
        equations: at the solution.
        sums: information and gradient of all detections by their states.
        key: of the collection.
        twists: by detection, (6, 6) its twist in the sensor by that of the moving part.
    """
    layout, n, (information, gradient) = equations.layout, BLOCK_SIZE, sums
    states, size = equations.state_jacobians.shape[2], BLOCK_SIZE * (1 + layout.shared)
    mine = [d for d, k in enumerate(problem.detections) if k.collection == key]
    jacobian, group = np.zeros((len(mine), states, size + n * layout.width)), -1
    for row, d in zip(jacobian, mine):
        if d in twists:
            row[:n, :n] = twists[d]
        for k, block in enumerate(problem.dependencies[d]):
            if block < 0:
                continue
            is_local = layout.group[block] >= 0
            group = int(layout.group[block]) if is_local else group
            start = (size if is_local else n) + n * int(layout.position[block])
            row[:, start : start + n] += equations.state_jacobians[d, k]
    every = np.einsum("dsp,dsq->pq", jacobian, information[mine] @ jacobian)
    slope = np.einsum("dsp,ds->p", jacobian, gradient[mine])
    head, own = every[:size, :size], slope[:size]
    if group >= 0:
        slope[size:] = equations.gradient_local[group]  # with what is expected of them
        head, own = _without_boards(every, slope, equations.local[group], size)
    values, vectors, scale = _directions(head[:n, :n])
    seen = values > _SEEN
    along = vectors.T @ (own[:n] * scale)
    gain = float(np.sum(np.where(seen, along**2 / np.where(seen, values, 1.0), 0.0)))
    return _Part(key, head, own, gain, int(np.sum(seen)))


def _without_boards(
    every: np.ndarray, slope: np.ndarray, local: np.ndarray, size: int
) -> Tuple[np.ndarray, np.ndarray]:
    """Return information and gradient of the first numbers (size,), the others eliminated."""
    cross = every[size:, :size]
    solved = np.linalg.lstsq(local, np.column_stack([cross, slope[size:]]), rcond=None)[0]
    head, own = (
        every[:size, :size] - cross.T @ solved[:, :size],
        slope[:size] - cross.T @ solved[:, -1],
    )
    alone = np.maximum(np.diagonal(every)[:BLOCK_SIZE], 1e-30)
    # Where the boards follow all of a twist, nothing is left but rounding.
    unseen = np.flatnonzero(np.diagonal(head)[:BLOCK_SIZE] < _SEEN * alone)
    head[unseen], head[:, unseen], own[unseen] = 0.0, 0.0, 0.0
    return head, own


def _directions(information: np.ndarray) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return eigenvalues (6,) and vectors (6, 6) of an information scaled to ones; the scale."""
    diagonal = np.diagonal(information)
    scale = np.where(diagonal > 0, 1.0 / np.sqrt(np.maximum(diagonal, 1e-30)), 0.0)
    values, vectors = np.linalg.eigh(information * scale[:, None] * scale)
    return values, vectors, scale
