"""Whether numbers differ between earlier and later collections, by one Gauss-Newton step.

A sensor's place, or one of its intrinsics, is another one from some collection on (a structural
change at an unknown time: Andrews 1993), or goes on changing from the first to the last. What that
explains is compared with how much the collections differ beside it.
"""

from __future__ import annotations

from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from scipy import special

from atom_core.model.dataset import Dataset
from atom_core.solvers.detection_columns import CollectionColumns
from atom_core.solvers.shared_equations import SharedEquations, inverse

CHANCE = 0.01  # of telling a change where there is none, all of a calibration together
FEWEST = 3  # collections before and after
MORE, BY_CHANCE = 1.2, 30.0  # times what single errors explain, and what the choice among many does
ALIKE = 0.9  # part of the gain with which another change explains it as well
_REST = 0.5  # part of a gain that a change keeps without any one stop, or it rests on that one
_SEEN = 1e-6  # part of its information that other numbers must leave a direction
_LOOSE = 5.0  # so much more than noise, or so little beside the step, differ the collections


class Changes(NamedTuple):
    """Numbers that may have changed, beside s shared ones, in the order of g stops.

    A stop is one collection, or some that follow one another with all boards where they were: what
    goes wrong there goes wrong in all of them, and tells of no change.

    Attributes:
        keys: of the first collection of each stop.
        ends: of the last one.
        columns: of what may have changed, by its name.
        inverse_of_all: (s, s) inverse of all information of the shared numbers.
        of_shared: (g, s, s) what each stop says of these.
        gradient: (g, s) likewise.
    """

    keys: Tuple[str, ...]
    ends: Tuple[str, ...]
    columns: Dict[str, CollectionColumns]
    inverse_of_all: np.ndarray
    of_shared: np.ndarray
    gradient: np.ndarray

    @classmethod
    def of_stops(
        cls,
        keys: Sequence[str],
        stops: Mapping[str, str],
        columns: Mapping[str, CollectionColumns],
        inverse_of_all: np.ndarray,
        of_shared: np.ndarray,
        gradient: np.ndarray,
    ) -> Changes:
        """Return the changes, given what each collection says, and the stop of each."""
        count = len(keys)
        starts = [i for i in range(count) if i == 0 or stops[keys[i]] != stops[keys[i - 1]]]

        def added(values: np.ndarray) -> np.ndarray:
            return values if len(starts) == count else np.add.reduceat(values, starts, axis=0)

        return cls(
            tuple(keys[i] for i in starts),
            tuple(keys[i - 1] for i in [*starts[1:], count]),
            {n: CollectionColumns(*(added(v) for v in own)) for n, own in columns.items()},
            inverse_of_all,
            added(of_shared),
            added(gradient),
        )

    def places(self, step: Step) -> Tuple[str, str]:
        """Return the collections right before and after a step; of what creeps, first and last."""
        if step.creeps:
            return self.keys[step.last], self.ends[step.first]
        return self.ends[step.last], self.keys[step.first]

    def without(self, stop: int) -> Changes:
        """Return the changes as all stops have them but one, by its index."""
        others = (np.arange(len(self.keys)) != stop).astype(float)
        each = others[:, None, None]
        columns = {
            name: CollectionColumns(
                own.cross * each, own.information * each, own.gradient * others[:, None]
            )
            for name, own in self.columns.items()
        }
        left = inverse(inverse(self.inverse_of_all) - self.of_shared[stop])
        of_shared, gradient = self.of_shared * each, self.gradient * others[:, None]
        return Changes(self.keys, self.ends, columns, left, of_shared, gradient)


class Step(NamedTuple):
    """A change of k numbers between two collections.

    Attributes:
        last, first: indices of the stops before and after it that tell of it; -1 and 0: it
            comes before all of them. Of what creeps, the first and the last that tell.
        value: (k,) by how much.
        gain: what it explains: by how much the cost (twice the negative logarithm of the
            likelihood) would fall.
        spread: by how much collections differ beside it, as a chi-square.
        freedom: of that.
        chance: that there is none.
        creeps: little by little.
    """

    last: int
    first: int
    value: np.ndarray
    gain: float
    spread: float
    freedom: int
    chance: float
    creeps: bool

    @property
    def is_of_all(self) -> bool:
        """Whether it comes before all collections."""
        return self.last < 0

    @property
    def stood_still(self) -> bool:
        """Whether collections are alike before it, and after it; else it is one of many."""
        return self.spread < max(_LOOSE * self.freedom, self.gain / _LOOSE)


_UNKNOWN = (np.zeros(0), 0.0, 0.0, 0, 1.0)  # value, gain, spread, freedom and chance of a step


def all_steps(changes: Changes) -> Tuple[Dict[str, List[Step]], int]:
    """Return the steps of each that are no chance by themselves, and how many were looked at.

    Between any two collections, with three or more on either side, and creeping from the first
    collection to the last.
    """
    found: Dict[str, List[Step]] = {}
    looked_at = 0
    for name, columns in changes.columns.items():
        told = _telling(columns).tolist()
        between = list(zip(told[FEWEST - 1 :], told[FEWEST : len(told) - FEWEST + 1]))
        if not between:
            continue
        steps = [step_between(changes, name, last, first) for last, first in between]
        steps.append(step_between(changes, name, told[0], told[-1], creeps=True))
        looked_at += len(steps)
        found[name] = [step for step in steps if step is not None]
    return found, looked_at


