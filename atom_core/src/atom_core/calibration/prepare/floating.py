"""Parts of the rig that can move as one body without any detection telling, and what holds them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Dict, List, Sequence, Set, Tuple

from atom_core.calibration.prepare.connectivity import nothing_moves
from atom_core.errors import quoted
from atom_core.model.dataset import MULTIPLE, Dataset, board_edge
from atom_core.model.transforms import Edge
from atom_core.problem.builder import FreeEdges
from atom_core.problem.measurements import Measurement


@dataclass(frozen=True)
class Part:
    """Sensors and fixed boards that transforms connect which are no parameters of a collection.

    Attributes:
        frame: one that carries a sensor or a fixed board of it.
        sensors: that were used, in the dataset's order.
        boards: those of the fixed ones that were seen.
        links: additional tfs, one for each collection, that join it to the rest; by name.
    """

    frame: str
    sensors: Tuple[str, ...]
    boards: Tuple[str, ...]
    links: Dict[str, Edge]


def floats_freely(dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges) -> bool:
    """Tell whether a part of the rig, or all of it, could move as one body (gauge freedom)."""
    return bool(floating_parts(dataset, measurements, free))


def floating_parts(
    dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges
) -> List[Part]:
    """Return the parts that could move as one rigid body; mostly none, or the whole rig.

    A part can when nothing in it is held or known beforehand and nothing moves between its sensors
    and its fixed boards: then all of them move along, with the boards that are elsewhere in each
    collection. That it is carried about as a whole ties nothing. An additional tf that is
    estimated in each collection follows any move, so that there is a part at either end of it.
    """
    collections = sorted({m.key.collection for m in measurements})
    return [
        part
        for part in _parts(dataset, measurements, free)
        if not _part_is_held(dataset, measurements, free, part)
        and nothing_moves(dataset, part.sensors, part.boards, collections)
    ]


def _parts(dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges) -> List[Part]:
    links = {name: e for name, e in free.additional_tfs.items() if _follows(dataset, free, e)}
    seen = {m.key.sensor for m in measurements}
    used = {m.key.pattern for m in measurements}
    sensors = {s.name: s.edge.parent for s in dataset.sensors.values() if s.name in seen}
    fixed = [p for p in dataset.patterns.values() if p.fixed and p.name in used]
    boards = {p.name: p.parent_frame for p in fixed}
    parts: List[Part] = []
    left = dict.fromkeys([*sensors.values(), *boards.values()])
    while left:
        frame = next(iter(left))
        mine = {f for f in left if _together(dataset, frame, f, links)}
        parts.append(
            Part(
                frame,
                tuple(name for name, f in sensors.items() if f in mine),
                tuple(name for name, f in boards.items() if f in mine),
                {n: e for n, e in links.items() if _ends_at(dataset, e, frame, links)},
            )
        )
        left = {f: None for f in left if f not in mine}
    return parts


def _follows(dataset: Dataset, free: FreeEdges, edge: Edge) -> bool:
    """Tell whether an additional tf is estimated in each collection, with nothing known of it."""
    of_sensors = dataset.sensor_edges
    one_each = dataset.edge_types.get(edge) == MULTIPLE
    return one_each and not (edge in of_sensors or edge in free.priors or edge in free.held_first)


def _together(dataset: Dataset, frame: str, other: str, links: Dict[str, Edge]) -> bool:
    return not any(step.edge in links.values() for step in dataset.graph.chain(frame, other))


def _ends_at(dataset: Dataset, link: Edge, frame: str, links: Dict[str, Edge]) -> bool:
    return any(_together(dataset, frame, end, links) for end in link)


def _part_is_held(
    dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges, part: Part
) -> bool:
    parents = [
        dataset.patterns[name].parent_frame for name in {m.key.pattern for m in measurements}
    ]
    if free.anchor_patterns and any(
        _together(dataset, part.frame, parent, part.links) for parent in parents
    ):
        return True
    edges = {dataset.sensors[name].edge for name in part.sensors}
    edges |= {board_edge(dataset.patterns[name]) for name in part.boards}
    return bool(edges & (free.held_edges(dataset) | set(free.priors)))


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
    others = {edge: prior for edge, prior in free.priors.items() if edge not in edges}
    without = floating_parts(dataset, measurements, replace(free, priors=others))
    if not names or len(without) == len(floating_parts(dataset, measurements, free)):
        return []
    return [
        f"only the prior of {quoted(names)} ties the rig to '{dataset.world}', and "
        f"its standard deviations are in those of all edges; for places relative to a sensor, "
        f"hold it (-as)"
    ]


def _tying_edges(dataset: Dataset) -> Set[Edge]:
    """Return the edges of which a prior says where the rig is in the world."""
    boards = {board_edge(pattern) for pattern in dataset.patterns.values() if pattern.fixed}
    return boards.union(dataset.sensor_edges)


def holding(
    dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges
) -> Tuple[FreeEdges, List[str]]:
    """Return what is estimated once each part that floats is held, and how it is, in sentences.

    By its first sensor; a part without sensors by the additional tf of the first collection.
    """
    remarks = []
    for part in floating_parts(dataset, measurements, free):
        if part.sensors:
            name = part.sensors[0]
            free = replace(free, anchored_sensors=(*free.anchored_sensors, name))
            remarks.append(
                f"nothing ties the rig to '{dataset.world}': sensor '{name}' is held where it is, "
                f"all others are relative to it (name one with anchored_sensor or -as)"
            )
        elif part.links:
            name, edge = next(iter(part.links.items()))
            if edge in free.held_first:
                continue
            free = replace(free, held_first=free.held_first | {edge})
            remarks.append(
                f"board {quoted(part.boards)} and additional tf '{name}' are seen relative to each "
                f"other only: '{name}' is held where the first collection has it, and the others "
                f"and the board are relative to that (or say with --prior how well it is known)"
            )
    return free, remarks
