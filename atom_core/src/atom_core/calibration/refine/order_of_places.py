"""Whether boards came in the order of their places, from near to far or from side to side.

What depends on the place then looks like what depends on time: which of the two it is, the data do
not tell.
"""

from __future__ import annotations

from typing import Dict, List, Sequence

import numpy as np

from atom_core.model.dataset import Dataset
from atom_core.problem.problem import Problem

_IN_ORDER = 0.8  # rank correlation of a place with the order of the collections


def order_of_places(dataset: Dataset, problem: Problem, x: np.ndarray, names: Sequence[str]) -> str:
    """Return a clause: in which order a sensor's boards came; nothing where they came mixed.

    Args:
        dataset: the order of its collections is that in which they were made.
        problem: whose detections.
        x: its vector.
        names: of sensors, of which the first counts that has boards in order; others have none.
    """
    return next(filter(None, (_order(dataset, problem, x, name) for name in names)), "")


def _order(dataset: Dataset, problem: Problem, x: np.ndarray, sensor: str) -> str:
    poses, number = problem.poses(x), {key: i for i, key in enumerate(dataset.collections)}
    places: Dict[int, List[np.ndarray]] = {}
    for key, pose in zip(problem.detections, poses):
        if key.sensor == sensor:
            centre = dataset.patterns[key.pattern].border.centre_in_pattern
            place = pose[:3, :3] @ centre + pose[:3, 3]
            places.setdefault(number[key.collection], []).append(place)
    if len(places) < 2:
        return ""
    middles = np.array([np.mean(places[i], axis=0) for i in sorted(places)])
    away = np.linalg.norm(middles, axis=1)
    if _in_order(away):
        return (
            "; since its boards came nearer or farther one after the other, it may be an error of "
            "distances instead, which boards in mixed order would tell"
        )
    directions = middles / away[:, None]
    directions -= directions.mean(axis=0)
    axes = np.linalg.svd(directions, full_matrices=False)[2][:2]  # across the line of sight
    if any(_in_order(directions @ axis) for axis in axes):
        return (
            "; since its boards came from one side to the other, it may be an error of directions "
            "instead, as of a lens, which boards in mixed order would tell"
        )
    return ""


def _in_order(values: np.ndarray) -> bool:
    ranks = np.argsort(np.argsort(values))
    return bool(abs(np.corrcoef(ranks, np.arange(len(values)))[0, 1]) >= _IN_ORDER)
