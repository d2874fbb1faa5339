"""Errors of items summed up: over one collection, over a pair, over the pairs of a kind."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional, Sequence

import numpy as np


@dataclass(frozen=True)
class Errors:
    """Errors of the items of one detection pair, in the unit of the metric.

    Attributes:
        distances: (n,) absolute errors.
        offsets: (n, 2) their parts along x and y of an image, or of the target's frame; or None.
        translation_mm, rotation_deg: between the two cameras' poses of the board, or None.
        unseen: items that the target image does not show; they are not among the errors.
    """

    distances: np.ndarray
    offsets: Optional[np.ndarray] = None
    translation_mm: Optional[float] = None
    rotation_deg: Optional[float] = None
    unseen: int = 0

    @classmethod
    def in_image(cls, offsets: np.ndarray, unseen: int = 0) -> Errors:
        """Return the errors of offsets (n, 2) in an image [px]."""
        return cls(np.linalg.norm(offsets, axis=1), offsets, unseen=unseen)


@dataclass(frozen=True)
class Figures:
    """What is reported of a set of errors; those that a metric does not have are None.

    ``mean_abs`` and ``std_abs`` are mean and (population's) standard deviation of absolute values.
    """

    points: int
    rms: float
    mean: float
    median: float
    x_mean_abs: Optional[float] = None
    y_mean_abs: Optional[float] = None
    x_std_abs: Optional[float] = None
    y_std_abs: Optional[float] = None
    translation_mm: Optional[float] = None
    rotation_deg: Optional[float] = None


def figures(parts: Sequence[Errors]) -> Figures:
    """Return the figures of all errors of some detection pairs, pooled."""
    distances = np.concatenate([part.distances for part in parts])
    offsets = [part.offsets for part in parts if part.offsets is not None]
    absolute = np.abs(np.concatenate(offsets)) if offsets else None
    mean = (None, None) if absolute is None else np.mean(absolute, axis=0)
    std = (None, None) if absolute is None else np.std(absolute, axis=0)
    return Figures(
        points=len(distances),
        rms=root_mean_square(distances),
        mean=float(np.mean(distances)),
        median=float(np.median(distances)),
        x_mean_abs=_plain(mean[0]),
        y_mean_abs=_plain(mean[1]),
        x_std_abs=_plain(std[0]),
        y_std_abs=_plain(std[1]),
        translation_mm=mean_of([part.translation_mm for part in parts]),
        rotation_deg=mean_of([part.rotation_deg for part in parts]),
    )


def root_mean_square(values: np.ndarray) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def mean_of(values: Sequence[Optional[float]]) -> Optional[float]:
    """Return the mean of the values that are there; None if there are none."""
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _plain(value: Optional[float]) -> Optional[float]:
    return None if value is None else float(value)
