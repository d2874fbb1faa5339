"""The labels of a dataset with every correction made to them, to be undone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Dict, List, Mapping, Optional

import numpy as np

from atom_core.editing.history import DatasetHistory
from atom_core.io.data_files import RecentData
from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey, Label

Changes = Mapping[str, Optional[Label]]  # by pattern; None: no label


class LabelHistory(DatasetHistory):
    """A dataset whose labels change; its data of one collection stay in memory."""

    def __init__(self, dataset: Dataset):
        """Begin with the first collection.

        Raises:
            SelectionError: there is none.
        """
        super().__init__(replace(dataset, data=RecentData(dataset.data)))

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

    def undo(self) -> str:
        """Take back the last correction, and show its collection."""
        step = self._step_back()
        if step is None:
            return "there is nothing to take back"
        self.show(step.collection)
        return f"taken back: {step.description}"

    def redo(self) -> str:
        """Make the last correction again that was taken back, and show its collection."""
        step = self._step_forward()
        if step is None:
            return "there is nothing to make again"
        self.show(step.collection)
        return f"made again: {step.description}"

    def save(self, path: Path) -> str:
        """Write the corrected dataset; return a sentence for the user.

        Raises:
            OutputError: the file cannot be written; an older one is whole.
        """
        changed = self.changed()
        self._write(path, changed)
        collections = len({key.collection for key in changed})
        corrected = f"{len(changed)} labels of {collections} collections are corrected"
        return f"saved to {path}: {corrected if changed else 'nothing is changed'}"

    def apply(self, sensor: str, changes: Changes, description: str) -> str:
        """Replace labels of a sensor in the collection that is shown; a step if it changes them.

        Args:
            sensor: its name.
            changes: the labels by pattern.
            description: what is done, for the user.
        """
        now = self.labels(sensor)
        real = {
            (sensor, pattern): label if label is not None and label.detected else None
            for pattern, label in changes.items()
        }
        if all(_same(now.get(pattern), label) for (_, pattern), label in real.items()):
            return f"nothing changes: {description}"
        return self._push(self.dataset.with_labels(self.collection, real), description)


def _same(one: Optional[Label], other: Optional[Label]) -> bool:
    """Tell whether two labels are the same to the last digit, in the same order."""
    if one is None or other is None:
        return one is other
    mine, theirs = vars(one), vars(other)
    return mine.keys() == theirs.keys() and all(
        np.array_equal(mine[name], theirs[name]) for name in mine
    )
