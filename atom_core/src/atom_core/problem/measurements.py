"""What the sensors measured of the boards, detection by detection, ready for residuals."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from types import MappingProxyType
from typing import Dict, List, Mapping, Optional, Sequence, Tuple

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
        """Return deviations (..., n) at poses (..., 4, 4), as metres [m], of a sample of items."""

    def with_atom_residuals(self) -> Measurement:
        """Return the measurement whose residuals are those of ATOM, where they differ."""
        return self

    @abstractmethod
    def implausibilities(self) -> List[str]:
        """Return what is wrong with it by itself, a phrase each, without its place."""


# What was read of a detection (None: too little to be used), and warnings.
Measured = Tuple[Optional[Measurement], Sequence[str]]


def measured_detections(
    dataset: Dataset, before: Mapping[DetectionKey, Measured] = MappingProxyType({})
) -> Dict[DetectionKey, Measured]:
    """Return what there is to read of every detection; clouds and images are read here.

    Args:
        dataset: whose transforms do not matter.
        before: what was read of detections that are the same still.

    Raises:
        DatasetError: a data file is absent or damaged, or a label does not fit it.
    """
    return {
        key: before.get(key) or dataset.sensors[key.sensor].kind.measure(dataset, key)
        for key, _ in dataset.detections()
    }


def read_measurements(
    dataset: Dataset, before: Mapping[DetectionKey, Measured] = MappingProxyType({})
) -> Tuple[List[Measurement], List[str]]:
    """Return the measurement of every detection that can be used, and all warnings.

    Args:
        dataset: whose transforms do not matter.
        before: what was read of detections that are the same still.

    Raises:
        DatasetError: a data file is absent or damaged, or a label does not fit it.
    """
    read = measured_detections(dataset, before).values()
    measurements = [measurement for measurement, _ in read if measurement is not None]
    return measurements, [remark for _, remarks in read for remark in remarks]


def repeated(counts: Sequence[Tuple[int, int]]) -> np.ndarray:
    """Return indices, each as often as its count says, from pairs (index, count)."""
    return np.repeat([i for i, _ in counts], [n for _, n in counts])
