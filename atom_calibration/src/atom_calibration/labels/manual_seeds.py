"""Seeds that a person gives: for one message or for all, and whether they lie in the data."""

from __future__ import annotations

from typing import Optional, Sequence

import numpy as np

from atom_calibration.errors import CollectionError
from atom_calibration.modalities.frames import Frame
from atom_core.io.seeds import Seed

_SAME_STAMP_S = 0.005


class ManualSeeds:
    """Seeds given by hand: for one time, or for all."""

    def __init__(self, seeds: Sequence[Seed]):
        """Take those of a file."""
        self._seeds = list(seeds)

    def of(self, frame: Frame) -> Optional[np.ndarray]:
        """Return the seed for the frame's time, else that for all times."""
        of_this = self.at(frame)
        return of_this if of_this is not None else self.for_all(frame.sensor.name)

    def at(self, frame: Frame) -> Optional[np.ndarray]:
        """Return the seed for the frame's time."""
        for seed in self._seeds:
            if seed.sensor != frame.sensor.name or seed.stamp_s is None:
                continue
            if abs(seed.stamp_s - frame.stamp_s) <= _SAME_STAMP_S:
                check_inside(seed, frame, "correct it in the file of --seeds")
                return seed.position
        return None

    def for_all(self, sensor: str) -> Optional[np.ndarray]:
        """Return the seed for all times."""
        found = [s for s in self._seeds if s.sensor == sensor and s.stamp_s is None]
        return found[0].position if found else None

    def set_for_all(self, sensor: str, position: Optional[np.ndarray]) -> None:
        """Replace, or with None remove, the seed for all times."""
        self._seeds = [s for s in self._seeds if s.sensor != sensor or s.stamp_s is not None]
        if position is not None:
            self._seeds.append(Seed(sensor, position))


def check_inside(seed: Seed, frame: Frame, remedy: str) -> None:
    """Refuse a seed that lies outside the data of its sensor.

    Raises:
        CollectionError: with the remedy given.
    """
    problem = outside_data(seed.position, frame)
    form = frame.sensor.kind.seed
    unit = "" if form is None else form.unit
    if problem:
        raise CollectionError(
            f"{frame.place}: the seed {np.round(seed.position, 3).tolist()} {unit} lies outside "
            f"the data ({problem}); {remedy}"
        )


def outside_data(position: np.ndarray, frame: Frame) -> str:
    """Return why a seed is outside the data of a range sensor; empty when it is inside."""
    assert frame.ros.seeds is not None
    return frame.ros.seeds.problem(frame, position)
