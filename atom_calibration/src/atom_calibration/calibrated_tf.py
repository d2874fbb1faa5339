"""The transforms of a calibration for tf: under the frames' own names, or apart from them."""

from __future__ import annotations

from typing import List, Optional

import numpy as np
import rospy
from geometry_msgs.msg import TransformStamped

from atom_calibration import conversions
from atom_calibration.corrections import is_fixed
from atom_calibration.standing import Standing
from atom_core.model.dataset import board_edge
from atom_core.model.transforms import Edge

# OWN: all of a collection. FIXED: those that do not move, beside a robot or a recording that
# publishes the others. PREFIXED: all of all collections, each in a tree of its own, as ATOM does.
OFF, OWN, FIXED, PREFIXED = "off", "own", "fixed", "prefixed"
MODES = (OFF, OWN, FIXED, PREFIXED)


def prefixed(collection: str, frame: str) -> str:
    """Return the name that a frame has in a collection's own tree."""
    return f"c{collection}_{frame}"


def transforms(
    standing: Standing, mode: str, collection: Optional[str] = None
) -> List[TransformStamped]:
    """Return the transforms to be published, without a stamp: they hold at any time.

    Args:
        standing: where the calibration stands.
        mode: OWN, FIXED, PREFIXED or OFF.
        collection: whose transforms; None for the first that is used. PREFIXED has all.
    """
    if mode == OFF:
        return []
    used = standing.used_collections()
    if mode == PREFIXED:
        return [message for key in used for message in _tree(standing, key)]
    dataset = standing.dataset
    key = used[0] if collection is None else collection
    boards = {board_edge(pattern) for pattern in dataset.patterns.values()}
    return [
        _message(edge, matrix)
        for edge, matrix in dataset.collections[key].transforms.items()
        if mode == OWN or (edge not in boards and is_fixed(dataset, edge))
    ]


def _tree(standing: Standing, key: str) -> List[TransformStamped]:
    world = standing.dataset.world
    root = _message(Edge(world, prefixed(key, world)), np.eye(4))
    edges = standing.dataset.collections[key].transforms
    return [root] + [
        _message(Edge(prefixed(key, edge.parent), prefixed(key, edge.child)), matrix)
        for edge, matrix in edges.items()
    ]


def _message(edge: Edge, matrix: np.ndarray) -> TransformStamped:
    return conversions.transform_message(edge, matrix, rospy.Time())
