"""One unknown pose from many ambiguous statements: every combination votes, consensus decides.

Each statement says that an unknown rigid motion X carries one of some source poses onto one of
some target poses. One statement alone allows as many X as it has combinations; the true one
returns in statement after statement, the others do not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, NamedTuple, Sequence

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.pose_solvers import rigid_fit

_TOLERANCE = 0.25  # of the board's diagonal: at this RMS distance of the corners a vote is lost
_MOST_STATEMENTS, _MOST_HYPOTHESES = 60, 800
_REFINEMENTS = 5
_ANOTHER_M, _ANOTHER_RAD = 0.2, 0.3  # two answers that differ by more are two
_MOST_ANSWERS = 6


@dataclass(frozen=True)
class Statement:
    """X carries one of the sources onto one of the targets.

    Attributes:
        sources, targets: (n, 4, 4) and (m, 4, 4) poses of the board before and after X.
        outline: (4, 3) corners of the board in its own frame [m].
    """

    sources: np.ndarray
    targets: np.ndarray
    outline: np.ndarray


class Answer(NamedTuple):
    """A pose and how many statements (in part) support it."""

    pose: np.ndarray
    support: float


def consensus(statements: Sequence[Statement]) -> List[Answer]:
    """Return the best supported X (4, 4), each a different one, best first."""
    statements = list(statements)
    step = max(len(statements) // _MOST_STATEMENTS, 1)
    judges = [_Judge(s) for s in statements[::step]]
    hypotheses = np.concatenate([j.hypotheses() for j in judges])
    hypotheses = hypotheses[:: max(len(hypotheses) // _MOST_HYPOTHESES, 1)]
    supports = np.sum([j.support(hypotheses) for j in judges], axis=0)
    answers: List[Answer] = []
    for i in np.argsort(-supports)[: 10 * _MOST_ANSWERS]:
        if supports[i] < 0.3 * supports.max() or len(answers) == _MOST_ANSWERS:
            break
        if any(_same(hypotheses[i], a.pose) for a in answers):
            continue
        refined = _refined(judges, Answer(hypotheses[i], float(supports[i])))
        if not any(_same(refined.pose, a.pose) for a in answers):
            answers.append(refined)
    return sorted(answers, key=lambda a: -a.support)


def _same(a: np.ndarray, b: np.ndarray) -> bool:
    shift_m, turn_rad = se3.pose_difference(a, b)
    return shift_m < _ANOTHER_M and turn_rad < _ANOTHER_RAD


class _Judge:
    """A statement with its boards' corners laid out for many hypotheses at once."""

    def __init__(self, statement: Statement):
        self.statement = statement
        self.sources = np.stack([se3.apply(p, statement.outline) for p in statement.sources])
        self.targets = np.stack([se3.apply(p, statement.outline) for p in statement.targets])
        diagonal = np.linalg.norm(statement.outline[2] - statement.outline[0])
        self.tolerance = _TOLERANCE * diagonal

    def hypotheses(self) -> np.ndarray:
        """Return (n m, 4, 4): X of every combination."""
        inverse = se3.inverse(self.statement.sources)
        return (self.statement.targets[None] @ inverse[:, None]).reshape(-1, 4, 4)

    def support(self, hypotheses: np.ndarray) -> np.ndarray:
        """Return (h,) in 0 .. 1: how well the best combination agrees."""
        squares = self._squares(hypotheses).reshape(len(hypotheses), -1).min(axis=1)
        return np.maximum(1.0 - squares / self.tolerance**2, 0.0)

    def best_pair(self, pose: np.ndarray) -> np.ndarray:
        """Return (2, 4, 3): source and target corners of the combination that agrees best."""
        squares = self._squares(pose[None])[0]
        source, target = np.unravel_index(np.argmin(squares), squares.shape)
        return np.stack([self.sources[source], self.targets[target]])

    def _squares(self, hypotheses: np.ndarray) -> np.ndarray:
        """Return (h, n, m) mean squared distances of the corners [m^2]."""
        moved = np.einsum("hij,npj->hnpi", hypotheses[:, :3, :3], self.sources)
        moved = moved + hypotheses[:, None, None, :3, 3]
        apart = moved[:, :, None] - self.targets[None, None]
        return np.mean(np.sum(apart**2, axis=-1), axis=-1)


def _refined(judges: Sequence[_Judge], answer: Answer) -> Answer:
    """Fit all supporting statements together, as long as the support grows."""
    for _ in range(_REFINEMENTS):
        weights = np.array([j.support(answer.pose[None])[0] for j in judges])
        pairs = np.stack([j.best_pair(answer.pose) for j in judges])[weights > 0]
        if len(pairs) == 0:
            break
        weight = np.repeat(weights[weights > 0], 4)
        pose = rigid_fit(pairs[:, 0].reshape(-1, 3), pairs[:, 1].reshape(-1, 3), weight)
        support = float(sum(j.support(pose[None])[0] for j in judges))
        if support <= answer.support:
            break
        answer = Answer(pose, support)
    return answer
