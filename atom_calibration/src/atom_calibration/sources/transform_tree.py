"""The transform tree of a recording, or of a running robot, at any time of it.

Nothing else is asked: no master, no wall clock. tf2's BufferCore interpolates between two
messages, however far apart they are; here a gap is an error, because nobody knows what the robot
did in it.
"""

from __future__ import annotations

import math
from bisect import bisect_left, insort
from typing import Any, Callable, Dict, Iterable, List, Mapping, NamedTuple, Optional, Set

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped

from atom_calibration.errors import TransformError
from atom_calibration.messages.headers import stamp_s
from atom_calibration.messages.poses import edge_of, transform_matrix
from atom_calibration.sources.contradictions import Contradiction
from atom_core.geometry import se3
from atom_core.model.transforms import Edge

DEFAULT_MAX_GAP_S = 1.0
_STILL = 2.5  # times as long a gap is bridged between two poses that are the same


class Recorded(NamedTuple):
    """When a recording has an edge that moves.

    Attributes:
        topic: that tells it.
        first_s, last_s: stamps of its first and its last pose [s].
    """

    topic: str
    first_s: float
    last_s: float


class TransformTree:
    """Edges over some time, each fixed or a sequence of poses that is interpolated."""

    def __init__(
        self,
        span_s: float = 60.0,
        max_gap_s: float = DEFAULT_MAX_GAP_S,
        recorded: Callable[[], Mapping[Edge, Recorded]] = dict,
        contradicted: Optional[Mapping[Edge, Contradiction]] = None,
    ):
        """Start without edges.

        Args:
            span_s: how much time it holds; older poses are forgotten.
            max_gap_s: longest time between two poses of an edge that is bridged.
            recorded: returns the edges that move at any time of the recording; asked where one is
                missed.
            contradicted: edges that have no pose, because messages contradict each other.
        """
        self._contradicted = {} if contradicted is None else contradicted
        self._buffer = tf2_ros.BufferCore(rospy.Duration.from_sec(span_s))
        self._span_s, self._max_gap_s = span_s, max_gap_s
        self._fixed: Dict[Edge, np.ndarray] = {}
        self._stamps: Dict[Edge, List[float]] = {}
        self._parents: Dict[str, str] = {}
        self._recorded = recorded

    def add(self, messages: Iterable[Any], fixed: bool) -> None:
        """Add the TransformStamped of a message of /tf, or (`fixed`) of /tf_static.

        Raises:
            MessageError: one of them is no pose.
        """
        for message in messages:
            edge, matrix = edge_of(message), transform_matrix(message)
            self._parents[edge.child] = edge.parent
            if fixed:
                self._fixed[edge] = matrix
                self._buffer.set_transform_static(_copy(edge, matrix, message), "bag")
            else:
                self._note(edge, stamp_s(message))
                self._buffer.set_transform(_copy(edge, matrix, message), "bag")

    def _note(self, edge: Edge, stamp: float) -> None:
        """Remember a stamp, and forget those that the buffer has forgotten."""
        stamps = self._stamps.setdefault(edge, [])
        insort(stamps, stamp)
        if stamps[-1] - stamps[0] > 2 * self._span_s:
            del stamps[: bisect_left(stamps, stamps[-1] - self._span_s)]

    @property
    def frames(self) -> Set[str]:
        """Every frame."""
        return {*self._parents, *self._parents.values()}

    @property
    def placed(self) -> Set[str]:
        """Every frame that stands in another one."""
        return set(self._parents)

    def connected_edges(self, root: str) -> List[Edge]:
        """Return every edge below a frame (or above it, towards tf's own root)."""
        edges = [Edge(parent, child) for child, parent in self._parents.items()]
        reached, grown = {root}, True
        while grown:
            found = {f for e in edges for f in e if reached & set(e)}
            grown, reached = not found <= reached, reached | found
        return [edge for edge in edges if edge.parent in reached]

    def path(self, target: str, source: str) -> List[Edge]:
        """Return the edges between two frames.

        Raises:
            TransformError: see `path_here`; where another time of the recording has what is
                missed, with when. The recording is read for that: who only asks whether there is a
                path asks `path_here`.
        """
        try:
            return self.path_here(target, source)
        except TransformError:
            self._refuse_what_other_times_have(target, source)
            raise

    def path_here(self, target: str, source: str) -> List[Edge]:
        """Return the edges between two frames, by what is in memory.

        Raises:
            TransformError: a frame is unknown, nothing connects the two, or frames stand in one
                another in a circle.
        """
        for frame in (target, source):
            if frame not in self.frames and target != source:
                known = ", ".join(sorted(self.frames)[:20])
                raise TransformError(
                    f"frame '{frame}' is in no message of /tf or /tf_static (there are: "
                    f"{known or 'none'}); correct the name, record the transforms, or take those "
                    f"of the robot's description (collect_from_bag --description)"
                )
        up, down = self._ancestors(target), self._ancestors(source)
        common = next((frame for frame in up if frame in down), None)
        if common is None:
            raise TransformError(
                f"no transform connects frame '{target}' with frame '{source}'; record the "
                f"missing part of /tf or /tf_static, e.g. run robot_state_publisher"
            )
        branches = up[: up.index(common)] + down[: down.index(common)]
        return [Edge(self._parents[child], child) for child in branches]

    def edge(self, edge: Edge, time_s: float) -> np.ndarray:
        """Return ``parent_T_child`` (4, 4) of one edge at a time.

        Raises:
            TransformError: there is no such edge, or no pose of it near that time, or messages
                contradict each other in it.
        """
        contradiction = self._contradicted.get(edge)
        if contradiction is not None and contradiction.covers(time_s):
            raise TransformError(contradiction.sentence)
        if edge in self._fixed:
            return self._fixed[edge]
        if edge not in self._stamps:
            raise TransformError(f"transform '{edge}' is not in /tf or /tf_static")
        time_s = self._within_gap(edge, time_s)
        try:
            found = self._buffer.lookup_transform_core(
                edge.parent, edge.child, rospy.Time.from_sec(time_s)
            )
        except tf2_ros.TransformException as error:
            raise TransformError(f"transform '{edge}' at time {time_s:.3f}: {error}") from None
        return transform_matrix(found)

    def lookup(self, target: str, source: str, time_s: float) -> np.ndarray:
        """Return ``target_T_source`` (4, 4) at a time.

        Raises:
            TransformError: see `path` and `edge`.
        """
        edges = self.path(target, source)
        up = self._ancestors(target)
        product = np.eye(4)
        for edge in edges:  # first up from the target, then up from the source, in reverse
            if edge.child in up:
                product = product @ se3.inverse(self.edge(edge, time_s))
        for edge in reversed([e for e in edges if e.child not in up]):
            product = product @ self.edge(edge, time_s)
        return product

    def lookup_fixed(self, target: str, source: str) -> Optional[np.ndarray]:
        """Return ``target_T_source`` (4, 4) where fixed transforms alone connect two frames."""
        try:
            edges = self.path_here(target, source)
            if not all(edge in self._fixed for edge in edges):
                return None
            return self.lookup(target, source, 0.0)
        except TransformError:
            return None

    def _refuse_what_other_times_have(self, *frames: str) -> None:
        """Raise a TransformError if edges above these frames are recorded, but not here."""
        recorded = self._recorded()
        parents = {edge.child: edge.parent for edge in recorded}
        parents.update(self._parents)
        for start in frames:
            frame, passed = start, {start}
            while frame in parents and parents[frame] not in passed:
                edge = Edge(parents[frame], frame)
                if frame not in self._parents:
                    topic, first_s, last_s = recorded[edge]
                    raise TransformError(
                        f"{topic} has no pose of '{edge}' near this time: it has them from time "
                        f"{first_s:.3f} to {last_s:.3f}; leave this time out, or record {topic} "
                        f"as long as the sensors"
                    )
                frame = edge.parent
                passed.add(frame)

    def _ancestors(self, frame: str) -> List[str]:
        """Return a frame, and those that it stands in, up to the root.

        Raises:
            TransformError: frames stand in one another in a circle.
        """
        chain = [frame]
        while chain[-1] in self._parents:
            parent = self._parents[chain[-1]]
            if parent in chain:
                circle = " in ".join(f"'{name}'" for name in [*chain, parent])
                raise TransformError(
                    f"the transforms of /tf and /tf_static go in a circle: {circle}; two programs "
                    f"publish what contradicts each other: record again without one of them"
                )
            chain.append(parent)
        return chain

    def _within_gap(self, edge: Edge, time_s: float) -> float:
        """Return the time to look up: the same, or that of the first or last pose if near."""
        stamps = self._stamps[edge]
        after = bisect_left(stamps, time_s - 1e-9)
        before_s = stamps[after - 1] if after > 0 else None
        after_s = stamps[after] if after < len(stamps) else None
        if after_s is not None and abs(after_s - time_s) < 1e-6:
            return after_s
        if before_s is not None and after_s is not None:
            gap = (after_s - before_s) / self._max_gap_s
            if gap <= 1.0 or (gap <= _STILL and self._is_still(edge, before_s, after_s)):
                return time_s
        else:  # the recording begins or ends here
            ends = stamps[:2] if before_s is None else stamps[:-3:-1]  # the nearest first
            longest_s, apart_s = 0.5 * self._max_gap_s, abs(ends[-1] - ends[0])
            if apart_s > longest_s and self._is_still(edge, ends[0], ends[-1]):
                longest_s = min(apart_s, _STILL * self._max_gap_s)
            if abs(ends[0] - time_s) <= longest_s:
                return ends[0]
        raise TransformError(
            f"/tf has no pose of '{edge}' near time {time_s:.3f}: before it "
            f"{_time_text(before_s)}, after it {_time_text(after_s)} (a gap of {self._max_gap_s:g} "
            f"s is bridged); leave this time out, or record /tf without gaps"
        )

    def _is_still(self, edge: Edge, *stamps_s: float) -> bool:
        """Tell whether poses of an edge are the same: of a program that repeats a fixed one."""
        try:
            poses = [
                transform_matrix(
                    self._buffer.lookup_transform_core(*edge, rospy.Time.from_sec(stamp))
                )
                for stamp in stamps_s
            ]
        except tf2_ros.TransformException:
            return False
        return all(np.allclose(pose, poses[0], rtol=0.0, atol=1e-9) for pose in poses)


