"""One sensor under two names: their labels are the same, and no residual ever tells."""

from __future__ import annotations

from collections import Counter
from itertools import combinations
from typing import Dict, List, Sequence, Tuple

import numpy as np

from atom_core.errors import CalibrationError
from atom_core.problem.corner_measurement import CornerMeasurement
from atom_core.problem.measurements import Measurement
from atom_core.problem.range_measurement import RangeMeasurement

_SURELY = 2  # detections that no two sensors share by chance
_LEAST_NUMBERS = 8  # of a detection


def check_same_labels(measurements: Sequence[Measurement]) -> None:
    """Refuse two sensors with the same labels: one of them was collected under two names.

    Raises:
        CalibrationError: naming both.
    """
    seen: Dict[Tuple[str, str], List[Measurement]] = {}
    for m in measurements:
        seen.setdefault((m.key.collection, m.key.pattern), []).append(m)
    pairs = [pair for together in seen.values() for pair in combinations(together, 2)]
    both = Counter(_names(*pair) for pair in pairs)
    same = Counter(_names(*pair) for pair in pairs if _are_same(*pair))
    for (a, b), count in same.items():
        if count >= min(_SURELY, both[a, b]):
            raise CalibrationError(
                f"the labels of sensors '{a}' and '{b}' are the same to the last digit in {count} "
                f"of the {both[a, b]} detections that both have: they are of one sensor under two "
                f"names; correct the topic_name of one of them in the configuration, or what "
                f"remaps it, and collect again"
            )


def _names(one: Measurement, other: Measurement) -> Tuple[str, str]:
    return one.key.sensor, other.key.sensor


def _are_same(one: Measurement, other: Measurement) -> bool:
    mine, others = _numbers(one), _numbers(other)
    return mine.size >= _LEAST_NUMBERS and np.array_equal(mine, others)


def _numbers(m: Measurement) -> np.ndarray:
    """Return what was measured: pixels, or points."""
    if isinstance(m, CornerMeasurement):
        return np.column_stack([m.ids, m.pixels])
    return m.inside if isinstance(m, RangeMeasurement) else np.zeros(0)
