"""Detections as constraints on the edges of the tree, for a start that is taken from the data.

A detection says where its board stands in its sensor. Walked along the tf chain from the
pattern's parent this reads ``F = L U R D``: the board's pose F in its parent, the constant
products L and R of the chain, one unknown edge U between them (walked forwards or backwards), and
the pose D of the board in the sensor, of which a single detection often allows several.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Container, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.dataset import Dataset
from atom_core.model.pattern import BoardKey
from atom_core.model.transforms import Chain, Edge, chain_transform
from atom_core.problem.initial_boards import misfits
from atom_core.problem.measurements import Measurement

_EXPECTED_M = 0.1  # misfit of a detection to a board that other, roughly placed sensors see
_CLOSE = 0.15  # of mean misfit: a candidate of a board this much worse than the best is kept
_MOST_PROPOSING = 8


@dataclass(frozen=True)
class Sighting:
    """One detection with the poses it allows.

    Attributes:
        measurement: the detection.
        edge: the calibrated edge of its sensor.
        board: which board it saw.
        chain: from the pattern's parent frame to the sensor's data frame.
        poses: (k, 4, 4) ``sensor_T_pattern``, the likeliest first; k may be 0.
        outline: (4, 3) corners of the board in the pattern's frame [m].
    """

    measurement: Measurement
    edge: Edge
    board: BoardKey
    chain: Chain
    poses: np.ndarray
    outline: np.ndarray

    @property
    def collection(self) -> str:
        """Key of its collection."""
        return self.measurement.key.collection

    @property
    def identifies_board(self) -> bool:
        """Tell whether it alone leaves little doubt about the pose."""
        return self.measurement.identifies_board

    @property
    def size_m(self) -> float:
        """The board's diagonal [m]."""
        return float(np.linalg.norm(self.outline[2] - self.outline[0]))

    def unknown(self, known: Container[Edge], free: Container[Edge]) -> List[Edge]:
        """Return the free edges on the chain that are not known yet."""
        return [edge for edge, _ in self.chain if edge in free and edge not in known]


class Split(NamedTuple):
    """A chain cut at one edge: ``parent_T_sensor = before U after``."""

    before: np.ndarray
    after: np.ndarray
    inverted: bool


def read_sightings(dataset: Dataset, measurements: Sequence[Measurement]) -> List[Sighting]:
    """Return the sightings of all detections."""
    graph, sightings = dataset.graph, []
    for m in measurements:
        sensor, pattern = dataset.sensors[m.key.sensor], dataset.patterns[m.key.pattern]
        outline = pattern.border.corners_in_pattern
        poses = np.array(m.likely_candidates()).reshape(-1, 4, 4)
        chain = graph.chain(pattern.parent_frame, sensor.frame)
        board = pattern.board_key(m.key.collection)
        sightings.append(Sighting(m, sensor.edge, board, chain, poses, outline))
    return sightings


def split(dataset: Dataset, sighting: Sighting, edge: Edge) -> Split:
    """Cut a sighting's chain at an edge that is on it, with the dataset's transforms."""
    transforms = dataset.collections[sighting.collection].transforms
    at = [step.edge for step in sighting.chain].index(edge)
    before = chain_transform(sighting.chain[:at], transforms)
    after = chain_transform(sighting.chain[at + 1 :], transforms)
    return Split(before, after, sighting.chain[at].inverted)


def sensor_in_parent(dataset: Dataset, sighting: Sighting) -> np.ndarray:
    """Return the pose (4, 4) of the sensor in the pattern's parent frame."""
    return chain_transform(sighting.chain, dataset.collections[sighting.collection].transforms)


def board_proposals(
    dataset: Dataset, placed: Sequence[Sighting]
) -> Mapping[BoardKey, List[np.ndarray]]:
    """Return the poses in their parents that boards may have, from sensors whose place is known.

    Args:
        dataset: with the known edges in its transforms.
        placed: sightings by sensors that stand where the dataset has them.
    """
    boards: Dict[BoardKey, List[Tuple[Sighting, np.ndarray]]] = {}
    for s in placed:
        boards.setdefault(s.board, []).append((s, sensor_in_parent(dataset, s)))
    return {key: _agreeing(seen) for key, seen in boards.items()}


def _agreeing(seen: Sequence[Tuple[Sighting, np.ndarray]]) -> List[np.ndarray]:
    """Return the candidates that explain the sightings of one board nearly as well as the best."""
    proposing = [pair for pair in seen if pair[0].identifies_board and len(pair[0].poses)]
    proposing = proposing or [pair for pair in seen if len(pair[0].poses)]
    step = max(len(proposing) // _MOST_PROPOSING, 1)
    proposals = [
        parent_T_sensor @ pose for s, parent_T_sensor in proposing[::step] for pose in s.poses
    ]
    if len(seen) == 1:
        return proposals
    judged = [(s.measurement, se3.inverse(parent_T_sensor)) for s, parent_T_sensor in seen]
    if not proposals:
        return []
    poses = np.array(proposals)
    costs = np.mean([misfits(m, inv @ poses, _EXPECTED_M) for m, inv in judged], axis=0)
    return [proposals[i] for i in _near_best(costs)]


def _near_best(costs: np.ndarray) -> np.ndarray:
    order = np.argsort(costs)
    return order[costs[order] <= costs[order[0]] + _CLOSE]


def misfit_at(
    sighting: Sighting, parent_T_sensor: np.ndarray, boards: Optional[Sequence[np.ndarray]]
) -> float:
    """Return how badly the best of a board's proposals explains a sighting, 0 .. 1."""
    if not boards:
        return 1.0
    sensor_T_boards = se3.inverse(parent_T_sensor) @ np.array(boards)
    # fmin: a pose that gives no number is passed over
    return float(np.fmin.reduce(misfits(sighting.measurement, sensor_T_boards, _EXPECTED_M)))