def edges_at(
    tree: TransformTree,
    root: str,
    frame_stamps: Mapping[str, float],
    board_stamps: Optional[Mapping[str, float]] = None,
) -> Dict[Edge, np.ndarray]:
    """Return every edge connected to the root, each at the time of the sensor that needs it.

    Args:
        tree: the transforms.
        root: the world.
        frame_stamps: time of the data [s] by frame of the data. An edge that leads to several
            of them is taken at their mean time, one that leads to none at the mean of all.
        board_stamps: when boards were seen [s], by the frame that they hang on.

    Raises:
        TransformError: a frame is unknown or not connected, or an edge on the way to a sensor or
            a board has no pose at that time. Other edges without a pose are left out.
    """
    wanted: Dict[Edge, List[float]] = {}
    for frame, stamp in [*frame_stamps.items(), *(board_stamps or {}).items()]:
        for edge in tree.path(root, frame):
            wanted.setdefault(edge, []).append(stamp)
    mean = float(np.mean(list(frame_stamps.values())))
    values = {}
    for edge in tree.connected_edges(root):
        try:
            values[edge] = tree.edge(edge, float(np.mean(wanted.get(edge, [mean]))))
        except TransformError:
            if edge in wanted:
                raise
    return values


def _copy(edge: Edge, matrix: np.ndarray, message: Any) -> TransformStamped:
    """Return a message of the real type; those out of a bag make tf2 complain."""
    copy = TransformStamped()
    copy.header.stamp = rospy.Time(message.header.stamp.secs, message.header.stamp.nsecs)
    copy.header.frame_id, copy.child_frame_id = edge
    t, q, given = copy.transform.translation, copy.transform.rotation, message.transform.rotation
    t.x, t.y, t.z = matrix[:3, 3].tolist()
    length = math.hypot(math.hypot(given.x, given.y), math.hypot(given.z, given.w))
    q.x, q.y, q.z, q.w = (v / length for v in (given.x, given.y, given.z, given.w))
    return copy


def _time_text(time_s: Optional[float]) -> str:
    return "none" if time_s is None else f"at {time_s:.3f}"
