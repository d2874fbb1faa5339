"""The transforms of a running robot, in the same tree that the transforms of a bag are in."""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import Any, Deque, Dict, List, Mapping, Optional

import rospy
from tf2_msgs.msg import TFMessage

from atom_calibration.messages.headers import stamp_s
from atom_calibration.messages.poses import edge_of
from atom_calibration.sources.contradictions import Contradiction, DoubtfulEdge, EdgeWatch
from atom_calibration.sources.sound_transforms import SoundTransforms
from atom_calibration.sources.transform_tree import TransformTree
from atom_core.model.transforms import Edge

SPAN_S = 30.0
_BACK_S = 5.0  # time that goes back by more begins anew, as when a bag is repeated
_MOST_WAITING = 5000  # messages of /tf that nobody has looked at


class LiveTransforms:
    """Listens to /tf and /tf_static. One thread at a time may look into the tree."""

    def __init__(self) -> None:
        """Start to listen."""
        self._lock = threading.Lock()
        self._waiting: Deque[Any] = deque(maxlen=_MOST_WAITING)
        self._waiting_static: Deque[Any] = deque()
        self._static: Dict[Edge, Any] = {}
        self._newest_s: Dict[Edge, float] = {}
        self._sound, self._watch = SoundTransforms(rospy.logwarn), EdgeWatch()
        self._tree = self._new_tree()
        self._before: Optional[TransformTree] = None  # time went back
        self._subscribers = [
            rospy.Subscriber("/tf", TFMessage, self._waiting.append, queue_size=200),
            rospy.Subscriber("/tf_static", TFMessage, self._waiting_static.append, queue_size=100),
        ]

    @property
    def doubtful(self) -> List[DoubtfulEdge]:
        """The transforms heard so far that messages contradict each other in."""
        return self._watch.doubtful

    @property
    def contradicted(self) -> Mapping[Edge, Contradiction]:
        """The transforms that have no pose at times, since messages contradict each other."""
        return self._watch.contradicted

    def at(self, time_s: float) -> TransformTree:
        """Return the tree, which holds the last half minute.

        Args:
            time_s: of which time [s]; where that lies ahead by far, since time went back, the
                tree is that of before.
        """
        with self._lock:
            while self._waiting_static:
                self._add_static(self._waiting_static.popleft())
            while self._waiting:
                self._add(self._waiting.popleft())
            newest_s = max(self._newest_s.values(), default=time_s)
            if self._before is not None and time_s > newest_s + _BACK_S:
                return self._before
            return self._tree

    def wait_until(self, time_s: float, patience_s: float) -> None:
        """Wait until every edge that moves has a pose at or after a time, but not for ever."""
        end = time.monotonic() + patience_s
        while time.monotonic() < end:
            self.at(time_s)
            recent = [s for s in self._newest_s.values() if s > time_s - 1.0]
            if all(stamp >= time_s for stamp in recent):
                return
            time.sleep(0.02)

    def _add_static(self, message: Any) -> None:
        for part in self._sound.of(message.transforms, "/tf_static"):
            self._tree.add([part], fixed=True)
            self._watch.see_fixed(part)
            self._static[edge_of(part)] = part

    def _add(self, message: Any) -> None:
        for part in self._sound.of(message.transforms, "/tf"):
            edge, stamp = edge_of(part), stamp_s(part)
            if stamp < self._newest_s.get(edge, stamp) - _BACK_S:
                self._begin_anew()
            self._tree.add([part], fixed=False)
            self._watch.see_moving(part)
            self._newest_s[edge] = max(stamp, self._newest_s.get(edge, stamp))

    def _begin_anew(self) -> None:
        self._watch.begin_anew()
        self._before = self._tree
        self._tree, self._newest_s = self._new_tree(), {}
        self._tree.add(self._static.values(), fixed=True)

    def _new_tree(self) -> TransformTree:
        return TransformTree(SPAN_S, contradicted=self._watch.contradicted)
