"""The transforms of a bag: what its /tf and /tf_static say, and what a description tells."""

from __future__ import annotations

from typing import Any, Dict, Iterator, List, Mapping, NamedTuple, Optional, Tuple

import numpy as np
from rospy import Time

from atom_calibration.errors import TransformError
from atom_calibration.messages.headers import stamp_s
from atom_calibration.messages.poses import TF_MESSAGE, edge_of
from atom_calibration.sources.bag_reader import BagMessage, BagReader
from atom_calibration.sources.contradictions import Contradiction, DoubtfulEdge, EdgeWatch
from atom_calibration.sources.described_edges import DescribedEdges
from atom_calibration.sources.sound_transforms import SoundTransforms
from atom_calibration.sources.transform_tree import DEFAULT_MAX_GAP_S, Recorded, TransformTree
from atom_core.model.transforms import Edge

TF, TF_STATIC = "/tf", "/tf_static"
_RENAME = f"play the bag with those of the robot renamed to {TF} and {TF_STATIC}, and record that"
_WINDOW_S = 5.0  # of /tf that are in memory at a time
_LATENCY_S = 2.0  # a transform may be recorded so much later than its stamp


class TfTopics(NamedTuple):
    """Which topics of a bag tell its transforms, as a running robot has /tf and /tf_static.

    Attributes:
        fixed: /tf_static, or what stands for it in a bag that has neither of the two.
        moving: the same for /tf.
        others: topics with transforms that are not used: recorded while another robot ran, or a
            bag was played with its transforms renamed.
    """

    fixed: Tuple[str, ...]
    moving: Tuple[str, ...]
    others: Tuple[str, ...]

    def __bool__(self) -> bool:
        """Tell whether there are any that are used."""
        return bool(self.fixed or self.moving)

    @property
    def remark(self) -> str:
        """A sentence on the topics that are not used; empty without such."""
        if not self.others:
            return ""
        used = " and ".join((*self.moving, *self.fixed))
        return (
            f"the transforms are those of {used}; " if used else ""
        ) + f"those on {', '.join(self.others)} are not used; if they should be, {_RENAME}"

    def refusal(self, path: object) -> str:
        """Return what to say of a bag where there are none that can be used."""
        if self.others:
            return (
                f"{path}: the bag has neither {TF} nor {TF_STATIC}, and {', '.join(self.others)} "
                f"may be of several robots; {_RENAME}"
            )
        return (
            f"{path}: the bag has neither {TF} nor {TF_STATIC}, and there is no robot "
            f"description: name one (--description FILE, or description_file in the "
            f"configuration), or record them, e.g. `rosbag record {TF} {TF_STATIC} ...`"
        )


def tf_topics(bag: BagReader) -> TfTopics:
    """Return the topics of a bag that tell its transforms.

    These are /tf and /tf_static. Where there is neither, and all topics with transforms are in one
    namespace, it is these: the robot was recorded so.
    """
    there = bag.topics_of([TF_MESSAGE, "tf/tfMessage"])
    used = [name for name in there if name in (TF, TF_STATIC)]
    if not used and len({_namespace(name) for name in there}) == 1:
        used = there
    fixed = tuple(name for name in used if name.endswith("tf_static"))
    moving = tuple(name for name in used if name not in fixed)
    return TfTopics(fixed, moving, tuple(name for name in there if name not in used))


def _namespace(topic: str) -> str:
    """Return what the topics of one robot's transforms have in common."""
    for ending in ("tf_static", "tf"):
        if topic.endswith(ending):
            return topic[: -len(ending)]
    return topic


