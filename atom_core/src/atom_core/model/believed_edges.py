"""Edges that nobody estimates, compared with what another source says of them.

A sensor's own edge is calibrated; what lies between it and the world, or its data, is believed.
"""

from __future__ import annotations

import math
from typing import Dict, List, Mapping, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.dataset import MULTIPLE, Dataset
from atom_core.model.transforms import Edge

_SAME_M, _SAME_RAD = 0.001, math.radians(0.05)


class EdgeApart(NamedTuple):
    """An edge of which two sources say something else, and the sensors that hang on it."""

    edge: Edge
    translation_m: float
    rotation_rad: float
    sensors: Tuple[str, ...]

    @property
    def words(self) -> str:
        """How far the two are from each other."""
        return f"{1e3 * self.translation_m:.1f} mm and {math.degrees(self.rotation_rad):.2f} deg"


def edges_apart(dataset: Dataset, others: Mapping[Edge, np.ndarray]) -> List[EdgeApart]:
    """Return the edges between world and data that others put elsewhere.

    Args:
        dataset: of it those edges that are not estimated and never move.
        others: ``parent_T_child`` (4, 4) by edge; edges that are not in it are passed over.
    """
    estimated = set(dataset.sensor_edges)
    estimated |= {edge for _, edge in dataset.config.estimated_edges}
    believed = {
        edge: sensors
        for edge, sensors in sensors_by_edge(dataset).items()
        if edge not in estimated and dataset.edge_types.get(edge) != MULTIPLE
    }
    pairs = {e: (others[e], dataset.first_value(e)) for e in believed if e in others}
    return poses_apart(pairs, believed)


def poses_apart(
    pairs: Mapping[Edge, Tuple[np.ndarray, np.ndarray]], sensors: Mapping[Edge, Sequence[str]]
) -> List[EdgeApart]:
    """Return the edges whose two values ``parent_T_child`` (4, 4) are not the same.

    Args:
        pairs: both values, by edge.
        sensors: names of those that hang on it, by edge.
    """
    found = []
    for edge, (one, other) in pairs.items():
        apart_m, apart_rad = se3.pose_difference(one, other)
        if apart_m > _SAME_M or apart_rad > _SAME_RAD:
            found.append(EdgeApart(edge, apart_m, apart_rad, tuple(sensors[edge])))
    return found


def sensors_by_edge(dataset: Dataset, with_boards: bool = False) -> Dict[Edge, List[str]]:
    """Return the sensors on whose way to the world an edge is, by edge.

    Args:
        dataset: whose.
        with_boards: count the ways to the boards that a sensor sees, too.
    """
    found: Dict[Edge, List[str]] = {}
    graph = dataset.graph
    ways = {name: [sensor.frame] for name, sensor in dataset.sensors.items()}
    seen = {(key.sensor, key.pattern) for key, _ in dataset.detections()} if with_boards else set()
    for sensor, pattern in sorted(seen):
        ways[sensor].append(dataset.patterns[pattern].parent_frame)
    for name, frames in ways.items():
        edges = (edge for frame in frames for edge in graph.edges_between(dataset.world, frame))
        for edge in dict.fromkeys(edges):
            found.setdefault(edge, []).append(name)
    return found
