"""Whether the sensors hang together through the boards they share, and what ties them to world."""

from __future__ import annotations

from dataclasses import replace
from typing import Dict, Hashable, Iterable, List, Sequence, Set, Tuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from atom_core.errors import CalibrationError
from atom_core.model.dataset import Dataset, board_edge
from atom_core.model.transforms import Edge
from atom_core.problem.builder import FreeEdges
from atom_core.problem.measurements import Measurement


def components(dataset: Dataset, measurements: Sequence[Measurement]) -> List[List[str]]:
    """Return the groups of sensors that shared boards connect, largest first."""
    if not measurements:
        return []
    number: Dict[Hashable, int] = {}  # of each edge of sensors and each board
    ends = [
        [number.setdefault(node, len(number)) for node in _nodes(dataset, m)] for m in measurements
    ]
    links = coo_matrix((np.ones(len(ends)), np.transpose(ends)), shape=2 * (len(number),))
    _, group_of = connected_components(links, directed=False)
    groups: Dict[int, List[str]] = {}
    for sensor in dataset.sensors.values():
        node = ("edge", sensor.edge)
        if node in number:
            groups.setdefault(group_of[number[node]], []).append(sensor.name)
    return sorted(groups.values(), key=lambda group: (-len(group), group))


def _nodes(dataset: Dataset, m: Measurement) -> Tuple[Hashable, Hashable]:
    """Return what a measurement connects: an edge of sensors, and a board."""
    board = dataset.patterns[m.key.pattern].board_key(m.key.collection)
    return ("edge", dataset.sensors[m.key.sensor].edge), ("board", board)


def check_connected(dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges) -> None:
    """Refuse sensors without a detection, and groups that nothing connects.

    Raises:
        CalibrationError: naming the sensors, or the components.
    """
    seen = {m.key.sensor for m in measurements}
    blind = [name for name in dataset.sensors if name not in seen]
    if blind:
        detected = {key.sensor for key, _ in dataset.detections()}
        alone = [name for name in blind if name in detected]
        what = (
            f"sensor {_list(alone)} sees no board together with another sensor, so nothing ties "
            f"it to the rig; {_remedy(dataset, alone)}"
            if alone
            else f"sensor {_list(blind)} has no detection in any collection used; collect again"
        )
        several = len(dataset.sensors) > 1
        raise CalibrationError(f"{what}, or leave it out with -ssf" if several else what)
    if free.anchor_patterns:
        return
    groups = components(dataset, measurements)
    held = set(free.anchored_sensors)
    loose = [group for group in groups if not held & set(group)]
    if len(groups) > 1 and loose:
        named = "; ".join(f"{{{', '.join(group)}}}" for group in groups)
        raise CalibrationError(
            f"the sensors are not connected through shared boards: components {named}; add "
            f"collections in which sensors of different components see the board together, or "
            f"select one component with -ssf"
        )


def _remedy(dataset: Dataset, alone: Sequence[str]) -> str:
    """Return what ties sensors to the rig that see boards by themselves."""
    single = len(dataset.sensors) == 1
    several = (
        "use a second sensor that sees the boards, too"
        if single
        else "collect boards that are seen by both"
    )
    loose = [pattern.name for pattern in dataset.patterns.values() if not pattern.fixed]
    moved = not all(nothing_moves(dataset, [name], loose, [*dataset.collections]) for name in alone)
    if not moved:
        return several
    still = f"if pattern {_list(loose)} does not move in the frame that it is attached to"
    said = f"{still} while the robot moves, set `fixed: true` of it in the configuration"
    return said if single else f"{several}; {said}"


def floats_freely(dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges) -> bool:
    """Tell whether the whole solution could move as one rigid body (gauge freedom).

    It can when nothing is anchored, no sensor's place is known beforehand, and no motion of the
    robot or the boards' parents ties the solution to world: then every sensor and every board may
    move along.
    """
    return not is_held(dataset, free) and nothing_moves(
        dataset,
        {m.key.sensor for m in measurements},
        {m.key.pattern for m in measurements},
        sorted({m.key.collection for m in measurements}),
    )


def is_held(dataset: Dataset, free: FreeEdges) -> bool:
    """Tell whether a sensor or the boards are held, or a prior says where one of them is."""
    if free.anchored_sensors or free.anchor_patterns:
        return True
    return any(edge in free.priors for edge in _tying_edges(dataset))


def only_by_priors(
    dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges
) -> List[str]:
    """Return a sentence where priors alone tie the rig to world."""
    edges = _tying_edges(dataset)
    names = [prior.name for edge, prior in free.priors.items() if edge in edges]
    if not names or not floats_freely(dataset, measurements, replace(free, priors={})):
        return []
    return [
        f"only the prior of {_list(names)} ties the rig to '{dataset.world}', and its standard "
        f"deviations are in those of all edges; for places relative to a sensor, hold it (-as)"
    ]


def _tying_edges(dataset: Dataset) -> Set[Edge]:
    """Return the edges of which a prior says where the rig is in the world."""
    boards = {board_edge(pattern) for pattern in dataset.patterns.values() if pattern.fixed}
    return boards | {sensor.edge for sensor in dataset.sensors.values()}


def nothing_moves(
    dataset: Dataset,
    sensors: Iterable[str],
    patterns: Iterable[str],
    collections: Sequence[str],
) -> bool:
    """Tell whether nothing moves that carries these sensors or the boards' parents."""
    graph = dataset.graph
    frames = {dataset.sensors[sensor].edge.parent for sensor in sensors}
    frames |= {dataset.patterns[pattern].parent_frame for pattern in patterns}
    edges = {step.edge for frame in frames for step in graph.chain(dataset.world, frame)}
    return all(_constant(dataset, edge, collections) for edge in edges)


def _constant(dataset: Dataset, edge: Edge, collections: Iterable[str]) -> bool:
    values: Dict[bytes, None] = {}
    for key in collections:
        matrix = dataset.collections[key].transforms.get(edge)
        values[b"" if matrix is None else matrix.round(9).tobytes()] = None
    return len(values) <= 1


def _list(names: Sequence[str]) -> str:
    return ", ".join(f"'{name}'" for name in names)
