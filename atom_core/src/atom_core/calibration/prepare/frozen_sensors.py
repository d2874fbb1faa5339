"""Sensors that hung: their data came again and again while the board moved before the others."""

from __future__ import annotations

from typing import Dict, List, Mapping, Sequence, Tuple

import numpy as np

from atom_core.calibration.prepare.same_labels import LEAST_NUMBERS, label_numbers
from atom_core.model.caveats import Caveat
from atom_core.model.dataset import Dataset
from atom_core.model.transforms import chain_transform
from atom_core.problem.corner_measurement import CornerMeasurement
from atom_core.problem.measurements import Measurement
from atom_core.problem.range_measurement import RangeMeasurement

_MOVED_PX, _MOVED_M = 5.0, 0.03  # of the middle of a label
_SAME = 1e-9  # entries of a matrix
_Place = Tuple[str, str]  # collection, pattern


def frozen_sensors(dataset: Dataset, measurements: Sequence[Measurement]) -> List[Caveat]:
    """Return which sensors have one label, to the last digit, though the board was moved.

    It was if another sensor, that stands in both collections where it stood beside this one, has
    its label elsewhere. Noise lets no sensor see the very same twice.
    """
    seen: Dict[str, Dict[_Place, Measurement]] = {}
    for m in measurements:
        seen.setdefault(m.key.sensor, {})[m.key.collection, m.key.pattern] = m
    caveats = []
    for name, labels in seen.items():
        others = {other: theirs for other, theirs in seen.items() if other != name}
        again = _again(dataset, name, labels, others)
        if again:
            listed = ", ".join(again)
            caveats.append(
                Caveat(
                    (name,),
                    f"its labels are the same to the last digit in collections {listed}, though "
                    f"the board was moved: it sent old data again",
                    "leave these collections of it out, or record again",
                )
            )
    return caveats


def _again(
    dataset: Dataset,
    name: str,
    labels: Mapping[_Place, Measurement],
    others: Mapping[str, Mapping[_Place, Measurement]],
) -> List[str]:
    """Return the collections with a label that another collection has, the first among them."""
    by_numbers: Dict[bytes, List[_Place]] = {}
    for place, m in labels.items():
        if label_numbers(m).size >= LEAST_NUMBERS:
            by_numbers.setdefault(label_numbers(m).tobytes(), []).append(place)
    found: List[str] = []
    for places in by_numbers.values():
        first, moved = places[0], []
        for place in places[1:]:
            if any(
                _moved(theirs[first], theirs[place]) and _beside(dataset, name, other, first, place)
                for other, theirs in others.items()
                if first in theirs and place in theirs
            ):
                moved.append(place[0])
        found += [first[0], *moved] if moved else []
    return sorted(set(found))


def _moved(one: Measurement, other: Measurement) -> bool:
    """Tell whether a sensor's label is elsewhere in its data."""
    if isinstance(one, CornerMeasurement) and isinstance(other, CornerMeasurement):
        apart_px = np.mean(one.pixels, axis=0) - np.mean(other.pixels, axis=0)
        return bool(np.linalg.norm(apart_px) > _MOVED_PX)
    if isinstance(one, RangeMeasurement) and isinstance(other, RangeMeasurement):
        apart_m = np.mean(one.inside, axis=0) - np.mean(other.inside, axis=0)
        return bool(np.linalg.norm(apart_m) > _MOVED_M)
    return False


def _beside(dataset: Dataset, name: str, other: str, first: _Place, place: _Place) -> bool:
    """Tell whether two sensors stand to each other alike in two collections."""
    frames = dataset.sensors[name].frame, dataset.sensors[other].frame
    chain = dataset.graph.chain(*frames)
    one, two = (
        chain_transform(chain, dataset.collections[key].transforms) for key, _ in (first, place)
    )
    return bool(np.allclose(one, two, rtol=0.0, atol=_SAME))
