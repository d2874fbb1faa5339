"""Whether a camera's focal length changed while the collections were made: autofocus, or a zoom.

Its images are larger then, as if it had gone nearer to the boards. So this is looked for beside
moves, in the same way: one number that is another one from some collection on, that goes on
changing, or that differs from collection to collection.
"""

from __future__ import annotations

from functools import partial
from typing import Mapping, NamedTuple, Optional, Sequence

import numpy as np
from scipy import special

from atom_core.calibration.refine.model_checks import ModelCheck
from atom_core.calibration.refine.model_errors import CheckedSolution
from atom_core.calibration.refine.steps import (
    ALIKE,
    BY_CHANCE,
    CHANCE,
    MORE,
    Changes,
    Step,
    all_steps,
    differences,
    order_of,
    shared_parts,
    step_between,
)
from atom_core.model.dataset import Dataset
from atom_core.problem.blocks import BLOCK_SIZE, TRANSLATION
from atom_core.problem.model_errors import CameraError
from atom_core.solvers.detection_columns import CollectionColumns
from atom_core.solvers.shared_equations import FLOOR, SharedEquations, inverse

_FOCAL_LENGTH = "focal_length"  # label of its error
_LEAST, _MOST = 0.001, 0.5  # change of a focal length, as a part of it
_APART = 10.0  # by so much less a move explains that is none
_STOP = "switch its autofocus off and lock its zoom"


class Refocused(NamedTuple):
    """A camera whose focal length changed.

    Attributes:
        camera: its name.
        last, first: the collections before and after; of what crept, the first and the last.
        change: of the focal length, as a part of it; its standard deviation where it differs from
            collection to collection.
        gain: by how much the cost (twice the negative logarithm of the likelihood) would fall.
        crept: little by little, from collection to collection.
        differs: from collection to collection.
        or_moved_m: shift of the camera that explains it as well; None: none does.
    """

    camera: str
    last: str
    first: str
    change: float
    gain: float
    crept: bool
    differs: bool
    or_moved_m: Optional[float]

    @property
    def is_clear(self) -> bool:
        """Whether no single error explains nearly as much: else it is not told."""
        return True

    @property
    def why(self) -> str:
        """One sentence for the user."""
        what, by = f"the focal length of {self.camera}", f"{100.0 * abs(self.change):.2g} %"
        between, remedy = f"between collections {self.last} and {self.first}", _STOP
        if self.or_moved_m is not None:
            by += f" (or it was moved by {1e3 * self.or_moved_m:.2g} mm, these data do not tell)"
            remedy = f"fasten it, {_STOP}"
        if self.differs:
            each = "from collection to collection"
            return f"{what} differs {each}, by {by}: {_STOP}, and collect again"
        if self.crept:
            return f"{what} crept {between}, by {by}: {remedy}, and collect again"
        return (
            f"{what} changed {between}, by {by}: {remedy}, and calibrate the collections of one "
            f"side alone (-csf)"
        )


def changed_focus(
    dataset: Dataset,
    solution: CheckedSolution,
    motions: Changes,
    moves: Mapping[str, Step],
    others: Sequence[ModelCheck],
) -> Optional[Refocused]:
    """Return the camera whose focus changed, where neither moves nor single errors explain more.

    Args:
        dataset: the order of its collections is that in which they were made.
        solution: its equations.
        motions: of sensors and boards, where a detection counts for little more than one row.
        moves: those of them that are clear, by name.
        others: the checks of single errors.
    """
    said_by = partial(_Said, dataset, solution.stops)
    cautious = [
        error
        for error in solution.cautious.errors
        if isinstance(error, CameraError) and error.label == _FOCAL_LENGTH
    ]
    most = ALIKE * max((step.gain for step in moves.values()), default=0.0)
    if not cautious:
        return None
    said = said_by(solution.cautious)
    found = [
        _change(said.changes(error), error.target, motions, len(cautious)) for error in cautious
    ]
    clear = [
        (change, error)
        for change, error in zip(found, cautious)
        if change is not None and change.gain > most
    ]
    if not clear:
        return None
    change, error = max(clear, key=lambda one: one[0].gain)
    again = _again(said_by(solution.equations).changes(error), error.target, change)
    explained = max((check.gain for check in others), default=0.0)
    if again.gain < MORE * explained + BY_CHANCE:
        return None
    part, step = float(np.expm1(error.step * again.value)), change.step
    if step is None:
        return Refocused(error.target, "", "", part, again.gain, False, True, None)
    move, or_moved_m = moves.get(error.target), None
    if move is not None and move.gain > change.gain - _APART:
        or_moved_m = float(np.linalg.norm(move.value[TRANSLATION]))
    places = motions.places(step)
    return Refocused(error.target, *places, part, again.gain, step.creeps, False, or_moved_m)