class BagTransforms:
    """The transforms of a bag; only a few seconds of /tf are in memory at a time.

    Attributes:
        lag_s: how long after their stamps the messages of /tf were received [s], where that is
            more than a delay: a bag that was played and recorded anew. Otherwise 0.
        moving: some of them move, so that they have a clock.
    """

    def __init__(
        self,
        bag: BagReader,
        max_gap_s: float = DEFAULT_MAX_GAP_S,
        described: Optional[DescribedEdges] = None,
        sound: Optional[SoundTransforms] = None,
    ):
        """Read /tf_static.

        Args:
            bag: the recording.
            max_gap_s: longest time between two poses of an edge that is bridged.
            described: edges that a description tells; of their frames nothing in /tf counts.
            sound: tells what is left out.

        Raises:
            TransformError: the bag has no transforms at all.
        """
        self._topics = topics = tf_topics(bag)
        if not topics and described is None:
            raise TransformError(topics.refusal(bag.path))
        self._described, self._sound = described, sound or SoundTransforms()
        self._bag, self._max_gap_s = bag, max_gap_s
        self._static: Dict[Edge, Any] = {}  # the last message of each edge holds
        self._watch = EdgeWatch()
        if topics.fixed:
            for found in bag.messages(topics.fixed):
                for message in self._counting(found):
                    self._static[edge_of(message)] = message
                    self._watch.see_fixed(message, found.topic)
        if described is not None:
            self._static.update({edge_of(m): m for m in described.fixed})
        lag_s = bag.receipt_lag_s(topics.moving, _newest_s) if topics.moving else None
        if lag_s is None and described is not None and described.topics:
            # Without stamps, the times of receipt are those of the positions.
            lag_s = bag.receipt_lag_s(described.topics, lambda m: stamp_s(m) or None) or 0.0
        self.moving = lag_s is not None
        self.lag_s = 0.0 if lag_s is None or abs(lag_s) <= _LATENCY_S else lag_s
        self._window: Tuple[float, float] = (np.inf, -np.inf)
        self._tree = TransformTree()
        self._recorded: Optional[Dict[Edge, Recorded]] = None

    @property
    def doubtful(self) -> List[DoubtfulEdge]:
        """The transforms read so far that messages contradict each other in."""
        return self._watch.doubtful

    @property
    def contradicted(self) -> Mapping[Edge, Contradiction]:
        """The transforms that have no pose at times, since messages contradict each other."""
        return self._watch.contradicted

    def at(self, time_s: float) -> TransformTree:
        """Return the tree around a time [s]."""
        return self.between(time_s, time_s)

    def between(self, start_s: float, end_s: float) -> TransformTree:
        """Return the tree over some seconds, and a margin around them."""
        if not (self._window[0] <= start_s and end_s <= self._window[1]):
            end_s = max(end_s, start_s + _WINDOW_S)
            self._tree = self._read(start_s - _LATENCY_S, end_s)
            self._window = (start_s - _LATENCY_S, end_s)
        return self._tree

    def _read(self, start_s: float, end_s: float) -> TransformTree:
        margin = self._max_gap_s + _LATENCY_S
        recorded = start_s - margin + self.lag_s, end_s + margin + self.lag_s
        tree = TransformTree(
            end_s - start_s + 4 * margin,
            self._max_gap_s,
            self._all_recorded,
            self._watch.contradicted,
        )
        tree.add(self._static.values(), fixed=True)
        for topic, moving in self._moving_transforms(*recorded):
            for message in moving:  # before two of one stamp are added
                self._watch.see_moving(message, topic)
            tree.add(moving, fixed=False)
        return tree

    def _moving_transforms(
        self, start_s: Optional[float] = None, end_s: Optional[float] = None
    ) -> Iterator[Tuple[str, List[Any]]]:
        """Yield what messages say of edges that move, and the topic."""
        if self._topics.moving:
            for found in self._bag.messages(self._topics.moving, start_s, end_s):
                yield found.topic, self._counting(found)
        if self._described is not None and self._described.topics:
            for found in self._bag.messages(self._described.topics, start_s, end_s):
                if found.message.header.stamp.is_zero():
                    found.message.header.stamp = Time.from_sec(found.recorded_s)
                yield found.topic, self._described.transforms(found.message, found.topic)

    def begins_s(self) -> List[float]:
        """Return when edges that move are told for the first time [s], in order."""
        return sorted({recorded.first_s for recorded in self._all_recorded().values()})

    def _all_recorded(self) -> Dict[Edge, Recorded]:
        """Return all edges that move, at any time; the bag is read for it once."""
        if self._recorded is None:
            self._recorded = {}
            for topic, moving in self._moving_transforms():
                for message in moving:
                    edge, at_s = edge_of(message), stamp_s(message)
                    before = self._recorded.get(edge, Recorded(topic, at_s, at_s))
                    first_s, last_s = min(before.first_s, at_s), max(before.last_s, at_s)
                    self._recorded[edge] = Recorded(topic, first_s, last_s)
        return self._recorded

    def _counting(self, found: BagMessage) -> List[Any]:
        """Return the TransformStamped of a message that count."""
        transforms: List[Any] = found.message.transforms
        if self._described is not None:
            transforms = self._described.others(transforms)
        return self._sound.of(transforms, found.topic)


def _newest_s(message: Any) -> Optional[float]:
    """Return the newest stamp of a message of /tf [s]; None: it has no transforms."""
    return max((stamp_s(transform) for transform in message.transforms), default=None)
