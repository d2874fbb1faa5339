"""Whether new boards, one by one, agree on where a sensor stands now.

A sensor that moved stands elsewhere for all of them. A board that itself moved while the sensors
looked at it, or a wrong label, is elsewhere for one.
"""

from __future__ import annotations

from typing import Dict, List, NamedTuple, Optional, Sequence

import numpy as np
from scipy.special import chdtrc  # scipy.stats has it as chi2.sf, and takes long to load

from atom_core.calibration.calibrate import calibrate
from atom_core.errors import AtomError
from atom_core.evaluation.drift_question import Question, scatter_of
from atom_core.evaluation.edge_errors import PoseError, pose_error
from atom_core.evaluation.edge_spread import known_spread
from atom_core.evaluation.spreads import LEAST_VARIANCE, NO_SPREAD, NUMBERS, Spread
from atom_core.model.transforms import Edge
from atom_core.solvers.base import FAILED, NOT_CONVERGED

_RARE = 0.001  # boards of one rig in so many that differ as much by chance


class OneBoard(NamedTuple):
    """Where one board alone has a sensor.

    Attributes:
        collection: of the board.
        change: found minus described.
        covariance: of the six numbers (6, 6), turns [rad] and shifts [m].
    """

    collection: str
    change: PoseError
    covariance: np.ndarray

    @property
    def numbers(self) -> np.ndarray:
        """(6,) turns [rad] and shifts [m]."""
        return np.concatenate([self.change.turn_rad, self.change.shift_m])

    @property
    def information(self) -> np.ndarray:
        """(6, 6) one over the covariance."""
        return np.linalg.inv(self.covariance + LEAST_VARIANCE * np.eye(NUMBERS))


class Disagreement(NamedTuple):
    """Boards that do not agree on a sensor.

    Attributes:
        edge: the sensor's.
        odd: without it the others agree best.
        others: those.
    """

    edge: Edge
    odd: OneBoard
    others: Sequence[OneBoard]


def disagreement(question: Question, edges: Sequence[Edge]) -> Optional[Disagreement]:
    """Return the edge on which boards agree worst, where that is no chance; None: on all they do.

    Args:
        question: with all new boards.
        edges: that seem to have moved; the other sensors are held.
    """
    limit, worst, found = _RARE / max(len(edges), 1), 1.0, None
    for edge, boards in _by_board(question, edges).items():
        chance = _chance(boards)
        if len(boards) > 1 and chance < min(worst, limit):
            rest = {b.collection: [o for o in boards if o is not b] for b in boards}
            odd = max(boards, key=lambda board: _chance(rest[board.collection]))
            worst, found = chance, Disagreement(edge, odd, rest[odd.collection])
    return found


def _by_board(question: Question, edges: Sequence[Edge]) -> Dict[Edge, List[OneBoard]]:
    found: Dict[Edge, List[OneBoard]] = {edge: [] for edge in edges}
    for key in question.standing.collections:
        one = question.of_collection(key).of_those_who_see()
        sensors = one.standing.sensors
        held = [name for name, sensor in sensors.items() if sensor.edge not in edges]
        try:
            solved = calibrate(one.standing, one.options(held))
        except AtomError:
            continue
        if solved.status in (FAILED, NOT_CONVERGED):
            continue
        for edge in edges:
            new = known_spread(solved, edge)
            if new is NO_SPREAD:  # it sees nothing of this board
                continue
            covariance = of_one_board(new, scatter_of(question.spreads.get(edge, NO_SPREAD)))
            described, now = one.standing.first_value(edge), solved.dataset.first_value(edge)
            found[edge].append(OneBoard(key, pose_error(described, now), covariance))
    return found


def of_one_board(new: Spread, scatter: float) -> np.ndarray:
    """Return the covariance (6, 6) of what one board says, turns [rad] and shifts [m].

    Turns and shifts are stated by a factor each. A sensor that sees one board turns about it, so
    that its shift goes with its turn: factors that differ would allow the board itself to be
    elsewhere, and forbid what it leaves open. One factor for all keeps them together.

    Args:
        new: how exactly that board alone tells the sensor's edge.
        scatter: by which its detections vary beyond their noise (`scatter_of`).
    """
    wider = np.mean(np.diagonal(new.stated) / np.maximum(np.diagonal(new.of_model), LEAST_VARIANCE))
    return (float(wider) + scatter - 1.0) * new.of_model


def _chance(boards: Sequence[OneBoard]) -> float:
    """Return how often boards that agree differ as much."""
    if len(boards) < 2:
        return 1.0
    weights = [board.information for board in boards]
    pull = sum(weight @ board.numbers for weight, board in zip(weights, boards))
    mean = np.linalg.solve(sum(weights), pull)
    off = [board.numbers - mean for board in boards]
    square = float(sum(o @ weight @ o for o, weight in zip(off, weights)))
    return float(chdtrc(NUMBERS * (len(boards) - 1), square))
