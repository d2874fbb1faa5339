"""Where the sensors stand, from the data alone: they grow together through the boards they share.

Beginning with what is known (held sensors, held boards, or simply the sensor that shares most),
the boards that known sensors see are placed, with every pose that is possible; a further sensor
is found where its own views of those boards agree (``pose_votes``), the best supported ones
first. A sensor on an arm that nothing known sees together with is found from its motion
(``hand_eye``). What the dataset's transforms say about the edges to be found is not used.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from typing import Dict, FrozenSet, List, Mapping, NamedTuple, Optional, Sequence, Set, Tuple

import numpy as np

from atom_core.calibration.prepare.connectivity import nothing_moves
from atom_core.calibration.start.hand_eye import MovingView, solve_hand_eye
from atom_core.calibration.start.pose_votes import Statement, consensus
from atom_core.calibration.start.sightings import (
    Sighting,
    board_proposals,
    misfit_at,
    read_sightings,
    sensor_in_parent,
    split,
)
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, board_edge, pose
from atom_core.model.pattern import BoardKey
from atom_core.model.transforms import Edge
from atom_core.problem.builder import FreeEdges
from atom_core.problem.measurements import Measurement

Boards = Mapping[BoardKey, Sequence[np.ndarray]]
# Margins between the best answer and the next, in detections explained: above the first nothing
# is gained by waiting for more sensors; below the second both are worth a solve.
_CLEAR, _CLOSE = 2.0, 0.7
_MOST_DOUBTFUL = 4
_LEAST_TURN_RAD = 0.1  # root of the sum of squares about a second axis


@dataclass(frozen=True)
class SensorEstimate:
    """A start from the data.

    Attributes:
        dataset: with the estimated edges in its transforms.
        others: the same with the second answer for an edge that the shared boards hardly settle;
            only a solve of each can tell (none in most cases).
        remarks: what could not be found and starts from the description.
    """

    dataset: Dataset
    others: Tuple[Dataset, ...]
    remarks: Tuple[str, ...]


def sensors_from_boards(
    dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges
) -> SensorEstimate:
    """Return the dataset with every free sensor edge estimated from the shared boards.

    Additional tfs and sensors that the data do not place keep their value, with a remark. The
    sensors must be connected (``connectivity.check_connected``) and something must be held.

    Args:
        dataset: its transforms give what is held and the constants between.
        measurements: detections that tie sensors together.
        free: what is to be estimated and what is held.
    """
    sightings = read_sightings(dataset, measurements)
    held = free.held_edges(dataset)
    root = _free_root(dataset, measurements, sightings, free)
    known = held if root is None else frozenset([root])

    def grown(second_choice: Optional[Edge]) -> Tuple[Dataset, _Growth]:
        growth = _Growth(dataset, sightings, known, free, second_choice)
        growth.run()
        moved = growth.dataset if root is None else _moved_back(dataset, growth, held)
        return moved, growth

    best, growth = grown(None)
    others = tuple(grown(edge)[0] for edge in growth.doubtful[:_MOST_DOUBTFUL])
    remarks = growth.remarks + [
        f"additional tf '{name}' ({edge}) starts from the description: a start from the data is "
        f"found for sensors only"
        for name, edge in free.additional_tfs.items()
    ]
    return SensorEstimate(best, others, tuple(remarks))


def _with_edges(dataset: Dataset, edges: Mapping[Edge, np.ndarray]) -> Dataset:
    return dataset.with_transforms(dict.fromkeys(dataset.collections, edges))


def _free_root(
    dataset: Dataset,
    measurements: Sequence[Measurement],
    sightings: Sequence[Sighting],
    free: FreeEdges,
) -> Optional[Edge]:
    """Return the sensor to begin with where any would do, or None.

    With one sensor held and nothing that moves, the whole rig can be built around the sensor that
    shares most boards and be moved to the held one in the end. The held one may share few.
    """
    if free.anchor_patterns or len(free.held_edges(dataset)) != 1:
        return None
    keys = [m.key for m in measurements]
    sensors, patterns = ({getattr(k, name) for k in keys} for name in ("sensor", "pattern"))
    if not nothing_moves(dataset, sensors, patterns, sorted({k.collection for k in keys})):
        return None
    edges = {s.edge for s in sightings}
    graph = dataset.graph
    for edge in edges:
        chain = graph.chain(dataset.world, edge.child)
        if chain[-1].edge != edge or any(step.edge in edges for step in chain[:-1]):
            return None  # one sensor hangs on another
    seen_by: Dict[BoardKey, Set[Edge]] = {}
    for s in sightings:
        seen_by.setdefault(s.board, set()).add(s.edge)
    shared = dict.fromkeys(sorted(edges), 0.0)
    for s in sightings:
        trust = 1.0 / len(s.poses) if len(s.poses) else 0.0
        shared[s.edge] += trust * (len(seen_by[s.board]) - 1)
    return max(shared, key=lambda edge: shared[edge])


def _moved_back(dataset: Dataset, growth: _Growth, held: FrozenSet[Edge]) -> Dataset:
    """Return the dataset with the rig moved as a whole, so that the held edge is where it was."""
    (anchor,) = held
    collection, graph = next(iter(dataset.collections.values())), dataset.graph
    parents = {e: pose(collection, graph, dataset.world, e.parent) for e in growth.known | held}
    grown_to = parents[anchor] @ growth.dataset.first_value(anchor)
    motion = parents[anchor] @ dataset.first_value(anchor) @ se3.inverse(grown_to)
    found = {
        edge: se3.inverse(parents[edge]) @ motion @ parents[edge] @ growth.dataset.first_value(edge)
        for edge in growth.known - held
    }
    return _with_edges(dataset, found)


class _Found(NamedTuple):
    """An edge's best answer, the next one, and by how many detections it is better."""

    edge: Edge
    pose: np.ndarray
    other: Optional[np.ndarray]
    margin: float


