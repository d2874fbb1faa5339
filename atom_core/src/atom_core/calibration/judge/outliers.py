"""Outliers: single corners and points that lie far from the solution, named one by one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.problem.problem import Problem
from atom_core.problem.residuals import UNITS

OUTLIER_SIGMAS = 4.0
MOST_LISTED = 1000


class Outlier(NamedTuple):
    """One item whose residual exceeds the limit.

    Attributes:
        collection, sensor, pattern: of its detection.
        kind: reprojection, orthogonal or border.
        id: corner id, or index of the point in its cloud or of the pixel in its image.
        residual: its norm.
        unit: of the residual, px or m.
        sigmas: the residual in standard deviations.
    """

    collection: str
    sensor: str
    pattern: str
    kind: str
    id: int
    residual: float
    unit: str
    sigmas: float


@dataclass(frozen=True)
class Outliers:
    """All items beyond ``OUTLIER_SIGMAS``.

    Attributes:
        counts: how many, by sensor.
        largest: the ``MOST_LISTED`` largest, in units of their sigma, the largest first.
    """

    counts: Dict[str, int]
    largest: Tuple[Outlier, ...]

    @property
    def count(self) -> int:
        """How many of all sensors."""
        return sum(self.counts.values())


def find_outliers(problem: Problem, x: np.ndarray, sigmas: Sequence[np.ndarray]) -> Outliers:
    """Return the outliers at the vector x.

    Args:
        problem: whose items.
        x: the vector.
        sigmas: for each residual block, (n,) in its unit.
    """
    counts: Dict[str, int] = {}
    owners, items, residuals, sizes = [], [], [], []
    for b, residual in enumerate(problem.residuals(x)):
        norms = np.linalg.norm(residual, axis=1)
        beyond = np.flatnonzero(norms > OUTLIER_SIGMAS * sigmas[b])
        sensor = problem.residual_blocks[b].sensor
        counts[sensor] = counts.get(sensor, 0) + len(beyond)
        owners.append(np.full(len(beyond), b))
        items.append(beyond)
        residuals.append(norms[beyond])
        sizes.append(norms[beyond] / sigmas[b][beyond])
    owner, item, norm, size = (np.concatenate(v) for v in (owners, items, residuals, sizes))
    order = np.argsort(-size, kind="stable")[:MOST_LISTED]
    largest = []
    for i in order:
        block, own = problem.residual_blocks[owner[i]], item[i]
        key, which = problem.detections[block.detection[own]], int(block.ids[own])
        length, unit, sigmas_off = float(norm[i]), UNITS[block.kind], float(size[i])
        named = key.collection, key.sensor, key.pattern
        largest.append(Outlier(*named, block.kind, which, length, unit, sigmas_off))
    return Outliers(counts, tuple(largest))
