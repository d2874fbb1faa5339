"""What the motions of a recording leave open, told before anything is solved."""

from __future__ import annotations

from typing import Dict, List, Sequence, Set

import numpy as np

from atom_core.calibration.prepare.floating import floats_freely, is_held
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, pose
from atom_core.problem.builder import FreeEdges
from atom_core.problem.measurements import Measurement

_TURNED_RAD = np.radians(1.0)  # less, in the mean of all collections, is no turning


def open_motion(dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges) -> str:
    """Return why all sensors and boards can shift together unseen; empty where they cannot.

    A shift v of everything, constant in the frame nearest to world that carries a sensor or a
    fixed board, changes no detection where each other such frame has it constant in its own axes,
    too: ``R_i R_0^T v = v`` for its rotations in the first. That is so of any v where nothing
    turns, and of the axis where all turns are about one. Boards that stand elsewhere in each
    collection follow any shift.

    Args:
        dataset: with the transforms of each collection.
        measurements: the detections that count.
        free: what is estimated.
    """
    if is_held(dataset, free) or floats_freely(dataset, measurements, free):
        return ""
    graph = dataset.graph
    turns: List[np.ndarray] = []
    turning: List[str] = []
    carriers = _carriers(dataset, measurements)
    nearest = min(carriers, key=lambda frame: len(graph.chain(dataset.world, frame)))
    for frame, collections in carriers.items():
        poses = [pose(dataset.collections[c], graph, nearest, frame) for c in collections]
        rotations = np.array(poses)[:, :3, :3]
        relative = rotations @ rotations[0].T
        turns.extend(relative - np.eye(3))
        if np.max(se3.rotation_angle(relative)) > _TURNED_RAD:
            turning.append(f"'{frame}'")
    singular = np.linalg.svd(np.concatenate(turns), compute_uv=False) / np.sqrt(len(turns))
    if singular[-1] > _TURNED_RAD:
        return ""
    if not turning:
        return (
            "what moves never turns: sensors and boards could shift together unseen, in all "
            "directions; collect with turns about two axes, or hold a sensor or the boards"
        )
    return (
        f"{' and '.join(turning)} turn{'s' * (len(turning) == 1)} about one axis only: sensors and "
        f"boards could shift together along it unseen; collect with turns about two axes, hold a "
        f"sensor or the boards, or say what is known beforehand (--prior)"
    )


def _carriers(dataset: Dataset, measurements: Sequence[Measurement]) -> Dict[str, Set[str]]:
    """Return the frames that carry sensors and fixed boards, with the collections that count."""
    found: Dict[str, Set[str]] = {}
    for m in measurements:
        pattern = dataset.patterns[m.key.pattern]
        frames = [dataset.sensors[m.key.sensor].edge.parent]
        frames += [pattern.parent_frame] if pattern.fixed else []
        for frame in frames:
            found.setdefault(frame, set()).add(m.key.collection)
    return found
