"""Labels as they stand in a dataset's JSON; see docs/dataset_format.md."""

from __future__ import annotations

from typing import Any, Dict, List, Mapping, Optional

from atom_core.model.dataset import Dataset, DetectionKey, Label, RgbLabel
from atom_core.model.sensor import RGB


def label_document(modality: str, label: Optional[Label]) -> Dict[str, Any]:
    """Return a label, or of None the empty label of what was not detected."""
    if modality == RGB:
        idxs: List[Any] = []
        if isinstance(label, RgbLabel):
            idxs = [
                {"id": int(i), "x": float(x), "y": float(y)}
                for i, (x, y) in zip(label.ids, label.pixels)
            ]
        return {"detected": bool(idxs), "idxs": idxs}
    if label is None or isinstance(label, RgbLabel):
        return {"detected": False, "idxs": [], "idxs_limit_points": []}
    return {
        "detected": label.detected,
        "idxs": [int(i) for i in label.indices],
        "idxs_limit_points": [int(i) for i in label.limit_indices],
    }


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
    document = label_document(dataset.sensors[key.sensor].modality, dataset.label(key))
    by_pattern[key.pattern] = {**(by_pattern.get(key.pattern) or {}), key.sensor: document}
    return by_pattern


def is_old_layout(
    labels: Mapping[str, Any], sensors: Mapping[str, Any], patterns: Mapping[str, Any]
) -> bool:
    """Tell version 2's ``labels[sensor]`` from version 3's ``labels[pattern][sensor]``."""
    if len(patterns) != 1 or not labels:
        return False
    return all(key in sensors and key not in patterns for key in labels)
