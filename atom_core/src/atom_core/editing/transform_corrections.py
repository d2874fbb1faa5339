"""Transforms of a dataset that a person corrects: bad odometry, a board's pose, a mount."""

from __future__ import annotations

from pathlib import Path
from typing import Dict, List, Optional, Sequence

import numpy as np

from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.preparation import free_edges
from atom_core.calibration.start.boards import initial_boards
from atom_core.editing.first_guess import UNSAVED
from atom_core.editing.history import DatasetHistory
from atom_core.errors import DatasetError, SelectionError
from atom_core.model.dataset import Dataset, board_edge
from atom_core.model.robot import FIXED
from atom_core.model.transforms import Edge
from atom_core.problem.measurements import read_measurements

_SAME = 1e-9  # m and entries of rotations


class TransformCorrections(DatasetHistory):
    """Edges of a dataset, edited one collection at a time.

    A fixed edge is the same in all collections, and so is its correction. Another one, and the
    pose of a board that is not fixed, is corrected in the collection that is shown.

    Attributes:
        edges: those that may be edited.
    """

    def __init__(
        self,
        dataset: Dataset,
        edges: Sequence[Edge],
        patterns: Sequence[str] = (),
        collection: Optional[str] = None,
    ):
        """Choose what may be edited.

        Args:
            dataset: where from.
            edges: of its transforms.
            patterns: boards whose pose may be edited; where the dataset does not have it, it comes
                from the sensors as they stand.
            collection: to begin with; the first when None.

        Raises:
            SelectionError: an edge, a pattern or a collection is not there.
            AtomError: boards are to be placed and cannot be.
        """
        super().__init__(_with_boards(dataset, patterns))
        if collection is not None:
            self.show(collection)
        boards = [board_edge(dataset.patterns[name]) for name in patterns]
        self.edges = list(dict.fromkeys([*edges, *boards]))
        for edge in edges:
            _check_present(dataset, edge)
        if not self.edges:
            raise SelectionError(
                "nothing to correct; name edges with --parent_link_list and --child_link_list, or "
                "boards with --patterns"
            )
        self._fixed = {edge for edge in self.edges if _is_fixed(self.dataset, edge)}
        self._dragged: Optional[Edge] = None

    def value(self, edge: Edge) -> Optional[np.ndarray]:
        """Return ``parent_T_child`` (4, 4) [m] in the collection that is shown; None if absent."""
        return self.dataset.collections[self.collection].transforms.get(edge)

    def concerned(self, edge: Edge) -> List[str]:
        """Return the collections that a correction of an edge changes."""
        keys = self.keys if edge in self._fixed else [self.collection]
        return [key for key in keys if edge in self.dataset.collections[key].transforms]

    def set(self, edge: Edge, parent_T_child: np.ndarray, dropped: bool = True) -> None:
        """Correct an edge (4, 4) [m].

        Args:
            edge: which.
            parent_T_child: its new value.
            dropped: the last of a drag; what comes before it is one step to undo.
        """
        matrix = np.array(parent_T_child, dtype=float)
        after = self.dataset.with_transforms({key: {edge: matrix} for key in self.concerned(edge)})
        if self._dragged == edge:
            self._extend_last_step(after)
        else:
            self._push(after, str(edge))
        self._dragged = None if dropped else edge

    def undo(self) -> bool:
        """Take back the last step, in whatever collection; return whether there was one."""
        self._dragged = None
        return self._step_back() is not None

    def reset_edge(self, edge: Edge) -> None:
        """Put an edge back to what the dataset had, where a correction would change it."""
        initial = self._initial.collections[self.collection].transforms
        if edge in initial:
            self.set(edge, initial[edge])

    def turn(self, steps: int) -> str:
        """Go to another collection, so many further; return its key."""
        self._dragged = None
        return super().turn(steps)

    def changed(self) -> Dict[Edge, List[str]]:
        """Return the collections in which an edge differs from the dataset's, by edge."""
        found: Dict[Edge, List[str]] = {}
        for key, collection in self.dataset.collections.items():
            before = self._initial.collections[key].transforms
            for edge in self.edges:
                now, then = collection.transforms.get(edge), before.get(edge)
                if now is not None and then is not None and not np.allclose(now, then, 0, _SAME):
                    found.setdefault(edge, []).append(key)
        return found

    def save(self, path: Path) -> str:
        """Write the corrected dataset; return a sentence for the user.

        Raises:
            OutputError: the file cannot be written.
        """
        self._write(path, [])
        changed = self.changed()
        listed = "; ".join(f"{edge} in {len(keys)} collections" for edge, keys in changed.items())
        return f"saved to {path}: {listed or 'nothing is changed'}"

    def keep_unsaved(self, path: Path) -> str:
        """Write what was corrected and not saved beside the file; return a sentence for the user.

        Args:
            path: what would have been saved; it stays as it is.

        Returns:
            Empty where nothing was left to save.

        Raises:
            OutputError: the file cannot be written.
        """
        if not self.unsaved:
            return ""
        beside = path.with_name(UNSAVED + path.name)
        self.save(beside)
        return (
            f"corrections were not saved; they are in {beside}: rename it to {path.name}, or go on "
            f"with --dataset {beside}"
        )


