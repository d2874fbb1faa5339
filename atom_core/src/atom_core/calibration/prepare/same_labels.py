"""The same labels twice: one sensor under two names, or one collection under two keys.

No residual ever tells either.
"""

from __future__ import annotations

from collections import Counter
from itertools import combinations
from typing import Dict, List, Mapping, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.errors import CalibrationError
from atom_core.model.dataset import Dataset
from atom_core.problem.corner_measurement import CornerMeasurement
from atom_core.problem.measurements import Measurement
from atom_core.problem.range_measurement import RangeMeasurement

_SURELY = 2  # detections that no two sensors share by chance
LEAST_NUMBERS = 8  # of a detection


class _Numbers(NamedTuple):
    """What a sensor measured of a board."""

    sensor: str
    numbers: np.ndarray


def check_same_labels(measurements: Sequence[Measurement]) -> None:
    """Refuse two sensors with the same labels: one of them was collected under two names.

    Raises:
        CalibrationError: naming both.
    """
    seen: Dict[Tuple[str, str], List[_Numbers]] = {}
    for m in measurements:  # the numbers of each are asked once: pairs are many
        numbers = _Numbers(m.key.sensor, label_numbers(m))
        seen.setdefault((m.key.collection, m.key.pattern), []).append(numbers)
    pairs = [pair for together in seen.values() for pair in combinations(together, 2)]
    both = Counter((one.sensor, other.sensor) for one, other in pairs)
    same = Counter((one.sensor, other.sensor) for one, other in pairs if _are_same(one, other))
    for (a, b), count in same.items():
        if count >= min(_SURELY, both[a, b]):
            raise CalibrationError(
                f"the labels of sensors '{a}' and '{b}' are the same to the last digit in {count} "
                f"of the {both[a, b]} detections that both have: they are of one sensor under two "
                f"names; correct the topic_name of one of them in the configuration, or what "
                f"remaps it, and collect again"
            )


def copies(dataset: Dataset, measurements: Sequence[Measurement]) -> Dict[str, str]:
    """Return collections that are copies of earlier ones, and of which.

    All their labels and transforms are the same to the last digit, as where datasets that overlap
    were merged; counted twice, they would make the sigmas too small.
    """
    seen: Dict[str, Dict[Tuple[str, str], np.ndarray]] = {}
    for m in measurements:
        seen.setdefault(m.key.collection, {})[m.key.sensor, m.key.pattern] = label_numbers(m)
    first: Dict[Tuple[int, float], List[str]] = {}
    found: Dict[str, str] = {}
    for key, labels in seen.items():
        size = sum(numbers.size for numbers in labels.values())
        total = float(sum(np.sum(numbers, dtype=float) for numbers in labels.values()))
        alike = first.setdefault((size, total), [])
        for other in alike:
            if size >= LEAST_NUMBERS and _same_collection(dataset, key, other, seen):
                found[key] = other
                break
        else:
            alike.append(key)
    return found


def _same_collection(
    dataset: Dataset,
    one: str,
    other: str,
    labels: Mapping[str, Mapping[Tuple[str, str], np.ndarray]],
) -> bool:
    mine, others = labels[one], labels[other]
    before, after = (dataset.collections[key].transforms for key in (one, other))
    return (
        mine.keys() == others.keys()
        and all(np.array_equal(numbers, others[place]) for place, numbers in mine.items())
        and before.keys() == after.keys()
        and all(np.array_equal(matrix, after[edge]) for edge, matrix in before.items())
    )


def _are_same(one: _Numbers, other: _Numbers) -> bool:
    return one.numbers.size >= LEAST_NUMBERS and np.array_equal(one.numbers, other.numbers)


def label_numbers(m: Measurement) -> np.ndarray:
    """Return what was measured: pixels, or points."""
    if isinstance(m, CornerMeasurement):
        return np.column_stack([m.ids, m.pixels])
    return m.inside if isinstance(m, RangeMeasurement) else np.zeros(0)
