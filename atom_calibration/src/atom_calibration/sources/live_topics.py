"""What the ROS master knows of topics, in the form in which ``rig`` asks a bag."""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import Any, Callable, Deque, Dict, List, Optional, Sequence, TypeVar

import roslib.message
import rospy

from atom_calibration.errors import BagError, TransformError
from atom_calibration.messages.cameras import CAMERA_INFO
from atom_calibration.sources.rig import candidate_topics
from atom_core.errors import AtomError
from atom_core.model.config import CalibrationConfig
from atom_core.model.modality import modalities

_POLL_S = 0.1
_KEPT = 30  # messages of a topic
_TELL_EVERY_S = 5.0
Result = TypeVar("Result")


class NotYetError(BagError):
    """A topic, or its first message, is not there yet."""


class LiveTopics:
    """Topics that are published now, and the first messages of those that a configuration names.

    Attributes:
        path: what messages call it.
        types: type of messages by topic.
    """

    path = "the ROS master"

    def __init__(self, config: CalibrationConfig):
        """Start to listen to the configuration's topics as they appear."""
        self._wanted = [t for entry in config.sensors.values() for t in candidate_topics(entry)]
        self.types: Dict[str, str] = {}
        self._early: Dict[str, Deque[Any]] = {}
        self._subscribers: Dict[str, rospy.Subscriber] = {}
        self._lock = threading.Lock()

    def __enter__(self) -> LiveTopics:
        """Return itself."""
        return self

    def __exit__(self, *_: Any) -> None:
        """Stop to listen."""
        for subscriber in self._subscribers.values():
            subscriber.unregister()

    def look(self) -> None:
        """Ask the master anew."""
        self.types = published_types(self._wanted)
        for topic in self._wanted:
            kind = message_class(self.types.get(topic, ""))
            if kind is not None and topic not in self._subscribers:
                self._subscribers[topic] = rospy.Subscriber(
                    topic, kind, self._keep, topic, queue_size=_KEPT, buff_size=2**24
                )

    def first(self, topic: str) -> Any:
        """Return the first message that came on a topic.

        Raises:
            NotYetError: none came.
        """
        with self._lock:
            if topic in self._early:
                return self._early[topic][0]
        raise NotYetError(
            f"topic {topic}: no message has come; is the sensor, or the bag, running?"
        )

    def absent(self, topic: str, types: Sequence[str], whose: str) -> NotYetError:
        """Return the error that nobody publishes a topic, with those that might be meant."""
        similar = sorted(name for name, kind in self.types.items() if kind in types)
        heard = rospy.resolve_name(topic)
        remapped = "" if heard == topic else f", remapped to {heard},"
        return NotYetError(
            f"topic {topic} ({whose}){remapped} is not published; topics of {' or '.join(types)}: "
            f"{', '.join(similar) or 'none'}; start the sensor or the bag, or correct topic_name"
        )

    def early(self, topic: str) -> List[Any]:
        """Return the last messages of a topic, for whoever begins to listen only now."""
        with self._lock:
            return list(self._early.get(topic, ()))

    def _keep(self, message: Any, topic: str) -> None:
        with self._lock:
            self._early.setdefault(topic, deque(maxlen=_KEPT)).append(message)


def published_types(wanted: Sequence[str] = ()) -> Dict[str, str]:
    """Return the types of all topics that are published now.

    Args:
        wanted: topics that have the type of what they are remapped to, for this node.

    Raises:
        NotYetError: the master does not answer, perhaps not for long.
    """
    try:
        types = {name: kind for name, kind in rospy.get_published_topics() if kind != "*"}
    except OSError:
        raise NotYetError("the ROS master does not answer") from None
    heard = {topic: rospy.resolve_name(topic) for topic in wanted}
    remapped = {topic: name for topic, name in heard.items() if name != topic}
    known = {topic: types[name] for topic, name in remapped.items() if name in types}
    return {**{n: kind for n, kind in types.items() if n not in remapped}, **known}


def message_class(name: str) -> Optional[type]:
    """Return the class of a type of messages; None if it is not one of sensors' data.

    Raises:
        BagError: the package that defines them is not there.
    """
    known = {t for modality in modalities() for t in modality.message_types}
    known.add(CAMERA_INFO)
    if name not in known:
        return None
    kind = roslib.message.get_message_class(name)
    if kind is None:
        raise BagError(
            f"messages of type {name} cannot be received: package '{name.partition('/')[0]}' is "
            f"not found; build and source its workspace, or label the bag with collect_from_bag"
        )
    return kind


def wait_for(
    get: Callable[[], Result],
    stopped: Callable[[], bool],
    tell: Callable[[str], None],
    patience_s: float = 0.0,
) -> Optional[Result]:
    """Return what ``get`` returns once it no longer fails for something that is not there yet.

    Args:
        get: raises NotYetError or TransformError until all is there.
        stopped: tells whether to give up; then None is returned.
        tell: is told every few seconds what is waited for.
        patience_s: longest time to wait; 0 for ever.

    Raises:
        AtomError: what ``get`` raises otherwise, or still raises when the patience is over.
    """
    begin = time.monotonic()
    last_told = begin
    while not stopped():
        try:
            return get()
        except (NotYetError, TransformError) as error:
            now = time.monotonic()
            if 0 < patience_s < now - begin:
                raise _tired(error, patience_s) from None
            if now - last_told > _TELL_EVERY_S:
                tell(f"waiting: {error}")
                last_told = now
        time.sleep(_POLL_S)
    return None


def _tired(error: AtomError, patience_s: float) -> AtomError:
    return type(error)(f"{error} (waited for {patience_s:g} s)")
