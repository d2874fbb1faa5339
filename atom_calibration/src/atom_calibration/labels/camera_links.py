"""How cameras' places contradict each other: by boards that two of them saw at once.

A camera's sight of a board is its whole pose, so one board tells where two cameras stand to each
other, whatever the transforms say. With it, what a range sensor contradicts of one camera's boards
and what it contradicts of another's count together.
"""

from __future__ import annotations

from collections import deque
from typing import Deque, Dict, List, NamedTuple, Optional, Tuple

import numpy as np

from atom_core.geometry import se3

_APART_M, _APART_RAD = 0.2, 0.2  # boards nearer to each other than this count once
_MOST_PLACES = 30
_SAME_RAD, _SAME_M = 0.1, 0.12  # of two boards, each as the other one's motion has it
_LEAST_SHARE = 0.7  # of the boards must agree


class _Pair(NamedTuple):
    """One board, as two cameras have it in the world."""

    first: np.ndarray
    second: np.ndarray


class CameraLinks:
    """Remembers boards that two cameras saw at once."""

    def __init__(self) -> None:
        """Start with none."""
        self._pairs: Dict[Tuple[str, str], Deque[_Pair]] = {}

    def see(self, first: str, second: str, first_has: np.ndarray, second_has: np.ndarray) -> None:
        """Take note of a board's poses (4, 4) in the world, by two cameras."""
        if first > second:
            first, second, first_has, second_has = second, first, second_has, first_has
        pairs = self._pairs.setdefault((first, second), deque(maxlen=_MOST_PLACES))
        if not any(_is_near(first_has, pair.first) for pair in pairs):
            pairs.append(_Pair(first_has, second_has))

    def between(self, first: str, second: str) -> Optional[np.ndarray]:
        """Return the motion (4, 4) that brings what ``second`` has to what ``first`` has.

        None where they never saw the same board, or their boards do not agree on a motion: one
        of the cameras moves, and not as the transforms say.
        """
        if first > second:
            found = self.between(second, first)
            return None if found is None else se3.inverse(found)
        pairs = list(self._pairs.get((first, second), ()))
        motions = [pair.first @ se3.inverse(pair.second) for pair in pairs]
        agreeing = [sum(_brings(motion, pair) for pair in pairs) for motion in motions]
        if not pairs or max(agreeing) < _LEAST_SHARE * len(pairs):
            return None
        return motions[int(np.argmax(agreeing))]

    def linked_with(self, camera: str) -> List[str]:
        """Return the cameras that saw a board along with one."""
        return sorted({name for pair in self._pairs if camera in pair for name in pair} - {camera})


def _brings(motion: np.ndarray, pair: _Pair) -> bool:
    shift_m, turn_rad = se3.pose_difference(pair.first, motion @ pair.second)
    return shift_m < _SAME_M and turn_rad < _SAME_RAD


def _is_near(pose: np.ndarray, other: np.ndarray) -> bool:
    shift_m, turn_rad = se3.pose_difference(other, pose)
    return shift_m < _APART_M and turn_rad < _APART_RAD
