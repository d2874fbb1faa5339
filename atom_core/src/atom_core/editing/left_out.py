"""A calibration solved again without what some sensors saw in some collections."""

from __future__ import annotations

from dataclasses import replace
from typing import FrozenSet, Set, Tuple

import numpy as np

from atom_core.calibration.calibrate import Calibration, calibrate
from atom_core.calibration.options import OFF, SUGGEST, CalibrationOptions
from atom_core.errors import SelectionError
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, pose

Place = Tuple[str, str]  # sensor, collection


class LeftOut:
    """Answers "what if this were not there?"; the calibration it begins with stays as it is.

    Attributes:
        first: that calibration.
        now: the one without what is left out.
    """

    def __init__(self, first: Calibration, options: CalibrationOptions):
        """Begin with nothing left out beside what the calibration rejected.

        Args:
            first: a calibration that has ended.
            options: with which it was made.
        """
        self.first = self.now = first
        self._options = replace(
            options,
            solver=replace(options.solver, progress=None),
            boards_of_dataset=True,
            noisy_initial_guess=(0.0, 0.0),
            # what would only be suggested costs time, and changes nothing
            model_errors=OFF if options.model_errors == SUGGEST else options.model_errors,
        )
        self._without: Set[Place] = set()
        self._kept: Set[Place] = set()

    @property
    def places(self) -> FrozenSet[Place]:
        """What is left out now: on request, and as bad detections."""
        rejected = {(r.key.sensor, r.key.collection) for r in self.now.rejected}
        return frozenset(self._without | rejected)

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
            self.now = calibrate(_without(self.first.dataset, without), options)
        else:
            self.now = self.first
        self._without, self._kept = set(without), set(kept)

    def _check(self, sensor: str, collection: str) -> None:
        labels = self.first.dataset.collections.get(collection)
        if labels is None or not any(name == sensor for name, _ in labels.labels):
            raise SelectionError(f"{sensor} has no label in collection '{collection}'")

    def _change(self) -> str:
        """Return which sensor stands elsewhere now, and how far from where it stood at first."""
        if self.now is self.first:
            return "all is as it was written"
        moves = {name: _move(self.first.dataset, self.now.dataset, name) for name in self._free()}
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
    moved = se3.inverse(here) @ there
    return float(np.linalg.norm(moved[:3, 3])), float(se3.rotation_angle(moved[:3, :3]))
