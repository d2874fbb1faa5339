"""The transforms of a calibration for tf: under the frames' own names, or apart from them."""

from __future__ import annotations

from typing import Dict, Iterable, List, Optional

import numpy as np
import rospy
from geometry_msgs.msg import TransformStamped

from atom_calibration.messages.poses import transform_message
from atom_calibration.show.estimate import Estimate
from atom_calibration.show.view_options import CALIBRATED, OFF, PREFIXED
from atom_core.model.transforms import Edge


def prefixed(collection: str, frame: str) -> str:
    """Return the name that a frame has in a collection's own tree."""
    return f"c{collection}_{frame}"


def transforms(
    estimate: Estimate, mode: str, collection: Optional[str] = None
) -> List[TransformStamped]:
    """Return the transforms to be published, without a stamp: they hold at any time.

    Args:
        estimate: what is shown.
        mode: OWN, CALIBRATED, PREFIXED or OFF.
        collection: whose transforms; None for the first that is used. PREFIXED has all.
    """
    if mode == OFF:
        return []
    used = estimate.used_collections()
    if mode == PREFIXED:
        return [message for key in used for message in _tree(estimate, key)]
    dataset = estimate.dataset
    edges = dataset.collections[used[0] if collection is None else collection].transforms
    if mode == CALIBRATED:
        edges = {edge: edges[edge] for edge in dataset.calibrated_edges if edge in edges}
    return [_message(edge, matrix) for edge, matrix in edges.items()]


def merged(
    others: Iterable[TransformStamped], calibrated: Iterable[TransformStamped]
) -> List[TransformStamped]:
    """Return transforms of which those that are calibrated replace the others, by their child."""
    by_child: Dict[str, TransformStamped] = {m.child_frame_id: m for m in others}
    by_child.update({m.child_frame_id: m for m in calibrated})
    return list(by_child.values())


def _tree(estimate: Estimate, key: str) -> List[TransformStamped]:
    world = estimate.dataset.world
    root = _message(Edge(world, prefixed(key, world)), np.eye(4))
    edges = estimate.dataset.collections[key].transforms
    return [root] + [
        _message(Edge(prefixed(key, edge.parent), prefixed(key, edge.child)), matrix)
        for edge, matrix in edges.items()
    ]


def _message(edge: Edge, matrix: np.ndarray) -> TransformStamped:
    return transform_message(edge, matrix, rospy.Time())
