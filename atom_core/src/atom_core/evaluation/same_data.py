"""Whether a test set is what was calibrated with."""

from __future__ import annotations

from typing import FrozenSet, List, Tuple

from atom_core.model.dataset import Dataset

_Labels = FrozenSet[Tuple[str, str, bytes]]


def shared_collections(train: Dataset, test: Dataset) -> List[str]:
    """Return the keys of the test set's collections whose labels are those of one of the train set.

    Args:
        train: what was calibrated with.
        test: what it is measured on.
    """
    known = {_labels(train, key) for key in train.collections} - {frozenset()}
    return [key for key in test.collections if _labels(test, key) in known]


def _labels(dataset: Dataset, collection: str) -> _Labels:
    labels = dataset.collections[collection].labels
    return frozenset(
        (sensor, pattern, b"".join(part.tobytes() for part in vars(label).values()))
        for (sensor, pattern), label in labels.items()
    )