class _Change(NamedTuple):
    """How a focal length changed.

    Attributes:
        step: when; None: it differs from collection to collection.
        value: by how much, in steps of the error; of what differs a standard deviation.
        gain: what it explains beside the focal length that was given.
    """

    step: Optional[Step]
    value: float
    gain: float


class _Said:
    """What collections say of the shared blocks' numbers, beside which a focal length may change.

    There are far more of those than of focal lengths, so that they are gathered and inverted once
    for all cameras.
    """

    def __init__(self, dataset: Dataset, stops: Mapping[str, str], shared: SharedEquations):
        """Gather it, in the order of the dataset."""
        self._shared, self._stops, self._order = shared, stops, order_of(dataset, shared)
        size = BLOCK_SIZE * shared.blocks
        self._numbers = np.arange(size)
        self._parts = np.zeros((len(self._order), size + 1, size + 1))
        self._parts[:, :-1, :-1] = shared_parts(shared, self._order, self._numbers)
        self._inverse = inverse(shared.total[:size, :size])

    def changes(self, error: CameraError) -> Changes:
        """Return a focal length as what may change, beside the one that all collections have.

        They hold until the next ones are asked for.
        """
        shared, said = self._shared, self._parts
        own = shared.place[error]
        numbers = np.append(self._numbers, own)
        for part, which in zip(said, self._order):
            part[:, -1] = part[-1] = shared.parts[which].column(own, numbers)
        gradient = shared.gradient[self._order][:, numbers]
        column = CollectionColumns(said[:, :, -1:], said[:, -1:, -1:], gradient[:, -1:])
        return Changes.of_stops(
            [shared.collections[i] for i in self._order],
            self._stops,
            {error.target: column},
            bordered(self._inverse, shared.total[numbers, own]),
            said,
            gradient,
        )


def bordered(inverse_of: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Return the inverse (m + 1, m + 1) of a matrix with a further row and column, as `inverse`.

    Args:
        inverse_of: (m, m) inverse of the matrix without them.
        column: (m + 1,) the further column, which ends with the corner.
    """
    follow = inverse_of @ column[:-1]
    left = max(column[-1] - column[:-1] @ follow, FLOOR * max(column[-1], 1e-30))
    with_minus_one = np.append(follow, -1.0)
    result = np.outer(with_minus_one, with_minus_one) / left
    result[:-1, :-1] += inverse_of
    return result


def _change(changes: Changes, camera: str, motions: Changes, cameras: int) -> Optional[_Change]:
    """Return the change that is clear and explains most; None: there is none."""
    steps, looked_at = all_steps(changes)
    limit = CHANCE / (cameras * (looked_at + 1))
    clear = [step for step in steps.get(camera, []) if step.chance < limit]
    best = max(clear, key=lambda step: step.gain, default=None)
    if best is not None and best.stood_still:
        found = _Change(best, float(best.value[0]), best.gain + _given_gain(changes))
    elif camera in motions.columns and _differs(changes, camera, motions, limit):
        found = _differing(changes, camera)
    else:
        return None
    return found if _LEAST < abs(found.value) * CameraError.step < _MOST else None


def _again(changes: Changes, camera: str, change: _Change) -> _Change:
    """Return a change as other equations have it."""
    if change.step is None:
        return _differing(changes, camera)
    step = step_between(changes, camera, change.step.last, change.step.first, change.step.creeps)
    if step is None:
        return change._replace(gain=0.0)
    return _Change(step, float(step.value[0]), step.gain + _given_gain(changes))


def _given_gain(changes: Changes) -> float:
    """Return what another focal length of all collections explains."""
    settled = changes.inverse_of_all @ changes.gradient.sum(axis=0)
    return float(settled[-1] ** 2 / changes.inverse_of_all[-1, -1])


def _differing(changes: Changes, camera: str) -> _Change:
    apart = differences(changes, camera)
    information = float(changes.columns[camera].information.sum())
    spread = np.sqrt(max(float(apart.sum()) - len(apart) + 1.0, 0.0) / information)
    return _Change(None, float(spread), float(apart.sum()) + _given_gain(changes))


def _differs(changes: Changes, camera: str, motions: Changes, limit: float) -> bool:
    """Tell whether a focal length, and not the camera's place, is another one in each collection.

    Not because of two of them alone.
    """
    apart, moved = differences(changes, camera), differences(motions, camera)
    freedom = len(apart) - 1
    most = np.sort(apart)[:-2]
    if freedom < 3 or special.chdtrc(freedom, apart.sum()) > limit:
        return False
    if special.chdtrc(max(len(most) - 1, 1), most.sum()) > limit:
        return False
    beyond = float(moved.sum()) - BLOCK_SIZE * (len(moved) - 1)
    return float(apart.sum()) - freedom > ALIKE * beyond
