"""Statistics of residuals, by sensor, kind and collection."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, List, Optional, Tuple

import numpy as np

from atom_core.problem.problem import Problem
from atom_core.problem.residuals import UNITS


@dataclass(frozen=True)
class ResidualStatistics:
    """Summary of the norms of some residuals.

    Attributes:
        unit: px or m.
        count: number of corners or points.
        mean: mean norm (for corners the mean Euclidean pixel distance, ATOM's figure).
        rms: root of the mean squared norm.
        median, max: of the norms.
    """

    unit: str
    count: int
    mean: float
    rms: float
    median: float
    max: float


def statistics(norms: np.ndarray, unit: str) -> ResidualStatistics:
    """Return the summary of norms (n,), n > 0."""
    return ResidualStatistics(
        unit,
        len(norms),
        float(np.mean(norms)),
        float(np.sqrt(np.mean(norms**2))),
        float(np.median(norms)),
        float(np.max(norms)),
    )


# by (sensor, kind, collection); collection None is all of them
Table = Dict[Tuple[str, str, Optional[str]], ResidualStatistics]


def residual_table(problem: Problem, x: np.ndarray) -> Table:
    """Return the statistics at the vector x, in all and by collection."""
    names, of_detection = np.unique(
        [key.collection for key in problem.detections], return_inverse=True
    )
    table: Table = {}
    for block, residual in zip(problem.residual_blocks, problem.residuals(x)):
        norms = np.linalg.norm(residual, axis=1)
        unit, of_item = UNITS[block.kind], of_detection[block.detection]
        table[(block.sensor, block.kind, None)] = statistics(norms, unit)
        order = np.argsort(of_item, kind="stable")
        present, starts = np.unique(of_item[order], return_index=True)
        for collection, mine in zip(present, np.split(norms[order], starts[1:])):
            where = (block.sensor, block.kind, str(names[collection]))
            table[where] = statistics(mine, unit)
    return table


def kinds_of(table: Table, sensor: str) -> List[str]:
    """Return the kinds of residuals that a sensor has."""
    return list(dict.fromkeys(kind for name, kind, _ in table if name == sensor))
