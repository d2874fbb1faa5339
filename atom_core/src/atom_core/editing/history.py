"""A dataset that a person edits, one collection at a time: undo, redo, what is saved."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import List, NamedTuple, Optional

from atom_core.errors import SelectionError
from atom_core.io.dataset_json import write_dataset
from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey

_MOST_STEPS = 500  # that can be undone


class Step(NamedTuple):
    """A correction: in which collection, what was done, and the datasets before and after."""

    collection: str
    description: str
    before: Dataset
    after: Dataset


class DatasetHistory:
    """A dataset with every change made to it, and the collection that is shown.

    Datasets are immutable: a step is the dataset before and the one after.

    Attributes:
        dataset: as it is now.
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
        self.dataset = dataset
        self.keys = list(dataset.collections)
        self.collection = self.keys[0]
        self._initial = self._saved = dataset
        self._done: List[Step] = []
        self._undone: List[Step] = []

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

    @property
    def place(self) -> str:
        """The collection that is shown, for the user: "collection 003 (4 of 9)"."""
        number = self.keys.index(self.collection) + 1
        return f"collection {self.collection} ({number} of {len(self.keys)})"

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
        """Put the collection that is shown back to what the dataset had."""
        collections = dict(self.dataset.collections)
        collections[self.collection] = self._initial.collections[self.collection]
        if collections[self.collection] is self.dataset.collections[self.collection]:
            return f"collection {self.collection} is as the dataset has it"
        description = f"collection {self.collection} reset"
        return self._push(replace(self.dataset, collections=collections), description)

    def _step_back(self) -> Optional[Step]:
        """Take back the last step; return it, None if there is none."""
        if not self._done:
            return None
        step = self._done.pop()
        self._undone.append(step)
        self.dataset = step.before
        return step

    def _step_forward(self) -> Optional[Step]:
        """Make the last step again that was taken back; return it, None if there is none."""
        if not self._undone:
            return None
        step = self._undone.pop()
        self._done.append(step)
        self.dataset = step.after
        return step

    def _push(self, after: Dataset, description: str) -> str:
        """Make a step of what the dataset is now; return its description."""
        step = Step(self.collection, description, self.dataset, after)
        self._done = [*self._done, step][-_MOST_STEPS:]
        self._undone = []
        self.dataset = after
        return description

    def _extend_last_step(self, after: Dataset) -> None:
        """Let the last step end with another dataset, as while something is dragged."""
        self._done[-1] = self._done[-1]._replace(after=after)
        self.dataset = after

    def join_last_steps(self) -> bool:
        """Make one step of the last two, if they are of one collection; tell whether they were."""
        if len(self._done) < 2 or self._done[-1].collection != self._done[-2].collection:
            return False
        first, last = self._done[-2:]
        joined = Step(
            first.collection, f"{first.description}; {last.description}", first.before, last.after
        )
        self._done = [*self._done[:-2], joined]
        return True

    def _write(self, path: Path, relabeled: List[DetectionKey]) -> None:
        """Write the dataset as it is now; from then on nothing is unsaved."""
        write_dataset(self.dataset, path, relabeled)
        self._saved = self.dataset
