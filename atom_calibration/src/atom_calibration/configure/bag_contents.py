"""What a bag tells of transforms and joints, without reading all of it."""

from __future__ import annotations

from typing import Any, Callable, Dict, Iterator, Optional, Sequence, Set, Tuple

import numpy as np

from atom_calibration.configure.tree import MULTIPLE
from atom_calibration.messages.poses import edge_of, transform_matrix
from atom_calibration.sources.bag_reader import BagReader
from atom_calibration.sources.bag_transforms import tf_topics
from atom_calibration.sources.joint_topics import JOINT_STATE
from atom_calibration.sources.sound_transforms import SoundTransforms
from atom_core.model.robot import FIXED
from atom_core.model.transforms import Edge

_LOOKED_AT_S = 20.0  # of each topic of /tf and /joint_states, which repeat themselves
_STILL = 1e-9  # between entries of poses that are repeated


def _beginnings(
    bag: BagReader, topics: Sequence[str], complete: Callable[[], bool]
) -> Iterator[Any]:
    """Yield a while of the messages of each topic, and further ones until all is there."""
    for topic in topics:
        first_s = None
        for found in bag.messages([topic]):
            first_s = found.recorded_s if first_s is None else first_s
            if found.recorded_s > first_s + _LOOKED_AT_S and complete():
                break
            yield found.message


def bag_edges(
    bag: BagReader, awaited: Set[Edge], warn: Callable[[str], None]
) -> Tuple[Dict[Edge, str], Dict[Edge, np.ndarray]]:
    """Return the kinds of a bag's edges, and the poses of those that stand still.

    Args:
        bag: the recording.
        awaited: edges that are looked for however late they come.
        warn: is told what is left out.

    Returns:
        FIXED or MULTIPLE by edge; ``parent_T_child`` (4, 4) [m].
    """
    edges: Dict[Edge, str] = {}
    fixed: Dict[Edge, np.ndarray] = {}
    topics = tf_topics(bag)
    if topics.remark:
        warn(f"{bag.path}: {topics.remark}")
    sound = SoundTransforms(lambda why: warn(f"{bag.path}: {why}"))
    for topic in topics.fixed:
        for found in bag.messages([topic]):
            for message in sound.of(found.message.transforms, topic):
                edges.setdefault(edge_of(message), FIXED)
                fixed[edge_of(message)] = transform_matrix(message)
    still: Dict[Edge, Optional[np.ndarray]] = {}  # None: it moves
    for topic in topics.moving:
        for heard in _beginnings(bag, [topic], lambda: awaited <= set(edges)):
            for message in sound.of(heard.transforms, topic):
                edge, pose = edge_of(message), transform_matrix(message)
                edges.setdefault(edge, MULTIPLE)
                first = still.setdefault(edge, pose)
                if first is not None and not np.allclose(first, pose, 0.0, _STILL):
                    still[edge] = None
    return edges, {**{edge: pose for edge, pose in still.items() if pose is not None}, **fixed}


def bag_joints(bag: BagReader, awaited: Set[str]) -> Dict[str, Set[str]]:
    """Return the joints by topic."""
    joints: Dict[str, Set[str]] = {topic: set() for topic in bag.topics_of([JOINT_STATE])}
    known: Set[str] = set()
    for topic, names in joints.items():
        for heard in _beginnings(bag, [topic], lambda: awaited <= known):
            names.update(heard.name)
            known.update(heard.name)
    return joints
