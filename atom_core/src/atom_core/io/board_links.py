"""Boards whose link hangs in the transforms in another place than the configuration says.

A simulation may publish the pose of its board, and a description may hold the board that the robot
carries. Where the configuration has the board estimated below another frame, its pose is that
estimate alone; by such a transform it would have a second one, which is taken as exact.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Collection as Sized
from typing import Dict, Iterable, Iterator, List, Mapping, Sequence, Set, Tuple

from atom_core.errors import DatasetError
from atom_core.model.dataset import Collection, board_edge
from atom_core.model.pattern import Pattern
from atom_core.model.transforms import Chain, Edge, FrameGraph, Step


def with_boards_free(
    collections: Mapping[str, Collection],
    patterns: Mapping[str, Pattern],
    frames: Iterable[str],
    calibrated: Sized[Edge],
    where: str,
) -> Tuple[Dict[str, Collection], List[str]]:
    """Return the collections without transforms that give a board a second pose.

    Args:
        collections: with their transforms.
        patterns: all of them.
        frames: the world's and those of the sensors, whose ways to each other must stay.
        calibrated: edges that are to be estimated, which must stay, too.
        where: the file, for messages.

    Returns:
        The collections, and a warning for each transform that is left out.

    Raises:
        DatasetError: a transform must stay, or ties the board by what hangs on it.
    """
    edges = {edge for c in collections.values() for edge in c.transforms}
    boards = {board_edge(pattern) for pattern in patterns.values()}
    parents = [pattern.parent_frame for pattern in patterns.values()]
    needed = boards | {*calibrated, *_between(edges, [*frames, *parents])}
    links = {pattern.frame: pattern for pattern in patterns.values()}
    left_out: Set[Edge] = set()
    warnings: List[str] = []
    for pattern in patterns.values():
        for way in _second_ways(edges | boards, pattern, left_out):
            of_boards = [step.edge for step in way if step.edge.child in links]
            free = [edge for edge in of_boards if edge not in needed]
            if not free:
                raise DatasetError(f"{where}: {_refusal(pattern, way[-1])}")
            left_out.add(free[-1])
            warnings.append(_warning(links[free[-1].child], free[-1]))
    if left_out:
        collections = {key: _without(c, left_out) for key, c in collections.items()}
    return dict(collections), warnings


def _between(edges: Iterable[Edge], frames: Sequence[str]) -> Iterator[Edge]:
    """Yield the edges on the ways from the first frame to the others that it is connected with."""
    graph = FrameGraph(edges)
    for frame in frames:
        yield from graph.edges_between(frames[0], frame)


def _second_ways(edges: Set[Edge], pattern: Pattern, left_out: Set[Edge]) -> Iterator[Chain]:
    """Yield the ways to a board beside its own, until all are left out."""
    own = board_edge(pattern)
    while True:
        graph = FrameGraph(sorted(edges - left_out - {own}))
        if own.child not in graph or own.parent not in graph:
            return
        try:
            chain = graph.chain(own.parent, own.child)
        except DatasetError:
            return
        if not chain:
            return
        yield chain


def _warning(pattern: Pattern, edge: Edge) -> str:
    return (
        f"pattern '{pattern.name}': its link '{pattern.frame}' hangs on '{edge.parent}' in the "
        f"transforms, too; transform '{edge}' is left out, since the configuration has it "
        f"estimated in '{pattern.parent_frame}'; where the board sits on '{edge.parent}', set "
        f"parent_link: {edge.parent}"
    )


def _refusal(pattern: Pattern, step: Step) -> str:
    name, link, parent = pattern.name, pattern.frame, pattern.parent_frame
    if step.inverted:
        return (
            f"pattern '{name}': its link '{link}' is connected with its parent_link '{parent}' by "
            f"transform '{step.edge}', too; give the board a link of its own"
        )
    return (
        f"pattern '{name}': its link '{link}' hangs on '{step.edge.parent}' in the transforms, not "
        f"on '{parent}'; set parent_link: {step.edge.parent}, or give the board a link of its own"
    )


def _without(collection: Collection, left_out: Set[Edge]) -> Collection:
    kept = {edge: pose for edge, pose in collection.transforms.items() if edge not in left_out}
    return replace(collection, transforms=kept)
