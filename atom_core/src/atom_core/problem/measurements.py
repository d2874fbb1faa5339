"""What the sensors measured of the boards, detection by detection, ready for residuals."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import List, Sequence, Tuple

import numpy as np

from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey


@dataclass(frozen=True)
class Measurement(ABC):
    """What one sensor measured of one board in one collection.

    Attributes:
        key: whose detection.
    """

    key: DetectionKey

    @property
    @abstractmethod
    def information(self) -> int:
        """How much it says about the board's pose, to choose among detections."""

    @property
    @abstractmethod
    def rows(self) -> int:
        """How many residuals it makes."""

    @property
    @abstractmethod
    def identifies_board(self) -> bool:
        """Tell whether it knows the points of the board one by one, and so its pose alone."""

    @abstractmethod
    def candidates(self) -> List[np.ndarray]:
        """Return the poses ``sensor_T_pattern`` (4, 4) that this detection alone allows."""

    def likely_candidates(self) -> List[np.ndarray]:
        """Return those of the candidates that are worth a try, the likeliest first."""
        return self.candidates()

    @abstractmethod
    def errors_m(self, sensor_T_pattern: np.ndarray) -> np.ndarray:
        """Return (n,) deviations at a pose (4, 4), as metres [m], of a sample of its items."""

    def with_atom_residuals(self) -> Measurement:
        """Return the measurement whose residuals are those of ATOM, where they differ."""
        return self

    @abstractmethod
    def implausibilities(self) -> List[str]:
        """Return what is wrong with it by itself, a phrase each, without its place."""


def read_measurements(dataset: Dataset) -> Tuple[List[Measurement], List[str]]:
    """Return the measurement of every detection, and warnings; clouds and images are read here.

    Raises:
        DatasetError: a data file is absent or damaged, or a label does not fit it.
    """
    measurements: List[Measurement] = []
    warnings: List[str] = []
    for key, _ in dataset.detections():
        measurement, remarks = dataset.sensors[key.sensor].kind.measure(dataset, key)
        warnings += remarks
        if measurement is not None:
            measurements.append(measurement)
    return measurements, warnings


def repeated(counts: Sequence[Tuple[int, int]]) -> np.ndarray:
    """Return indices, each as often as its count says, from pairs (index, count)."""
    return np.repeat([i for i, _ in counts], [n for _, n in counts])
