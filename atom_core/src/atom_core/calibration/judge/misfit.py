"""Whether the sensors fit the joint solution as well as each of their detections fits by itself.

Every detection is fitted alone, to a pose of the board of its own, from where the joint solution
has it. What is then left is the noise of its corners or points, and what is wrong within one
detection. Where the joint solution leaves far more, no noise explains it: something that all
detections are assumed to share does not hold. The estimated weights cannot tell; they grow with
the residuals.
"""

from __future__ import annotations

from typing import Dict, List, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.problem.blocks import SENSOR
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import BORDER, ORTHOGONAL, REPROJECTION
from atom_core.solvers.base import Solver, SolverFactory
from atom_core.solvers.free_fit import distances, distances_alone, medians

# By which factor the joint fit must be worse than the fit alone, and by how much [px, m, m].
_FACTOR = {REPROJECTION: 1.5, ORTHOGONAL: 1.5, BORDER: 2.0}
_EXCESS = {REPROJECTION: 0.5, ORTHOGONAL: 0.01, BORDER: 0.01}
_UNITS = {
    REPROJECTION: ("corners", 1.0, "px"),
    ORTHOGONAL: ("points on the board", 1e3, "mm"),
    BORDER: ("border points", 1e3, "mm"),
}
# Where to look.
BOARD, INTRINSICS = "the board's squares, layout and border", "its intrinsics"
POINTS = "the unit and axes of its points"
_LIKELY = {
    REPROJECTION: (INTRINSICS, BOARD),
    ORTHOGONAL: (POINTS, BOARD),
    BORDER: (BOARD, POINTS),
}
# So far off, what the sensor itself says of the board comes first.
_GROSS = {REPROJECTION: 50.0, ORTHOGONAL: 0.03, BORDER: 0.03}
_ALL_OF_POINTS = "its points (unit, axes, whether labels and data belong to these collections)"
_GROSS_LIKELY = {
    REPROJECTION: (
        "its labels (whether they belong to these collections, how corners are numbered, and "
        "whether its images are mirrored)",
        INTRINSICS,
    ),
    ORTHOGONAL: (_ALL_OF_POINTS, BOARD),
    BORDER: (_ALL_OF_POINTS, BOARD),
}
_MOVING = "the poses of links that move"
_STILL = 1e-6  # by which a number of a chain may differ where nothing moves
_FEWEST = 2  # detections, to speak of a sensor


class Misfit(NamedTuple):
    """One kind of residual of one sensor, in the middle of its detections.

    Attributes:
        sensor, kind: of which residuals.
        alone: distance of a corner or point [px or m] where each detection has its own pose.
        joint: likewise in the joint solution.
        collections: in which the joint fit is much worse, the worst first.
        moves: whether links between it and a board stand otherwise in other collections.
        beside: the other sensors that one calibrated edge puts where they are, together with it.
    """

    sensor: str
    kind: str
    alone: float
    joint: float
    collections: Tuple[str, ...]
    moves: bool
    beside: Tuple[str, ...] = ()

    @property
    def likely(self) -> Tuple[str, ...]:
        """Where to look, the likeliest first."""
        gross = self.joint > _GROSS[self.kind]
        found = list(_GROSS_LIKELY[self.kind] if gross else _LIKELY[self.kind])
        if self.moves:
            found.insert(1 if gross else 0, _MOVING)
        if self.beside:
            others = ", ".join(self.beside)
            found.insert(1 if gross else 0, f"its transform to {others} (they hang on one edge)")
        return tuple(found)

    @property
    def why(self) -> str:
        """One clause for the user: how much, where, and what is likely."""
        what, scale, unit = _UNITS[self.kind]
        worst, likely = ", ".join(self.collections[:3]), ", then at ".join(self.likely)
        return (
            f"{what} of {self.sensor} are {scale * self.joint:.3g} {unit} off, but "
            f"{scale * self.alone:.3g} {unit} where each board may stand as this sensor alone has "
            f"it (worst in {worst}): noise does not explain it; look at {likely}"
        )


def misfits(
    solver: Solver,
    x: np.ndarray,
    sigmas: Sequence[np.ndarray],
    loss: str,
    make_solver: SolverFactory,
) -> List[Misfit]:
    """Return the sensors that the joint solution does not fit, the worst first.

    Args:
        solver: of the problem that was solved.
        x: its solution.
        sigmas: for each residual block, (n,) in its unit.
        loss: robust loss.
        make_solver: which solver.
    """
    problem, found = solver.problem, []
    joint = distances(solver, x, sigmas)
    blocks = problem.residual_blocks
    middles = [np.median(medians(block, d)[1]) for block, d in zip(blocks, joint)]
    if all(middle <= _EXCESS[block.kind] for block, middle in zip(blocks, middles)):
        return []  # by themselves they could not fit so much better
    alone = distances_alone(problem, x, sigmas, loss, make_solver)
    for block, together, own in zip(problem.residual_blocks, joint, alone):
        detections, by_joint = medians(block, together)
        _, by_itself = medians(block, own)
        joint_middle, alone_middle = np.median(by_joint), np.median(by_itself)
        if len(detections) < _FEWEST or not _is_worse(block.kind, joint_middle, alone_middle):
            continue
        order = np.argsort(-by_joint)
        worse = order[_is_worse(block.kind, by_joint, by_itself)[order]]
        names = tuple(problem.detections[d].collection for d in detections[worse])
        both = float(alone_middle), float(joint_middle)
        moves, beside = _moves(problem, detections), _beside(problem, block.sensor)
        found.append(Misfit(block.sensor, block.kind, *both, names, moves, beside))
    return sorted(found, key=lambda m: -m.joint / max(m.alone, 1e-12))


def _is_worse(kind: str, joint: np.ndarray, alone: np.ndarray) -> np.ndarray:
    """Tell (n,) where the joint fit is worse than noise explains; also of single figures."""
    excess = np.sqrt(np.maximum(joint**2 - alone**2, 0.0))
    return (excess > _EXCESS[kind]) & (joint > _FACTOR[kind] * alone)


def _beside(problem: Problem, sensor: str) -> Tuple[str, ...]:
    """Return the sensors that share a sensor's calibrated edge, if it has none of its own."""
    of_sensors = [b.names for b in problem.parameters.blocks if b.kind == SENSOR]
    mine = [names for names in of_sensors if sensor in names]
    if not mine or (sensor,) in mine:
        return ()
    return tuple(name for name in mine[0] if name != sensor)


def _moves(problem: Problem, detections: np.ndarray) -> bool:
    """Tell whether what is held in the chains of a sensor's detections (n,) differs."""
    of_pattern: Dict[str, List[int]] = {}
    for detection in detections:
        of_pattern.setdefault(problem.detections[detection].pattern, []).append(detection)
    constants = [problem.chains.constants[chosen] for chosen in of_pattern.values()]
    return any(float(np.max(np.ptp(held, axis=0))) > _STILL for held in constants)
