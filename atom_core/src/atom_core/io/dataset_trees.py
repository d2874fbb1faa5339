"""Transforms of a collection make a tree: no frame stands in two places."""

from __future__ import annotations

from typing import Collection as Sized
from typing import Iterable

import numpy as np

from atom_core.errors import DatasetError
from atom_core.model.dataset import Collection
from atom_core.model.transforms import Edge, loops

_APART_M, _APART_RAD = 1e-4, 2e-4  # by which ways of placing a frame may differ


def check_trees(collections: Iterable[Collection], estimated: Sized[Edge], where: str) -> None:
    """Refuse transforms that put a frame in two places, now or once it is calibrated.

    Args:
        collections: with their transforms; a loop of fixed ones that agree is no harm.
        estimated: edges that a calibration changes.
        where: the file, for messages.

    Raises:
        DatasetError: naming the collection and the transforms.
    """
    for collection in collections:
        for loop in loops(collection.transforms):
            others = [step.edge for step in loop.others]
            ways = (
                f"{where}: collection {collection.key}: frames '{loop.edge.parent}' and "
                f"'{loop.edge.child}' are connected twice, by transform '{loop.edge}' and by "
                f"{' and '.join(repr(str(edge)) for edge in others)}"
            )
            if loop.off_m > _APART_M or loop.off_rad > _APART_RAD:
                off_mm, off_deg = 1e3 * loop.off_m, np.degrees(loop.off_rad)
                raise DatasetError(
                    f"{ways}, which lie {off_mm:.1f} mm and {off_deg:.2f} deg apart; remove the "
                    f"wrong one"
                )
            if any(edge in estimated for edge in (loop.edge, *others)):
                raise DatasetError(
                    f"{ways}, one of which is to be calibrated and would contradict the others "
                    f"then; remove a transform of this loop"
                )
