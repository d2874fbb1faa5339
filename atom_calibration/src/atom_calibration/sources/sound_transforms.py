"""What is no transform is passed over, as tf2 does: one bad frame costs no other one."""

from __future__ import annotations

import logging
import math
from typing import Any, Callable, Iterable, List, Optional, Set, Tuple

from atom_calibration.messages.poses import SHORTEST_QUATERNION, edge_of
from atom_core.model.transforms import Edge


class SoundTransforms:
    """Leaves out what is no transform; of each edge and topic it is told once."""

    def __init__(self, warn: Callable[[str], None] = logging.getLogger(__name__).warning):
        """Know of none; ``warn`` is told what is left out."""
        self._warn = warn
        self._told: Set[Tuple[Edge, str]] = set()

    def of(self, messages: Iterable[Any], topic: str) -> List[Any]:
        """Return those TransformStamped of a topic that are transforms."""
        return [message for message in messages if self._is_sound(message, topic)]

    def _is_sound(self, message: Any, topic: str) -> bool:
        why = _why_none(message)
        if why is None:
            return True
        edge = edge_of(message)
        if (edge, topic) not in self._told:
            self._told.add((edge, topic))
            self._warn(
                f"a transform of {topic} is left out, and others like it: {why}; correct its "
                f"publisher"
            )
        return False


def _why_none(message: Any) -> Optional[str]:
    """Return why a TransformStamped is no transform; None: it is one. There are many of them."""
    edge = edge_of(message)
    t, q = message.transform.translation, message.transform.rotation
    translation, quaternion = [t.x, t.y, t.z], [q.x, q.y, q.z, q.w]
    length = math.sqrt(sum(value * value for value in quaternion))
    if not (all(map(math.isfinite, translation)) and SHORTEST_QUATERNION < length < math.inf):
        return f"'{edge}' is no pose (translation {translation}, quaternion {quaternion})"
    if not edge.parent or not edge.child:
        return f"one of the two frames of '{edge}' has no name"
    if edge.parent == edge.child:
        return f"frame '{edge.child}' stands in itself"
    return None