def differences(changes: Changes, name: str) -> np.ndarray:
    """Return (t,) how far those collections that tell are from all, in k numbers, as chi-squares.

    All together have k (t - 1) independent ones.
    """
    columns = changes.columns[name]
    settled = -changes.inverse_of_all @ changes.gradient.sum(axis=0)  # the shared numbers' own step
    left = columns.gradient + np.einsum("gsk,s->gk", columns.cross, settled)
    inverses = np.linalg.pinv(columns.information, rcond=1e-8)
    return np.einsum("gi,gij,gj->g", left, inverses, left)[_telling(columns)]


def order_of(dataset: Dataset, shared: SharedEquations) -> np.ndarray:
    """Return (g,) the indices of the equations' collections as these follow in a dataset."""
    place = {name: i for i, name in enumerate(dataset.collections)}
    return np.argsort([place[name] for name in shared.collections])


def shared_parts(shared: SharedEquations, order: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Return what each collection says of some shared numbers.

    Args:
        shared: all that they say.
        order: (g,) of the collections.
        numbers: (s,) which, ascending.

    Returns:
        (g, s, s).
    """
    result = np.zeros((len(order), len(numbers), len(numbers)))
    for own, which in zip(result, order):
        part = shared.parts[which]
        kept = np.isin(part.numbers, numbers)
        mine = np.searchsorted(numbers, part.numbers[kept])
        own[mine[:, None], mine] = part.information[np.ix_(kept, kept)]
    return result


def _telling(columns: CollectionColumns) -> np.ndarray:
    """Return the indices of the collections that say something of a change."""
    return np.flatnonzero(np.trace(columns.information, axis1=1, axis2=2) > 0)


def _shares(count: int, last: int, first: int, creeps: bool) -> np.ndarray:
    """Return which part (g,) of a change each of so many collections has."""
    each = np.arange(count)
    if creeps:
        return np.clip((each - last) / (first - last), 0.0, 1.0)
    return np.asarray(each >= first, dtype=float)


def step_between(
    changes: Changes, name: str, last: int, first: int, creeps: bool = False
) -> Optional[Step]:
    """Return a change between two collections; None: the data do not tell it, or it is chance.

    Args:
        changes: with its columns.
        name: of what changes.
        last: index of a collection, as in `Step`.
        first: likewise.
        creeps: little by little from the one to the other.
    """
    shares = _shares(len(changes.keys), last, first, creeps)
    return _step_of(changes, name, shares, Step(last, first, *_UNKNOWN, creeps))


def rests_on(changes: Changes, name: str, step: Step, limit: float) -> List[int]:
    """Return the indices of the stops without any one of which a clear step would be none.

    Args:
        changes: with its columns.
        name: of what changes.
        step: between two collections.
        limit: of the chance up to which a step is clear.
    """
    found = []
    for stop in _telling(changes.columns[name]).tolist():
        left = step_between(changes.without(stop), name, step.last, step.first, step.creeps)
        if left is None or (left.gain < _REST * step.gain and left.chance >= limit):
            found.append(int(stop))
    return found


def step_at(changes: Changes, name: str, stop: int) -> Optional[Step]:
    """Return a change at one stop alone, by its index; None: the data do not tell it."""
    shares = (np.arange(len(changes.keys)) == stop).astype(float)
    return _step_of(changes, name, shares, Step(stop, stop, *_UNKNOWN, creeps=False))


def _step_of(changes: Changes, name: str, shares: np.ndarray, step: Step) -> Optional[Step]:
    """Return a step with all that the data tell of it; None: they do not, or it is chance.

    Args:
        changes: with its columns.
        name: of what changes.
        shares: (g,) which part of the change each stop has.
        step: between which stops it is.
    """
    whole = changes.columns[name]
    size = whole.information.shape[-1]
    columns = _weighted(whole, shares)
    crossed = columns.cross.sum(axis=0)
    follow = changes.inverse_of_all @ crossed
    total = columns.information.sum(axis=0) - crossed.T @ follow
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(columns.information.sum(axis=0)), 1e-30))
    if np.linalg.eigvalsh(total * scale[:, None] * scale)[0] < _SEEN:
        return None
    slope = columns.gradient.sum(axis=0) - changes.gradient.sum(axis=0) @ follow
    value = -np.linalg.solve(total, slope)
    gain = float(value @ total @ value)
    freedom = size * (len(_telling(whole)) - 2)
    if special.fdtrc(size, freedom, gain / size) > CHANCE:
        return None  # even if collections differed by no more than noise
    spread = _spread_of(changes, columns, follow, value)
    ratio = gain / size / max(spread / freedom, 1.0)
    chance = float(special.fdtrc(size, freedom, ratio))
    return step._replace(value=value, gain=gain, spread=spread, freedom=freedom, chance=chance)


def _weighted(columns: CollectionColumns, shares: np.ndarray) -> CollectionColumns:
    """Return the columns of a change of which each collection has a part (g,)."""
    each = shares[:, None, None]
    return columns._replace(
        information=columns.information * each**2,
        gradient=columns.gradient * shares[:, None],
        cross=columns.cross * each,
    )


def _spread_of(
    changes: Changes, columns: CollectionColumns, follow: np.ndarray, value: np.ndarray
) -> float:
    """Return by how much collections differ beside a step, as a chi-square.

    Args:
        changes: with what each collection says of the shared numbers.
        columns: of the step.
        follow: (s, k) by how much the shared numbers follow it, with the other sign.
        value: (k,) of the step.
    """
    slope = columns.gradient - changes.gradient @ follow
    crossed = np.swapaxes(columns.cross, 1, 2) @ follow
    own = columns.information - crossed - np.swapaxes(crossed, 1, 2)
    own += follow.T @ changes.of_shared @ follow
    left = slope + own @ value
    return float(np.einsum("gi,gij,gj->", left, np.linalg.pinv(own, rcond=1e-8), left))
