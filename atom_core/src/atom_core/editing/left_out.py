"""A calibration solved again without what some sensors saw in some collections.

Solving is quick, since data are read once, and boards and sigmas begin where they were. What the
new answer is worth is found when it is asked for.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Dict, FrozenSet, Optional, Set, Tuple

import numpy as np

from atom_core.calibration.calibrate import Calibration, judged, solved
from atom_core.calibration.judge.solved import Solved
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.refine.refinement import Earlier
from atom_core.errors import SelectionError
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, pose
from atom_core.model.labels import DetectionKey
from atom_core.problem.measurements import Measured, measured_detections

Place = Tuple[str, str]  # sensor, collection


class LeftOut:
    """Answers "what if this were not there?"; the calibration it begins with stays as it is.

    Attributes:
        first: that calibration.
        solved: the one without what is left out, not judged; None where nothing is.
    """

    def __init__(self, first: Calibration, options: CalibrationOptions):
        """Begin with nothing left out beside what the calibration rejected.

        Args:
            first: a calibration that has ended.
            options: with which it was made.
        """
        self.first = first
        self.solved: Optional[Solved] = None
        self._judged: Optional[Tuple[Solved, Calibration]] = None
        self._options = replace(
            options,
            solver=replace(options.solver, progress=None),
            boards_of_dataset=True,
            noisy_initial_guess=(0.0, 0.0),
        )
        self._without: Set[Place] = set()
        self._kept: Set[Place] = set()

    @property
    def now(self) -> Calibration:
        """The calibration without what is left out, judged when this is first asked for.

        It may be asked for in a thread while another one leaves out more.
        """
        solution, known = self.solved, self._judged
        if solution is None:
            return self.first
        if known is None or known[0] is not solution:
            known = (solution, judged(solution))
            self._judged = known
        return known[1]

    @property
    def places(self) -> FrozenSet[Place]:
        """What is left out now: on request, and as bad detections."""
        now = self.first if self.solved is None else self.solved.refined
        rejected = {(r.key.sensor, r.key.collection) for r in now.rejected}
        return frozenset(self._without | rejected)

    def get_ready(self) -> None:
        """Read the data, so that the first answer comes as soon as the others.

        Raises:
            AtomError: they cannot be read any more.
        """
        _ = self._read

    def leave_out(self, sensor: str, collection: str) -> str:
        """Solve without what a sensor saw in a collection; return what that changes.

        Raises:
            SelectionError: it saw nothing there.
            AtomError: without it nothing can be solved; all stays as it was.
        """
        self._check(sensor, collection)
        place = (sensor, collection)
        self._solve(self._without | {place}, self._kept - {place})
        return f"{sensor} in {collection} is left out; {self._change()}"

    def take_in(self, sensor: str, collection: str) -> str:
        """Solve with it again, also where it was rejected; return what that changes.

        Raises:
            SelectionError: it saw nothing there.
            AtomError: with it nothing can be solved; all stays as it was.
        """
        self._check(sensor, collection)
        place = (sensor, collection)
        rejected = place in self.places - self._without
        self._solve(self._without - {place}, self._kept | ({place} if rejected else set()))
        return f"{sensor} in {collection} is used again; {self._change()}"

    def _solve(self, without: Set[Place], kept: Set[Place]) -> None:
        if without or kept:
            keep = tuple((collection, sensor) for sensor, collection in sorted(kept))
            options = replace(
                self._options, keep_detections=(*self._options.keep_detections, *keep)
            )
            left = _without(self.first.dataset, without)
            earlier = Earlier(self.first.problem, self.first.summary)
            self.solved = solved(left, options, self._read, earlier)
        else:
            self.solved = None
        self._without, self._kept = set(without), set(kept)

    @cached_property
    def _read(self) -> Dict[DetectionKey, Measured]:
        return measured_detections(self.first.dataset)

    def _check(self, sensor: str, collection: str) -> None:
        labels = self.first.dataset.collections.get(collection)
        if labels is None or not any(name == sensor for name, _ in labels.labels):
            raise SelectionError(f"{sensor} has no label in collection '{collection}'")

    def _change(self) -> str:
        """Return which sensor stands elsewhere now, and how far from where it stood at first."""
        if self.solved is None:
            return "all is as it was written"
        after = self.solved.dataset
        moves = {name: _move(self.first.dataset, after, name) for name in self._free()}
        if not moves:
            return "no sensor is estimated"
        name = max(moves, key=lambda name: moves[name][0])
        metres, radians = moves[name]
        return (
            f"{name} moves most, by {1e3 * metres:.2f} mm and {np.rad2deg(radians):.3f} deg; "
            f"what is written stays as it was"
        )

    def _free(self) -> Tuple[str, ...]:
        dataset = self.first.dataset
        held = self.first.free.held_edges(dataset)
        return tuple(s.name for s in dataset.sensors.values() if s.edge not in held)


def _without(dataset: Dataset, places: Set[Place]) -> Dataset:
    for sensor, collection in sorted(places):
        labels = dataset.collections[collection].labels
        none = {key: None for key in labels if key[0] == sensor}
        dataset = dataset.with_labels(collection, none)
    return dataset


def _move(before: Dataset, after: Dataset, name: str) -> Tuple[float, float]:
    """Return how far a sensor moved in the world [m], [rad], in the first collection."""
    key, frame = next(iter(before.collections)), before.sensors[name].frame
    here, there = (
        pose(dataset.collections[key], dataset.graph, dataset.world, frame)
        for dataset in (before, after)
    )
    return se3.pose_difference(here, there)
