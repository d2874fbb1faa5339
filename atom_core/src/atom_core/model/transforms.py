"""Edges of the transform tree, and chains of them between two frames."""

from __future__ import annotations

from collections import deque
from typing import Dict, Iterable, Iterator, List, Mapping, NamedTuple, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.geometry import se3


class Edge(NamedTuple):
    """One edge of the tree: ``parent_T_child`` is the pose of child in parent."""

    parent: str
    child: str

    def __str__(self) -> str:
        """Return the name that ATOM's files use; never split it, frames may hold a dash."""
        return f"{self.parent}-{self.child}"


class Step(NamedTuple):
    """One edge as it stands in a chain; ``inverted`` when walked from child to parent."""

    edge: Edge
    inverted: bool


Chain = Tuple[Step, ...]
Transforms = Mapping[Edge, np.ndarray]


class FrameGraph:
    """Which frames hang together; finds the chain between any two, each one once."""

    def __init__(self, edges: Iterable[Edge]):
        """Build the graph; an edge may be named more than once."""
        self._neighbours: Dict[str, Dict[str, Step]] = {}
        self._chains: Dict[Tuple[str, str], Chain] = {}
        self._came_by: Dict[str, Dict[str, Tuple[str, Step]]] = {}
        for edge in edges:
            self._neighbours.setdefault(edge.parent, {})[edge.child] = Step(edge, False)
            self._neighbours.setdefault(edge.child, {})[edge.parent] = Step(edge, True)

    def __contains__(self, frame: object) -> bool:
        """Tell whether the frame is in the graph."""
        return frame in self._neighbours

    def chain(self, target: str, source: str) -> Chain:
        """Return the steps whose product is ``target_T_source``.

        Raises:
            DatasetError: a frame is unknown, or nothing connects the two.
        """
        key = (target, source)
        if key not in self._chains:
            self._chains[key] = self._search(target, source)
        return self._chains[key]

    def edges_between(self, target: str, source: str) -> Tuple[Edge, ...]:
        """Return the edges of the chain between two frames; none where nothing connects them."""
        try:
            return tuple(step.edge for step in self.chain(target, source))
        except DatasetError:
            return ()

    def hangs_below(self, frame: str, edge: Edge) -> bool:
        """Tell whether a frame is on the child's side of an edge, and moves with its value.

        Raises:
            DatasetError: nothing connects the two.
        """
        return any(step.edge == edge for step in self.chain(edge.parent, frame))

    def _search(self, target: str, source: str) -> Chain:
        for frame in (target, source):
            if frame not in self._neighbours and target != source:
                raise DatasetError(f"frame '{frame}' is in no transform of the dataset")
        if target not in self._came_by:
            self._came_by[target] = self._spread(target)
        came_by = self._came_by[target]
        steps = []
        frame = source
        while frame != target:
            if frame not in came_by:
                raise DatasetError(
                    f"no chain of transforms connects frame '{target}' with frame '{source}'"
                )
            frame, step = came_by[frame]
            steps.append(step)
        return tuple(reversed(steps))

    def _spread(self, target: str) -> Dict[str, Tuple[str, Step]]:
        """Return, by frame that hangs together with one, the next towards it and the step there."""
        came_by: Dict[str, Tuple[str, Step]] = {}
        queue = deque([target])
        while queue:
            frame = queue.popleft()
            for neighbour, step in self._neighbours.get(frame, {}).items():
                if neighbour not in came_by and neighbour != target:
                    came_by[neighbour] = (frame, step)
                    queue.append(neighbour)
        return came_by


class Loop(NamedTuple):
    """An edge between two frames that other edges connect already.

    Attributes:
        edge: the one that closes the loop.
        others: the chain of other edges from its parent to its child.
        off_m, off_rad: how far its child lies from where the others put it.
    """

    edge: Edge
    others: Chain
    off_m: float
    off_rad: float


def loops(transforms: Transforms) -> Iterator[Loop]:
    """Yield the loops of one collection's transforms; a tree, as tf has it, has none."""
    tree: List[Edge] = []
    roots: Dict[str, str] = {}

    def root(frame: str) -> str:
        while roots.get(frame, frame) != frame:
            frame = roots[frame]
        return frame

    for edge, matrix in transforms.items():
        if root(edge.parent) != root(edge.child):
            roots[root(edge.child)] = root(edge.parent)
            tree.append(edge)
            continue
        others = FrameGraph(tree).chain(edge.parent, edge.child)
        apart = se3.pose_difference(chain_transform(others, transforms), matrix)
        yield Loop(edge, others, *apart)


def chain_transform(chain: Chain, transforms: Transforms) -> np.ndarray:
    """Return the product (4, 4) of a chain with one collection's transforms.

    Raises:
        DatasetError: the collection lacks an edge of the chain.
    """
    product = np.eye(4)
    for edge, inverted in chain:
        if edge not in transforms:
            raise DatasetError(f"transform '{edge}' is absent from the collection")
        matrix = transforms[edge]
        product = product @ (se3.inverse(matrix) if inverted else matrix)
    return product