def chosen_edges(parents: Sequence[str], children: Sequence[str]) -> List[Edge]:
    """Return the edges of two parallel lists of frames.

    Raises:
        SelectionError: the lists differ in length.
    """
    if len(parents) != len(children):
        raise SelectionError(
            f"{len(parents)} parents and {len(children)} children; give one child for each parent"
        )
    return [Edge(parent, child) for parent, child in zip(parents, children)]


def _with_boards(dataset: Dataset, patterns: Sequence[str]) -> Dataset:
    """Return the dataset with a pose of each board, those it lacks from the sensors."""
    for name in patterns:
        if name not in dataset.patterns:
            known = ", ".join(dataset.patterns)
            raise SelectionError(f"there is no pattern '{name}'; use one of {known}")
    lacking = {
        (name, key): board_edge(dataset.patterns[name])
        for name in patterns
        for key, collection in dataset.collections.items()
        if board_edge(dataset.patterns[name]) not in collection.transforms
    }
    if not lacking:
        return dataset
    measurements, _ = read_measurements(dataset)
    poses = initial_boards(dataset, measurements, free_edges(dataset, CalibrationOptions()))
    changes: Dict[str, Dict[Edge, np.ndarray]] = {}
    for (name, key), edge in lacking.items():
        matrix = poses.get(dataset.patterns[name].board_key(key))
        if matrix is not None:
            changes.setdefault(key, {})[edge] = matrix
    if not changes:
        raise DatasetError(f"{dataset.source}: no board can be placed; is any of them detected?")
    return dataset.with_transforms(changes)


def _check_present(dataset: Dataset, edge: Edge) -> None:
    if not any(edge in collection.transforms for collection in dataset.collections.values()):
        known = {str(e) for c in dataset.collections.values() for e in c.transforms}
        below = sorted(text for text in known if edge.parent in text or edge.child in text)
        raise SelectionError(
            f"{dataset.source}: there is no edge '{edge}' in its transforms; similar ones: "
            f"{', '.join(below[:8]) or 'none'}"
        )


def _is_fixed(dataset: Dataset, edge: Edge) -> bool:
    """Tell whether an edge is the same in all collections, by its type and its values."""
    if dataset.edge_types.get(edge, FIXED) != FIXED:
        return False
    for pattern in dataset.patterns.values():
        if board_edge(pattern) == edge:
            return pattern.fixed
    values = [c.transforms[edge] for c in dataset.collections.values() if edge in c.transforms]
    return all(np.allclose(value, values[0], rtol=0.0, atol=_SAME) for value in values)
