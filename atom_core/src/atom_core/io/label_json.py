"""Labels as they stand in a dataset's JSON; see docs/dataset_format.md."""

from __future__ import annotations

import json
import math
from typing import Any, Dict, Mapping

import numpy as np

from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey, Label, RangeLabel, RgbLabel
from atom_core.model.modality import LabelFormat
from atom_core.model.pattern import Pattern

_LIKE_NUMBERS = {bool, str}  # none, though numpy takes them for numbers: true, "1.5"
_MOST = 2**53  # and all above are not told apart


def with_label(stored: Mapping[str, Any], dataset: Dataset, key: DetectionKey) -> Dict[str, Any]:
    """Return a collection's labels as they stand in the JSON, with one of them as it is now.

    What older programs noted beside it (projected points, samples) belonged to the label that was,
    and goes. Version 2's ``labels[sensor]`` becomes ``labels[pattern][sensor]``.

    Args:
        stored: ``labels`` of the collection.
        dataset: with the label.
        key: of the label.
    """
    by_pattern = dict(stored)
    if is_old_layout(by_pattern, dataset.sensors, dataset.patterns):
        by_pattern = {next(iter(dataset.patterns)): by_pattern}
    labels = dataset.sensors[key.sensor].kind.labels
    document = labels.document(dataset.label(key) or labels.empty)
    by_pattern[key.pattern] = {**(by_pattern.get(key.pattern) or {}), key.sensor: document}
    return by_pattern


def says_detected(label: Mapping[str, Any]) -> bool:
    """Tell whether a label says that something was seen; one without ``detected`` has indices."""
    return bool(label.get("detected", label.get("idxs")))


def is_old_layout(
    labels: Mapping[str, Any], sensors: Mapping[str, Any], patterns: Mapping[str, Any]
) -> bool:
    """Tell version 2's ``labels[sensor]`` from version 3's ``labels[pattern][sensor]``."""
    if len(patterns) != 1 or not labels:
        return False
    return all(key in sensors and key not in patterns for key in labels)


def range_label_format(limit_key: str) -> LabelFormat:
    """Return how labels of points and limit points stand in the JSON.

    Args:
        limit_key: under which the limit points are written; ATOM's keys are all read.
    """

    def document(label: Label) -> Dict[str, Any]:
        assert isinstance(label, RangeLabel)
        return {
            "detected": label.detected,
            "idxs": [int(i) for i in label.indices],
            limit_key: [int(i) for i in label.limit_indices],
        }

    return LabelFormat(RangeLabel(*np.zeros((2, 0), dtype=int)), document, _read_range_label)


def _corner_document(label: Label) -> Dict[str, Any]:
    assert isinstance(label, RgbLabel)
    idxs = [
        {"id": int(i), "x": float(x), "y": float(y)} for i, (x, y) in zip(label.ids, label.pixels)
    ]
    return {"detected": bool(idxs), "idxs": idxs}


def _read_corner_label(value: Mapping[str, Any], pattern: Pattern) -> RgbLabel:
    corners = value["idxs"] or []
    ids = _indices([corner["id"] for corner in corners])
    xys = [[_number(corner["x"]), _number(corner["y"])] for corner in corners]
    pixels = np.array(xys, dtype=float).reshape(-1, 2)
    bad = ~np.all(np.isfinite(pixels), axis=1)
    if np.any(bad):
        raise ValueError(
            f"the pixel of corner {ids[bad][0]} is not a number; correct the label, or leave the "
            f"collection out with -csf"
        )
    pattern.corners_of(ids)
    unique, counts = np.unique(ids, return_counts=True)
    if np.any(counts > 1):
        raise ValueError(f"corner {unique[counts > 1][0]} is labeled more than once")
    return RgbLabel(ids, pixels)


def _read_range_label(value: Mapping[str, Any], _: Pattern) -> RangeLabel:
    limit = value.get("idxs_limit_points", value.get("edge_idxs"))
    return RangeLabel(_indices(value["idxs"] or []), _indices(limit or []))


def _number(value: Any) -> Any:
    return math.nan if type(value) in _LIKE_NUMBERS else value


def _indices(values: Any) -> np.ndarray:
    if _LIKE_NUMBERS & set(map(type, values)):
        other = next(value for value in values if type(value) in _LIKE_NUMBERS)
        raise ValueError(f"{json.dumps(other)[:40]} is no index of a corner or a point")
    array = np.array(values, dtype=float).reshape(-1)
    wrong = ~((np.abs(array) < _MOST) & (array == np.floor(array)))
    if np.any(wrong):
        raise ValueError(f"{array[wrong][0]:g} is no index of a corner or a point")
    return array.astype(int)


CORNER_LABELS = LabelFormat(
    RgbLabel(np.zeros(0, dtype=int), np.zeros((0, 2))), _corner_document, _read_corner_label
)
