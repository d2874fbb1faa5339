"""Divisions of a dataset's collections into those to calibrate with and those to measure on."""

from __future__ import annotations

from typing import Any, Dict, Hashable, List, Mapping, NamedTuple, Optional, Sequence

import numpy as np

from atom_core.errors import ConfigError, DatasetError
from atom_core.io.dataset_tools import split_keys
from atom_core.model.dataset import Dataset

STRATIFIED_K_FOLD, K_FOLD = "stratified-k-fold", "k-fold"
LEAVE_ONE_OUT, SHUFFLE_SPLIT = "leave-one-out", "stratified-shuffle-split"
KINDS = (STRATIFIED_K_FOLD, K_FOLD, LEAVE_ONE_OUT, SHUFFLE_SPLIT)
_OFTEN = 1000  # more splits than anyone asks for; keeps the seeds of splits apart


class Fold(NamedTuple):
    """One division; keys of collections.

    Attributes:
        train: to calibrate with.
        test: to measure on.
    """

    train: List[str]
    test: List[str]


def folds(
    dataset: Dataset, wanted: Optional[Mapping[str, Any]], seed: int, where: str = ""
) -> List[Fold]:
    """Return the divisions that a cross-validation asks for.

    Args:
        dataset: whose collections are divided.
        wanted: ``type``, ``n_splits`` and ``train_size`` as in ATOM's data.yml; None: one fold,
            with all collections in both parts.
        seed: of chance.
        where: the file that asks, for messages.

    Raises:
        ConfigError: the kind is none, or its numbers do not fit the dataset.
        DatasetError: the train part of a fold leaves a sensor without a detection.
    """
    keys = list(dataset.collections)
    kind = (wanted or {}).get("type")
    if kind is None or wanted is None:
        return [Fold(keys, keys)]
    if kind not in KINDS:
        raise ConfigError(
            f"{where}: cross_validation has the type '{kind}'; use one of {', '.join(KINDS)}, or "
            f"leave it out"
        )
    if kind == SHUFFLE_SPLIT:
        count, percent = _splits(wanted, _OFTEN, where), _percent(wanted, len(keys), where)
        seeds = [_OFTEN * seed + i for i in range(count)]
        return [Fold(*split_keys(dataset, percent, each)) for each in seeds]
    count = len(keys) if kind == LEAVE_ONE_OUT else _splits(wanted, len(keys), where)
    dealt = _order(dataset, kind, np.random.default_rng(seed))
    found = []
    for i in range(count):
        test = set(dealt[i::count])
        found.append(Fold([k for k in keys if k not in test], [k for k in keys if k in test]))
    _refuse_blind(dataset, found)
    return found


def _order(dataset: Dataset, kind: str, rng: np.random.Generator) -> List[str]:
    """Return the keys in the order in which they are dealt to the folds."""
    keys = list(dataset.collections)
    if kind == LEAVE_ONE_OUT:
        return keys
    shuffled = [keys[i] for i in rng.permutation(len(keys))]
    if kind == K_FOLD:
        return shuffled
    alike: Dict[Hashable, List[str]] = {}  # collections in which the same sensors see the same
    for key in shuffled:
        labels = dataset.collections[key].labels
        seen = frozenset(name for name, label in labels.items() if label.detected)
        alike.setdefault(seen, []).append(key)
    return [key for group in alike.values() for key in group]


def _splits(wanted: Mapping[str, Any], most: int, where: str) -> int:
    count = wanted.get("n_splits")
    if isinstance(count, bool) or not isinstance(count, int) or not 2 <= count <= most:
        raise ConfigError(
            f"{where}: cross_validation needs n_splits, a whole number from 2 to {most}; it has "
            f"{count!r}"
        )
    return count


def _percent(wanted: Mapping[str, Any], number: int, where: str) -> float:
    """Return how many per cent of the collections are to train with; of a share or a number."""
    size = wanted.get("train_size")
    known = isinstance(size, (int, float)) and not isinstance(size, bool)
    value = float(size) if known and size is not None else 0.0
    if not 0 < value < number:
        raise ConfigError(
            f"{where}: cross_validation needs train_size, a share below 1 or a number of "
            f"collections below {number}; it has {size!r}"
        )
    return 100.0 * value if value < 1 else 100.0 * value / number


def _refuse_blind(dataset: Dataset, found: Sequence[Fold]) -> None:
    seen = {key.sensor for key, _ in dataset.detections()}
    for number, fold in enumerate(found, start=1):
        there = {key.sensor for key, _ in dataset.selected(collections=fold.train).detections()}
        for sensor in sorted(seen - there):
            raise DatasetError(
                f"{dataset.source}: the train part of fold {number} leaves sensor '{sensor}' "
                f"without a detection; use fewer splits, another seed, or collect more"
            )
