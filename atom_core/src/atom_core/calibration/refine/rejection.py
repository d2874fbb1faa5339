"""Whole bad detections and collections: found, named, left out.

After the robust solve each detection is tested against all others. Where one is suspicious, its
board is fitted to subsets of its detections: the one is left out without which the others agree
best, until they agree. Where no majority agrees, the board is left out as a whole. Then all is
solved again. The worst go first, since they disturb the test of others.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Set, Tuple

import numpy as np
from scipy.special import chdtri  # scipy.stats has it as chi2.isf, and takes long to load

from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.connectivity import check_connected
from atom_core.calibration.refine.board_fit import BoardFits
from atom_core.calibration.refine.disagreement import CHANCE, Disagreement, disagreement
from atom_core.calibration.refine.moving_parts import MovingSolution
from atom_core.calibration.start.boards import boards_in, solved_dataset
from atom_core.calibration.start.starts import InitialProblem
from atom_core.errors import CalibrationError
from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey, place
from atom_core.model.pattern import BoardKey
from atom_core.problem.blocks import ParameterBlock
from atom_core.problem.builder import build_problem
from atom_core.problem.measurements import Measurement
from atom_core.problem.problem import Problem
from atom_core.solvers import losses
from atom_core.solvers.base import FAILED, SIGMA, SolverSetup
from atom_core.solvers.reweighting import solve_again

_ROUNDS = 10
_WORST = 0.25  # boards nearly as bad as the worst are dealt with in the same round
_CLEAR = 20.0  # chi-square by which one explanation must beat the next
_LENIENT = 2.0  # on the limit of what the test of all detections did not find suspicious
GARBAGE = "most of it fits no pose of the board"
DISAGREES = "it disagrees with the other sensors on where the board is"
NO_MAJORITY = "its sensors do not agree on where the board is"
_LIMIT = float(chdtri(6, CHANCE))
ALONE = "no other sensor is left that sees the board"


class Rejected(NamedTuple):
    """A detection that is left out.

    Attributes:
        key: which one.
        reason: why, to be read after its name.
        excess: its chi-square over what random errors allow.
    """

    key: DetectionKey
    reason: str
    excess: float


@dataclass(frozen=True)
class Rejection:
    """What is left after bad detections were left out.

    Attributes:
        solution: of what is left.
        rejected: in the order in which they were found.
        failure: why what is left cannot be calibrated, or None; then nothing was left out.
    """

    solution: MovingSolution
    rejected: Tuple[Rejected, ...]
    failure: Optional[str]


def reject_bad_detections(
    start: InitialProblem,
    solution: MovingSolution,
    options: CalibrationOptions,
    setup: SolverSetup,
) -> Rejection:
    """Leave bad detections out and solve again, until none is left.

    Without a robust loss, or without weights that mean something, there is nothing to test.

    Args:
        start: what the problem was built from, with the measurements of all detections.
        solution: with all detections.
        options: what to keep in any case.
        setup: which solver.
    """
    now = solution
    rejected: Tuple[Rejected, ...] = ()
    if setup.options.weights != SIGMA or setup.options.loss == losses.NONE:
        return Rejection(now, rejected, None)
    initial, left = start.initial, list(start.measurements)
    for _ in range(_ROUNDS):
        if now.summary.interrupted or now.summary.status == FAILED:
            break
        judge = _Judge(now, rejected, left, options, setup)
        found = judge.verdict()
        if not found:
            break
        out = {r.key for r in found}
        left = [m for m in left if m.key not in out]
        rejected += tuple(found)
        try:
            check_connected(initial, left, solution.free)
        except CalibrationError as error:
            return Rejection(solution, (), _failure(initial, left, rejected, str(error)))
        again = setup.make(_rebuilt(initial, now, left, judge.boards))
        after = solve_again(again, setup.options, now.solver.problem, now.summary)
        now = replace(now, solver=again, summary=after)
    return Rejection(now, rejected, None)


def _failure(
    dataset: Dataset, left: Sequence[Measurement], rejected: Sequence[Rejected], error: str
) -> str:
    seen = {m.key.sensor for m in left}
    blind = [name for name in dataset.sensors if name not in seen]
    if blind:
        error = f"nothing is left of what sensor '{blind[0]}' saw"
    named = ", ".join(f"{r.key.sensor} in {r.key.collection}" for r in rejected[:5])
    more = "" if len(rejected) <= 5 else f" and {len(rejected) - 5} more"
    return (
        f"{len(rejected)} detections contradict the others ({named}{more}), and without them "
        f"{error}; correct these labels, or keep them with --keep_collections"
    )


def _rebuilt(
    initial: Dataset,
    now: MovingSolution,
    left: Sequence[Measurement],
    refitted: Mapping[BoardKey, np.ndarray],
) -> Problem:
    """Return the problem of the remaining detections, from the present solution on."""
    base = solved_dataset(initial, now.solver.problem, now.summary.x, {})
    boards = boards_in(base, left)
    boards.update({key: pose for key, pose in refitted.items() if key in boards})
    return build_problem(base, left, boards, now.free)


class _Judge:
    """One round: which detections are bad, given the present solution."""

    def __init__(
        self,
        now: MovingSolution,
        before: Sequence[Rejected],
        measurements: Sequence[Measurement],
        options: CalibrationOptions,
        setup: SolverSetup,
    ):
        self.boards: Dict[BoardKey, np.ndarray] = {}  # refitted to the detections kept
        self._options, self._setup = options, setup
        self._before = before
        self._problem, self._summary = now.solver.problem, now.summary
        self._measurements = {m.key: m for m in measurements}
        x, sigmas = now.summary.x, now.summary.sigmas
        equations = now.solver.equations(x, sigmas, setup.options.loss)
        squares = now.solver.squares(x, sigmas)
        self._test: Disagreement = disagreement(self._problem, x, equations, squares)

    def verdict(self) -> List[Rejected]:
        """Return what is to be left out; empty when all is well."""
        suspicious = self._test.suspicious
        if not np.any(suspicious):
            return []
        groups = self._groups()
        worst = {i: float(np.max(self._test.excess[members])) for i, members in groups.items()}
        for i, members in groups.items():
            if np.any(self._test.mostly_outliers[members]):
                worst[i] = max(worst[i], 1.0)
        limit = _WORST * max(
            (w for i, w in worst.items() if np.any(suspicious[groups[i]])), default=np.inf
        )
        found: List[Rejected] = []
        for i, members in groups.items():
            if worst[i] >= limit and np.any(suspicious[members]):
                found += self._of_board(i, members) if i >= 0 else self._worst_of(members)
        return found

    def _groups(self) -> Dict[int, np.ndarray]:
        """Return the detections of each board of a collection; under -1 those of all others."""
        is_board = self._problem.parameters.is_board_of_collection
        groups: Dict[int, List[int]] = {}
        for d, row in enumerate(self._problem.chains.block):
            boards = [b for b in row if b >= 0 and is_board[b]]
            groups.setdefault(boards[0] if boards else -1, []).append(d)
        return {i: np.array(members) for i, members in groups.items()}

    def _kept(self, detection: int) -> bool:
        key = self._problem.detections[detection]
        options = self._options
        named = (key.collection, key.sensor) in options.keep_detections
        return named or key.collection in options.keep_collections

    def _worst_of(self, members: np.ndarray) -> List[Rejected]:
        """Judge detections of a board that holds for all collections, or is held."""
        excess = np.maximum(self._test.excess, self._test.mostly_outliers)[members]
        limit = max(_WORST * np.max(excess), 1.0)
        return [
            self._rejected(d, GARBAGE if self._test.mostly_outliers[d] else DISAGREES)
            for d, e in zip(members, excess)
            if e >= limit and not self._kept(d)
        ]

    def _rejected(self, detection: int, reason: str) -> Rejected:
        excess = float(min(self._test.excess[detection], 1e12))
        return Rejected(self._problem.detections[detection], reason, excess)

    def _of_board(self, block: int, members: np.ndarray) -> List[Rejected]:
        """Judge the detections of one board of one collection."""
        fits = self._fits(block, members)
        found = {d: GARBAGE for d in members if not self._kept(d) and fits.is_garbage(d)}
        left = [d for d in members if d not in found]
        first, unclear = 0.0, False
        while len(left) > 1 and not unclear:
            blamed, gain = self._blamed(fits, left)
            first = max(first, gain)
            if not blamed or gain < _WORST * first:
                break
            unclear = len(blamed) > 1
            found.update(dict.fromkeys(blamed, NO_MAJORITY if unclear else DISAGREES))
            left = [d for d in left if d not in blamed]
        if not found:
            return []
        board = self._problem.parameters.blocks[block]
        if unclear or len(left) <= (len(members) + self._lost(board)) / 2:
            why = ALONE if len(left) == 1 else NO_MAJORITY
            found.update({d: found.get(d, why) for d in members if not self._kept(d)})
        else:
            key = (board.names[0], board.collection)
            self.boards[key] = fits.fit(left).parent_T_pattern
        return [self._rejected(d, reason) for d, reason in found.items()]

    def _lost(self, board: ParameterBlock) -> int:
        """Return how many detections of a board were left out in earlier rounds."""
        place = (board.collection, board.names[0])
        return sum((r.key.collection, r.key.pattern) == place for r in self._before)

    def _blamed(self, fits: BoardFits, left: Sequence[int]) -> Tuple[List[int], float]:
        """Return the one without which the others agree best, and the chi-square that it saves.

        Nobody where they agree as it is; several when nothing tells which of them it is.
        """
        choices = [d for d in left if not self._kept(d)]
        without = {d: fits.disagreement([o for o in left if o != d]) for d in choices}
        ranked = sorted(choices, key=lambda d: without[d])
        if not ranked:
            return [], 0.0
        gain = fits.disagreement(left) - without[ranked[0]]
        lenient = 1.0 if self._test.suspicious[ranked[0]] else _LENIENT
        if gain < lenient * _LIMIT:
            return [], gain
        return [d for d in ranked if without[d] - without[ranked[0]] < _CLEAR], gain

    def _fits(self, block: int, members: np.ndarray) -> BoardFits:
        problem, scatter = self._problem, np.sqrt(self._test.scatter)
        sigmas = [
            sigma * scatter[b.detection]
            for b, sigma in zip(problem.residual_blocks, self._summary.sigmas)
        ]
        mine = {int(d): self._measurements[problem.detections[d]] for d in members}
        loss, x = self._setup.options.loss, self._summary.x
        return BoardFits(problem, x, sigmas, block, mine, loss, self._setup.make)


def whole_collections(rejected: Sequence[Rejected], left: Set[str]) -> Dict[str, str]:
    """Return why collections are not used, of those whose last detection was left out.

    Args:
        rejected: the detections left out.
        left: collections that still have detections.
    """
    reasons: Dict[str, Set[str]] = {}
    for r in rejected:
        if r.key.collection not in left:
            reasons.setdefault(r.key.collection, set()).add(r.reason)
    return {
        key: f"left out: {NO_MAJORITY if len(why) > 1 else next(iter(why))}"
        for key, why in reasons.items()
    }


def rejection_warnings(rejected: Sequence[Rejected], left: Set[str]) -> List[str]:
    """Return a sentence for each collection and each single detection that was left out."""
    warnings = [
        f"collection {key} is {reason} (--keep_collections {key} forces it in)"
        for key, reason in sorted(whole_collections(rejected, left).items())
    ]
    warnings += [
        f"{place(r.key)}: left out, {r.reason} (--keep_detections "
        f"{r.key.collection}:{r.key.sensor} forces it in)"
        for r in sorted(rejected, key=lambda r: r.key)
        if r.key.collection in left
    ]
    return warnings
