"""Edges that are estimated as one pose and move between the collections: a sensor's on a joint."""

from __future__ import annotations

from typing import Dict, List, Optional, Sequence

import numpy as np

from atom_core.errors import CalibrationError, quoted
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset
from atom_core.model.joints import MOVING_TYPES
from atom_core.model.transforms import Edge
from atom_core.problem.builder import FreeEdges
from atom_core.problem.measurements import Measurement

_SAME_M, _SAME_RAD = 1e-3, float(np.radians(0.1))
_LEAST_STEPS, _MOST_SHARE = 3, 0.5  # a guess is improved now and then; a joint moves every time


def check_mounts(
    dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges
) -> List[str]:
    """Refuse sensors of which the estimated edge moves; say of which the guess was improved.

    One moves where a joint with its edge did, or where the edge is another one in most collections
    than in the one before.

    Raises:
        CalibrationError: naming the sensor, the edge, and how far apart its poses are.
    """
    collections: Dict[Edge, Dict[str, None]] = {}
    names: Dict[Edge, List[str]] = {}
    held = free.held_edges(dataset)
    for m in sorted(measurements, key=lambda m: m.key.collection):
        sensor = dataset.sensors[m.key.sensor]
        if sensor.edge not in held:
            collections.setdefault(sensor.edge, {})[m.key.collection] = None
            names.setdefault(sensor.edge, []).append(sensor.name)
    remarks = []
    for edge, keys in collections.items():
        poses = np.array([dataset.collections[key].transforms[edge] for key in keys])
        apart_m, apart_rad = se3.pose_differences(poses[:1], poses)
        if np.all((apart_m <= _SAME_M) & (apart_rad <= _SAME_RAD)):
            continue
        sensors = quoted(dict.fromkeys(names[edge]))
        by = f"{1e3 * np.max(apart_m):.1f} mm and {np.degrees(np.max(apart_rad)):.2f} deg"
        mover = _mover(dataset, edge, list(keys), poses)
        if mover is not None:
            raise CalibrationError(
                f"sensor {sensors}: edge '{edge}', of which one pose is estimated, moves by {by} "
                f"between the collections{mover}; let parent_link and child_link be those of a "
                f"transform on its chain that stands still, or hold the sensor (-as)"
            )
        remarks.append(
            f"sensor {sensors}: edge '{edge}', of which one pose is estimated, is not the same in "
            f"all collections ({by} apart), as where the first guess was improved between them; if "
            f"a joint moves it, let parent_link and child_link be those of a transform that stands "
            f"still"
        )
    return remarks


def _mover(dataset: Dataset, edge: Edge, keys: Sequence[str], poses: np.ndarray) -> Optional[str]:
    """Return what moves an edge, as the end of a clause; None where it may be an improved guess."""
    positions: Dict[str, List[float]] = {}
    for key in keys:
        for name, joint in dataset.collections[key].joints.items():
            if joint.edge == edge:
                positions.setdefault(name, []).append(joint.position)
    for name, values in positions.items():
        if np.ptp(values) > min(_SAME_M, _SAME_RAD):
            return f", as joint '{name}' does"
    if positions:
        return None
    if dataset.edge_types.get(edge) in MOVING_TYPES:
        return f", as a {dataset.edge_types[edge]} joint does"
    apart_m, apart_rad = se3.pose_differences(poses[:-1], poses[1:])
    steps = int(np.sum((apart_m > _SAME_M) | (apart_rad > _SAME_RAD)))
    often = steps >= _LEAST_STEPS and steps > _MOST_SHARE * len(apart_m)
    return f", {steps} times in {len(poses)} of them" if often else None
