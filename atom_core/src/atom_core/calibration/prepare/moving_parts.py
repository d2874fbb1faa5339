"""Moving parts: arms, pan-tilts, odometry. Which there are, and what tells how far they are off."""

from __future__ import annotations

from typing import Dict, List, Mapping, Optional, Sequence, Set, Tuple

import numpy as np

from atom_core.calibration.options import CalibrationOptions
from atom_core.errors import CalibrationError
from atom_core.model.dataset import Dataset, board_edge
from atom_core.model.transforms import Edge
from atom_core.problem.builder import FreeEdges
from atom_core.problem.measurements import Measurement
from atom_core.solvers.base import SIGMA

_MOVED = 1e-9  # entries of a transform that differ by less do not
_OPTION = "--moving_edge_sigma"
Sigmas = Optional[Tuple[float, float]]


def moves(dataset: Dataset, edge: Edge) -> bool:
    """Tell whether a transform changes from collection to collection."""
    values = [c.transforms[edge] for c in dataset.collections.values() if edge in c.transforms]
    return len(values) > 0 and bool(np.max(np.ptp(np.array(values), axis=0)) > _MOVED)


def moving_frames(dataset: Dataset) -> Dict[str, Edge]:
    """Return the last edge of each run of moving edges between sensors and boards, by its child."""
    edges = [edge for edge in _passed(dataset) if moves(dataset, edge)]
    parents = {edge.parent for edge in edges}
    return {edge.child: edge for edge in edges if edge.child not in parents}


def moving_parts(
    dataset: Dataset, options: CalibrationOptions, free: FreeEdges
) -> Dict[Edge, Sigmas]:
    """Return the edges that are to be off by so many metres and radians; None: to be estimated.

    Raises:
        CalibrationError: a frame that is not there, does not move, or is estimated already.
    """
    wanted = options.moving_edge_sigma
    if wanted and options.solver.weights != SIGMA:
        raise CalibrationError(f"{_OPTION} needs --weights sigma")
    passed = {edge.child: edge for edge in _passed(dataset)}
    taken = _estimated(dataset, free)
    there = ", ".join(moving_frames(dataset)) or "none"
    for frame in wanted:
        if frame not in passed:
            raise CalibrationError(
                f"{_OPTION} {frame}: no such frame stands between a sensor and a board; those "
                f"that move are: {there}"
            )
        edge = passed[frame]
        if edge in taken:
            raise CalibrationError(
                f"{_OPTION} {frame}: its edge '{edge}' is estimated already, of {taken[edge]}; "
                f"leave the option out, or hold that one"
            )
        if not moves(dataset, edge):
            raise CalibrationError(
                f"{_OPTION} {frame}: '{frame}' stands still in '{edge.parent}', in all "
                f"collections; those that move are: {there}"
            )
    return {passed[frame]: sigmas for frame, sigmas in wanted.items()}


def check_told(
    dataset: Dataset,
    measurements: Sequence[Measurement],
    free: FreeEdges,
    parts: Mapping[Edge, Sigmas],
) -> None:
    """Refuse moving parts of which no board tells where they are, or which of them is off.

    Raises:
        CalibrationError: naming the part, or both.
    """
    for edge in parts:
        if not telling_collections(dataset, measurements, free, edge):
            raise CalibrationError(
                f"{_OPTION} {edge.child}: nothing tells how far '{edge.child}' is off, since every "
                f"board may stand anywhere in each collection, and no sensor sees it otherwise "
                f"than past '{edge.child}'; leave the option out, or use a board that stays where "
                f"it is (fixed)"
            )

    estimated = [edge for edge, sigmas in parts.items() if sigmas is None]
    for i, edge in enumerate(estimated):
        for other in estimated[:i]:
            if _passing(dataset, edge) == _passing(dataset, other):
                raise CalibrationError(
                    f"{_OPTION} {other.child} {edge.child}: nothing tells which of the two is off, "
                    f"since every board is seen past both or neither; leave one out, or give the "
                    f"figures of both"
                )


def _passing(dataset: Dataset, edge: Edge) -> Set[Tuple[str, str]]:
    """Return the sensors and patterns between which an edge stands."""
    graph = dataset.graph
    return {
        (sensor.name, pattern.name)
        for sensor in dataset.sensors.values()
        for pattern in dataset.patterns.values()
        if edge in [step.edge for step in graph.chain(sensor.frame, pattern.frame)]
    }


def telling_collections(
    dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges, edge: Edge
) -> List[str]:
    """Return the collections in which some board tells where a moving part is.

    A board that holds for all collections does. Another one does where it is seen past the part
    and in another way: else the part's pose and the board's own are the same six numbers.
    """
    graph = dataset.graph
    ways: Dict[Tuple[str, str], int] = {}
    seen: Dict[Tuple[str, str], Set[int]] = {}
    told: Dict[str, None] = {}
    for m in measurements:
        sensor, pattern = m.key.sensor, dataset.patterns[m.key.pattern]
        if (sensor, pattern.name) not in ways:
            chain = graph.chain(dataset.sensors[sensor].frame, pattern.frame)
            passes = [-1 if step.inverted else 1 for step in chain if step.edge == edge]
            ways[(sensor, pattern.name)] = sum(passes)
        way = ways[(sensor, pattern.name)]
        if pattern.fixed or free.anchor_patterns:
            if way != 0:
                told[m.key.collection] = None
            continue
        of_board = seen.setdefault((m.key.collection, pattern.name), set())
        of_board.add(way)
        if len(of_board) > 1:
            told[m.key.collection] = None
    return list(told)


def _passed(dataset: Dataset) -> List[Edge]:
    """Return all edges between a sensor and a board."""
    graph = dataset.graph
    return list(
        dict.fromkeys(
            step.edge
            for sensor in dataset.sensors.values()
            for pattern in dataset.patterns.values()
            for step in graph.chain(sensor.frame, pattern.frame)
        )
    )


def _estimated(dataset: Dataset, free: FreeEdges) -> Dict[Edge, str]:
    taken = {board_edge(p): f"pattern '{p.name}'" for p in dataset.patterns.values()}
    taken.update({dataset.joint(name).edge: f"joint '{name}'" for name in free.joints})
    taken.update({edge: f"additional tf '{name}'" for name, edge in free.additional_tfs.items()})
    taken.update({s.edge: f"sensor '{s.name}'" for s in dataset.sensors.values()})
    return taken
