"""Sensors whose place the user states though the data could tell it: held, or with a prior.

Where such a statement is wrong, something else gives way: an error of the sensor that is estimated,
its intrinsics, or the sensors beside it. One sensor may be held, and one have a prior, for all
others to have something to be related to; that states nothing that data could contradict.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, Tuple

from atom_core.calibration.prepare.connectivity import nothing_moves
from atom_core.model.dataset import Dataset
from atom_core.problem.builder import FreeEdges
from atom_core.problem.problem import Problem


@dataclass(frozen=True)
class StatedPlaces:
    """Names of the sensors whose place is stated.

    Attributes:
        held: where the description has them.
        with_prior: to its standard deviations.
    """

    held: Tuple[str, ...] = ()
    with_prior: Tuple[str, ...] = ()

    @property
    def names(self) -> Tuple[str, ...]:
        """Both."""
        return (*self.held, *self.with_prior)

    @property
    def likely_cause(self) -> str:
        """The rest of a sentence about what does not fit; '' where nothing is stated."""
        told: List[str] = []
        if self.held:
            what = "release it" if len(self.held) == 1 else "hold one of them alone"
            told.append(
                f"; {_are(self.held)} held where the description has {_them(self.held)} "
                f"(anchored_sensor, -as): if that may be wrong, {what}"
            )
        if self.with_prior:
            told.append(
                f"; {_are(self.with_prior)} held near where {_its(self.with_prior)} prior is: if "
                f"that may be wrong, state it as wide as it is known, or leave it out"
            )
        return "".join(told)

    def sentence(self, name: str) -> str:
        """Return how a sensor's place is stated."""
        if name in self.held:
            return "it is held where the description has it"
        return "it is held near where its prior is"

    def remedy(self, name: str) -> str:
        """Return what to do where that may be wrong."""
        if name in self.held:
            return "release it (no anchored_sensor, -as) unless its place is known better than that"
        return "state its prior as wide as it is known, or leave it out"


def stated_places(dataset: Dataset, problem: Problem, free: FreeEdges) -> StatedPlaces:
    """Return the sensors whose place is stated though the data could tell it.

    Args:
        dataset: that was calibrated.
        problem: its detections.
        free: what was held, and what has a prior.
    """
    keys = problem.detections
    seen = {key.sensor for key in keys}
    held = tuple(name for name in free.anchored_sensors if name in seen)
    with_prior = tuple(
        name
        for name in dataset.sensors
        if name in seen and name not in held and dataset.sensors[name].edge in free.priors
    )
    patterns = {key.pattern for key in keys}
    collections = sorted({key.collection for key in keys})
    floats = not free.anchor_patterns and nothing_moves(dataset, seen, patterns, collections)
    if floats and len(held) == 1:
        return StatedPlaces((), with_prior)
    if floats and not held and len(with_prior) == 1:
        return StatedPlaces()
    return StatedPlaces(held, with_prior)


def _are(names: Tuple[str, ...]) -> str:
    return f"{' and '.join(names)} {'is' if len(names) == 1 else 'are'}"


def _them(names: Tuple[str, ...]) -> str:
    return "it" if len(names) == 1 else "them"


def _its(names: Tuple[str, ...]) -> str:
    return "its" if len(names) == 1 else "their"
