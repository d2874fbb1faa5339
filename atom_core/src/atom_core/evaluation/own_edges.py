"""Where what lies between two frames is the test set's own, whatever the calibration says.

An additional tf with a value in each collection, such as odometry, is estimated for the collections
that were calibrated, and unknown in others. What is measured across it are its errors.
"""

from __future__ import annotations

from typing import Collection, FrozenSet, Optional

from atom_core.evaluation.mixed import not_measured
from atom_core.model.dataset import Dataset
from atom_core.model.transforms import Edge


def own_edges(train: Dataset, test: Dataset) -> FrozenSet[Edge]:
    """Return the additional tfs that were estimated, and are the test set's own nevertheless."""
    return frozenset(not_measured(train, test)).difference(test.sensor_edges)


def own_edge_between(
    dataset: Dataset, own: Collection[Edge], target: str, source: str
) -> Optional[Edge]:
    """Return the first of some edges that lies between two frames; None where none does.

    Args:
        dataset: for its tree of transforms.
        own: edges that are the test set's own (`own_edges`).
        target: a frame.
        source: another one.
    """
    if not own:
        return None
    return next((e for e in dataset.graph.edges_between(target, source) if e in own), None)


def why_own(edge: Edge) -> str:
    """Return why nothing is measured across such an edge."""
    return (
        f"'{edge}' lies in between, which is estimated anew in each collection: in those of the "
        f"test set it is what the robot said, and no part of the calibration"
    )