class _Growth:
    """The sensors known so far, and the dataset with their edges."""

    def __init__(
        self,
        dataset: Dataset,
        sightings: Sequence[Sighting],
        known: FrozenSet[Edge],
        free: FreeEdges,
        second_choice: Optional[Edge],
    ):
        self.second_choice = second_choice
        self.dataset, self.sightings = dataset, sightings
        self.edges = list(dict.fromkeys(s.edge for s in sightings))
        self.known: Set[Edge] = set(known) & set(self.edges)
        self.held_boards = _held_boards(dataset, sightings) if free.anchor_patterns else {}
        self.doubtful: List[Edge] = []
        self.remarks: List[str] = []

    def run(self) -> None:
        """Find one edge after the other, as long as any can be found."""
        while any(edge not in self.known for edge in self.edges):
            found = self._votes() or self._motions() or self._motions_beside()
            if not found:
                self._give_up()
                return
            for answer in found:
                self._accept(answer)

    def _accept(self, found: _Found) -> None:
        self.known.add(found.edge)
        chosen = found.pose
        if found.other is not None and found.margin < _CLOSE:
            self.doubtful.append(found.edge)
            chosen = found.other if found.edge == self.second_choice else found.pose
        self.dataset = _with_edges(self.dataset, {found.edge: chosen})

    def _give_up(self) -> None:
        for edge in self.edges:
            if edge not in self.known:
                names = self.dataset.sensors_on(edge)
                self.remarks.append(
                    f"sensor '{', '.join(names)}': the data alone do not tell where it stands; it "
                    f"starts from the description (more collections with other sensors or other "
                    f"motions would help)"
                )

    def _unknown(self, sighting: Sighting) -> List[Edge]:
        return sighting.unknown(self.known, self.edges)

    def _boards(self) -> Boards:
        if self.held_boards:
            return self.held_boards
        return board_proposals(self.dataset, [s for s in self.sightings if not self._unknown(s)])

    def _votes(self) -> List[_Found]:
        """Return the edges that views of known boards place: all clear ones, or the clearest."""
        boards = self._boards()
        by_edge: Dict[Edge, List[Sighting]] = {}
        for s in self.sightings:
            unknown = self._unknown(s)
            if len(unknown) == 1 and boards.get(s.board):
                by_edge.setdefault(unknown[0], []).append(s)
        answers = [self._answer(edge, seen, boards) for edge, seen in by_edge.items()]
        found = sorted((a for a in answers if a is not None), key=lambda a: -a.margin)
        clear = [a for a in found if a.margin >= _CLEAR]
        return clear or found[:1]

    def _answer(self, edge: Edge, seen: Sequence[Sighting], boards: Boards) -> Optional[_Found]:
        statements = [self._statement(s, edge, boards[s.board]) for s in seen if len(s.poses)]
        if not statements:
            return None
        poses = [answer.pose for answer in consensus(statements)]
        costs = np.array([self._misfit(edge, pose_, seen, boards) for pose_ in poses])
        order = np.argsort(costs)
        best = poses[order[0]]
        if len(order) == 1:
            return _Found(edge, best, None, float(len(seen) - costs[0]))
        margin = float(costs[order[1]] - costs[order[0]])
        return _Found(edge, best, poses[order[1]], margin)

    def _statement(self, s: Sighting, edge: Edge, boards: Sequence[np.ndarray]) -> Statement:
        cut = split(self.dataset, s, edge)
        near = se3.inverse(cut.before) @ np.array(boards)
        far = cut.after @ s.poses
        return Statement(near, far, s.outline) if cut.inverted else Statement(far, near, s.outline)

    def _misfit(
        self, edge: Edge, pose_: np.ndarray, seen: Sequence[Sighting], boards: Boards
    ) -> float:
        placed = _with_edges(self.dataset, {edge: pose_})
        return sum(misfit_at(s, sensor_in_parent(placed, s), boards[s.board]) for s in seen)

    def _motions(self) -> List[_Found]:
        """Return an edge that is found from its own motion before a pattern that stays."""
        views: Dict[Tuple[Edge, BoardKey], List[Sighting]] = {}
        for s in self.sightings:
            unknown = self._unknown(s)
            if len(unknown) == 1 and s.board[1] is None:
                views.setdefault((unknown[0], s.board), []).append(s)
        for (edge, _), seen in sorted(views.items(), key=lambda item: -len(item[1])):
            cuts = [split(self.dataset, s, edge) for s in seen]
            moving = [MovingView(c.before, c.after @ s.poses) for c, s in zip(cuts, seen)]
            X = solve_hand_eye(moving, seen[0].outline)
            if X is not None:
                found = se3.inverse(X) if cuts[0].inverted else X
                return [_Found(edge, found, None, np.inf)]
        return []

    def _motions_beside(self) -> List[_Found]:
        """Return an edge that is found from its own motion beside another that is not known, too.

        Of a board that both see, wherever it is carried: L U R D = M V S E gives
        V = (M^-1 L) U (R D E^-1 S^-1), in which U moves before V as before a board that stays.
        """
        seen_by: Dict[Tuple[str, BoardKey], List[Tuple[Edge, Sighting]]] = {}
        for s in self.sightings:
            unknown = self._unknown(s)
            if len(unknown) == 1 and s.identifies_board and len(s.poses):
                seen_by.setdefault((s.collection, s.board), []).append((unknown[0], s))
        pairs: Dict[Tuple[Edge, Edge], List[MovingView]] = {}
        sure: Dict[Edge, Sighting] = {}
        for together in seen_by.values():
            for (mine, one), (its, other) in permutations(together, 2):
                if mine != its:
                    sure.setdefault(mine, one)
                    view = self._beside(one, other, mine, its)
                    pairs.setdefault((mine, its), []).append(view)
        for (mine, _), views in sorted(pairs.items(), key=lambda item: -len(item[1])):
            one = sure[mine]
            X = solve_hand_eye(views, one.outline) if _turn(views) else None
            if X is not None:
                inverted = split(self.dataset, one, mine).inverted
                return [_Found(mine, se3.inverse(X) if inverted else X, None, np.inf)]
        return []

    def _beside(self, one: Sighting, other: Sighting, mine: Edge, its: Edge) -> MovingView:
        cut, beside = split(self.dataset, one, mine), split(self.dataset, other, its)
        ends = [se3.inverse(beside.after @ pose_) for pose_ in other.poses]
        H = [cut.after @ pose_ @ end for pose_ in one.poses for end in ends]
        return MovingView(se3.inverse(beside.before) @ cut.before, np.array(H))


def _turn(views: Sequence[MovingView]) -> bool:
    """Tell whether what moves between the views turns about more than one axis."""
    rotations = np.array([view.G[:3, :3] for view in views])
    turns = se3.rotation_vector_from_rotation(rotations[0].T @ rotations)
    singular = np.linalg.svd(turns, compute_uv=False)
    return len(views) > 2 and bool(singular[1] > _LEAST_TURN_RAD)


def _held_boards(dataset: Dataset, sightings: Sequence[Sighting]) -> Boards:
    boards: Dict[BoardKey, Sequence[np.ndarray]] = {}
    for s in sightings:
        transforms = dataset.collections[s.collection].transforms
        boards[s.board] = [transforms[board_edge(dataset.patterns[s.board[0]])]]
    return boards
