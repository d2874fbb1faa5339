"""The labels of a dataset with every correction made to them, to be undone; knows no ROS."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Dict, List, Mapping, NamedTuple, Optional

import numpy as np

from atom_core.errors import SelectionError
from atom_core.io.data_files import RecentData
from atom_core.io.dataset_json import write_dataset
from atom_core.model.dataset import Dataset, DetectionKey, Label, RangeLabel, RgbLabel

_MOST_STEPS = 500  # that can be undone

Changes = Mapping[str, Optional[Label]]  # by pattern; None: no label


class _Step(NamedTuple):
    """A correction: of which collection, what was done, and the datasets before and after."""

    collection: str
    words: str
    before: Dataset
    after: Dataset


class LabelHistory:
    """A dataset whose labels change, one collection at a time.

    Datasets are immutable: a step is the dataset before and the one after.

    Attributes:
        dataset: as it is now; its data of one collection stay in memory.
        collection: the key of the one that is shown.
        keys: of all collections.
    """

    def __init__(self, dataset: Dataset):
        """Begin with the first collection.

        Raises:
            SelectionError: there is none.
        """
        if not dataset.collections:
            raise SelectionError(f"{dataset.source}: there are no collections to go through")
        self.dataset = replace(dataset, data=RecentData(dataset.data))
        self._initial = self._saved = self.dataset
        self.keys = list(dataset.collections)
        self.collection = self.keys[0]
        self._done: List[_Step] = []
        self._undone: List[_Step] = []

    @property
    def undo_steps(self) -> int:
        """How many corrections can be undone."""
        return len(self._done)

    @property
    def redo_steps(self) -> int:
        """How many can be made again."""
        return len(self._undone)

    @property
    def unsaved(self) -> bool:
        """Tell whether something differs from what was saved last."""
        return self.dataset is not self._saved

    def labels(self, sensor: str) -> Dict[str, Label]:
        """Return the labels of a sensor in the collection that is shown, by pattern."""
        labels = self.dataset.collections[self.collection].labels
        patterns = self.dataset.patterns
        return {name: labels[(sensor, name)] for name in patterns if (sensor, name) in labels}

    def changed(self) -> List[DetectionKey]:
        """Return the labels that differ from the dataset's."""
        return [
            DetectionKey(key, sensor, pattern)
            for key in self.keys
            if self.dataset.collections[key] is not self._initial.collections[key]
            for sensor in self.dataset.sensors
            for pattern in self.dataset.patterns
            if not _same(
                self.dataset.collections[key].labels.get((sensor, pattern)),
                self._initial.collections[key].labels.get((sensor, pattern)),
            )
        ]

    def turn(self, steps: int) -> str:
        """Go so many collections further; return the key."""
        return self.show(self.keys[(self.keys.index(self.collection) + steps) % len(self.keys)])

    def show(self, key: str) -> str:
        """Go to a collection, by its key or by the number in it (1 for 001); return its key.

        Raises:
            SelectionError: there is none of that key.
        """
        alike = [k for k in self.keys if k.isdigit() and key.isdigit() and int(k) == int(key)]
        if key not in self.keys and len(alike) == 1:
            key = alike[0]
        if key not in self.keys:
            raise SelectionError(
                f"there is no collection '{key}'; use one of {', '.join(self.keys)}"
            )
        self.collection = key
        return key

    def reset(self) -> str:
        """Put the labels of the collection that is shown back to what the dataset had."""
        collections = dict(self.dataset.collections)
        collections[self.collection] = self._initial.collections[self.collection]
        if collections[self.collection] is self.dataset.collections[self.collection]:
            return f"collection {self.collection} is as the dataset has it"
        words = f"collection {self.collection} reset"
        return self._push(replace(self.dataset, collections=collections), words)

    def undo(self) -> str:
        """Take back the last correction, and show its collection."""
        if not self._done:
            return "there is nothing to take back"
        step = self._done.pop()
        self._undone.append(step)
        self.dataset = step.before
        self.show(step.collection)
        return f"taken back: {step.words}"

    def redo(self) -> str:
        """Make the last correction again that was taken back, and show its collection."""
        if not self._undone:
            return "there is nothing to make again"
        step = self._undone.pop()
        self._done.append(step)
        self.dataset = step.after
        self.show(step.collection)
        return f"made again: {step.words}"

    def save(self, path: Path) -> str:
        """Write the corrected dataset; return a sentence for the user.

        Raises:
            OutputError: the file cannot be written; an older one is whole.
        """
        changed = self.changed()
        write_dataset(self.dataset, path, changed)
        self._saved = self.dataset
        collections = len({key.collection for key in changed})
        told = f"{len(changed)} labels of {collections} collections are corrected"
        return f"saved to {path}: {told if changed else 'nothing is changed'}"

    def apply(self, sensor: str, changes: Changes, words: str) -> str:
        """Replace labels of a sensor in the collection that is shown; a step if it changes them.

        Args:
            sensor: its name.
            changes: the labels by pattern.
            words: what is done, for the user.
        """
        now = self.labels(sensor)
        real = {
            (sensor, pattern): label if label is not None and label.detected else None
            for pattern, label in changes.items()
        }
        if all(_same(now.get(pattern), label) for (_, pattern), label in real.items()):
            return f"nothing changes: {words}"
        return self._push(self.dataset.with_labels(self.collection, real), words)

    def _push(self, after: Dataset, words: str) -> str:
        step = _Step(self.collection, words, self.dataset, after)
        self._done = [*self._done, step][-_MOST_STEPS:]
        self._undone = []
        self.dataset = after
        return words


def _same(one: Optional[Label], other: Optional[Label]) -> bool:
    """Tell whether two labels are the same to the last digit, in the same order."""
    if one is None or other is None:
        return one is other
    if isinstance(one, RgbLabel) and isinstance(other, RgbLabel):
        return np.array_equal(one.ids, other.ids) and np.array_equal(one.pixels, other.pixels)
    if isinstance(one, RangeLabel) and isinstance(other, RangeLabel):
        return np.array_equal(one.indices, other.indices) and np.array_equal(
            one.limit_indices, other.limit_indices
        )
    return False
